//! Fits whose integrator was not chosen: finer methods, as long as a finer step would move an unknown.

use super::stages::Led;
use crate::error::Error;
use crate::estimate::{About, Starts, Summary, Unknown, Warning, WarningCode};
use crate::numeral::{number, unit_after};
use crate::optimize::Outcome;
use crate::problem::{Control, PARTS, Problem};
use crate::severity::Severity;
use std::time::Instant;

/// A deviance that is larger by this is worth a note; by the second, a warning. If both methods had the same fixed parameters, a
/// record of the finer model would favor the coarser one by 15 in less than `exp(-15 / 2)`, one of 1,800 records; with estimated
/// parameters that is about right only.
const WORSE: f64 = 4.0;
pub(super) const CERTAINLY_WORSE: f64 = 15.0;

/// An unknown that a finer step moved by more than so many standard errors is worth a note, where the data do not tell the two
/// apart.
const MOVED: f64 = 1.0;

/// A search with a finer step that moves an unknown by fewer standard errors counts as leaving it where it is.
const UNMOVED: f64 = 0.1;

/// Minima whose deviances differ by less for each measurement, half a percent of the errors, are alike. The errors of an output that is left
/// unexplained are about as large as the output; if the step were the reason, one four times as fine would change them by far more.
const ALIKE: f64 = 0.01;

/// A search that explains the outputs may take so many times [`PARTS`]: next to a minimum it may converge slowly (107 trial steps were seen where 100 were
/// allowed), and a still finer method costs more than the steps that are left.
const EXPLAINED: u64 = 2;

/// A part of a search that lowers the deviance by less makes no progress.
const LOWERED: f64 = 1.0;

/// Where a search begins.
#[derive(Clone)]
pub(super) struct Start {
    pub coordinates: Vec<f64>,
    /// The most trial steps, if fewer than the settings allow.
    pub trials: u64,
    /// Where earlier searches from several starts ended; those of this method begin there.
    pub ends: Option<Starts>,
    /// The stages that led to it, if any.
    pub stages: Option<Led>,
}

impl Start {
    /// The declared start of a problem.
    pub fn declared(problem: &Problem<'_>) -> Self {
        Start { coordinates: problem.unknowns.start(), trials: u64::MAX, ends: None, stages: None }
    }
}

/// The answer by the finest method tried so far.
pub(super) struct Attempt {
    found: Result<Summary, Error>,
    /// The minima of coarser methods.
    coarser: Vec<Coarser>,
}

/// The minimum of a coarser method.
struct Coarser {
    deviance: f64,
    integrator: String,
    values: Vec<f64>,
}

/// The unknown that is farthest from one of these values: its number, and how many standard errors.
pub(super) fn farthest(found: &Summary, values: impl Iterator<Item = f64>) -> Option<(usize, f64)> {
    let errors = |(i, (unknown, value)): (usize, (&Unknown, f64))| {
        let error = unknown.knowledge.standard_error()?;
        Some((i, (unknown.value - value).abs() / error))
    };
    found.unknowns.iter().zip(values).enumerate().filter_map(errors).max_by(|a, b| a.1.total_cmp(&b.1))
}

impl Attempt {
    pub fn new(found: Result<Summary, Error>) -> Self {
        Attempt { found, coarser: vec![] }
    }

    /// Whether a finer method is to be tried: a finer step would move an unknown, or the start cannot be simulated, or one of several.
    pub fn is_coarse(&self) -> bool {
        match &self.found {
            // An output that is constant determines no parameter by any method.
            Ok(found) => {
                (is_coarse(found) || has_lost_starts(found))
                    && found.outcome != Outcome::Exact
                    && !is_useless(found, WarningCode::ConstantOutput)
            }
            Err(error) => matches!(error, Error::Start(_)),
        }
    }

    /// Where the search by a finer method begins: at the end of this one if only the step is wrong with it, else at the declared start. `None` if no
    /// trial step is left of so many for all methods, if the method is adaptive, the slowest, and no step seems to be the reason, or if the finer
    /// step, too, would decide the cost at the start.
    pub fn start(&self, finer: &Problem<'_>, most: u64, control: &Control) -> Option<Start> {
        let trials = most.saturating_sub(self.found.as_ref().map_or(0, |found| found.iterations));
        if trials == 0 || finer.sweep.is_adaptive() && self.is_unexplained_by_any_step() {
            return None;
        }
        match &self.found {
            Ok(found) if is_only_coarse(found) || lacks_starts_only(found) => {
                let within = |(x, (lower, upper)): (f64, (f64, f64))| x.max(lower).min(upper);
                let coordinates = found.coordinates().into_iter().zip(finer.unknowns.bounds()).map(within).collect();
                Some(Start { coordinates, trials, ends: found.starts.clone(), stages: None })
            }
            _ => declared_start(finer, trials, control),
        }
    }

