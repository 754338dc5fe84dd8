//! How records are made and judged.

use crate::random::Random;
use greybox::{
    Experiment, ExperimentOf, Fit, Hold, Horizon, Huber, Kind, Model, Of, Parameter, Rk45, Severity, Signals,
    Simulator, Time, WarningCode, free,
};

/// The columns of a record.
#[derive(Clone)]
pub struct Columns {
    pub step: f64,
    /// Of samples that are not evenly spaced.
    pub times: Option<Vec<f64>>,
    pub u: Vec<Vec<f64>>,
    pub y: Vec<Vec<f64>>,
}

impl Columns {
    /// The first samples.
    pub fn first(mut self, samples: usize) -> Self {
        self.u.iter_mut().chain(&mut self.y).for_each(|column| column.truncate(samples));
        self
    }

    pub fn len(&self) -> usize {
        self.y[0].len()
    }

    /// Adds Gaussian noise: a part of the standard deviation of each output, with this correlation from sample to sample.
    pub fn noisy(mut self, part: f64, correlation: f64, seed: u64) -> Self {
        let mut random = Random(seed ^ 0x5eed);
        for y in &mut self.y {
            let sigma = part * deviation(y);
            let mut e = random.normal();
            for y in y.iter_mut() {
                *y += sigma * e;
                e = correlation * e + (1.0 - correlation * correlation).sqrt() * random.normal();
            }
        }
        self
    }

    fn time(&self) -> Time {
        self.times.clone().map_or(Time::Uniform { start: 0.0, step: self.step }, Time::Stamps)
    }
}

/// Standard deviation of a column.
pub fn deviation(values: &[f64]) -> f64 {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    (values.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / n).sqrt()
}

/// How a record is fitted.
#[derive(Clone, Default)]
pub struct How {
    pub noise: Option<Vec<f64>>,
    pub robust: bool,
    /// Starts have the opposite sign of the truth.
    pub opposite: bool,
    /// Predictions from the last measurement on, instead of a simulation.
    pub one_step: bool,
    /// The covariance of the noise of all outputs is estimated.
    pub covariance: bool,
    /// From so many starts; zero for one.
    pub starts: usize,
    /// What else is declared of a parameter, by its number.
    pub declare: Option<fn(usize, Parameter) -> Parameter>,
}

/// What was said of a fit.
pub struct Found {
    pub severity: Severity,
    /// The warnings that are no mere notes.
    pub codes: Vec<WarningCode>,
    /// Largest error of a parameter in standard errors.
    pub errors: f64,
    pub text: String,
}

/// A model whose truth is known.
pub trait Plant {
    fn truth(&self) -> Vec<f64>;
    /// Inputs of so many samples that excite it.
    fn inputs(&self, seed: u64, samples: usize) -> Vec<Vec<f64>>;
    /// What it makes of inputs at these times (even ones, if none are given), with these parameters.
    fn simulated_at(&self, times: Option<Vec<f64>>, u: Vec<Vec<f64>>, truth: &[f64]) -> Columns;
    /// A fit of several records at once.
    fn fit_all(&self, records: &[Columns], how: &How, seed: u64) -> Found;

    fn fit(&self, columns: &Columns, how: &How, seed: u64) -> Found {
        self.fit_all(std::slice::from_ref(columns), how, seed)
    }

    /// The same at even times.
    fn simulated(&self, u: Vec<Vec<f64>>, truth: &[f64]) -> Columns {
        self.simulated_at(None, u, truth)
    }

    fn record(&self, seed: u64, samples: usize) -> Columns {
        self.simulated(self.inputs(seed, samples), &self.truth())
    }
}

/// A model with parameters, a sample time (s), inputs (mean, amplitude, samples per level) and the state it begins in.
pub struct Bench<M: Model> {
    pub model: M,
    pub truth: Vec<f64>,
    pub step: f64,
    pub drive: Vec<(f64, f64, usize)>,
    pub initial: Vec<f64>,
    /// Whether the state at the first sample is told to the fit, because the outputs do not give it.
    pub told: bool,
    pub hold: Hold,
}

impl<M: Model> Bench<M> {
    pub fn experiment(&self, columns: &Columns) -> ExperimentOf<M> {
        let inputs = (0..columns.len()).map(|k| M::Input::from_fn(|i| columns.u[i][k])).collect();
        let outputs = (0..columns.len()).map(|k| M::Output::from_fn(|j| columns.y[j][k])).collect();
        let record = Experiment::new(&self.model, columns.time(), inputs, outputs).unwrap().hold(self.hold);
        match self.told {
            true => record.initial(M::State::from_fn(|i| greybox::fixed(self.initial[i]))),
            false => record,
        }
    }
}

