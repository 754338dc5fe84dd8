//! Warnings about the data and the method of an estimate.

use super::{
    aliases, color, conditions, correlated_outputs, curved, data, data_noise, explained, few, growing_errors, known,
    not_examined, outliers, parts, sensors, shape, starts, step_accumulation, uneven_errors, within_loss,
};
use crate::estimate::{Direction, Knowledge, Unknown, Warning, WarningCode};
use crate::judge::covariances::Covariances;
use crate::judge::directions::{taking_part, undetermined};
use crate::judge::evidence::Evidence;
use crate::layout::Kind;
use crate::numeral::{counted, exact, number, percent};
use crate::optimize::{Outcome, Severity};
use crate::parameter::Transform;
use crate::problem::{Free, Objective, Role, SearchPlan};

/// Largest change of a parameter with a finer step, in standard errors, without a warning: with a method that was chosen, and
/// with one of the library's choice (beyond the former it makes the estimate unusable).
const STEP_SHIFT: f64 = 0.5;
const REFINED_SHIFT: f64 = 0.1;
/// A predicted standard deviation below this fraction of the errors counts as zero.
const ZERO_DEVIATION: f64 = 1e-6;
/// Smallest part of an unknown's value that a finer step must move it by for a warning about data that are reproduced, and about a
/// step that is too coarse to be used: of values that are right to more digits only the intervals are wrong.
const DIGITS: f64 = 1e-6;
/// The same from which on a fit without errors is not usable without care.
const MUCH: f64 = 1e-3;
/// Guessed initial states that are named; more are counted.
const NAMED: usize = 4;

pub(crate) fn care(code: WarningCode, text: String) -> Warning {
    Warning { code, severity: Severity::UsableWithCare, text }
}

/// All warnings, in the order in which they are shown.
pub(crate) fn warnings(
    evidence: &Evidence<'_>,
    unknowns: &[Unknown],
    directions: &[Direction],
    covariances: &Covariances,
) -> Vec<Warning> {
    let early = evidence.point.objective.control.stops();
    let mut warnings = vec![];
    warnings.extend(of_the_data(evidence, unknowns));
    warnings.extend(data::data(evidence));
    warnings.extend(explained::unexplained(evidence));
    warnings.extend(explained::given_noise(evidence, covariances.method));
    warnings.extend(shape::shape(evidence));
    warnings.extend(outliers::outliers(evidence));
    warnings.extend(parts::contradictions(evidence, unknowns));
    warnings.extend(sensors::sensors(evidence, unknowns));
    warnings.extend(known::knowledge(evidence, unknowns, covariances));
    warnings.extend(unbounded(evidence));
    warnings.extend(gaps(evidence));
    warnings.extend(guessed_starts(evidence));
    for unknown in unknowns {
        if let Knowledge::Held { bound, end } = unknown.knowledge {
            let Unknown { name, unit, .. } = unknown;
            let place = match (unknown.transform, bound) {
                (Transform::Log, 0.0) => {
                    "is held where it changes nothing: its logarithm has no minimum, the cost falls towards zero"
                        .to_owned()
                }
                _ => format!("is held at its bound {} {unit}: the cost falls beyond it", exact(bound)),
            };
            let reaches = match end {
                Some(end) => {
                    format!("; its 95 % interval reaches from {} to {} {unit}", exact(bound), number(end, 3))
                }
                None => String::new(),
            };
            warnings.push(care(WarningCode::HeldAtBound, format!("`{name}` {place}{reaches}")));
        }
    }
    warnings.extend(not_positive(evidence, unknowns));
    warnings.extend(directions.iter().map(|direction| without_influence(evidence, direction, unknowns)));
    warnings.extend(step(evidence, unknowns));
    warnings.extend(aliases::aliased(evidence));
    if !evidence.point.end.outcome.converged() && unknowns.iter().any(|row| row.knowledge.standard_error().is_some()) {
        let text = "standard errors and intervals are those of a minimum, where the search did not arrive".to_owned();
        warnings.push(Warning { code: WarningCode::NotAtMinimum, severity: Severity::NotUsable, text });
    }
    if let Some(starts) = &evidence.point.end.starts {
        let asked = matches!(evidence.point.objective.problem.settings.searches, SearchPlan::All(_));
        let colored = evidence.color_dominates();
        warnings.extend(starts::warnings(starts, evidence.residuals.measured, asked, colored));
    }
    if let Some(write_error) = &evidence.point.end.write_error {
        let text = format!("the checkpoint could not be written ({write_error}); the search went on without it");
        warnings.push(Warning { code: WarningCode::CheckpointNotWritten, severity: Severity::Usable, text });
    }
    warnings.extend(curved::curved(evidence, unknowns, covariances));
    warnings.extend(conditions::kinked(evidence, unknowns, covariances));
    warnings.extend(growing_errors::uneven(unknowns, covariances));
    warnings.extend(few::decided_by_few(evidence, unknowns, covariances));
    warnings.extend(uneven_errors::uneven_errors(unknowns, covariances));
    warnings.extend(within_loss::few_within_the_loss(evidence));
    warnings.extend(data_noise::restart_noise(evidence, unknowns));
    warnings.extend(data_noise::input_noise(evidence, unknowns));
    warnings.extend(color::autocorrelation(evidence, covariances));
    warnings.extend(correlated_outputs::correlated_outputs(evidence));
    warnings.extend(not_examined::not_examined(evidence, early));
    warnings
}