    /// Whether an output is left unexplained at minima alike by this step and by the next coarser one.
    fn is_unexplained_by_any_step(&self) -> bool {
        let Ok(found) = &self.found else { return false };
        let deviances = found.deviance.zip(self.coarser.last().map(|coarser| coarser.deviance));
        let alike = |(this, coarser): (f64, f64)| (this - coarser).abs() < ALIKE * found.measurements as f64;
        found.outcome.converged() && is_useless(found, WarningCode::Unexplained) && deviances.is_some_and(alike)
    }

    /// The result `again` of a finer method's search from [`start`](Self::start). If that search began at the end of this one and did not
    /// converge, the result of another from the declared start, if it converges: at the end of a coarse method the plant may be
    /// unstable with a finer step. `most` limits the trial steps of all methods together.
    pub fn again_from_start(
        &self,
        finer: &Problem<'_>,
        (again, most): (Result<Summary, Error>, u64),
        begin: Instant,
        control: &Control,
    ) -> Result<Summary, Error> {
        let from_end = matches!(&self.found, Ok(found) if is_only_coarse(found) && found.starts.is_none());
        let (Ok(found), Ok(before), true) = (&again, &self.found, from_end) else { return again };
        let trials = most.saturating_sub(before.iterations + found.iterations);
        if found.outcome.converged() || trials == 0 || control.stops() {
            return again;
        }
        let Some(start) = declared_start(finer, trials, control) else { return again };
        match finer.run_on(finer.run_within(begin, control, start), trials, begin, control) {
            Ok(other) if other.outcome.converged() => Ok(after(found, other)),
            _ => again,
        }
    }

    /// The answer of a finer method if it converged, else this one. A finer step is closer to the model's equations, so that it
    /// is preferred also where a coarser one has a smaller deviance. But the tolerance of an adaptive one may be coarser than the steps
    /// before it, those of the next coarser method: if it is too coarse, too, it has to make usable what was not.
    pub fn or(self, again: Result<Summary, Error>, adaptive: bool) -> Self {
        let no_finer = |before: &Summary, again: &Summary| {
            let next = again.method.refinement == before.method.refinement + 1;
            let good = before.outcome.converged() && !is_useless(before, WarningCode::CoarseStep);
            adaptive && next && good && is_coarse(again)
        };
        let (before, again) = match (self.found, again) {
            (Err(_), again @ Ok(_)) => return Attempt { found: again, coarser: self.coarser },
            (Ok(before), Ok(again)) if no_finer(&before, &again) => {
                return Attempt { found: Ok(with_work_of(before, &again)), coarser: self.coarser };
            }
            // What was tried are the starts that this method could not simulate.
            (Ok(before), Ok(again)) if lacks_starts_only(&before) && !is_lower(&again, &before) => {
                return Attempt { found: Ok(with_starts_of(before, again)), coarser: self.coarser };
            }
            (Ok(before), Ok(again)) if again.outcome.converged() || !before.outcome.converged() => (before, again),
            // A coarse minimum that explains nothing is none of the equations.
            (Ok(before), Ok(again)) if explains_more(&again, &before) => (before, again),
            (before, _) => return Attempt { found: before, coarser: self.coarser },
        };
        let again = if moves_nothing(&before, &again) { without_step(again) } else { again };
        Attempt { found: Ok(after(&before, again)), coarser: self.coarser }.beside(&before)
    }

    /// This answer beside an estimate by a coarser method, if that is a minimum.
    pub fn beside(mut self, before: &Summary) -> Self {
        if let Some(deviance) = before.deviance.filter(|_| before.outcome.converged()) {
            let values = before.unknowns.iter().map(|unknown| unknown.value).collect();
            self.coarser.push(Coarser { deviance, integrator: before.method.integrator.clone(), values });
        }
        self
    }

