//! Warnings about the step of the method.
//!
//! The step is compared with a finer one in windows that begin where the coarse simulation stands. The difference at the end of a window
//! persists in the next ones until the state has decayed: the phase errors of a resonator of high quality add up over the whole record.

use super::*;
use crate::covariance::directions::{taking_part, undetermined};
use crate::optimize::{Linearization, Outcome};
use crate::record::{Record, Time};
use crate::residuals::modes::{StateAt, decays, some};

pub(crate) const STEP: Check = Check::new(
    "a finer step changes nothing",
    "Where some windows change with a finer step: by how many standard errors would an unknown move, or what the \
     data determine of several together, or is there no minimum with it?",
    &[WarningCode::CoarseStep, WarningCode::NotAtMinimum],
    |evidence, intervals| step(evidence, &intervals.unknowns).into(),
)
.costs(&[Pass::Finer])
.levels(&[
    level(
        "standard errors, with a method that was chosen",
        STEP_SHIFT,
        "half of one: intervals of 95 % then cover 92 %",
    ),
    level("standard errors, with one of the library's choice", REFINED_SHIFT, "a tenth: nothing is lost"),
    level("the part of a value that moves, where the data are reproduced", DIGITS, "a millionth"),
]);

/// Largest change of a parameter with a finer step, in standard errors, without a warning: with a method that was chosen, and
/// with one of the library's choice (beyond the former it makes the estimate unusable).
const STEP_SHIFT: f64 = 0.5;
const REFINED_SHIFT: f64 = 0.1;
/// Smallest part of an unknown's value that a finer step must move it by for a warning about data that are reproduced, and about a
/// step that is too coarse to be used: of values that are right to more digits only the intervals are wrong.
const DIGITS: f64 = 1e-6;
/// The part from which on a fit without errors is not usable without care.
const MUCH: f64 = 1e-3;
/// Samples of the shortest windows that are compared.
const WINDOW: f64 = 64.0;

/// Whether a finer step would move an unknown. The bound first, which costs little; the shift itself only where the
/// bound is not enough.
fn step(evidence: &Evidence<'_>, unknowns: &[Unknown]) -> Vec<Warning> {
    // The noise, where the errors were not divided by it.
    let refines = evidence.point.objective.problem.refines;
    let most = if refines { REFINED_SHIFT } else { STEP_SHIFT };
    if evidence.point.is_exact() {
        return refines.then(|| exact_with_this_step(evidence, unknowns)).flatten().into_iter().collect();
    }
    let stopped = matches!(evidence.point.end.outcome, Outcome::TimeLimit | Outcome::Cancelled);
    let change = evidence.residuals.step_error / evidence.point.widening;
    // No more windows than samples.
    let windows = evidence.point.objective.problem.samples() as f64;
    let coarse = change > most || change * windows > most && change * windows_add_up(evidence) > most;
    let fewer = (refines && !stopped && coarse).then(|| determined_by_a_finer_step(evidence, unknowns)).flatten();
    if let Some(fewer) = fewer {
        return vec![fewer];
    }
    if refines && !stopped && !evidence.point.end.outcome.converged() {
        return step_decides_the_search(evidence).into_iter().collect();
    }
    let finer =
        coarse.then(|| evidence.point.objective.sweep.refined(evidence.point.objective.problem.all_steps())).flatten();
    let Some(finer) = finer else { return vec![] };
    let objective = evidence.point.objective.of(evidence.point.objective.problem, &*finer);
    let Some(Shift { of, errors, part }) = shift(evidence, &objective, unknowns) else {
        return diverges(evidence, change, &finer.integrator());
    };
    let finer = finer.integrator();
    let wrong = refines && errors > STEP_SHIFT && part >= DIGITS;
    let severity = if wrong { Severity::NotUsable } else { Severity::UsableWithCare };
    let warning = || {
        let (part, errors) = (percent(part, 2), number(errors, 2));
        let tried = if refines { "no method that was tried steps finely enough" } else { "the step is too coarse" };
        let text = format!(
            "{tried}: with {finer} {of} would move by {part} of itself ({errors} standard errors); use a finer step, \
             or smooth the model"
        );
        Warning::new(WarningCode::CoarseStep, severity, text).about(About::Step)
    };
    if errors > most { vec![warning()] } else { vec![] }
}

