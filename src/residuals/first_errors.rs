//! The first errors of the first experiments, for tests that need them sample by sample.

use crate::problem::Objective;
use crate::sweep::Window;

/// Records that are looked at, and samples of each.
const RECORDS: usize = 8;
const SAMPLES: usize = 16_384;

/// Errors of an experiment, output by output, sample by sample; `None` where nothing was measured.
pub(crate) type Errors = Vec<Vec<Option<f64>>>;

/// The first errors of an experiment.
pub(crate) struct FirstErrors {
    /// Windows that begin at this sample or later are left out.
    end: usize,
    /// In the units of the outputs.
    pub errors: Errors,
    /// Divided by their predicted deviations; empty where none are predicted.
    pub standardized: Errors,
}

impl FirstErrors {
    pub fn new(experiment: usize, outputs: usize) -> Self {
        let (end, none) = (if experiment < RECORDS { SAMPLES } else { 0 }, vec![vec![]; outputs]);
        FirstErrors { end, errors: none.clone(), standardized: none }
    }

    /// Takes a window with its errors, output by output.
    pub fn add(&mut self, window: &Window, lane: usize, errors: &[f64]) {
        let samples = window.samples[lane];
        if window.begin[lane] >= self.end {
            return;
        }
        for (j, (kept, errors)) in self.errors.iter_mut().zip(errors.chunks_exact(samples)).enumerate() {
            let in_units = |(k, error): (usize, &f64)| {
                window.is_measured(k, j, lane).then(|| error * window.variance_root(k, j, lane))
            };
            kept.extend(errors.iter().enumerate().map(in_units));
        }
        if !window.has_variances() {
            return;
        }
        for (j, (kept, errors)) in self.standardized.iter_mut().zip(errors.chunks_exact(samples)).enumerate() {
            let divided = |(k, error): (usize, &f64)| window.is_measured(k, j, lane).then_some(*error);
            kept.extend(errors.iter().enumerate().map(divided));
        }
    }

    pub fn append(&mut self, later: FirstErrors) {
        self.errors.iter_mut().zip(later.errors).for_each(|(errors, later)| errors.extend(later));
        self.standardized.iter_mut().zip(later.standardized).for_each(|(errors, later)| errors.extend(later));
    }
}

/// What is left out, if something is.
pub(crate) fn left_out(objective: &Objective<'_>) -> Option<&'static str> {
    let long = objective.problem.records.iter().any(|record| record.len() > SAMPLES);
    (long || objective.experiments() > RECORDS)
        .then_some("records beyond the first 8, and samples beyond the first 16,384")
}

/// All errors of an experiment.
pub(crate) fn errors(objective: &Objective<'_>, coordinates: &[f64], e: usize) -> Errors {
    let mut errors = vec![vec![]; objective.outputs()];
    let visit = &mut |window: &mut Window| {
        for k in 0..window.samples[0] {
            for (j, errors) in errors.iter_mut().enumerate() {
                let error = window.error(k, j, 0);
                errors.push((window.is_measured(k, j, 0) && error.is_finite()).then_some(error));
            }
        }
        true
    };
    // Those up to where it fails.
    let _ = objective.run_alone(e, coordinates, false, visit);
    errors
}
