//! Fits whose integrator was not chosen: finer methods, as long as a finer step would move an unknown.

use crate::error::Error;
use crate::estimate::{Summary, Warning, WarningCode};
use crate::numeral::number;
use crate::optimize::{Outcome, Severity};
use crate::problem::{Control, PARTS, Problem, TRIALS};
use std::time::Instant;

/// A deviance that is larger by this is worth a note; by the second, a warning. If both methods had the same fixed parameters, a
/// record of the finer model would favor the coarser one by 15 in less than `exp(-15 / 2)`, one of 1,800 records; with estimated
/// parameters that is about right only.
const WORSE: f64 = 4.0;
const CERTAINLY_WORSE: f64 = 15.0;

/// The answer by the finest method tried so far.
pub(super) struct Attempt {
    found: Result<Summary, Error>,
    /// The least deviance of coarser methods, and which one has it.
    coarser: Option<(f64, String)>,
}

impl Attempt {
    pub fn new(found: Result<Summary, Error>) -> Self {
        Attempt { found, coarser: None }
    }

    /// Whether a finer method is to be tried: a finer step would move an unknown, or the start cannot be simulated.
    pub fn is_coarse(&self) -> bool {
        match &self.found {
            // An output that is constant determines no parameter by any method.
            Ok(found) => {
                let coarse = found.warnings.iter().any(|warning| warning.code == WarningCode::CoarseStep);
                coarse && !is_useless(found, WarningCode::ConstantOutput)
            }
            Err(error) => matches!(error, Error::Start(_)),
        }
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

    /// The answer of a finer method if it converged, else this one. A finer step is closer to the model's equations, so that it
    /// is preferred also where a coarser one has a smaller deviance.
    pub fn or(self, again: Result<Summary, Error>) -> Self {
        let (before, again) = match (self.found, again) {
            (Err(_), again @ Ok(_)) => return Attempt { found: again, coarser: self.coarser },
            (Ok(before), Ok(again)) if again.outcome.converged() || !before.outcome.converged() => (before, again),
            (before, _) => return Attempt { found: before, coarser: self.coarser },
        };
        let deviance = before.deviance.filter(|_| before.outcome.converged());
        let this = deviance.map(|deviance| (deviance, before.method.integrator.clone()));
        let coarser = self.coarser.into_iter().chain(this).min_by(|a, b| a.0.total_cmp(&b.0));
        Attempt { found: Ok(after(&before, again)), coarser }
    }

    /// The answer, with a note where a coarser step explains the data better.
    pub fn answer(self) -> Result<Summary, Error> {
        let mut found = self.found?;
        if let (Some((least, coarser)), Some(deviance)) = (self.coarser, found.deviance)
            && deviance > least + WORSE
        {
            let certain = deviance > least + CERTAINLY_WORSE;
            let why = if certain { "the record may have been simulated with it" } else { "which may be chance" };
            let text = format!(
                "{coarser} explains the data better than {}, by {} in -2 ln of the likelihood ({why}); the estimate is that of the \
                 finer step, which is closer to the equations; choose one with Fit::integrator",
                found.method.integrator,
                number(deviance - least, 2)
            );
            let severity = if certain { Severity::UsableWithCare } else { Severity::Usable };
            found.warnings.push(Warning { code: WarningCode::CoarseStep, severity, text });
        }
        Ok(found)
    }
}

impl Problem<'_> {
    /// Continues a search by this finer method that ended at the limit of a part, as long as the model explains the data better
    /// than a constant. Not for searches from several starts, which are not run in parts, nor where the user's own limit is
    /// below that of a part.
    pub(super) fn run_on(
        &self,
        found: Result<Summary, Error>,
        begin: Instant,
        control: &Control,
    ) -> Result<Summary, Error> {
        let mut found = found?;
        let mut trials = found.iterations;
        for _ in 1..PARTS {
            let limited = matches!(found.outcome, Outcome::IterationLimit { .. }) && trials >= TRIALS;
            if self.settings.starts > 1 || !limited || is_useless(&found, WarningCode::Unexplained) || control.stops() {
                break;
            }
            let again = self.run_within(begin, control, found.coordinates())?;
            trials = again.iterations;
            found = after(&found, again);
        }
        Ok(found)
    }
}

/// Whether an estimate is not usable for this reason.
fn is_useless(found: &Summary, code: WarningCode) -> bool {
    found.warnings.iter().any(|warning| warning.code == code && warning.severity == Severity::NotUsable)
}

/// The estimate of a finer method, with the work of both.
fn after(before: &Summary, again: Summary) -> Summary {
    Summary {
        iterations: before.iterations + again.iterations,
        evaluations: before.evaluations + again.evaluations,
        ..again
    }
}