/// Whether there are too few measurements, or none that determine an unknown.
fn of_the_data(evidence: &Evidence<'_>, unknowns: &[Unknown]) -> Option<Warning> {
    let (measured, severity) = (evidence.residuals.measured, Severity::NotUsable);
    if measured <= unknowns.len() as u64 {
        let text = format!(
            "{measured} measurement(s) for {} unknown(s) leave nothing to tell the accuracy by; fix some, or record more",
            unknowns.len()
        );
        return Some(Warning { code: WarningCode::TooFewMeasurements, severity, text });
    }
    let none = unknowns.iter().all(|row| row.knowledge == Knowledge::Unidentified);
    none.then(|| Warning {
        code: WarningCode::NothingDetermined,
        severity,
        text: "the data determine none of the unknowns".to_owned(),
    })
}

/// Whether a predicted variance goes to zero: there the likelihood has no maximum.
fn unbounded(evidence: &Evidence<'_>) -> Option<Warning> {
    let of = |j: usize| (evidence.residuals.least_sigma[j], evidence.residuals.outputs[j].rmse);
    let j = (0..evidence.residuals.least_sigma.len()).find(|&j| is_nothing(of(j)))?;
    let (output, (least_sigma, rmse)) = (&evidence.point.objective.problem.layout().outputs[j], of(j));
    let free =
        evidence.point.objective.problem.unknowns.row.iter().any(|one| matches!(one.role, Role::InitialState(_)));
    let (cause, remedy) = match free {
        true => ("a free initial state fits the first measurement exactly", "fix the initial state"),
        false => ("such as a first one that equals the initial state", "leave out what is predicted exactly (NaN)"),
    };
    let text = format!(
        "a measurement of `{}` is predicted with a standard deviation of {} {unit}, beside errors of {} {unit}: the \
         likelihood grows without bound ({cause}); give the noise a lower bound, or {remedy}",
        output.name,
        number(least_sigma, 2),
        number(rmse, 2),
        unit = output.unit
    );
    Some(Warning { code: WarningCode::UnboundedLikelihood, severity: Severity::NotUsable, text })
}

/// Parameters that were declared positive and are not.
fn not_positive(evidence: &Evidence<'_>, unknowns: &[Unknown]) -> Vec<Warning> {
    let rows = evidence.point.objective.problem.unknowns.row.iter().zip(unknowns);
    let wrong = rows.filter(|(row, unknown)| row.parameter.positive && unknown.value <= 0.0);
    let warning = |(_, unknown): (&Free, &Unknown)| {
        let consistent = matches!(unknown.knowledge, Knowledge::Known { upper, .. } if upper > 0.0);
        let means = match consistent {
            true => {
                "its interval reaches above zero: the record says little of it; excite what depends on it, or fix it"
            }
            false => "model and record contradict each other; check units, signs and the hold of the inputs",
        };
        let (value, unit) = (number(unknown.value, 4), &unknown.unit);
        let text = format!("`{}` is {value} {unit}, but was declared positive: {means}", unknown.name);
        Warning { code: WarningCode::NotPositive, severity: Severity::NotUsable, text }
    };
    wrong.map(warning).collect()
}

/// A direction that the data do not determine; a note for an initial state that has died out, which changes no other unknown.
fn without_influence(evidence: &Evidence<'_>, direction: &Direction, unknowns: &[Unknown]) -> Warning {
    if let [(name, _)] = direction.moves.as_slice()
        && evidence.point.linear.forgotten().iter().any(|i| unknowns[*i].name == *name)
    {
        let text = format!(
            "`{name}` has died out before the first measurement: it is not known, and no other unknown depends on it"
        );
        return Warning { code: WarningCode::Unidentified, severity: Severity::Usable, text };
    }
    Direction::warning(direction.to_string())
}

/// Initial states whose start is a guess of the library.
fn guessed_starts(evidence: &Evidence<'_>) -> Option<Warning> {
    let rows = &evidence.point.objective.problem.unknowns.row;
    let guessed: Vec<_> = rows.iter().filter(|unknown| unknown.guessed).collect();
    let first = guessed.first()?;
    let names: Vec<String> = guessed.iter().take(NAMED).map(|unknown| format!("`{}`", unknown.name)).collect();
    let more = if guessed.len() > NAMED { format!(" and {} more", guessed.len() - NAMED) } else { String::new() };
    let text = format!(
        "the outputs do not give {}{more}: estimated, from a start of {}; if it is known, or nearly, say so \
         (Experiment::initial)",
        names.join(", "),
        exact(first.parameter.start)
    );
    Some(Warning { code: WarningCode::GuessedStart, severity: Severity::Usable, text })
}

