//! Fits whose integrator was not chosen: finer methods, as long as a finer step would move an unknown.

use crate::error::Error;
use crate::estimate::{Summary, Warning, WarningCode};
use crate::optimize::Severity;
use crate::problem::{Control, Problem};

/// The best answer by the methods tried so far.
pub(super) struct Attempt {
    pub found: Result<Summary, Error>,
    /// Whether a finer method was tried and is no better.
    ended: bool,
}

impl Attempt {
    pub fn new(found: Result<Summary, Error>) -> Self {
        Attempt { found, ended: false }
    }

    /// Whether a finer method is to be tried: a finer step would move an unknown, or the start cannot be simulated.
    pub fn is_coarse(&self) -> bool {
        let coarse = match &self.found {
            Ok(found) => coarse_step(found).is_some(),
            Err(error) => matches!(error, Error::Start(_)),
        };
        coarse && !self.ended
    }

    /// Where the search by a finer method begins: at the end of this one if the step is all that is wrong with it, else at the
    /// start of the problem; `None` if that method's step would decide the cost there, too.
    pub fn start(&self, finer: &Problem<'_>, control: &Control) -> Option<Vec<f64>> {
        let wrong =
            |warning: &Warning| warning.severity == Severity::NotUsable && warning.code != WarningCode::CoarseStep;
        match &self.found {
            Ok(found) if found.outcome.converged() && !found.warnings.iter().any(wrong) => {
                let within = |(x, (lower, upper)): (f64, (f64, f64))| x.max(lower).min(upper);
                Some(found.coordinates().into_iter().zip(finer.unknowns.bounds()).map(within).collect())
            }
            _ => {
                let start = finer.unknowns.start();
                let steps = finer.in_units(control);
                (finer.sweep.is_adaptive() || !steps.step_decides(&start).unwrap_or(true)).then_some(start)
            }
        }
    }

    /// This answer or that of a finer method.
    pub fn or(self, again: Result<Summary, Error>) -> Self {
        let (found, ended) = match (self.found, again) {
            (Ok(before), Ok(again)) if !before.outcome.converged() => (Ok(after(&before, again)), false),
            (Ok(before), Ok(again)) if again.outcome.converged() => match explains(&before, &again) {
                true => (Ok(after(&before, again)), false),
                false => (Ok(kept(before, &again)), true),
            },
            (Err(_), again @ Ok(_)) => (again, false),
            (before, _) => (before, false),
        };
        Attempt { found, ended }
    }
}

/// The warning that a finer step would move an unknown.
fn coarse_step(found: &Summary) -> Option<&Warning> {
    found.warnings.iter().find(|warning| warning.code == WarningCode::CoarseStep)
}

/// Whether a finer method explains the data no worse than a coarser one: records that were simulated with the coarser step
/// are explained by that alone.
fn explains(before: &Summary, again: &Summary) -> bool {
    const INDISTINGUISHABLE: f64 = 4.0;
    before.deviance.zip(again.deviance).is_none_or(|(before, again)| again < before + INDISTINGUISHABLE)
}

/// The estimate of a finer method, with the work of both.
fn after(before: &Summary, again: Summary) -> Summary {
    Summary {
        iterations: before.iterations + again.iterations,
        evaluations: before.evaluations + again.evaluations,
        ..again
    }
}

/// The estimate of a coarser method, which explains the data better than a finer one.
fn kept(mut before: Summary, again: &Summary) -> Summary {
    if let Some(warning) = before.warnings.iter_mut().find(|warning| warning.code == WarningCode::CoarseStep) {
        warning.severity = warning.severity.min(Severity::UsableWithCare);
        warning.text +=
            &format!("; {} explains the data worse, so that the coarser step was kept", again.method.integrator);
    }
    before
}
