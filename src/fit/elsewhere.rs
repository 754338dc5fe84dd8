//! Searches that a fit runs by itself after its estimate was judged, since another minimum may be the right one: on the other side of
//! half the frequency of sampling, and from further starts where the model explains nothing.

use super::refine::{Start, after, is_useless};
use crate::estimate::{Summary, Warning, WarningCode};
use crate::optimize::Severity;
use crate::problem::{Control, Problem};
use std::time::Instant;

/// Starts of a fit whose first search ended where the model explains nothing, the declared one among them: of fifteen records of
/// predators and prey 16 starts led ten to the right minimum, 32 all of them.
const STARTS: usize = 32;
/// Trial steps of each of these searches: so many times those of the first, within limits. They run in lanes, some at a time.
const AGAIN: u64 = 2;
const FEWEST: u64 = 100;
const MOST: u64 = 300;
/// Most trial steps of a search on the other side: so many, or so many times those of the search before.
const LEAST_TRIALS: u64 = 100;
const PATIENCE: u64 = 3;

/// The most trial steps of each further search, at least one, and whether the user's limit makes them fewer.
#[derive(Clone, Copy)]
pub(super) struct Trials {
    pub most: u64,
    pub short: bool,
}

impl Trials {
    /// So many of those that a search left of the user's limit; `None` where it left none.
    fn of(wanted: u64, iterations: u64, limit: u64) -> Option<Self> {
        let most = wanted.min(limit.saturating_sub(iterations));
        (most > 0).then_some(Trials { most, short: most < wanted })
    }
}

impl Problem<'_> {
    /// What searches from elsewhere make of an estimate, with their time and evaluations; `None` where it needs none, and where nothing
    /// is left of the fit's limits.
    pub(super) fn searched_elsewhere(&self, found: &Summary, control: &Control) -> Option<Summary> {
        if control.stops() {
            return None;
        }
        let (begin, before, limit) = (Instant::now(), found.iterations, self.settings.optimizer.most());
        let best = match is_useless(found, WarningCode::Unexplained) {
            true => {
                let trials = Trials::of((AGAIN * before).clamp(FEWEST, MOST), before, limit)?;
                self.search_again(found, trials.most, begin, control)
            }
            false => {
                let trials = Trials::of(LEAST_TRIALS.max(PATIENCE * before), before, limit)?;
                self.on_both_sides(found, trials, begin, control)
            }
        }?;
        Some(Summary { seconds: found.seconds + begin.elapsed().as_secs_f64(), ..best })
    }

    /// The best minimum of searches from further starts, or the estimate itself if they found none; with a note. They run by the default
    /// method, and go on to finer ones only where the model explains something. `None` where a number of starts was asked for, and
    /// where the measurements tell nothing by any parameters.
    fn search_again(&self, found: &Summary, trials: u64, begin: Instant, control: &Control) -> Option<Summary> {
        let hopeless = [WarningCode::ConstantOutput, WarningCode::TooFewMeasurements];
        if self.settings.starts.is_some() || hopeless.into_iter().any(|code| is_useless(found, code)) {
            return None;
        }
        let problem = self.with_starts(STARTS);
        let start = Start { trials, ..Start::declared(&problem) };
        let mut again = problem.run_within(begin, control, start).ok()?;
        if !is_useless(&again, WarningCode::Unexplained) {
            again = problem.refined(Ok(again), 0, begin, control).ok()?;
        }
        let stopped = if control.stops() { "; limits of the fit stopped searches before their end" } else { "" };
        let text = format!(
            "the search from the declared start ended where the model explains nothing, so that the fit searched from {STARTS} starts \
             by itself, as Fit::starts does{stopped}"
        );
        let better = again.outcome.converged() || !found.outcome.converged();
        let mut best = if better { after(found, again) } else { found.clone() };
        best.warnings.push(Warning { code: WarningCode::Unexplained, severity: Severity::Usable, text });
        Some(best)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of a limit of 100 steps a search of 60 leaves 40, one of 100 none.
    #[test]
    fn further_searches_have_what_is_left() {
        let of = |wanted: u64, iterations: u64| Trials::of(wanted, iterations, 100).map(|left| (left.most, left.short));
        assert_eq!([of(40, 60), of(41, 60), of(1, 100)], [Some((40, false)), Some((40, true)), None]);
    }
}
