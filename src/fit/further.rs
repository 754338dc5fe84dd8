//! [`Further`]: what the searches found that a fit makes by itself after its first.

use super::stages::Led;
use crate::estimate::{About, Summary, Warning, WarningCode};
use crate::numeral::counted;
use crate::severity::Severity;
use std::time::Duration;

/// Starts of a fit whose first search left an output unexplained, the declared one among them: of 138 records of predators
/// and prey 16 starts led 118 to the right minimum, 24 led 133, 32 led 136.
pub(super) const STARTS: usize = 32;
/// Deviances that differ by less belong to one minimum: a move by a tenth of a standard error changes the deviance by 0.1^2.
pub(super) const SAME: f64 = 0.01;

/// Why an estimate is followed by further searches.
#[derive(Clone, Copy)]
pub(super) enum Reason {
    /// It is not usable and leaves an output unexplained.
    Unexplained,
    /// Its search ended at no minimum, by itself, and its errors are colored.
    Stuck,
}

impl Reason {
    fn text(self) -> &'static str {
        match self {
            Reason::Unexplained => "the search ended where an output is left unexplained",
            Reason::Stuck => "the search ended at no minimum, with colored errors",
        }
    }
}

/// What further searches found.
pub(super) enum Further {
    Found {
        reason: Reason,
        best: Box<Summary>,
        way: Way,
        /// Whether limits of the fit stopped searches before their end.
        stopped: bool,
        time: Duration,
    },
    /// Records are longer than so many samples, with which searches from further starts would take too long, and stages lead nowhere.
    TooLong(Reason, usize),
}

/// Where further searches began.
pub(super) enum Way {
    Starts,
    /// At the end of stages.
    Stages(Led),
}

impl Way {
    /// Whether stages led to an estimate that explains all outputs. It is taken also where its search has not converged, as is common on the
    /// rough cost of a chaotic plant.
    fn explains(&self, best: &Summary) -> bool {
        matches!(self, Way::Stages(_)) && !leaves_unexplained(best)
    }
}

impl Further {
    /// The best minimum, if it is usable, in place of the estimate before it.
    pub fn usable(&self, before: &Summary) -> Option<Summary> {
        match self {
            Further::Found { best, .. } => (best.severity() < Severity::NotUsable).then(|| self.or(before)),
            Further::TooLong(..) => None,
        }
    }

    /// What led to where the searches began, if stages did.
    pub fn led(&self) -> Option<&Led> {
        match self {
            Further::Found { way: Way::Stages(led), .. } => Some(led),
            _ => None,
        }
    }

    /// The better one of the best minimum and an estimate that has the work of these searches, with a note.
    pub fn or(&self, found: &Summary) -> Summary {
        let (mut best, text) = match self {
            Further::Found { reason, best, way, stopped, .. } => {
                let began = match way {
                    Way::Starts => format!("from {STARTS} starts by itself, and went on from the best of them"),
                    Way::Stages(led) => format!("by itself from the end of {}", led.path()),
                };
                let stopped = if *stopped { "; limits of the fit stopped searches before their end" } else { "" };
                let explains = matches!(reason, Reason::Unexplained) && way.explains(best);
                let better =
                    if explains || is_better(best, found) { work_of(found, (**best).clone()) } else { found.clone() };
                (better, format!("{}, so that the fit searched {began}{stopped}", reason.text()))
            }
            Further::TooLong(reason, most) => (
                found.clone(),
                format!(
                    "{}; with more than {} the fit does not search from further starts by itself, so ask for \
                     Fit::starts({STARTS})",
                    reason.text(),
                    counted(*most as u64, "sample")
                ),
            ),
        };
        let colored = best.warnings.iter().any(|warning| warning.code == WarningCode::ColoredErrors);
        let (severity, local) = match colored {
            true => (
                Severity::UsableWithCare,
                "; the errors are colored, as those of a local minimum are: a lower one may lie elsewhere",
            ),
            false => (Severity::Usable, ""),
        };
        best.warnings.push(Warning::new(WarningCode::Unexplained, severity, text + local).about(About::Search));
        best
    }
}

/// An estimate as if it had taken the work of another.
pub(super) fn work_of(of: &Summary, found: Summary) -> Summary {
    Summary { iterations: of.iterations, evaluations: of.evaluations, seconds: of.seconds, ..found }
}

