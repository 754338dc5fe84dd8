//! Inputs that act a sample earlier or later than the record says, or behave otherwise between samples.
//!
//! Predictions that are corrected by measurements take such a fault as process noise: their errors stay white, and the likelihood alone is
//! lower. Each input is tried a sample earlier, a sample later, and with the other hold, the unknowns being those of the estimate. A wrong
//! model is more likely than the right one by a factor `l` with a probability of at most `1 / l` (Markov's inequality), in a closed loop too,
//! where an input a sample earlier follows from the measurement that is predicted: a controller acts against the errors, an input with them.

use super::*;
use crate::interval::Hold;
use crate::layout::Kind;
use crate::problem::Problem;
use crate::record::{Channel, Holds, Record};

pub(crate) const INPUT_TIMING: Check = Check::new(
    "inputs act when the model takes them to",
    "Where predictions are corrected by measurements: is the record more likely with an input a sample earlier, a sample later, or with the \
     other hold (likelihood ratio at the estimate), and by how much would a parameter move?",
    &[WarningCode::InputTiming],
    input_timing,
)
.unless(&[Unless::Static, Unless::RoundOff, Unless::NoMinimum])
.costs(&[Pass::Values(3 * (MOST + 1)), Pass::Slopes(1)])
.levels(&[
    level("the probability by chance, over all that is tried", LEVEL, "at most one good record in a thousand"),
    level("the move of a parameter of care, in standard errors", CARE, "half of one: intervals of 95 % then cover 92 %"),
    level("the part of a parameter that is not usable", FAR, "a quarter"),
    level("the inputs of a model that is examined", MOST as f64, "each takes three passes"),
]);

const LEVEL: f64 = 1e-3;
const CARE: f64 = 0.5;
const FAR: f64 = 0.25;
const MOST: usize = 16;

/// How an input may have acted instead.
#[derive(Clone, Copy, PartialEq)]
enum Otherwise {
    Earlier,
    Later,
    OtherHold,
}

/// Inputs that act otherwise, and the logarithm of the factor by which the record is more likely so.
struct Found<'p> {
    inputs: Vec<usize>,
    otherwise: Otherwise,
    problem: Problem<'p>,
    log_likelihood: f64,
}

/// What makes the record more likely than any other fault does.
fn input_timing(evidence: &Evidence<'_>, intervals: &Intervals) -> Examined {
    let objective = evidence.point.objective;
    let (problem, inputs) = (objective.problem, objective.problem.layout().inputs.len());
    let corrected = objective.sweep.predicts_variance() || objective.sweep.restarts().is_some();
    if !corrected || inputs == 0 {
        return Examined::from(None);
    }
    if inputs > MOST {
        return Examined::skipped("more than 16 inputs");
    }
    let ways: &[Otherwise] = match problem.layout().kind {
        Kind::Continuous => &[Otherwise::Earlier, Otherwise::Later, Otherwise::OtherHold],
        _ => &[Otherwise::Earlier, Otherwise::Later],
    };
    let each = (0..inputs).map(|i| vec![i]);
    let all = (inputs > 1).then(|| (0..inputs).collect());
    let tried: Vec<(Vec<usize>, Otherwise)> =
        each.chain(all).flat_map(|inputs| ways.iter().map(move |way| (inputs.clone(), *way))).collect();
    let tests = tried.len() as f64;
    let found = tried.into_iter().filter_map(|(inputs, way)| found(evidence, inputs, way));
    let most = found.max_by(|a, b| a.log_likelihood.total_cmp(&b.log_likelihood));
    let certain = most.filter(|found| found.log_likelihood > (tests / LEVEL).ln());
    Examined::from(certain.map(|found| warning(evidence, found, &intervals.unknowns)))
}

/// With fewer errors where they are colored; `None` where there are no predictions.
fn found<'p>(evidence: &Evidence<'p>, inputs: Vec<usize>, otherwise: Otherwise) -> Option<Found<'p>> {
    let objective = evidence.point.objective;
    let records = objective.problem.records.iter().map(|record| with(record, &inputs, otherwise)).collect();
    let problem = objective.problem.with_records(records).ok()?;
    let cost = objective.of(&problem, objective.sweep).cost_at(&evidence.point.end.coordinates).ok()?;
    let inflation = evidence.residuals.whiteness.iter().map(|white| white.variance_inflation).fold(1.0, f64::max);
    let log_likelihood = (evidence.point.linear.cost - cost) / inflation;
    Some(Found { inputs, otherwise, problem, log_likelihood })
}

