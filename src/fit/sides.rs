//! Fits of plants that oscillate faster than the samples show: a search on the other side of half the frequency of sampling.

use super::refine::{Start, farthest};
use crate::estimate::{Summary, Unknown, Warning, WarningCode};
use crate::judge::{Aliases, INDISTINGUISHABLE};
use crate::numeral::number;
use crate::optimize::{Outcome, Severity};
use crate::problem::{Control, Problem, Settings};
use std::time::Instant;

/// Ends whose unknowns differ by less than this part of a standard error are the same.
const SAME: f64 = 0.1;
/// Most trial steps of a search: so many, or so many times those of the search before.
const LEAST_TRIALS: u64 = 100;
const PATIENCE: u64 = 3;

/// An estimate, after its deviance.
type End = (f64, Summary);

impl Problem<'_> {
    /// The best of an estimate and those of searches that begin where its oscillation has another frequency with the same samples, if
    /// it is warned of one; with what is known of the others. Of minima that explain the data as well it is the one given.
    pub(super) fn on_both_sides(&self, found: Summary, begin: Instant, control: &Control) -> Summary {
        let useless = |warning: &Warning| {
            let cured = matches!(warning.code, WarningCode::NotAtMinimum | WarningCode::CoarseStep);
            warning.severity == Severity::NotUsable && !cured
        };
        let warned = found.warnings.iter().any(is_open) && !found.warnings.iter().any(useless);
        // Minima cannot be compared without a likelihood, nor where the cost is too rough for one of them.
        let rough = matches!(found.outcome, Outcome::Rough { .. }) && !found.outcome.converged();
        if !warned || rough || found.deviance.is_none() || control.stops() {
            return found;
        }
        let number_of_method =
            self.by_method().position(|one| one.sweep.integrator() == found.method.integrator).unwrap_or(0);
        let Some(finest) = self.by_method().nth(number_of_method) else { return found };
        let settings = Settings { checkpoint: None, ..finest.settings.clone() };
        let problem = Problem { settings, ..finest.clone() };
        let aliases = problem.at_within(&found, control).ok().and_then(|(objective, x)| Aliases::at(&objective, &x));
        let Some(Aliases { frequency, others }) = aliases else { return found };
        let most = self.settings.optimizer.most().saturating_sub(found.iterations);
        let trials = most.min(LEAST_TRIALS.max(PATIENCE * found.iterations));
        let mut frequencies = vec![number(frequency, 3)];
        frequencies.extend(others.iter().map(|(frequency, _)| number(*frequency, 3)));
        frequencies.dedup();
        let search = |(_, coordinates): (f64, Vec<f64>)| {
            let start = Start { coordinates, trials, ends: None };
            let end = problem.run_on(problem.run_within(begin, control, start), trials, begin, control);
            self.refined(end, number_of_method, begin, control).ok()
        };
        let ends = std::iter::once(found.clone()).chain(others.into_iter().filter_map(search));
        let ends = ends.filter_map(|end| Some((end.deviance?, end))).collect();
        best(ends, &frequencies.join(" or ")).unwrap_or(found)
    }
}

/// Whether a warning leaves open which of two frequencies is right.
fn is_open(warning: &Warning) -> bool {
    warning.code == WarningCode::Aliased && warning.severity > Severity::Usable
}

/// The best of ends, of searches begun where the model has these frequencies (rad/s), and the first of those that explain the data as
/// well; `None` where there is no other end.
fn best(mut ends: Vec<End>, frequencies: &str) -> Option<Summary> {
    let (iterations, evaluations) =
        ends.iter().fold((0, 0), |(i, e), (_, end)| (i + end.iterations, e + end.evaluations));
    let distance = |one: &Summary, other: &End| farthest(one, other.1.unknowns.iter().map(|unknown| unknown.value));
    let is_at = |one: &Summary, other: &End| distance(one, other).is_none_or(|(_, errors)| errors <= SAME);
    let minima = ends.iter().filter(|(_, end)| end.outcome.converged());
    let least = minima.map(|(deviance, _)| *deviance).min_by(f64::total_cmp).filter(|_| ends.len() > 1)?;
    let is_best = |(deviance, end): &End| end.outcome.converged() && *deviance <= least + INDISTINGUISHABLE;
    let kept = ends.iter().position(is_best)?;
    let (deviance, mut best) = ends.remove(kept);
    let rival = ends.iter().filter(|end| !is_at(&best, end)).min_by(|a, b| a.0.total_cmp(&b.0));
    let rival = rival.and_then(|rival| Some((rival, distance(&best, rival)?.0)));
    let begun = format!("the samples do not show whether the plant oscillates at {frequencies} rad/s");
    let (severity, text) = match rival {
        None => (Severity::Usable, format!("{begun}: searches begun at each of them ended in one minimum")),
        Some((other, i)) => {
            let Unknown { name, unit, value, .. } = &other.1.unknowns[i];
            let (place, better) = (format!("`{name}` = {} {unit}", number(*value, 5)), number(other.0 - deviance, 2));
            if other.0 - deviance > INDISTINGUISHABLE {
                let text = format!(
                    "{begun}: of the minima that searches begun at each of them found, this is the best by {better} in -2 ln of the \
                     likelihood; the next is at {place}"
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
    Some(Summary { iterations, evaluations, ..best })
}