/// An estimate with the work of further searches after it.
pub(super) fn with_work_of(found: Summary, further: Option<&Further>) -> Summary {
    match further {
        Some(Further::Found { best, time, .. }) => Summary {
            iterations: found.iterations + best.iterations,
            evaluations: found.evaluations + best.evaluations,
            seconds: found.seconds + time.as_secs_f64(),
            ..found
        },
        _ => found,
    }
}

/// Whether an estimate is not usable and leaves an output unexplained. That may not be the reason by itself: where the loss is robust
/// or measurements are weighted, it is a warning only.
pub(super) fn leaves_unexplained(found: &Summary) -> bool {
    let of_an_output = |warning: &Warning| matches!(warning.about, About::Output(_));
    let unexplained = |warning: &Warning| warning.code == WarningCode::Unexplained && of_an_output(warning);
    found.severity() == Severity::NotUsable && found.warnings.iter().any(unexplained)
}

/// Whether further searches found a better estimate: one that explains all outputs, or one of no higher deviance. The first search had more
/// trial steps than most of theirs, and may have ended lower.
fn is_better(again: &Summary, found: &Summary) -> bool {
    let lower = again.deviance.zip(found.deviance).is_some_and(|(again, found)| again <= found + SAME);
    let converged = again.outcome.converged() || !found.outcome.converged();
    converged && (lower || leaves_unexplained(found) && !leaves_unexplained(again))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::optimize::Outcome;
    use crate::tests::{Current, Gain, Line, Voltage};
    use crate::{Experiment, Fit, Time, free};

    /// Neither a higher minimum nor a search that has not ended takes the place of a minimum, where no output is explained.
    #[test]
    fn a_higher_minimum_is_not_better() {
        let inputs: Vec<Voltage> = (0..40).map(|k| Voltage { u: f64::from(k * 37 % 21) - 10.0 }).collect();
        let outputs = (0..40).map(|k| Current { i: f64::from(k * 11 % 17) - 8.0 }).collect();
        let record = Experiment::new(&Line, Time::Uniform { start: 0.0, step: 1.0 }, inputs, outputs).unwrap();
        let fit = Fit::new(&Line, &record).parameters(Gain { a: free(1.0) }).starts(1);
        let found = fit.run().unwrap().summary().clone();
        assert!(leaves_unexplained(&found) && found.outcome.converged(), "{found:?}");
        let of = |by: f64| Summary { deviance: found.deviance.map(|deviance| deviance + by), ..found.clone() };
        assert_eq!([-1.0, 0.0, 1.0].map(|by| is_better(&of(by), &found)), [true, true, false]);
        let unended = Summary { outcome: Outcome::IterationLimit { iterations: 9 }, ..of(-1.0) };
        assert!(!is_better(&unended, &found) && is_better(&of(-1.0), &unended));
        // A higher one that explains the output is better all the same: without its warnings it is usable.
        assert!(is_better(&Summary { warnings: vec![], ..of(1.0) }, &found));
    }

    /// What further searches found is with care where its errors are colored, and as usable as it was where they are not.
    #[test]
    fn colored_errors_after_further_searches_are_with_care() {
        let inputs: Vec<Voltage> = (0..40).map(|k| Voltage { u: f64::from(k * 37 % 21) - 10.0 }).collect();
        let noise = |k: usize| f64::from(k as u32 * 11 % 17) / 17.0 - 0.5;
        let outputs = inputs.iter().enumerate().map(|(k, u)| Current { i: 2.0 * u.u + noise(k) }).collect();
        let record = Experiment::new(&Line, Time::Uniform { start: 0.0, step: 1.0 }, inputs, outputs).unwrap();
        let found = Fit::new(&Line, &record).parameters(Gain { a: free(1.0) }).run().unwrap().summary().clone();
        let colored = Warning::new(WarningCode::ColoredErrors, Severity::Usable, String::new()).about(About::Output(0));
        let severity = |warnings: Vec<Warning>| {
            let best = Box::new(Summary { warnings, ..found.clone() });
            let further = Further::Found {
                reason: Reason::Unexplained,
                best,
                way: Way::Starts,
                stopped: false,
                time: Duration::ZERO,
            };
            further.or(&found).severity()
        };
        assert_eq!([severity(vec![]), severity(vec![colored])], [Severity::Usable, Severity::UsableWithCare]);
    }
}
