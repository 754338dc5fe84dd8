//! Starts from which a state decays within a small part of a sample.
//!
//! Simulations and predictions from there have hardly a slope, and those by an explicit method grow without bound. The measurements do not show what
//! decays so fast.

use super::moves::Movement;
use crate::layout::Kind;
use crate::problem::{Control, Problem};
use crate::residuals::modes::{StateAt, eigenvalues, reached};

/// A start is too fast where its fastest decay times the interval between samples is more than this: beyond 2.8 a step of Runge and Kutta grows.
const FAST: f64 = 3.0;
/// The most by which the logarithm of the decay is changed at once.
const LARGEST_STEP: f64 = 2.0;

/// The start with its parameters changed, all by the least parts of themselves, until the fastest decay of the state at the first sample of the record
/// that moves the most is one per sample; `None` where it is not much faster, where the parameters' bounds do not allow it, and where `control` stops.
pub(super) fn slower(problem: &Problem<'_>, movement: &Movement, start: &[f64], control: &Control) -> Option<Vec<f64>> {
    if problem.layout().kind != Kind::Continuous {
        return None;
    }
    let objective = problem.in_units(control);
    let experiment = movement.most;
    let at = StateAt { experiment, sample: 0, state: objective.values_of(experiment, start).x };
    let fastest = |x: &[f64]| {
        if control.stops() {
            return None;
        }
        let decays = eigenvalues(&objective, x, &at)?.into_iter().map(|rate| -rate.re);
        decays.reduce(f64::max).map(|decay| decay * movement.step)
    };
    let decay = fastest(start).filter(|decay| *decay > FAST)?;
    let all: Vec<usize> = (0..start.len()).collect();
    reached(&objective, (experiment, start), &all, (decay, LARGEST_STEP), &|x, _| fastest(x), |decay: f64| -decay.ln())
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

    /// A decay of 1e6 1/s becomes 10 1/s, one per sample of 0.1 s. One of 20 1/s, a growth, and one whose bound does not allow it stay.
    #[test]
    fn rates_are_moved_to_that_of_the_samples() {
        let inputs: Vec<Voltage> = (0..40).map(|k| Voltage { u: f64::from(k % 7) }).collect();
        let outputs = (0..40).map(|k| Current { i: f64::from(k % 5) }).collect();
        let record = Experiment::new(&Coil, Time::Uniform { start: 0.0, step: 0.1 }, inputs, outputs).unwrap();
        let moved = |a: crate::Parameter| {
            let problem = Fit::new(&Coil, &record).parameters(Gain { a }).problem().unwrap();
            let movement = problem.movement().unwrap();
            let found = slower(&problem, &movement, &problem.unknowns.start(), &Control::NEVER);
            found.map(|x| problem.unknowns.values(&x)[0])
        };
        for a in [free(1e6), free(1e6).log()] {
            let found = moved(a).unwrap();
            assert!((found / 10.0 - 1.0).abs() < 2e-3, "{found}");
        }
        assert_eq!([free(20.0), free(-1e6), free(1e6).within(1e3, 1e7)].map(moved), [None; 3]);
    }
}