/// Warnings where the simulation with a finer step fails at the estimate, or grows until its slopes determine no step: a coarse step damps
/// oscillations by itself, so that parameters of an unstable plant may fit. These are no minimum with the finer step.
fn diverges(evidence: &Evidence<'_>, change: f64, finer: &str) -> Vec<Warning> {
    if evidence.point.undetermined.held.iter().all(|held| *held) {
        return vec![];
    }
    let by = match change.is_finite() {
        true => format!("changes by {} standard deviations", number(change, 2)),
        false => "fails".to_owned(),
    };
    let text = format!(
        "the step is too coarse: with {finer} the simulation at the estimate {by}; use a finer step, or smooth the model"
    );
    let minimum = "the estimate is a minimum with the coarse step only".to_owned();
    vec![
        not_usable(WarningCode::CoarseStep, text).about(About::Step),
        not_usable(WarningCode::NotAtMinimum, minimum).about(About::Search),
    ]
}

/// Data that are reproduced to their rounding may have been made with this step. But a step with held inputs is exact for a linear
/// plant of other parameters, too: so what a finer one changes is said.
fn exact_with_this_step(evidence: &Evidence<'_>, unknowns: &[Unknown]) -> Option<Warning> {
    let finer = evidence.point.objective.sweep.refined(evidence.point.objective.problem.all_steps())?;
    let objective = evidence.point.objective.of(evidence.point.objective.problem, &*finer);
    let Shift { of, part, .. } = shift(evidence, &objective, unknowns).filter(|shift| shift.part >= DIGITS)?;
    let text = format!(
        "the data are reproduced to their rounding by {}; {} would change {of} by {} of itself: right for a record that was \
         simulated with this step, else choose a finer one (Fit::integrator)",
        evidence.point.objective.sweep.integrator(),
        finer.integrator(),
        percent(part, 2)
    );
    let severity = if part >= MUCH { Severity::UsableWithCare } else { Severity::Usable };
    Some(Warning::new(WarningCode::CoarseStep, severity, text).about(About::Step))
}

/// Of a fit with null directions: whether there are fewer with a finer step. The factor by which a method multiplies a state from step
/// to step has a minimum as a function of the eigenvalue (that of Runge-Kutta 4 at -1.6 over the step): a search whose data
/// decay faster ends there, where the slope is zero.
fn determined_by_a_finer_step(evidence: &Evidence<'_>, unknowns: &[Unknown]) -> Option<Warning> {
    let directions = &evidence.point.undetermined.directions;
    if directions.is_empty() {
        return None;
    }
    let finer = evidence.point.objective.sweep.refined(evidence.point.objective.problem.all_steps())?;
    let linear = evidence
        .point
        .objective
        .of(evidence.point.objective.problem, &*finer)
        .evaluate(&evidence.point.end.coordinates)
        .ok()?;
    let held: Vec<bool> = evidence.point.held_at.iter().map(Option::is_some).collect();
    if undetermined(&linear, &held).directions.len() >= directions.len() {
        return None;
    }
    let part = |i: usize| directions.iter().any(|direction| taking_part(direction).any(|(j, _)| i == j));
    let names = unknowns.iter().enumerate().filter(|(i, _)| part(*i)).map(|(_, unknown)| format!("`{}`", unknown.name));
    let text = format!(
        "the step is too coarse: with {} the data determine more of {}; use a finer step, or smooth the model",
        finer.integrator(),
        names.collect::<Vec<_>>().join(", ")
    );
    Some(not_usable(WarningCode::CoarseStep, text).about(About::Step))
}

