//! How far a finer step would move the predictions, from some windows that are simulated again.

use crate::problem::{Objective, Values, each};
use crate::record::{Record, Time};
use crate::sweep::{Piece, Prepared, Sweep, Window};
use std::borrow::Cow;
use std::ops::Range;

/// A window that is to be compared with a finer simulation.
pub(crate) struct Sampled {
    pub begin: usize,
    pub samples: usize,
    /// Whether it is one of those at even distances, from which the change of the whole record is extrapolated.
    pub spaced: bool,
    /// Its errors, output by output, sample by sample; where variances are predicted these are standardized by them, and the logarithms
    /// of the variances follow.
    pub errors: Vec<f64>,
    /// Errors of the sample after it, to which the last of its steps leads; empty before they are known, and at the end of the record.
    pub after: Vec<f64>,
    pub carry: Vec<f64>,
}

impl Sampled {
    fn range(&self) -> Range<usize> {
        self.begin..self.begin + self.samples + usize::from(!self.after.is_empty())
    }

    /// The error of an output at a sample, counted from the begin; behind the outputs, the logarithm of a variance.
    fn error(&self, j: usize, k: usize) -> f64 {
        if k < self.samples { self.errors[j * self.samples + k] } else { self.after[j] }
    }

    /// The square by which the prediction of an output changes at a sample of a window, in standard deviations. A logarithm of a variance
    /// counts by half its square, as in the information of the likelihood.
    fn change(&self, window: &Window, k: usize, j: usize, lane: usize, sigma: f64) -> f64 {
        let row = window.begin[lane] + k - self.begin;
        let error = window.error(k, j, lane);
        if !window.has_variances() {
            return ((self.error(j, row) - error) / sigma).powi(2);
        }
        if !window.is_measured(k, j, lane) {
            return 0.0;
        }
        let before = self.error(window.outputs() + j, row);
        let variance = window.variance(k, j, lane).ln() - before;
        (self.error(j, row) - error / (0.5 * before).exp()).powi(2) + 0.5 * variance * variance
    }

    /// Takes the errors of a sample if it is the one after the window.
    pub fn follow(&mut self, sample: usize, errors: &[f64]) {
        if self.begin + self.samples == sample {
            self.after = errors.to_vec();
        }
    }
}

/// The windows of a record in which a quantity is largest, such as the changes of its measurements: at all windows at even distances the plant
/// may be at rest.
#[derive(Default)]
pub(crate) struct Extremes(Vec<(f64, Sampled)>);

/// The most windows of a kind.
const MOST: usize = 4;

impl Extremes {
    /// Keeps a window if its value of the quantity is above zero and among the largest.
    pub fn offer(&mut self, much: f64, window: impl FnOnce() -> Sampled) {
        let Extremes(windows) = self;
        let at = windows.partition_point(|(more, _)| *more >= much);
        if at < MOST && much > 0.0 {
            windows.insert(at, (much, window()));
            windows.truncate(MOST);
        }
    }

    /// Adds those of the windows that follow.
    pub fn append(&mut self, Extremes(later): Extremes) {
        later.into_iter().for_each(|(much, window)| self.offer(much, || window));
    }

    pub fn follow(&mut self, sample: usize, errors: &[f64]) {
        self.0.iter_mut().for_each(|(_, window)| window.follow(sample, errors));
    }

    pub fn windows(self) -> impl Iterator<Item = Sampled> {
        self.0.into_iter().map(|(_, window)| window)
    }
}

/// Number of samples from which on other threads are used.
const WORTH_THREADS: usize = 20_000;

/// Windows of an experiment, at a point.
#[derive(Clone, Copy)]
pub(crate) struct Compared<'s> {
    pub objective: &'s Objective<'s>,
    pub coordinates: &'s [f64],
    pub experiment: usize,
    pub windows: &'s [Sampled],
}

