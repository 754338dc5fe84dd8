//! Fits that go in stages, asked for or because their start cannot be simulated.

use super::elsewhere::leaves_unexplained;
use super::refine::{Start, is_only_coarse};
use super::stages::Led;
use crate::error::Error;
use crate::estimate::{About, Summary, Warning, WarningCode};
use crate::numeral::counted;
use crate::problem::{Control, Problem, SearchPlan, Settings};
use crate::severity::Severity;
use std::time::Instant;

/// What the stages are, in words.
const STAGES: &str = "predictions by a filter that corrects the state at each sample, from stage to stage less";

/// What a fit did that went in so many stages.
pub(super) fn went(stages: u32) -> String {
    format!("went from there in {} ({STAGES}), and searched on", counted(stages.into(), "stage"))
}

impl Problem<'_> {
    /// The estimate from where stages led the declared start, and how many; `None` where they led nowhere.
    pub(super) fn run_in_stages(&self, trials: u64, begin: Instant, control: &Control) -> Option<(Summary, u32)> {
        // A checkpoint is that of the search before.
        let settings = Settings { checkpoint: None, ..self.settings.clone() };
        let problem = Problem { settings, ..self.clone() };
        let start = problem.stages().ok()?.declared(control)?;
        let count = start.stages.map_or(0, |led| led.stages);
        let mut found = problem.run_within(begin, control, Start { trials, ..start }).ok()?;
        if is_only_coarse(&found) {
            found = problem.refined(Ok(found), 0, begin, control).ok()?;
        }
        Some((found, count))
    }

    /// An estimate with a note of the stages that were asked for.
    pub(super) fn told_of_stages(&self, mut found: Summary, led: Option<Led>) -> Summary {
        if !self.settings.staged {
            return found;
        }
        let text = match (led, self.stages()) {
            (_, Err(reason)) => format!("stages were asked for, but there are none: {reason}"),
            (Some(led), _) => {
                let count = counted(led.stages.into(), "stage");
                format!("the search began where {count} ({STAGES}) led the declared start")
            }
            (None, _) if self.settings.searches.count() > 1 => format!("each search began where stages ({STAGES}) led its start"),
            (None, _) => "stages were asked for, but led the declared start no nearer to the measurements; the search began there".to_owned(),
        };
        found.warnings.push(Warning::new(WarningCode::Staged, Severity::Usable, text).about(About::Search));
        found
    }

    /// The estimate, or that from where stages led a start that cannot be simulated.
    pub(super) fn or_in_stages(&self, found: Result<Summary, Error>, control: &Control) -> Result<Summary, Error> {
        let error = match found {
            Ok(found) => return Ok(found),
            Err(error) => error,
        };
        self.in_stages_of(&error, control).ok_or(error)
    }

    /// The estimate from where stages led a start that cannot be simulated, with a note; `None` where they led nowhere, and of other errors.
    pub(super) fn in_stages_of(&self, error: &Error, control: &Control) -> Option<Summary> {
        let single = self.settings.searches == SearchPlan::Single && !self.settings.staged;
        if !(single && matches!(error, Error::Start(_))) {
            return None;
        }
        let (mut found, stages) = self.run_in_stages(self.settings.optimizer.most(), Instant::now(), control)?;
        let text = format!("the declared start cannot be simulated, so that the fit {}", went(stages));
        found.warnings.push(Warning::new(WarningCode::Staged, Severity::Usable, text).about(About::Search));
        Some(found)
    }
}

/// An estimate with the evaluations of the stages that led to its start, and a note where a simulation from there loses the measurements.
pub(super) fn led_by(found: Summary, led: Led) -> Summary {
    let mut found = Summary { evaluations: found.evaluations + led.evaluations, ..found };
    if !led.follows && leaves_unexplained(&found) {
        let text = "predictions of a filter that corrects the state at each sample led to where this search began, and a simulation from there does \
                    not follow the measurements: the plant may be unstable, chaotic or disturbed; take Kalman, with Model::diffusion and Model::noise";
        found.warnings.push(Warning::new(WarningCode::Staged, Severity::Usable, text.to_owned()).about(About::Search));
    }
    found
}