    /// The answer, with a note where a coarser step explains the data better, or as well with other values.
    pub fn answer(self) -> Result<Summary, Error> {
        let Attempt { found, coarser } = self;
        let mut found = found?;
        let warning = found.deviance.and_then(|deviance| {
            let least = coarser.iter().min_by(|a, b| a.deviance.total_cmp(&b.deviance))?;
            let better = deviance - least.deviance;
            if better > WORSE {
                Some(explains_better(least, better, &found))
            } else {
                explains_as_well(&coarser, deviance, &found)
            }
        });
        found.warnings.extend(warning);
        Ok(found)
    }
}

/// Whether a search with a finer step has left all unknowns where those of the coarser one were, by its standard errors.
fn moves_nothing(before: &Summary, again: &Summary) -> bool {
    let converged = [before, again].iter().all(|found| found.outcome.converged());
    let known = again.unknowns.iter().all(|unknown| unknown.knowledge.standard_error().is_some());
    let values = before.unknowns.iter().map(|unknown| unknown.value);
    converged && known && farthest(again, values).is_some_and(|(_, errors)| errors <= UNMOVED)
}

/// An estimate without the warnings about still finer steps, whose moves are found by one step along the slopes: that is too long where the trajectory
/// depends strongly on the unknowns. The warnings stay where the simulation with a finer step fails.
fn without_step(found: Summary) -> Summary {
    let fails = found.warnings.iter().any(|warning| warning.code == WarningCode::NotAtMinimum);
    let kept = |warning: &Warning| fails || warning.about != About::Step;
    Summary { warnings: found.warnings.into_iter().filter(kept).collect(), ..found }
}

/// The start of the problem, with so many trial steps; `None` where the step of its method decides the cost.
fn declared_start(finer: &Problem<'_>, trials: u64, control: &Control) -> Option<Start> {
    let start = finer.unknowns.start();
    let steps = finer.in_units(control);
    let fine = finer.sweep.is_adaptive() || !steps.step_decides(&start).unwrap_or(true);
    fine.then_some(Start { coordinates: start, trials, ends: None, stages: None })
}

/// The warning where the data do not distinguish the estimate from that of a coarser step.
fn explains_as_well(coarser: &[Coarser], deviance: f64, found: &Summary) -> Option<Warning> {
    let close = coarser.iter().filter(|coarser| coarser.deviance - deviance < WORSE);
    let moved = close.filter_map(|coarser| Some((coarser, farthest(found, coarser.values.iter().copied())?)));
    let (coarser, (i, errors)) = moved.max_by(|a, b| a.1.1.total_cmp(&b.1.1)).filter(|(_, (_, e))| *e > MOVED)?;
    let text = format!(
        "the step decides `{}`, and the data do not tell which one is right: {} gives {}{}, {} standard errors away, and explains \
         them as well (-2 ln of the likelihood differs by {}); the estimate is that of the finer step, which is closer to the \
         equations; for a record that was simulated, choose its step with Fit::integrator",
        found.unknowns[i].name,
        coarser.integrator,
        number(coarser.values[i], 5),
        unit_after(&found.unknowns[i].unit),
        number(errors, 2),
        number((coarser.deviance - deviance).abs(), 2)
    );
    Some(Warning::new(WarningCode::CoarseStep, Severity::Usable, text).about(About::Minimum))
}

/// The warning where a coarser step explains the data better than that of the estimate, by so much.
fn explains_better(coarser: &Coarser, better: f64, found: &Summary) -> Warning {
    let certain = better > CERTAINLY_WORSE;
    let why = if certain { "the record may have been simulated with it" } else { "which may be chance" };
    let text = format!(
        "{} explains the data better than {}, by {} in -2 ln of the likelihood ({why}); the estimate is that of the finer step, \
         which is closer to the equations; choose one with Fit::integrator",
        coarser.integrator,
        found.method.integrator,
        number(better, 2)
    );
    let severity = if certain { Severity::UsableWithCare } else { Severity::Usable };
    Warning::new(WarningCode::CoarseStep, severity, text).about(About::Minimum)
}

