//! The first errors of the first experiments, for tests that need them sample by sample.

use crate::problem::Objective;
use crate::sweep::Window;

/// Records that are looked at, and samples of each.
const RECORDS: usize = 8;
const SAMPLES: usize = 16_384;

/// Errors of an experiment, output by output, sample by sample; NaN where nothing was measured.
pub(crate) type Errors = Vec<Vec<f64>>;

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
    /// Of an experiment of so many samples.
    pub fn new(experiment: usize, outputs: usize, samples: usize) -> Self {
        let (end, none) = (if experiment < RECORDS { samples.min(SAMPLES) } else { 0 }, vec![vec![]; outputs]);
        FirstErrors { end, errors: none.clone(), standardized: none }
    }

    /// Takes a window with its errors, output by output.
    pub fn add(&mut self, window: &Window, lane: usize, errors: &[f64]) {
        let samples = window.samples[lane];
        if window.begin[lane] >= self.end {
            return;
        }
        for (j, (kept, errors)) in self.errors.iter_mut().zip(errors.chunks_exact(samples)).enumerate() {
            if window.whole && !window.has_variances() {
                kept.extend_from_slice(errors);
                continue;
            }
            let in_units = |(k, error): (usize, &f64)| match window.is_measured(k, j, lane) {
                true => error * window.variance_root(k, j, lane),
                false => f64::NAN,
            };
            kept.extend(errors.iter().enumerate().map(in_units));
        }
        if !window.has_variances() {
            return;
        }
        for (j, (kept, errors)) in self.standardized.iter_mut().zip(errors.chunks_exact(samples)).enumerate() {
            let divided = |(k, error): (usize, &f64)| if window.is_measured(k, j, lane) { *error } else { f64::NAN };
            kept.extend(errors.iter().enumerate().map(divided));
        }
    }

    pub fn append(&mut self, later: FirstErrors) {
        let all = self.errors.iter_mut().chain(&mut self.standardized);
        for (errors, later) in all.zip(later.errors.into_iter().chain(later.standardized)) {
            if !later.is_empty() {
                errors.reserve_exact(self.end.saturating_sub(errors.len()).max(later.len()));
                errors.extend(later);
            }
        }
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
                errors.push(if window.is_measured(k, j, 0) && error.is_finite() { error } else { f64::NAN });
            }
        }
        true
    };
    // Those up to where it fails.
    let _ = objective.run_alone(e, coordinates, false, visit);
    errors
}
