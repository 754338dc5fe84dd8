//! Fits that go in stages: asked for, or because their start cannot be simulated or leads to no minimum.

use super::further::{SAME, leaves_unexplained, work_of};
use super::refine::{Start, is_only_coarse};
use super::stages::Led;
use crate::error::Error;
use crate::estimate::{About, Summary, Warning, WarningCode};
use crate::optimize::{Infeasible, LeastSquares, Outcome};
use crate::problem::{Control, Lead, Problem, SearchPlan, Settings};
use crate::severity::Severity;
use std::time::Instant;

impl Problem<'_> {
    /// Where the search begins, and a note of the stages, if they were asked for.
    pub(super) fn first_start(&self, control: &Control) -> (Start, Option<Warning>) {
        let declared = Start::declared(self);
        if self.settings.lead == Lead::Declared {
            return (declared, None);
        }
        let (asked, none, its) = match self.settings.lead {
            Lead::Shooting => ("multiple shooting was asked for", "there is none", "its"),
            _ => ("stages were asked for", "there are none", "their"),
        };
        let (start, text) = match self.stages().map(|stages| (self.settings.searches.count() > 1, stages)) {
            Err(reason) => (declared, format!("{asked}, but {none}: {reason}")),
            Ok((true, _)) => {
                (declared, format!("{asked}: each search began at {its} end, if that is nearer to the measurements"))
            }
            Ok((false, stages)) => match stages.declared(control) {
                Ok((start, led)) if self.is_failing(&start, control) => {
                    let text = format!(
                        "no simulation can be run from the end of {}: the plant is unstable or chaotic; the search began at the declared start",
                        led.path()
                    );
                    (Start { stages: start.stages, ..declared }, text)
                }
                Ok((start, led)) => (start, format!("the search began at the end of {}", led.path())),
                Err(reason) => (declared, format!("{asked}, but {reason}; the search began at the declared start")),
            },
        };
        (start, Some(note(text)))
    }

    /// Whether a simulation from there fails, or one of its slopes.
    fn is_failing(&self, start: &Start, control: &Control) -> bool {
        matches!(self.in_units(control).linearize(&start.coordinates), Err(Infeasible::Failed(_)))
    }

    /// The estimate, or that from the end of stages where the declared start cannot be simulated.
    pub(super) fn or_in_stages(&self, found: Result<Summary, Error>, control: &Control) -> Result<Summary, Error> {
        found.or_else(|error| self.in_stages(&error, control).ok_or(error))
    }

    /// The estimate from the end of stages, with a note, where a fit failed because its declared start cannot be simulated; `None` where the
    /// stages fail, too, and of other errors.
    pub(super) fn in_stages(&self, error: &Error, control: &Control) -> Option<Summary> {
        let single = self.settings.searches == SearchPlan::Single && self.settings.lead == Lead::Declared;
        if !(single && matches!(error, Error::Start(_))) {
            return None;
        }
        let (mut found, led) = self.searched_in_stages(Instant::now(), control)?;
        let path = led.path();
        let text = format!("the declared start cannot be simulated, so that the search began at the end of {path}");
        found.warnings.push(note(text));
        Some(found)
    }

    /// The estimate from the end of stages, and these; `None` where they lead nowhere.
    pub(super) fn searched_in_stages(&self, begin: Instant, control: &Control) -> Option<(Summary, Led)> {
        // A checkpoint is that of the search before.
        let settings = Settings { checkpoint: None, ..self.settings.clone() };
        let leading = Problem { settings: Settings { lead: Lead::Stages, ..settings.clone() }, ..self.clone() };
        let (start, led) = leading.stages().ok()?.declared(control).ok()?;
        let problem = Problem { settings, ..self.clone() };
        let found = problem.run_within(begin, control, start).ok()?;
        let mut found = problem.shot_further(&found, Some(&led), control).unwrap_or(found);
        if is_only_coarse(&found) {
            found = problem.refined(Ok(found), 0, begin, control).ok()?;
        }
        Some((found, led))
    }

    /// The estimate after multiple shooting from where a search from the end of stages is stuck, with the iterations and evaluations of all: the cost of a chaotic plant
    /// is rough, that of pieces is not. `None` where there is no such end; the estimate as it was where the new one is higher.
    pub(super) fn shot_further(&self, found: &Summary, led: Option<&Led>, control: &Control) -> Option<Summary> {
        let trials = self.settings.optimizer.most().saturating_sub(found.iterations);
        let is_new = led.is_some_and(|led| led.stages > 0 && led.shot.is_none());
        if !is_new || !is_stuck(found.outcome) || trials == 0 || control.stops() {
            return None;
        }
        let begin = Instant::now();
        // A checkpoint is that of the search before.
        let problem = Problem { settings: Settings { checkpoint: None, ..self.settings.clone() }, ..self.clone() };
        let shot = problem.stages().ok()?.shot(&found.coordinates(), control).ok()?;
        let start = Start { coordinates: shot.coordinates.clone(), trials, ..Start::declared(&problem) };
        let again = problem.run_within(begin, control, start).ok();
        let [iterations, evaluations] = again.as_ref().map_or([0; 2], |again| [again.iterations, again.evaluations]);
        let work = Summary {
            iterations: found.iterations + iterations,
            evaluations: found.evaluations + shot.evaluations + evaluations,
            seconds: found.seconds + begin.elapsed().as_secs_f64(),
            ..found.clone()
        };
        let Some(again) = again else { return Some(work) };
        if !again.deviance.zip(found.deviance).is_some_and(|(again, found)| again <= found + SAME) {
            return Some(work);
        }
        let text =
            format!("the search from the end of the stages was stuck, so that one from the end of {shot} followed");
        Some(noted(work_of(&work, again), Some(note(text))))
    }
}

/// Whether a search ended by itself and not at a minimum: no limit ended it.
pub(super) fn is_stuck(outcome: Outcome) -> bool {
    let stuck = matches!(
        outcome,
        Outcome::Stalled { .. } | Outcome::Creeping { .. } | Outcome::Rough { .. } | Outcome::LimitOfPrecision { .. }
    );
    stuck && !outcome.converged()
}

/// An estimate with one more note, if there is one.
pub(super) fn noted(mut found: Summary, note: Option<Warning>) -> Summary {
    found.warnings.extend(note);
    found
}

pub(super) fn note(text: String) -> Warning {
    Warning::new(WarningCode::Staged, Severity::Usable, text).about(About::Search)
}

/// An estimate with the evaluations of the stages before it, if there were any, and a note where a simulation from their end leaves the measurements.
pub(super) fn after_stages(found: Summary, led: Option<&Led>) -> Summary {
    let Some(led) = led else { return found };
    let mut found = Summary { evaluations: found.evaluations + led.evaluations, ..found };
    let explained = led.follows || led.explains();
    if led.stages > 0 && !explained && leaves_unexplained(&found) {
        let text = "predictions of a filter that corrects the state at each sample follow the measurements where this search began, and a simulation \
                    does not: the plant may be unstable, chaotic or disturbed; take Kalman, with Model::diffusion and Model::noise";
        found.warnings.push(note(text.to_owned()));
    }
    found
}
