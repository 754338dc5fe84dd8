//! [`Objective`]: the cost of a fit as a function of its unknowns.

use super::segments::Memory;
use super::unknowns::Free;
use super::{Control, Problem, Whitening};
use crate::error::Failure;
use crate::loss::Loss;
use crate::optimize::{Infeasible, LeastSquares, Linearization};
use crate::parameter::{Parameter, Transform};
use crate::record::Record;
use crate::sweep::{OVERFLOW, RunError, Sweep, Window};
use std::sync::Arc;

static NEVER: Control = Control::NEVER;

/// The cost of a fit, for its own and for argmin's solvers.
///
/// The unknowns are coordinates in a row: shared parameters, then each experiment's free initial states and own
/// parameters; parameters declared with `.log()` by their logarithm. [`names`](Self::names) gives the order. The cost
/// is the sum over samples and outputs of `weight * rho(error / sigma)`, plus half the squares of the priors; where the
/// variance `v` is predicted, of `rho(error / sqrt(v)) + kappa / 2 * ln(v)`, with `kappa` the mean of `psi(z) z` for
/// Gaussian `z` (one for least squares).
#[derive(Clone)]
pub struct Objective<'p> {
    pub(crate) problem: &'p Problem<'p>,
    pub(crate) sweep: &'p dyn Sweep,
    pub(crate) whitening: Whitening,
    pub(crate) control: &'p Control,
    /// Weighted sum of the squares of each output's measurements.
    pub(crate) squares: Arc<[f64]>,
    /// Unknowns whose slopes are set to zero; empty for none.
    pub(crate) left_out: Vec<bool>,
    /// Carries at the begins of segments, at points that were evaluated.
    pub(crate) memory: Memory,
}

impl<'p> Objective<'p> {
    /// The names of the unknowns, in order.
    pub fn names(&self) -> Vec<String> {
        self.problem.unknowns()
    }

    /// The coordinates at which the fit starts.
    pub fn start(&self) -> Vec<f64> {
        self.problem.unknowns.start()
    }