/// Of a search that ended without a minimum: whether a finer step changes the cost at its start or at its end, so that the
/// search may have failed by the step.
fn step_decides_the_search(evidence: &Evidence<'_>) -> Option<Warning> {
    let start = evidence.point.objective.problem.unknowns.start();
    let decides = |x: &[f64]| evidence.point.objective.step_decides(x) == Some(true);
    let place = if decides(&start) {
        "start"
    } else if decides(&evidence.point.end.coordinates) {
        "end"
    } else {
        return None;
    };
    let text = format!(
        "the step may have kept the search from a minimum: with {} the cost at its {place} is another; use a finer step, or \
         smooth the model",
        evidence.point.objective.sweep.refined(evidence.point.objective.problem.all_steps())?.integrator()
    );
    Some(not_usable(WarningCode::CoarseStep, text).about(About::Step))
}

/// A move towards the minimum of another objective.
pub(super) struct Shift {
    /// What moves, for a sentence.
    pub of: String,
    /// By how many standard errors.
    pub errors: f64,
    /// By which part of itself.
    pub part: f64,
}

/// The largest move of an unknown, or of what the data determine of several unknowns together.
pub(super) fn shift(evidence: &Evidence<'_>, objective: &Objective<'_>, unknowns: &[Unknown]) -> Option<Shift> {
    let linear = objective.evaluate(&evidence.point.end.coordinates).ok()?;
    let one = of_one(Some(evidence.point.linear), &linear, unknowns, |_| true);
    let found = [one, of_several(evidence, &linear, unknowns)];
    found.into_iter().flatten().max_by(|a, b| a.errors.total_cmp(&b.errors))
}

/// The largest move of an unknown that is known by itself, of those that count. The step that the estimate's own slopes ask for is subtracted: at a
/// kink of the cost it is not zero.
pub(super) fn of_one(
    from: Option<&Linearization>,
    to: &Linearization,
    unknowns: &[Unknown],
    counts: impl Fn(&Unknown) -> bool,
) -> Option<Shift> {
    let held: Vec<bool> = unknowns.iter().map(|row| row.knowledge.standard_error().is_none()).collect();
    let step = |linear: &Linearization| linear.step(&vec![0.0; unknowns.len()], &held);
    let here = from.and_then(step).unwrap_or(vec![0.0; unknowns.len()]);
    let step: Vec<f64> = step(to)?.iter().zip(here).map(|(to, here)| to - here).collect();
    let of = |i: usize| {
        let (unknown, change) = (&unknowns[i], change(&step, unknowns, i));
        let errors = change / unknown.knowledge.standard_error()?;
        Some(Shift { of: format!("`{}`", unknown.name), errors, part: change / unknown.value.abs() })
    };
    let counted = (0..unknowns.len()).filter(|i| counts(&unknowns[*i]));
    counted.filter_map(of).max_by(|a, b| a.errors.total_cmp(&b.errors))
}

/// The move of unknowns that the data determine only together, such as the product of a scale and a rate.
fn of_several(evidence: &Evidence<'_>, linear: &Linearization, unknowns: &[Unknown]) -> Option<Shift> {
    let directions = evidence.point.undetermined.directions.iter();
    let several = directions.map(|direction| taking_part(direction).map(|(i, _)| i).collect::<Vec<_>>());
    let mut together: Vec<usize> = several.filter(|all| all.len() > 1).flatten().collect();
    together.sort_unstable();
    together.dedup();
    if together.is_empty() {
        return None;
    }
    let at_bounds: Vec<bool> = evidence.point.held_at.iter().map(Option::is_some).collect();
    let held = undetermined(linear, &at_bounds).held;
    let step = linear.step(&vec![0.0; unknowns.len()], &held)?;
    // The norm of the change of all predictions: no combination of unknowns changes by more of its standard errors.
    let errors = (2.0 * linear.predicted_reduction(&step)).max(0.0).sqrt() / evidence.point.widening;
    let parts = together.iter().map(|&i| change(&step, unknowns, i) / unknowns[i].value.abs());
    let part = parts.filter(|part| part.is_finite()).fold(0.0, f64::max);
    let names: Vec<String> = together.iter().map(|&i| format!("`{}`", unknowns[i].name)).collect();
    Some(Shift { of: format!("what the data determine of {}", names.join(", ")), errors, part })
}