impl Compared<'_> {
    fn record(&self) -> &Record {
        &self.objective.problem.records[self.experiment]
    }
}

/// The sum of the squared changes of all standardized predictions of each experiment with a finer step: extrapolated from its windows at
/// even distances, or that of all its windows, whichever is larger. All experiments are those of one sweep.
pub(crate) fn step_errors(all: &[Compared<'_>]) -> Vec<f64> {
    let windows: Vec<(usize, &Sampled)> =
        all.iter().enumerate().flat_map(|(i, one)| one.windows.iter().map(move |window| (i, window))).collect();
    let mut sums = vec![Changes::default(); all.len()];
    let samples: usize = windows.iter().map(|(_, window)| window.range().len()).sum();
    // A program is worth its compilation by the steps that it takes.
    let steps = all.first().map_or(0, |one| samples * one.objective.problem.steps);
    if let Some(finer) = all.first().and_then(|one| one.objective.sweep.refined(steps)) {
        let batches = batches(&*finer, all, &windows);
        let one = |b: usize| changes(&*finer, all, batches[b]);
        let found: Vec<Vec<(f64, usize)>> = match samples >= WORTH_THREADS {
            true => each(batches.len(), one),
            false => (0..batches.len()).map(one).collect(),
        };
        for ((i, window), (change, samples)) in windows.iter().zip(found.into_iter().flatten()) {
            let sums = &mut sums[*i];
            sums.all += change;
            if window.spaced {
                (sums.spaced, sums.samples) = (sums.spaced + change, sums.samples + samples);
            }
        }
    }
    let whole = |(one, sums): (&Compared<'_>, Changes)| {
        sums.all.max(sums.spaced * one.record().len() as f64 / sums.samples.max(1) as f64)
    };
    all.iter().zip(sums).map(whole).collect()
}

/// Squared changes of an experiment's windows: of all, and of those at even distances, with their samples.
#[derive(Clone, Copy, Default)]
struct Changes {
    all: f64,
    spaced: f64,
    samples: usize,
}

/// Windows that can run in parallel lanes, in their order.
fn batches<'w>(
    finer: &dyn Sweep,
    all: &[Compared<'_>],
    windows: &'w [(usize, &'w Sampled)],
) -> Vec<&'w [(usize, &'w Sampled)]> {
    let kind = |(i, _): &(usize, &Sampled)| {
        let record = all[*i].record();
        (record.holds.clone(), matches!(record.times(), Time::Uniform { .. }))
    };
    let alike = windows.chunk_by(|a, b| kind(a) == kind(b));
    alike.flat_map(|alike| alike.chunks(finer.lanes(all[alike[0].0].record(), &[]).max(1))).collect()
}

