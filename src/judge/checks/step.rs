//! Warnings about the step of the method.

use crate::estimate::{Unknown, Warning, WarningCode};
use crate::judge::check::{Check, Level, Pass};
use crate::judge::checks::step_accumulation::windows_add_up;
use crate::judge::checks::step_shift::{Shift, shift};
use crate::judge::directions::{taking_part, undetermined};
use crate::judge::evidence::Evidence;
use crate::numeral::{number, percent};
use crate::optimize::{Outcome, Severity};

pub(crate) const STEP: Check = Check {
    name: "a finer step changes nothing",
    asks: "Where some windows change with a finer step: by how many standard errors would an unknown move, or what the data determine of several together, or is there no minimum with it?",
    codes: &[WarningCode::CoarseStep, WarningCode::NotAtMinimum],
    costs: &[Pass::Finer],
    levels: &[
        Level {
            of: "standard errors, with a method that was chosen",
            value: STEP_SHIFT,
            source: "half of one: intervals of 95 % then cover 92 %",
        },
        Level {
            of: "standard errors, with one of the library's choice",
            value: REFINED_SHIFT,
            source: "a tenth: nothing is lost",
        },
        Level {
            of: "the part of a value that moves, where the data are reproduced",
            value: DIGITS,
            source: "a millionth",
        },
    ],
    examine: |evidence, intervals| step(evidence, &intervals.unknowns).into(),
};

/// Largest change of a parameter with a finer step, in standard errors, without a warning: with a method that was chosen, and
/// with one of the library's choice (beyond the former it makes the estimate unusable).
const STEP_SHIFT: f64 = 0.5;
const REFINED_SHIFT: f64 = 0.1;
/// Smallest part of an unknown's value that a finer step must move it by for a warning about data that are reproduced, and about a
/// step that is too coarse to be used: of values that are right to more digits only the intervals are wrong.
const DIGITS: f64 = 1e-6;
/// The same from which on a fit without errors is not usable without care.
const MUCH: f64 = 1e-3;
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
        coarse.then(|| evidence.point.objective.sweep.refined(evidence.point.objective.problem.samples())).flatten();
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
        Warning { code: WarningCode::CoarseStep, severity, text }
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
    let texts = [
        (
            WarningCode::CoarseStep,
            format!(
                "the step is too coarse: with {finer} the simulation at the estimate {by}; use a finer step, or smooth the model"
            ),
        ),
        (WarningCode::NotAtMinimum, "the estimate is a minimum with the coarse step only".to_owned()),
    ];
    texts.map(|(code, text)| Warning { code, severity: Severity::NotUsable, text }).into()
}

/// Data that are reproduced to their rounding may have been made with this step. But a step with held inputs is exact for a linear
/// plant of other parameters, too: so what a finer one changes is said.
fn exact_with_this_step(evidence: &Evidence<'_>, unknowns: &[Unknown]) -> Option<Warning> {
    let finer = evidence.point.objective.sweep.refined(evidence.point.objective.problem.samples())?;
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
    Some(Warning { code: WarningCode::CoarseStep, severity, text })
}

/// Of a fit with null directions: whether there are fewer with a finer step. The factor by which a method multiplies a state from step
/// to step has a minimum as a function of the eigenvalue (that of Runge-Kutta 4 at -1.6 over the step): a search whose data
/// decay faster ends there, where the slope is zero.
fn determined_by_a_finer_step(evidence: &Evidence<'_>, unknowns: &[Unknown]) -> Option<Warning> {
    let directions = &evidence.point.undetermined.directions;
    if directions.is_empty() {
        return None;
    }
    let finer = evidence.point.objective.sweep.refined(evidence.point.objective.problem.samples())?;
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
    Some(Warning { code: WarningCode::CoarseStep, severity: Severity::NotUsable, text })
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
        evidence.point.objective.sweep.refined(evidence.point.objective.problem.samples())?.integrator()
    );
    Some(Warning { code: WarningCode::CoarseStep, severity: Severity::NotUsable, text })
}