/// The change of an unknown by a step of all coordinates.
fn change(step: &[f64], unknowns: &[Unknown], i: usize) -> f64 {
    (step[i] * unknowns[i].transform.slope(unknowns[i].value)).abs()
}

/// An upper bound of the ratio of the whole record's differences to those within windows, from the slowest decay of the state at some
/// points along the records. One for predictions that restart.
fn windows_add_up(evidence: &Evidence<'_>) -> f64 {
    let objective = evidence.point.objective;
    if objective.sweep.restarts().is_some() {
        return 1.0;
    }
    let of = |point: &StateAt| {
        let record = &objective.problem.records[point.experiment];
        decays(objective, &evidence.point.end.coordinates, point, interval(record))
    };
    let slowest = some(&evidence.residuals.points).filter_map(of).flatten().reduce(f64::max);
    let Some(decay) = slowest else { return 1.0 };
    let records = objective.problem.records.iter();
    records.map(|record| sum(decay * WINDOW * interval(record), record.len() as f64 / WINDOW)).fold(1.0, f64::max)
}

/// The sum of a geometric series with so many terms, one per window; `exponent` is the logarithm of the decay over a window.
fn sum(exponent: f64, windows: f64) -> f64 {
    if exponent >= 0.0 {
        return windows.max(1.0);
    }
    (exponent * windows).exp_m1() / exponent.exp_m1()
}

/// The mean time between samples (s).
fn interval(record: &Record) -> f64 {
    match record.times() {
        Time::Uniform { step, .. } => *step,
        Time::Stamps(stamps) => match stamps.as_slice() {
            [first, .., last] => (last - first) / (stamps.len() - 1) as f64,
            _ => 0.0,
        },
    }
}

#[cfg(test)]
mod tests {
    use super::{of_one, sum};
    use crate::estimate::Knowledge;
    use crate::tests::{Current, Gain, Line, Voltage};
    use crate::{Experiment, Fit, Time, free};

    /// At a gain of two, where a record has three: the whole way in the gain itself; in its logarithm half of it by the slope,
    /// which is one of the gain. Errors of 0.5.
    #[test]
    fn an_unknown_moves_in_its_own_unit() {
        let time = Time::Uniform { start: 0.0, step: 1.0 };
        let record = Experiment::new(&Line, time, vec![Voltage { u: 1.0 }; 4], vec![Current { i: 3.0 }; 4]).unwrap();
        for (a, coordinate) in [(free(2.0), 2.0), (free(2.0).log(), 2f64.ln())] {
            let fit = Fit::new(&Line, &record).parameters(Gain { a }).noise(Current { i: 1.0 });
            let problem = fit.problem().unwrap();
            let mut unknowns = problem.estimate(&[coordinate]).unwrap().unknowns;
            unknowns[0].knowledge = Knowledge::Known { standard_error: 0.5, lower: 1.0, upper: 3.0 };
            let linear = problem.objective().unwrap().evaluate(&[coordinate]).unwrap();
            let found = of_one(None, &linear, &unknowns, |_| true).unwrap();
            assert!(
                (found.errors - 2.0).abs() < 1e-12 && (found.part - 0.5).abs() < 1e-12,
                "{} {}",
                found.errors,
                found.part
            );
        }
    }

    /// Ten windows without decay, ten with a decay by half each, and infinitely many with a decay to a third each.
    #[test]
    fn changes_of_windows_by_hand() {
        assert_eq!([sum(0.0, 10.0), sum(0.1, 10.0), sum(0.0, 0.5)], [10.0, 10.0, 1.0]);
        let halves: f64 = (0..10).map(|k| 0.5f64.powi(k)).sum();
        assert!((sum(-std::f64::consts::LN_2, 10.0) - halves).abs() < 1e-14);
        assert!((sum(-3f64.ln(), 1e6) - 1.5).abs() < 1e-14);
    }
}
