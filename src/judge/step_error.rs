//! How far a finer step would move the predictions, from some windows that are simulated again.

use crate::problem::{Objective, each};
use crate::sweep::{Piece, Prepared, Sweep};
use std::borrow::Cow;
use std::sync::Arc;

/// A window that is to be compared with a finer simulation.
pub(super) struct Sampled {
    pub begin: usize,
    pub errors: Vec<f64>,
    pub carry: Vec<f64>,
}

/// The norm of the change of all standardized predictions with a finer step, extrapolated from some windows.
pub(super) fn step_error(objective: &Objective<'_>, coordinates: &[f64], again: &[&[Sampled]]) -> f64 {
    let Some(finer) = objective.sweep.refined() else { return 0.0 };
    if objective.sweep.predicts_variance() {
        return 0.0;
    }
    let sigma = objective.whitening.sigma();
    let change = |e: usize| changed(objective, coordinates, e, &finer, &sigma, again[e]);
    each(again.len(), change).into_iter().sum::<f64>().sqrt()
}

/// Sum of the squared standardized changes in some windows, extrapolated to the whole experiment.
fn changed(
    objective: &Objective<'_>,
    x: &[f64],
    e: usize,
    finer: &Arc<dyn Sweep + '_>,
    sigma: &[f64],
    again: &[Sampled],
) -> f64 {
    let record = &objective.problem.records[e];
    let values = objective.problem.unknowns.of_experiment(e, x);
    let prepared = Prepared { restarts: objective.problem.prepared[e].restarts.clone(), ..Prepared::default() };
    let (mut change, mut seen) = (0.0, 0usize);
    for sampled in again {
        let samples = sampled.errors.len() / sigma.len();
        let piece = Piece {
            record,
            prepared: &prepared,
            samples: sampled.begin..sampled.begin + samples,
            carry: Cow::Borrowed(&sampled.carry),
            slopes: Cow::default(),
            parameters: &values.p,
        };
        let mut found = 0.0;
        let reached = finer.run(std::slice::from_ref(&piece), &[], &mut |window| {
            for k in 0..window.samples[0] {
                for (j, sigma) in sigma.iter().enumerate() {
                    let before = sampled.errors[(window.begin[0] + k - sampled.begin) * window.outputs() + j];
                    found += ((before - window.error(k, j, 0)) / sigma).powi(2);
                }
            }
            true
        });
        if reached.iter().all(Result::is_ok) && found.is_finite() {
            change += found;
            seen += samples;
        }
    }
    if seen > 0 { change * record.len() as f64 / seen as f64 } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::super::residual_pass::residual_pass;
    use crate::{Experiment, Fit, Model, Rk4, Scalar, Time, free, signals, simulate};

    signals! { struct Voltage { u: "V" } }
    signals! { struct Current { i: "A" } }
    signals! { struct Rate { a: "1/s" } }

    #[derive(Clone)]
    struct Decay;

    impl Model for Decay {
        type State = Current;
        type Input = Voltage;
        type Output = Current;
        type Parameters = Rate;

        fn derivative<S: Scalar>(&self, _t: S, x: &Current<S>, u: &Voltage<S>, p: &Rate<S>) -> Current<S> {
            Current { i: (u.u - x.i) * p.a }
        }
        fn output<S: Scalar>(&self, _t: S, x: &Current<S>, _u: &Voltage<S>, _p: &Rate<S>) -> Current<S> {
            *x
        }
    }

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
}