impl Problem<'_> {
    /// Continues a search by this finer method that ended at the limit of a part, as long as it makes progress, up to so many trial steps.
    /// Not for searches from several starts, which are not run in parts.
    pub(super) fn run_on(
        &self,
        found: Result<Summary, Error>,
        most: u64,
        begin: Instant,
        control: &Control,
    ) -> Result<Summary, Error> {
        let mut found = found?;
        let mut before = None;
        // An adaptive method takes ever more steps for a plant that explodes.
        let most_parts = if self.sweep.is_adaptive() { 1 } else { PARTS };
        for parts in 1.. {
            let trials = most.saturating_sub(found.iterations);
            let goes_on = self.settings.searches.count() == 1 && may_go_on(&found, before, (parts, most_parts));
            if trials == 0 || !goes_on || control.stops() {
                break;
            }
            before = found.deviance;
            let start = Start { coordinates: found.coordinates(), trials, ends: None, stages: None };
            found = after(&found, self.run_within(begin, control, start)?);
            if let Outcome::OwnLimit { iterations, .. } = &mut found.outcome {
                *iterations = found.iterations;
            }
        }
        Ok(found)
    }
}

/// Whether a search that did not end at a minimum explains the data better than a coarse minimum that leaves an output unexplained.
fn explains_more(again: &Summary, before: &Summary) -> bool {
    let lower = again.deviance.zip(before.deviance).is_some_and(|(again, before)| again < before);
    is_useless(before, WarningCode::Unexplained) && (lower || !is_useless(again, WarningCode::Unexplained))
}

/// Whether nothing but the step makes an estimate not usable.
pub(super) fn is_only_coarse(found: &Summary) -> bool {
    let wrong = |warning: &Warning| warning.severity == Severity::NotUsable && warning.about != About::Step;
    found.outcome.converged() && !found.warnings.iter().any(wrong)
}

/// Whether a search that ended at a limit of trial steps goes on after so many parts: up to some, and further while each lowers the deviance,
/// which before the last one was this. Where an output is left unexplained, while each lowers it, and no further than `most` parts.
fn may_go_on(found: &Summary, before: Option<f64>, (parts, most): (u64, u64)) -> bool {
    let limited = matches!(found.outcome, Outcome::IterationLimit { .. } | Outcome::OwnLimit { .. });
    let lowers = found.deviance.is_some_and(|now| before.is_none_or(|before| now < before - LOWERED));
    limited
        && match is_useless(found, WarningCode::Unexplained) {
            true => lowers && parts < most,
            false => lowers || parts < EXPLAINED * PARTS,
        }
}

/// Whether a finer step would move an unknown.
fn is_coarse(found: &Summary) -> bool {
    found.warnings.iter().any(|warning| warning.about == About::Step)
}

/// Whether one of several starts could not be simulated.
fn has_lost_starts(found: &Summary) -> bool {
    found.starts.iter().flat_map(|starts| &starts.failed).any(|failed| !failed.evaluated)
}

/// Whether that is all for which a finer method is to be tried.
fn lacks_starts_only(found: &Summary) -> bool {
    has_lost_starts(found) && !is_coarse(found)
}

/// Whether a later estimate is a minimum that explains the data better, by more than the step may decide.
fn is_lower(again: &Summary, before: &Summary) -> bool {
    let lower = again.deviance.zip(before.deviance).is_some_and(|(again, before)| again < before - WORSE);
    again.outcome.converged() && (lower || !before.outcome.converged())
}

/// An estimate with the work of later searches from its minima and other starts, and what they found.
fn with_starts_of(found: Summary, again: Summary) -> Summary {
    let about_starts = |warning: &Warning| warning.about == About::Minimum;
    let mut found = with_work_of(found, &again);
    found.warnings.retain(|warning| !about_starts(warning));
    found.warnings.extend(again.warnings.into_iter().filter(about_starts));
    Summary { starts: again.starts, ..found }
}

/// An estimate with the work of a later search that found no better one.
pub(super) fn with_work_of(found: Summary, again: &Summary) -> Summary {
    Summary {
        iterations: found.iterations + again.iterations,
        evaluations: found.evaluations + again.evaluations,
        seconds: found.seconds.max(again.seconds),
        ..found
    }
}

/// Whether an estimate is not usable for this reason.
pub(super) fn is_useless(found: &Summary, code: WarningCode) -> bool {
    found.warnings.iter().any(|warning| warning.code == code && warning.severity == Severity::NotUsable)
}

/// The estimate of a later search, with the work of both.
pub(super) fn after(before: &Summary, again: Summary) -> Summary {
    Summary {
        iterations: before.iterations + again.iterations,
        evaluations: before.evaluations + again.evaluations,
        ..again
    }
}

#[cfg(test)]
pub(super) mod tests;
