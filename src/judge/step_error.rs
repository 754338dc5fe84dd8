//! How far a finer step would move the predictions, from windows that are simulated again.

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