fn gaps(evidence: &Evidence<'_>) -> Vec<Warning> {
    let problem = evidence.point.objective.problem;
    // Nothing is held between samples without a state or without an input.
    if problem.layout().kind == Kind::Static || problem.layout().inputs.is_empty() {
        return vec![];
    }
    let records = problem.records.iter().zip(&problem.unknowns.labels);
    let gaps = |(record, label): (&crate::record::Record, &String)| {
        let gaps = record.gaps();
        let (count, first) = (counted(gaps.len() as u64, "gap"), gaps.first()?);
        Some(care(
            WarningCode::TimeGaps,
            format!(
                "time jumps in experiment `{label}` ({count}, the first: {first}): the input is taken as held meanwhile, \
             which is seldom what happened; fit the pieces between (Experiment::without_gaps)"
            ),
        ))
    };
    records.filter_map(gaps).collect()
}

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
    let coarse =
        change > most || change * windows > most && change * step_accumulation::windows_add_up(evidence) > most;
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
    let Some((name, shift, part)) = shift(&objective, &evidence.point.end.coordinates, unknowns) else {
        return diverges(unknowns, change, &finer.integrator());
    };
    let finer = finer.integrator();
    let wrong = refines && shift > STEP_SHIFT && part >= DIGITS;
    let severity = if wrong { Severity::NotUsable } else { Severity::UsableWithCare };
    let warning = || {
        let (part, errors) = (percent(part, 2), number(shift, 2));
        let tried = if refines { "no method that was tried steps finely enough" } else { "the step is too coarse" };
        let text = format!(
            "{tried}: with {finer} `{name}` would move by {part} of itself ({errors} standard errors); use a finer step, \
             or smooth the model"
        );
        Warning { code: WarningCode::CoarseStep, severity, text }
    };
    if shift > most { vec![warning()] } else { vec![] }
}

/// Warnings where the simulation with a finer step fails at the estimate, or grows until its slopes determine no step: a coarse step damps
/// oscillations by itself, so that parameters of an unstable plant may fit. These are no minimum with the finer step.
fn diverges(unknowns: &[Unknown], change: f64, finer: &str) -> Vec<Warning> {
    if unknowns.iter().all(|unknown| unknown.knowledge.standard_error().is_none()) {
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
    let (name, _, part) =
        shift(&objective, &evidence.point.end.coordinates, unknowns).filter(|(.., part)| *part >= DIGITS)?;
    let text = format!(
        "the data are reproduced to their rounding by {}; {} would change `{name}` by {} of itself: right for a record that was \
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

/// By how many standard errors, and by which part of itself, an unknown would move at most towards the minimum of an
/// objective.
fn shift(objective: &Objective<'_>, coordinates: &[f64], unknowns: &[Unknown]) -> Option<(String, f64, f64)> {
    let linear = objective.evaluate(coordinates).ok()?;
    let held: Vec<bool> = unknowns.iter().map(|row| row.knowledge.standard_error().is_none()).collect();
    let step = linear.step(&vec![0.0; unknowns.len()], &held)?;
    let shift = |i: usize| {
        let unknown = &unknowns[i];
        let change = (step[i] * unknown.transform.slope(unknown.value)).abs();
        let error = unknown.knowledge.standard_error()?;
        Some((unknown.name.clone(), change / error, change / unknown.value.abs()))
    };
    (0..unknowns.len()).filter_map(shift).max_by(|a, b| a.1.total_cmp(&b.1))
}

/// Whether a predicted standard deviation is nothing beside the root mean square of the errors.
fn is_nothing((sigma, rmse): (f64, f64)) -> bool {
    sigma < ZERO_DEVIATION * rmse
}

#[cfg(test)]
mod tests {
    use super::{is_nothing, shift};
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
            let (_, errors, part) = shift(&problem.objective().unwrap(), &[coordinate], &unknowns).unwrap();
            assert!((errors - 2.0).abs() < 1e-12 && (part - 0.5).abs() < 1e-12, "{errors} {part}");
        }
    }

    /// A millionth, of large errors and of small ones.
    #[test]
    fn deviations_of_nothing() {
        for rmse in [1e-3, 1e3] {
            assert!(is_nothing((0.99e-6 * rmse, rmse)) && !is_nothing((1.01e-6 * rmse, rmse)));
        }
        assert!(!is_nothing((0.0, 0.0)) && !is_nothing((f64::INFINITY, 1.0)));
    }
}