impl<M: Model> Plant for Bench<M> {
    fn truth(&self) -> Vec<f64> {
        self.truth.clone()
    }

    fn inputs(&self, seed: u64, samples: usize) -> Vec<Vec<f64>> {
        let mut random = Random(seed.wrapping_mul(0x9e37_79b9) ^ 0xd1ce);
        let column = |&(mean, amplitude, hold): &(f64, f64, usize)| {
            let mut level = 0.0;
            let level = |k: usize| {
                if k.is_multiple_of(hold) {
                    level = mean + amplitude * (2.0 * random.uniform() - 1.0);
                }
                level
            };
            (0..samples).map(level).collect()
        };
        self.drive.iter().map(column).collect()
    }

    fn simulated_at(&self, times: Option<Vec<f64>>, u: Vec<Vec<f64>>, truth: &[f64]) -> Columns {
        let samples = u.first().map_or(times.as_ref().map_or(400, Vec::len), Vec::len);
        let rows: Vec<Of<M::Input, f64>> = (0..samples).map(|k| M::Input::from_fn(|i| u[i][k])).collect();
        let (truth, start) = (M::Parameters::from_fn(|i| truth[i]), M::State::from_fn(|i| self.initial[i]));
        let time = times.clone().map_or(Time::Uniform { start: 0.0, step: self.step }, Time::Stamps);
        let simulator = Simulator::new(&self.model).hold(self.hold);
        let exact = Rk45 { relative: 1e-12, absolute: 1e-14 };
        let run = match M::KIND {
            Kind::Continuous => simulator.integrator(exact).run(&truth, &start, time, &rows),
            _ => simulator.run(&truth, &start, time, &rows),
        };
        let run = run.unwrap();
        let outputs: Vec<_> = run.outputs.into_iter().map(M::Output::into_array).collect();
        let y = (0..M::Output::LEN).map(|j| outputs.iter().map(|row| row.as_ref()[j]).collect()).collect();
        Columns { step: self.step, times, u, y }
    }

    fn fit_all(&self, records: &[Columns], how: &How, seed: u64) -> Found {
        let records: Vec<_> = records.iter().map(|columns| self.experiment(columns)).collect();
        let mut random = Random(seed ^ 0x57a7);
        let start = |i: usize| -> Parameter {
            let sign = if how.opposite { -1.0 } else { 1.0 };
            let start = free(sign * self.truth[i] * (0.35 * (2.0 * random.uniform() - 1.0)).exp());
            how.declare.map_or(start, |declare| declare(i, start))
        };
        let fit = Fit::new(&self.model, &records).parameters(M::Parameters::from_fn(start));
        let fit = match &how.noise {
            Some(sigma) => fit.noise(M::Output::from_fn(|j| sigma[j])),
            None => fit,
        };
        let fit = if how.one_step { fit.predictor(Horizon { steps: 1, filter: None }) } else { fit };
        let fit = if how.covariance { fit.noise_covariance() } else { fit };
        let fit = if how.starts > 0 { fit.starts(how.starts) } else { fit };
        let fit = if how.robust { fit.loss(Huber::default()) } else { fit };
        let estimate = match fit.run() {
            Ok(estimate) => estimate,
            Err(error) => {
                let text = error.to_string();
                return Found { severity: Severity::NotUsable, codes: vec![], errors: 0.0, text };
            }
        };
        let mut errors = 0.0f64;
        for (found, truth) in estimate.summary().parameters.iter().zip(&self.truth) {
            let error = (found.value - truth).abs();
            errors = errors.max(found.knowledge.standard_error().map_or(0.0, |one| error / one));
        }
        let told = estimate.warnings.iter().filter(|warning| warning.severity > Severity::Usable);
        let codes = told.map(|warning| warning.code).collect();
        Found { severity: estimate.severity(), codes, errors, text: estimate.to_string() }
    }
}

pub fn bench<M: Model + 'static>(
    model: M,
    truth: &[f64],
    step: f64,
    drive: &[(f64, f64, usize)],
    initial: &[f64],
) -> Bench<M> {
    let (truth, drive, initial) = (truth.to_vec(), drive.to_vec(), initial.to_vec());
    Bench { model, truth, step, drive, initial, told: false, hold: Hold::default() }
}