fn warning(evidence: &Evidence<'_>, found: Found<'_>, unknowns: &[Unknown]) -> Warning {
    let objective = evidence.point.objective;
    let layout = objective.problem.layout();
    let names: Vec<String> = found.inputs.iter().map(|i| format!("`{}`", layout.inputs[*i].name)).collect();
    let (several, names) = (names.len() > 1, names.join(", "));
    let held = objective.problem.records.iter().any(|record| record.input_hold(found.inputs[0]) == Hold::Zero);
    let (acts, check) = match (found.otherwise, several) {
        (Otherwise::Earlier, false) => ("acts a sample before it is recorded", EARLIER),
        (Otherwise::Earlier, true) => ("act a sample before they are recorded", EARLIER),
        (Otherwise::Later, false) => ("acts a sample after it is recorded", LATER),
        (Otherwise::Later, true) => ("act a sample after they are recorded", LATER),
        (Otherwise::OtherHold, false) if held => ("is a straight line between its samples rather than held", HOLD),
        (Otherwise::OtherHold, true) if held => ("are straight lines between their samples rather than held", HOLD),
        (Otherwise::OtherHold, false) => ("is held between its samples rather than a straight line", HOLD),
        (Otherwise::OtherHold, true) => ("are held between their samples rather than straight lines", HOLD),
    };
    let furthest = furthest(evidence, &objective.of(&found.problem, objective.sweep), unknowns);
    let (severity, moved) = match furthest {
        Some((name, part, errors)) => {
            let severity = match (part > FAR && errors > CARE, errors > CARE) {
                (true, _) => Severity::NotUsable,
                (_, true) => Severity::UsableWithCare,
                _ => Severity::Usable,
            };
            let (part, errors) = (percent(part, 2), number(errors, 2));
            (severity, format!("; `{name}` would move by about {part} of itself ({errors} standard errors)"))
        }
        None => (Severity::UsableWithCare, String::new()),
    };
    let higher = number(found.log_likelihood, 3);
    let text = format!(
        "the log-likelihood is {higher} higher if {names} {acts}{moved}, which a predictor that corrects its state takes as noise of the \
         plant: {check}"
    );
    Warning::new(WarningCode::InputTiming, severity, text)
}

const EARLIER: &str = "check when the column is written, and shift it";
const LATER: &str = "check when the column is written, and whether the plant has a dead time or the actuator a lag that the model lacks";
const HOLD: &str = "say how it behaves (`hold`)";

/// The parameter that stands not in the noise alone and moves by most standard errors, by which part of itself, and by how many.
fn furthest<'u>(
    evidence: &Evidence<'_>,
    objective: &Objective<'_>,
    unknowns: &'u [Unknown],
) -> Option<(&'u str, f64, f64)> {
    let linear = objective.evaluate(&evidence.point.end.coordinates).ok()?;
    let held: Vec<bool> = unknowns.iter().map(|row| row.knowledge.standard_error().is_none()).collect();
    let step = linear.step(&vec![0.0; unknowns.len()], &held)?;
    let levels = objective.sweep.levels();
    let moves = |(unknown, step): (&'u Unknown, f64)| {
        let error = unknown.knowledge.standard_error()?;
        matches!(unknown.role, Role::Parameter(place) if !levels.contains(&place)).then_some(())?;
        let change = (step * unknown.transform.slope(unknown.value)).abs();
        Some((&*unknown.name, change / unknown.value.abs(), change / error))
    };
    unknowns.iter().zip(step).filter_map(moves).max_by(|a, b| a.2.total_cmp(&b.2))
}

/// A record whose inputs act otherwise.
fn with(record: &Record, inputs: &[usize], otherwise: Otherwise) -> Record {
    let one = |(i, input): (usize, &Channel)| match inputs.contains(&i) {
        true => input.with(shifted(&input.values, otherwise)),
        false => input.clone(),
    };
    let hold = |i: usize| match (record.input_hold(i), inputs.contains(&i) && otherwise == Otherwise::OtherHold) {
        (Hold::Zero, true) => Hold::First,
        (Hold::First, true) => Hold::Zero,
        (hold, false) => hold,
    };
    Record {
        inputs: record.inputs.iter().enumerate().map(one).collect(),
        holds: Holds::each((0..record.inputs.len()).map(hold).collect()),
        ..record.clone()
    }
}

/// Values of the next sample or of the one before; the last or the first one twice.
fn shifted(values: &[f64], otherwise: Otherwise) -> Vec<f64> {
    let last = values.len().saturating_sub(1);
    let from = |k: usize| match otherwise {
        Otherwise::Earlier => (k + 1).min(last),
        Otherwise::Later => k.saturating_sub(1),
        Otherwise::OtherHold => k,
    };
    (0..values.len()).map(|k| values[from(k)]).collect()
}
