//! Fits of plants that oscillate faster than the samples show: a search on the other side of half the frequency of sampling.

use super::refine::{Start, farthest};
use crate::estimate::{Summary, Unknown, Warning, WarningCode};
use crate::judge::Aliases;
use crate::numeral::number;
use crate::optimize::Severity;
use crate::problem::{Control, Problem, Settings};
use std::time::Instant;

/// A difference of deviances that decides between two minima: if both had the same number of fixed parameters, the wrong one would
/// be better by this in less than `exp(-10 / 2)`, one of 150 records.
const DECIDES: f64 = 10.0;
/// Ends whose unknowns differ by less than this part of a standard error are the same.
const SAME: f64 = 0.1;

/// An estimate, after its deviance and the frequency where its search began (rad/s).
type End = (f64, f64, Summary);

impl Problem<'_> {
    /// The best of an estimate and those of searches that begin where its oscillation has another frequency with the same samples,
    /// if it is warned of one; with what is known of the others.
    pub(super) fn on_both_sides(&self, found: Summary, begin: Instant, control: &Control) -> Summary {
        let warned = found.warnings.iter().any(is_open);
        let wrong = found.warnings.iter().any(|warning| warning.severity == Severity::NotUsable);
        if !warned || wrong || !found.outcome.converged() || control.stops() {
            return found;
        }
        let finest = self.by_name(&found.method.integrator);
        let settings = Settings { checkpoint: None, ..finest.settings.clone() };
        let problem = Problem { settings, ..finest.clone() };
        let aliases = problem.at_within(&found, control).ok().and_then(|(objective, x)| Aliases::at(&objective, &x));
        let Some(Aliases { frequency, others }) = aliases else { return found };
        let trials = self.settings.optimizer.most().saturating_sub(found.iterations);
        let search = |(frequency, coordinates): (f64, Vec<f64>)| {
            let start = Start { coordinates, trials, ends: None };
            let end = problem.run_on(problem.run_within(begin, control, start), trials, begin, control).ok()?;
            let deviance = end.deviance.filter(|_| end.outcome.converged())?;
            Some((deviance, frequency, end))
        };
        let ends: Vec<End> = others.into_iter().filter_map(search).collect();
        let Some(deviance) = found.deviance.filter(|_| !ends.is_empty()) else { return found };
        best((deviance, frequency, found), ends)
    }
}

/// Whether a warning leaves open which of two frequencies is right.
fn is_open(warning: &Warning) -> bool {
    warning.code == WarningCode::Aliased && warning.severity > Severity::Usable
}

/// The best of the first estimate and others, each with its deviance and the frequency where its search began.
fn best(first: End, others: Vec<End>) -> Summary {
    let mut ends = vec![first];
    ends.extend(others);
    let frequencies: Vec<String> = ends.iter().map(|end| number(end.1, 3)).collect();
    let (iterations, evaluations) =
        ends.iter().fold((0, 0), |(i, e), (_, _, end)| (i + end.iterations, e + end.evaluations));
    // Of ends that are as good, the first.
    ends.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (deviance, frequency, mut best) = ends.swap_remove(0);
    ends.sort_by(|a, b| a.0.total_cmp(&b.0));
    let distance = |end: &End| farthest(&best, end.2.unknowns.iter().map(|unknown| unknown.value));
    let apart = ends.iter().filter_map(|end| Some((end, distance(end)?)));
    let rival = apart.filter(|(_, (_, errors))| *errors > SAME).map(|(end, (i, _))| (end, i)).next();
    let begun = format!("the samples do not show whether the plant oscillates at {} rad/s", frequencies.join(" or "));
    let (severity, text) = match rival {
        None => (Severity::Usable, format!("{begun}: searches begun at each of them ended in one minimum")),
        Some((other, i)) => {
            let Unknown { name, unit, value, .. } = &other.2.unknowns[i];
            let (place, better) = (format!("`{name}` = {} {unit}", number(*value, 5)), number(other.0 - deviance, 2));
            if other.0 - deviance > DECIDES {
                let text = format!(
                    "{begun}: of searches begun at each of them, that at {} found the best minimum, by {better} in -2 ln of the \
                     likelihood; the next is at {place}",
                    number(frequency, 3)
                );
                (Severity::Usable, text)
            } else {
                let text = format!(
                    "{begun}, and another minimum explains the data as well, at {place} (-2 ln of the likelihood differs by \
                     {better}): bounds or a prior must tell which one is meant; or sample faster"
                );
                (Severity::UsableWithCare, text)
            }
        }
    };
    best.warnings.retain(|warning| !is_open(warning));
    best.warnings.push(Warning { code: WarningCode::Aliased, severity, text });
    Summary { iterations, evaluations, ..best }
}
