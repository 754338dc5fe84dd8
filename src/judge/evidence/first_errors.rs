//! Errors of single experiments at the estimate, for tests that need them sample by sample.

use crate::problem::Objective;
use crate::sweep::Window;

/// Records that are looked at, and samples of each: the first ones.
const RECORDS: usize = 8;
const SAMPLES: usize = 16_384;

/// Errors of an experiment, output by output, sample by sample; `None` where nothing was measured.
pub(crate) type Errors = Vec<Vec<Option<f64>>>;

/// The first errors of the first records.
pub(crate) fn of_all(objective: &Objective<'_>, coordinates: &[f64]) -> Vec<Errors> {
    (0..objective.experiments().min(RECORDS)).map(|e| errors(objective, coordinates, e, SAMPLES)).collect()
}

/// What is left out, if something is.
pub(crate) fn left_out(objective: &Objective<'_>) -> Option<&'static str> {
    let long = objective.problem.records.iter().any(|record| record.len() > SAMPLES);
    (long || objective.experiments() > RECORDS)
        .then_some("records beyond the first 8, and samples beyond the first 16,384")
}

/// Errors of an experiment, in the units of the outputs, as far as this many samples or somewhat beyond.
pub(crate) fn errors(objective: &Objective<'_>, coordinates: &[f64], e: usize, samples: usize) -> Errors {
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
