//! Starts from which a state decays within a small part of a sample.
//!
//! Simulations and predictions from there have hardly a slope, and those by an explicit method grow without bound. What decays so fast does
//! not show in the measurements: the start is no better than one with the same parameters in other proportions.

use crate::layout::Kind;
use crate::problem::{Control, Problem};
use crate::residuals::modes::{StateAt, eigenvalues, reached};

/// A start is too fast where its fastest rate times the interval between samples is more than this: beyond 2.8 Runge and Kutta's step grows.
const FAST: f64 = 3.0;
/// The most by which the logarithm of the rate is changed at once.
const LARGEST_STEP: f64 = 2.0;

/// The start with its parameters changed, all by the least parts of themselves, until the fastest rate of the state at the first sample is that of
/// the samples; `None` where it is not much faster, and where the parameters' bounds do not allow it. `interval` is that between samples (s).
pub(super) fn slower(problem: &Problem<'_>, interval: f64, start: &[f64]) -> Option<Vec<f64>> {
    if problem.layout().kind != Kind::Continuous {
        return None;
    }
    let never = Control::NEVER;
    let objective = problem.in_units(&never);
    let at = StateAt { experiment: 0, sample: 0, state: objective.values_of(0, start).x };
    let fastest = |x: &[f64]| {
        let rates = eigenvalues(&objective, x, &at)?.into_iter().map(|rate| rate.norm());
        rates.reduce(f64::max).map(|rate| rate * interval)
    };
    let rate = fastest(start).filter(|rate| *rate > FAST)?;
    let all: Vec<usize> = (0..start.len()).collect();
    reached(&objective, (0, start), &all, (rate, LARGEST_STEP), &|x, _| fastest(x), |rate: f64| -rate.ln())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::{Current, Gain, Voltage};
    use crate::{Experiment, Fit, Model, Scalar, Time, free};

    /// A current that decays with `a`.
    #[derive(Clone)]
    struct Coil;

    impl Model for Coil {
        type State = Current;
        type Input = Voltage;
        type Output = Current;
        type Parameters = Gain;

        fn derivative<S: Scalar>(&self, _t: S, x: &Current<S>, u: &Voltage<S>, p: &Gain<S>) -> Current<S> {
            Current { i: u.u - p.a * x.i }
        }
        fn output<S: Scalar>(&self, _t: S, x: &Current<S>, _u: &Voltage<S>, _p: &Gain<S>) -> Current<S> {
            *x
        }
    }

    /// A rate of a million is moved to that of samples a tenth of a second apart, one that these show is not, and a bound is kept.
    #[test]
    fn rates_are_moved_to_that_of_the_samples() {
        let inputs: Vec<Voltage> = (0..40).map(|k| Voltage { u: f64::from(k % 7) }).collect();
        let outputs = (0..40).map(|k| Current { i: f64::from(k % 5) }).collect();
        let record = Experiment::new(&Coil, Time::Uniform { start: 0.0, step: 0.1 }, inputs, outputs).unwrap();
        let moved = |a: crate::Parameter| {
            let problem = Fit::new(&Coil, &record).parameters(Gain { a }).problem().unwrap();
            slower(&problem, 0.1, &problem.unknowns.start()).map(|x| problem.unknowns.values(&x)[0])
        };
        for a in [free(1e6), free(1e6).log(), free(-1e6)] {
            let found = moved(a).unwrap();
            assert!((found.abs() / 10.0 - 1.0).abs() < 2e-3 && found * a.start > 0.0, "{found}");
        }
        assert_eq!([moved(free(20.0)), moved(free(1e6).within(1e3, 1e7))], [None, None]);
    }
}
