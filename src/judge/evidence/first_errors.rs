//! Errors of single experiments at the estimate, for tests that need them sample by sample.

use super::conclude::Judgement;
use crate::problem::Objective;
use crate::sweep::Window;

/// Records that are looked at, and samples of each: the first ones.
pub(super) const RECORDS: usize = 8;
const SAMPLES: usize = 16_384;

/// The first errors of an experiment, output by output; `None` where nothing was measured.
pub(super) fn first_errors(judgement: &Judgement<'_>, e: usize) -> Vec<Vec<Option<f64>>> {
    errors(judgement.objective, &judgement.end.coordinates, e, SAMPLES)
}

/// Errors of an experiment, in the units of the outputs, as far as this many samples or somewhat beyond.
pub(super) fn errors(
    objective: &Objective<'_>,
    coordinates: &[f64],
    e: usize,
    samples: usize,
) -> Vec<Vec<Option<f64>>> {
    let mut errors = vec![vec![]; objective.outputs()];
    let visit = &mut |window: &mut Window| {
        for k in 0..window.samples[0] {
            for (j, errors) in errors.iter_mut().enumerate() {
                let error = window.error(k, j, 0);
                errors.push((window.is_measured(k, j, 0) && error.is_finite()).then_some(error));
            }
        }
        errors[0].len() < samples
    };
    // It stops early where there are enough.
    let _ = objective.run_alone(e, coordinates, false, visit);
    errors
}
