//! Inputs that act a sample earlier or later than the record says, or behave otherwise between samples.
//!
//! Predictions that are corrected by measurements take such a fault as process noise: their errors stay white, and the likelihood alone is
//! lower. Each input is tried a sample earlier, a sample later, and with the other hold, the unknowns being those of the estimate. A wrong
//! model is more likely than the right one by a factor `l` with a probability of at most `1 / l` (Markov's inequality). That does not hold where
//! the value of the next sample is taken and a controller has computed it from the measurement that is predicted. Most controllers make such a
//! record less likely, but not all: an inverse response in a loop makes it more likely, so that no estimate is refused for that.

use super::step::{Shift, of_one};
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
    level("the part of a parameter that is not usable, where no value of the next sample is taken", FAR, "a quarter"),
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

/// Inputs that act otherwise, with the records, and the logarithm of the factor by which these are more likely.
struct Found<'p> {
    inputs: Vec<usize>,
    otherwise: Otherwise,
    problem: Problem<'p>,
    log_likelihood: f64,
}

/// The fault with which the record is most likely.
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

/// The log-likelihood counts the errors by how many independent ones they tell as much as. `None` where nothing can be predicted.
fn found<'p>(evidence: &Evidence<'p>, inputs: Vec<usize>, otherwise: Otherwise) -> Option<Found<'p>> {
    let objective = evidence.point.objective;
    let records = objective.problem.records.iter().map(|record| with(record, &inputs, otherwise)).collect();
    let problem = objective.problem.with_records(records).ok()?;
    let cost = objective.of(&problem, objective.sweep).cost_at(&evidence.point.end.coordinates).ok()?;
    let variance = evidence.point.widening.powi(2) * evidence.most_inflation();
    let log_likelihood = (evidence.point.linear.cost - cost) / variance;
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
        (Otherwise::OtherHold, false) if held => ("is a straight line between its samples rather than held", LINE),
        (Otherwise::OtherHold, true) if held => ("are straight lines between their samples rather than held", LINE),
        (Otherwise::OtherHold, false) => ("is held between its samples rather than a straight line", HELD),
        (Otherwise::OtherHold, true) => ("are held between their samples rather than straight lines", HELD),
    };
    // The value of the next sample may have been computed from the measurement.
    let next = found.otherwise == Otherwise::Earlier || found.otherwise == Otherwise::OtherHold && held;
    let with = objective.of(&found.problem, objective.sweep);
    let (severity, moved) = match furthest(evidence, &with, unknowns) {
        Some(Shift { of, part, errors }) if part.is_finite() => {
            let severity = match errors > CARE {
                true if part > FAR && !next => Severity::NotUsable,
                true => Severity::UsableWithCare,
                false => Severity::Usable,
            };
            let (part, errors) = (percent(part, 2), number(errors, 2));
            (severity, format!("; {of} would move by about {part} of itself ({errors} standard errors)"))
        }
        _ => (Severity::UsableWithCare, String::new()),
    };
    let higher = number(found.log_likelihood, 3);
    let text = format!(
        "the log-likelihood is {higher} higher if {names} {acts}{moved}, which a predictor that corrects its state takes as noise of the \
         plant: {check}"
    );
    Warning::new(WarningCode::InputTiming, severity, text)
}

const EARLIER: &str = "check when the column is written, and shift it; an input that is computed from the measurements, as by a controller, may look \
                       like that, too";
const LATER: &str = "check when the column is written, and whether the plant has a dead time or the actuator a lag that the model lacks";
const LINE: &str = "check what it does between samples, and declare its hold; an input that is computed from the measurements, as by a controller, may \
                    look like that, too";
const HELD: &str = "check what it does between samples, and declare its hold";

/// The largest move of a parameter that does not stand in the noise alone.
fn furthest(evidence: &Evidence<'_>, objective: &Objective<'_>, unknowns: &[Unknown]) -> Option<Shift> {
    let linear = objective.evaluate(&evidence.point.end.coordinates).ok()?;
    let levels = objective.sweep.levels();
    let counts = |unknown: &Unknown| matches!(unknown.role, Role::Parameter(place) if !levels.contains(&place));
    of_one(Some(evidence.point.linear), &linear, unknowns, counts)
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