    pub(super) fn new(
        problem: &'p Problem<'p>,
        sweep: &'p dyn Sweep,
        whitening: Whitening,
        control: &'p Control,
    ) -> Objective<'p> {
        let (left_out, memory) = (vec![], Memory::default());
        let squares: Vec<f64> = (0..problem.layout().outputs.len()).map(|j| squares(problem, j)).collect();
        Objective { problem, sweep, whitening, control, squares: squares.into(), left_out, memory }
    }

    /// This objective without the slopes of the unknowns on their bounds, which may be infinite there (the root of an initial
    /// level of zero); `None` where none is, or where they have been left out already.
    pub(super) fn inside_bounds(&self, coordinates: &[f64]) -> Option<Self> {
        let bounds = self.problem.unknowns.bounds();
        let left_out: Vec<bool> =
            bounds.iter().zip(coordinates).map(|((low, high), x)| x <= low || x >= high).collect();
        let some = self.left_out.is_empty() && left_out.contains(&true);
        some.then(|| Objective { left_out, ..self.clone() })
    }

    /// This objective with errors and slopes in the units of the outputs.
    pub(crate) fn in_units(&self) -> Self {
        self.with(Whitening::none(self.outputs()))
    }

    /// This objective with errors standardized otherwise.
    pub(crate) fn with(&self, whitening: Whitening) -> Self {
        Objective { whitening, ..self.clone() }
    }

    /// This objective without stop conditions: for passes that an answer cannot do without.
    pub(crate) fn unlimited(&self) -> Self {
        Objective { control: &NEVER, ..self.clone() }
    }

    /// Norm of the standardized measurements; `None` where variances are predicted.
    pub(super) fn data_norm(&self) -> Option<f64> {
        let squares = self.squares.iter().zip(self.whitening.sigma()).map(|(squares, sigma)| squares / (sigma * sigma));
        (!self.sweep.predicts_variance()).then(|| squares.sum::<f64>().sqrt())
    }

    /// This objective with another sweep, or records that differ in what was measured.
    pub(crate) fn of<'q>(&'q self, problem: &'q Problem<'q>, sweep: &'q dyn Sweep) -> Objective<'q> {
        let whitening = self.whitening.clone();
        Objective::new(problem, sweep, whitening, self.control)
    }

    /// Number of experiments.
    pub(crate) fn experiments(&self) -> usize {
        self.problem.records.len()
    }

    /// Number of outputs.
    pub(crate) fn outputs(&self) -> usize {
        self.problem.layout().outputs.len()
    }

    pub(crate) fn loss(&self) -> Option<&dyn Loss> {
        self.problem.settings.loss.as_deref().map(|loss| loss as &dyn Loss)
    }

    /// Whether the cost is that of squares alone: without a loss, nor logarithms of variances.
    pub(crate) fn is_sum_of_squares(&self) -> bool {
        self.loss().is_none() && !self.sweep.predicts_variance()
    }

    /// Whether the loss reduces the weight of large errors.
    pub(crate) fn is_robust(&self) -> bool {
        self.loss().is_some_and(|loss| loss.weight(1e3) < 1.0)
    }

    /// Whether weights, a pre-filter or a robust loss make the classical covariance wrong, whatever the data.
    pub(crate) fn needs_sandwich(&self) -> bool {
        self.is_weighted() || self.problem.settings.prefilter.is_some() || self.is_robust()
    }

    pub(crate) fn is_weighted(&self) -> bool {
        self.problem.settings.weights.is_some()
    }

    /// The weight of a sample.
    pub(crate) fn weight(&self, experiment: usize, sample: usize) -> f64 {
        let weights = self.problem.settings.weights.as_ref();
        weights.map_or(1.0, |weights| weights.weight(&self.problem.records[experiment], sample))
    }

    pub(crate) fn infeasible(&self, experiment: usize, error: RunError) -> Infeasible {
        match error {
            RunError::Stopped => Infeasible::Cancelled,
            // A search needs no more than the fact: the exact cause would cost another simulation.
            RunError::Failed { sample } => {
                let label = &self.problem.unknowns.labels[experiment];
                Infeasible::Failed(format!("experiment `{label}` cannot be evaluated (noticed at sample {sample})"))
            }
        }
    }

    /// The exact failure of an experiment that cannot be evaluated; `sample` is where it was noticed.
    pub(crate) fn locate(&self, e: usize, coordinates: &[f64], sample: usize) -> Failure {
        let (problem, sigma) = (self.problem, self.whitening.sigma());
        let (label, record) = (&problem.unknowns.labels[e], &problem.records[e]);
        let values = self.values_of(e, coordinates);
        let stops = || self.control.stops();
        let found = self.sweep.locate(record, &values.x, &values.p, sample, &sigma, &stops);
        let failure = |signal: String, value: f64, hint| Failure {
            experiment: label.clone(),
            sample,
            time: record.moment(sample),
            signal,
            value,
            hint,
        };
        match found {
            Some(Err(failure)) => Failure { experiment: label.clone(), ..failure },
            Some(Ok(largest)) => {
                let largest = Failure { experiment: label.clone(), ..largest };
                self.unsound_prediction(e, coordinates).unwrap_or(largest)
            }
            None => self
                .unsound_prediction(e, coordinates)
                .unwrap_or_else(|| failure("the prediction".to_owned(), f64::NAN, UNSOUND)),
        }
    }

    /// The first predicted variance that is not positive, or slope that is not finite.
    fn unsound_prediction(&self, e: usize, coordinates: &[f64]) -> Option<Failure> {
        let outputs = &self.problem.layout().outputs;
        let unknowns: Vec<&str> =
            self.problem.unknowns.columns(e).map(|i| self.problem.unknowns.row[i].name.as_str()).collect();
        let mut first: Option<(usize, String, f64, &'static str)> = None;
        let visit = &mut |window: &mut Window| {
            for (k, j) in (0..window.samples[0]).flat_map(|k| (0..outputs.len()).map(move |j| (k, j))) {
                let (sample, output, variance) = (window.begin[0] + k, &outputs[j].name, window.variance(k, j, 0));
                if window.is_measured(k, j, 0) && !(variance > 0.0 && variance.is_finite()) {
                    let signal = format!("the predicted variance of output `{output}`");
                    let hint = match variance {
                        _ if variance < 0.0 => NEGATIVE,
                        _ if variance.is_nan() => NO_NUMBER,
                        _ => NO_NOISE,
                    };
                    first.get_or_insert((sample, signal, variance, hint));
                }
                let slopes = unknowns.iter().enumerate().map(|(column, name)| (name, window.at(k, j, column, 0)));
                for (unknown, slope) in slopes.filter(|(_, slope)| !slope.is_finite()) {
                    let signal = format!("the slope of output `{output}` with respect to `{unknown}`");
                    let error = window.error(k, j, 0).abs();
                    first.get_or_insert((sample, signal, slope, if error < OVERFLOWING { STEEP } else { OVERFLOW }));
                }
            }
            first.is_none()
        };
        // It fails, where it fails, after what is looked for.
        let _ = self.run_alone(e, coordinates, true, visit);
        let (sample, signal, value, hint) = first?;
        let experiment = self.problem.unknowns.labels[e].clone();
        let time = self.problem.records[e].moment(sample);
        Some(Failure { experiment, sample, time, signal, value, hint })
    }
}

/// The weighted sum of the squares of an output's measurements.
fn squares(problem: &Problem<'_>, output: usize) -> f64 {
    let weights = problem.settings.weights.as_ref();
    let of = |record: &Record| {
        let weight = |k: usize| weights.map_or(1.0, |weights| weights.weight(record, k));
        let mut sums = [0.0; 4];
        for (c, chunk) in record.outputs()[output].values.chunks(4).enumerate() {
            for (k, (sum, y)) in sums.iter_mut().zip(chunk).enumerate() {
                *sum += if y.is_nan() { 0.0 } else { weight(4 * c + k) * y * y };
            }
        }
        sums.iter().sum::<f64>()
    };
    problem.records.iter().map(of).sum()
}