/// The sum of squared standardized changes in each window of a batch, and its samples. The change is infinite where the simulation
/// fails; with a method that chooses its steps it is zero, since such a method also fails where it needs more steps than it may take.
fn changes(finer: &dyn Sweep, all: &[Compared<'_>], windows: &[(usize, &Sampled)]) -> Vec<(f64, usize)> {
    let at = |i: &usize| {
        let Compared { objective, coordinates, experiment, .. } = all[*i];
        let values = objective.problem.unknowns.of_experiment(experiment, coordinates);
        let restarts = objective.problem.prepared[experiment].restarts.clone();
        (values, Prepared { restarts, ..Prepared::default() }, objective.whitening.sigma())
    };
    let points: Vec<(Values, Prepared, Vec<f64>)> = windows.iter().map(|(i, _)| at(i)).collect();
    let mut pieces: Vec<Piece<'_>> = Vec::with_capacity(windows.len());
    for ((i, window), (values, prepared, _)) in windows.iter().zip(&points) {
        let samples = window.range();
        let (record, carry, slopes) = (all[*i].record(), Cow::Borrowed(&window.carry[..]), Cow::default());
        pieces.push(Piece { record, prepared, samples, carry, slopes, parameters: &values.p });
    }
    let mut found = vec![0.0; windows.len()];
    let reached = finer.run(&pieces, &[], &mut |window| {
        for (lane, (found, ((_, sampled), (.., sigma)))) in
            found.iter_mut().zip(windows.iter().zip(&points)).enumerate()
        {
            for k in 0..window.samples[lane] {
                *found += sigma.iter().enumerate().map(|(j, s)| sampled.change(window, k, j, lane, *s)).sum::<f64>();
            }
        }
        true
    });
    let seen =
        |(piece, (found, reached)): (&Piece<'_>, (f64, &Result<_, _>))| match reached.is_ok() && found.is_finite() {
            true => (found, piece.samples.len()),
            false if finer.is_adaptive() => (0.0, 0),
            false => (f64::INFINITY, piece.samples.len()),
        };
    pieces.iter().zip(found.into_iter().zip(&reached)).map(seen).collect()
}

#[cfg(test)]
mod tests {
    use crate::residuals::residual_pass;
    use crate::tests::{Current, Decay, Rate, Voltage};
    use crate::{Experiment, Fit, Kalman, Model, Rk4, Scalar, Time, fixed, free, signals, simulate};

    /// Records of one window each: the root of the sum of all squared differences between one step per sample and two, by the noise.
    #[test]
    fn all_of_short_records_is_compared() {
        let inputs =
            |from: usize| -> Vec<Voltage> { (from..from + 20).map(|k| Voltage { u: (k as f64).sin() }).collect() };
        let time = Time::Uniform { start: 0.0, step: 1.0 };
        let simulated = |inputs: &[Voltage], a: f64| {
            simulate(&Decay, &Rate { a }, &Current { i: 0.5 }, time.clone(), inputs).unwrap().outputs
        };
        let record = |from: usize| Experiment::new(&Decay, time.clone(), inputs(from), simulated(&inputs(from), 0.9));
        let records = [record(0).unwrap().named("0"), record(7).unwrap().named("7")];
        let fit = |substeps: u32| {
            let fit = Fit::new(&Decay, &records).parameters(Rate { a: free(1.0) }).noise(Current { i: 0.1 });
            fit.integrator(Rk4 { substeps }).problem().unwrap()
        };
        let (coarse, fine) = (fit(1), fit(2));
        let (coarse, fine) = (coarse.objective().unwrap(), fine.objective().unwrap());
        let start = coarse.start();
        let found = residual_pass(&coarse, &start).unwrap().step_error;
        let errors =
            |objective: &crate::problem::Objective<'_>| argmin::core::Operator::apply(objective, &start).unwrap();
        let (coarse, fine) = (errors(&coarse), errors(&fine));
        assert_eq!(coarse.len(), 40);
        let expected = coarse.iter().zip(&fine).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
        assert!(expected > 1e-3 && (found / expected - 1.0).abs() < 1e-9, "{found} {expected}");
    }

    /// With this number of records the finer step is compiled and runs in lanes: the sum of what each record alone gives, in dual numbers.
    /// Both are sums of the same differences, of which the largest is a thousandth of the predictions: 13 digits less 3.
    #[test]
    fn many_records_are_compared_in_lanes() {
        let time = Time::Uniform { start: 0.0, step: 1.0 };
        let record = |e: usize| {
            let inputs: Vec<Voltage> = (0..40 + e % 3).map(|k| Voltage { u: ((k + e) as f64).sin() }).collect();
            let initial = Current { i: 0.5 };
            let outputs = simulate(&Decay, &Rate { a: 0.9 }, &initial, time.clone(), &inputs).unwrap().outputs;
            Experiment::new(&Decay, time.clone(), inputs, outputs).unwrap().named(format!("{e}"))
        };
        let records: Vec<_> = (0..110).map(record).collect();
        let step_error = |records: &[crate::ExperimentOf<Decay>]| {
            let fit = Fit::new(&Decay, records).parameters(Rate { a: free(1.0) }).noise(Current { i: 0.1 });
            let problem = fit.integrator(Rk4 { substeps: 1 }).problem().unwrap();
            let objective = problem.objective().unwrap();
            residual_pass(&objective, &objective.start()).unwrap().step_error
        };
        let squares: f64 = records.iter().map(|one| step_error(std::slice::from_ref(one)).powi(2)).sum();
        let together = step_error(&records);
        assert!(together > 1e-2 && (together / squares.sqrt() - 1.0).abs() < 1e-10, "{together} {squares}");
    }

    signals! { struct Levels { a: "1/s", drift: "A", noise: "A" } }

    /// A decay with process and measurement noise.
    #[derive(Clone)]
    struct Noisy;

    impl Model for Noisy {
        type State = Current;
        type Input = Voltage;
        type Output = Current;
        type Parameters = Levels;

        fn derivative<S: Scalar>(&self, _t: S, x: &Current<S>, u: &Voltage<S>, p: &Levels<S>) -> Current<S> {
            Current { i: (u.u - x.i) * p.a }
        }
        fn diffusion<S: Scalar>(&self, _t: S, _x: &Current<S>, _u: &Voltage<S>, p: &Levels<S>) -> Current<S> {
            Current { i: p.drift }
        }
        fn noise<S: Scalar>(&self, _t: S, _x: &Current<S>, _u: &Voltage<S>, p: &Levels<S>) -> Current<S> {
            Current { i: p.noise }
        }
        fn output<S: Scalar>(&self, _t: S, x: &Current<S>, _u: &Voltage<S>, _p: &Levels<S>) -> Current<S> {
            *x
        }
    }

    /// A decay of rate one from 2 over one second, from an exact state: `x = 2 R(-1)` and `P = drift^2 (1 - R(-2)) / 2` by one step of
    /// Runge-Kutta 4, whose factor is `R(z)`; by two steps `R(-1/2)^2` and `R(-1)^2` take their places. The mean counts by its
    /// standard deviation, the variance by half the square of its logarithm; a sample that is missing does not count.
    #[test]
    fn predicted_variances_are_compared() {
        let factor = |z: f64| 1.0 + z + z * z / 2.0 + z.powi(3) / 6.0 + z.powi(4) / 24.0;
        let (drift, noise) = (0.5, 0.2);
        let step_error = |last: f64| {
            let (time, inputs) = (Time::Uniform { start: 0.0, step: 1.0 }, vec![Voltage { u: 0.0 }; 2]);
            let outputs = vec![Current { i: 1.9 }, Current { i: last }];
            let record = Experiment::new(&Noisy, time, inputs, outputs).unwrap().initial(Current { i: fixed(2.0) });
            let parameters = Levels { a: free(1.0), drift: fixed(drift), noise: fixed(noise) };
            let fit =
                Fit::new(&Noisy, &record).parameters(parameters).predictor(Kalman).integrator(Rk4 { substeps: 1 });
            let problem = fit.problem().unwrap();
            let objective = problem.objective().unwrap();
            residual_pass(&objective, &objective.start()).unwrap().step_error
        };
        let variance = |decay: f64| drift * drift * 0.5 * (1.0 - decay) + noise * noise;
        let (coarse, fine) = (variance(factor(-2.0)), variance(factor(-1.0).powi(2)));
        let mean = 2.0 * (factor(-1.0) - factor(-0.5).powi(2)) / coarse.sqrt();
        let expected = (mean * mean + 0.5 * (fine / coarse).ln().powi(2)).sqrt();
        // The rounding of sums of numbers near one.
        assert!((step_error(0.7) / expected - 1.0).abs() < 1e-12 && expected > 0.1, "{} {expected}", step_error(0.7));
        assert_eq!(step_error(f64::NAN), 0.0);
    }
}
