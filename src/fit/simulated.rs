//! Predictions that restart from measured states, against a simulation of the whole record.

use super::refine::{CERTAINLY_WORSE, Start, farthest, is_useless};
use crate::estimate::{Summary, Unknown, Warning, WarningCode};
use crate::numeral::{number, unit_after};
use crate::optimize::Severity;
use crate::problem::{Control, Problem, SearchPlan, Settings};
use std::time::Instant;

/// Most trial steps of the simulation's search: from a start that led the predictions to a minimum, tens are usual.
const TRIALS: u64 = 200;
/// Standard errors of the predictions' estimate by which the simulation's must differ: chance exceeds three in 0.3 %.
const APART: f64 = 3.0;

impl Problem<'_> {
    /// The estimate with a warning, where a fit of the simulation has a certainly higher likelihood than that of the predictions from measured
    /// states, with other parameters. Disturbances of the plant would lower the likelihood of the simulation, so noise in the
    /// measurements is the cause. `None` where this is not so, the simulation has no minimum, or the two use different measurements.
    pub(super) fn compared_with_simulation(&self, found: &Summary, control: &Control) -> Option<Summary> {
        if !found.outcome.converged() || control.stops() || is_useless(found, WarningCode::RestartNoise) {
            return None;
        }
        let begin = Instant::now();
        let finest = self.by_number(found.method.refinement);
        let sweep = finest.sweep.simulating()?;
        let settings = Settings { checkpoint: None, searches: SearchPlan::Single, ..self.settings.clone() };
        let problem = Problem::new(sweep, self.records.clone(), &self.unknowns.parameters, settings).ok()?;
        let start = Start { trials: TRIALS.min(self.settings.optimizer.most()), ..Start::declared(&problem) };
        let simulated = problem.run_within(begin, control, start).ok()?;
        let better = found.deviance? - simulated.deviance?;
        let same = simulated.measurements == found.measurements && simulated.unknowns.len() == found.unknowns.len();
        if !simulated.outcome.converged() || !same || better <= CERTAINLY_WORSE {
            return None;
        }
        let values = simulated.unknowns.iter().map(|unknown| unknown.value);
        let (i, errors) = farthest(found, values).filter(|(_, errors)| *errors > APART)?;
        let Unknown { name, unit, value, .. } = &simulated.unknowns[i];
        let text = format!(
            "a simulation explains the outputs better than predictions from measured states do (-2 ln of the likelihood is less by {}), \
             with `{name}` = {}{}, {} standard errors away: these measurements are noisy, which biases what restarts from them; \
             simulate (FreeRun, the default), or use Kalman with Model::noise",
            number(better, 3),
            number(*value, 4),
            unit_after(unit),
            number(errors, 2)
        );
        let mut warned = found.clone();
        warned.warnings.push(Warning { code: WarningCode::RestartNoise, severity: Severity::NotUsable, text });
        let (evaluations, seconds) =
            (found.evaluations + simulated.evaluations, found.seconds + begin.elapsed().as_secs_f64());
        Some(Summary { evaluations, seconds, ..warned })
    }
}