/// Errors beyond this come with slopes that overflow.
const OVERFLOWING: f64 = 1e100;
const STEEP: &str = "; the value is finite but has no slope there (a root or a power at zero): start elsewhere, or write \
                     the model so that it is smooth there";
const NO_NOISE: &str = "; it must be positive: write Model::noise, and keep the noise levels away \
                        from zero (with .log())";
const NO_NUMBER: &str = "; it must be positive: write Model::noise; where it is written, the filtered state is where a root, a power or a logarithm of \
                         the model has no value: limit it there (the larger of it and zero)";
const NEGATIVE: &str = "; that is an error of the integrator: use a finer step (Fit::integrator)";
const UNSOUND: &str = "; it is not a finite number: bound the parameters or start elsewhere";

impl LeastSquares for Objective<'_> {
    fn linearize(&self, x: &[f64]) -> Result<Linearization, Infeasible> {
        self.evaluate(x)
    }

    fn curvature(&self, x: &[f64], along: &[f64]) -> Option<Result<Linearization, Infeasible>> {
        (!self.sweep.predicts_variance()).then(|| self.second_along(x, along))
    }

    fn sizes(&self) -> Vec<Option<f64>> {
        // A filter corrects its state by the measurements, and with short steps of the initial one the noise levels stay away from
        // zero, where the likelihood of a state that passes through a measurement grows without limit.
        let filtered = self.sweep.predicts_variance();
        let size = |unknown: &Free| match unknown.parameter.transform {
            Transform::Log => Some(1.0),
            Transform::Identity => unknown.size.filter(|_| !filtered),
        };
        self.problem.unknowns.row.iter().map(size).collect()
    }

    fn logarithms(&self) -> Vec<bool> {
        let positive = |parameter: &Parameter| parameter.transform == Transform::Log && parameter.lower <= 0.0;
        self.problem.unknowns.row.iter().map(|unknown| positive(&unknown.parameter)).collect()
    }

    fn bounds(&self) -> Vec<(f64, f64)> {
        self.problem.unknowns.bounds()
    }
}

#[cfg(test)]
mod tests {
    use crate::optimize::LeastSquares;
    use crate::{Experiment, ExperimentOf, Fit, Kind, Model, Nothing, Sample, Scalar, Time, free, signals};

    signals! { struct Input { u: "V" } }
    signals! { struct Output { y: "V", z: "V" } }
    signals! { struct Gain { a: "1" } }

    #[derive(Clone)]
    struct Amplifier;

    impl Model for Amplifier {
        type State = Nothing;
        type Input = Input;
        type Output = Output;
        type Parameters = Gain;
        const KIND: Kind = Kind::Static;

        fn output<S: Scalar>(&self, _t: S, _x: &Nothing, u: &Input<S>, p: &Gain<S>) -> Output<S> {
            Output { y: p.a * u.u, z: p.a + u.u }
        }
    }

    /// Eleven samples of two outputs, one of them perhaps missing.
    fn data(missing: Option<usize>) -> (Vec<Input>, Vec<Output>, ExperimentOf<Amplifier>) {
        let inputs: Vec<Input> = (0..11).map(|k| Input { u: 1.0 + f64::from(k) }).collect();
        let z = |k: usize| if missing == Some(k) { f64::NAN } else { 7.0 - k as f64 };
        let outputs: Vec<Output> = (0..11).map(|k| Output { y: 3.0 + k as f64, z: z(k) }).collect();
        let time = Time::Uniform { start: 0.0, step: 1.0 };
        let record = Experiment::new(&Amplifier, time, inputs.clone(), outputs.clone()).unwrap();
        (inputs, outputs, record)
    }

    /// A row for each measurement, with a weight or without.
    #[test]
    fn rows_are_measurements() {
        for (missing, rows) in [(None, 22), (Some(6), 21)] {
            let (_, _, record) = data(missing);
            let fit = || Fit::new(&Amplifier, &record).parameters(Gain { a: free(1.0) });
            let weighted = fit().weighting(|s: &Sample<Amplifier>| s.u.u);
            for problem in [fit().problem().unwrap(), weighted.problem().unwrap()] {
                let objective = problem.objective().unwrap();
                assert_eq!(objective.linearize(&objective.start()).unwrap().rows(), rows);
            }
        }
    }

    /// `sum of w y^2 / sigma^2` over what was measured.
    #[test]
    fn norm_of_the_data_by_hand() {
        let (inputs, outputs, record) = data(Some(6));
        let fit = Fit::new(&Amplifier, &record).parameters(Gain { a: free(1.0) }).noise(Output { y: 0.5, z: 4.0 });
        let problem = fit.weighting(|s: &Sample<Amplifier>| s.u.u).problem().unwrap();
        let found = problem.objective().unwrap().data_norm().unwrap();
        let squares = |k: usize| {
            let Output { y, z } = outputs[k];
            inputs[k].u * (y * y / 0.25 + if z.is_nan() { 0.0 } else { z * z / 16.0 })
        };
        let expected = (0..11).map(squares).sum::<f64>().sqrt();
        assert!((found / expected - 1.0).abs() < 1e-14, "{found} {expected}");
    }
}
