//! Warnings about what was declared: times, initial states, bounds, signs; and what the data do not determine of it.

use super::*;
use crate::estimate::Direction;
use crate::interval::Hold;
use crate::judge::checks::conditions;
use crate::layout::Kind;
use crate::parameter::Transform;
use crate::record::Holds;

pub(crate) const GAPS: Check = Check::new(
    "time has no gaps",
    "Does time jump within a record with inputs, which are not known meanwhile?",
    &[WarningCode::TimeGaps],
    |evidence, _| gaps(evidence).into(),
);

pub(crate) const GUESSED: Check = Check::new(
    "initial states have a start",
    "Does neither the user nor an output give a start for an initial state?",
    &[WarningCode::GuessedStart],
    |evidence, _| guessed_starts(evidence).into(),
);

pub(crate) const HELD: Check = Check::new(
    "no unknown is at a bound",
    "Is an unknown held at a bound, beyond which the cost falls?",
    &[WarningCode::HeldAtBound],
    |_, intervals| held_at_bound(&intervals.unknowns).into(),
);

pub(crate) const POSITIVE: Check = Check::new(
    "positive parameters are positive",
    "Is a parameter that was declared positive zero or below?",
    &[WarningCode::NotPositive],
    |evidence, intervals| not_positive(evidence, &intervals.unknowns).into(),
);

pub(crate) const IDENTIFIED: Check = Check::new(
    "all unknowns are identified",
    "Along which directions of the unknowns do the data say nothing, by the singular values of the slopes? Does a \
     parameter without slope change the cost in steps?",
    &[WarningCode::Unidentified],
    |evidence, intervals| {
        let directions = &evidence.point.undetermined.directions;
        let one = |d: usize| {
            let (entries, named) = (&directions[d], &intervals.directions[d]);
            without_influence(evidence, entries, named, &intervals.unknowns).about(About::Direction(d))
        };
        (0..directions.len().min(intervals.directions.len())).map(one).collect::<Vec<_>>().into()
    },
)
.costs(&[Pass::EachUnknown(6)]);

/// Guessed initial states that are named; more are counted.
const NAMED: usize = 4;

/// Unknowns that are held at a bound.
fn held_at_bound(unknowns: &[Unknown]) -> Vec<Warning> {
    let mut warnings = vec![];
    for (i, unknown) in unknowns.iter().enumerate() {
        if let Knowledge::Held { bound, end } = unknown.knowledge {
            let (name, unit) = (&unknown.name, unit_after(&unknown.unit));
            let place = match (unknown.transform, bound) {
                (Transform::Log, 0.0) => {
                    "is held where it changes nothing: its logarithm has no minimum, the cost falls towards zero"
                        .to_owned()
                }
                _ => format!("is held at its bound {}{unit}: the cost falls beyond it", exact(bound)),
            };
            let reaches = match end {
                Some(end) => {
                    let (bound, end) =
                        if end < bound { (number(end, 3), exact(bound)) } else { (exact(bound), number(end, 3)) };
                    format!("; its 95 % interval reaches from {bound} to {end}{unit}")
                }
                None => String::new(),
            };
            let text = format!("`{name}` {place}{reaches}");
            warnings.push(with_care(WarningCode::HeldAtBound, text).about(About::Unknown(i)));
        }
    }
    warnings
}

/// Parameters that were declared positive and are not.
fn not_positive(evidence: &Evidence<'_>, unknowns: &[Unknown]) -> Vec<Warning> {
    let rows = &evidence.point.objective.problem.unknowns.row;
    let wrong = |(i, unknown): &(usize, &Unknown)| rows[*i].parameter.positive && unknown.value <= 0.0;
    let warning = |(i, unknown): (usize, &Unknown)| {
        let consistent = matches!(unknown.knowledge, Knowledge::Known { upper, .. } if upper > 0.0);
        let means = match consistent {
            true => {
                "its interval reaches above zero: the record says little of it; excite what depends on it, or fix it"
            }
            false => "model and record contradict each other; check units, signs and the hold of the inputs",
        };
        let (value, unit) = (number(unknown.value, 4), unit_after(&unknown.unit));
        let text = format!("`{}` is {value}{unit}, but was declared positive: {means}", unknown.name);
        not_usable(WarningCode::NotPositive, text).about(About::Unknown(i))
    };
    unknowns.iter().enumerate().filter(wrong).map(warning).collect()
}

/// A direction that the data do not determine; a note for an initial state that has died out, which changes no other unknown.
fn without_influence(
    evidence: &Evidence<'_>,
    entries: &[(usize, f64)],
    direction: &Direction,
    unknowns: &[Unknown],
) -> Warning {
    if let [(name, _)] = direction.moves.as_slice()
        && evidence.point.linear.forgotten().iter().any(|i| unknowns[*i].name == *name)
    {
        let text = format!(
            "`{name}` has died out before the first measurement: it is not known, and no other unknown depends on it"
        );
        return note(WarningCode::Unidentified, text);
    }
    if let [(i, _)] = entries
        && let Some(what) = conditions::without_slope(evidence, *i)
    {
        return with_care(WarningCode::Unidentified, format!("`{}` {what}", unknowns[*i].name));
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
        number(first.parameter.start, 6)
    );
    Some(note(WarningCode::GuessedStart, text))
}

fn gaps(evidence: &Evidence<'_>) -> Vec<Warning> {
    let problem = evidence.point.objective.problem;
    // Nothing is held between samples without a state or without an input.
    if problem.layout().kind == Kind::Static || problem.layout().inputs.is_empty() {
        return vec![];
    }
    let records = problem.records.iter().zip(&problem.unknowns.labels).enumerate();
    let gaps = |(e, (record, label)): (usize, (&crate::record::Record, &String))| {
        let gaps = record.gaps();
        let (count, first) = (counted(gaps.len() as u64, "gap"), gaps.first()?);
        let meanwhile = match &record.holds {
            Holds::All(Hold::Zero) => "held",
            Holds::All(Hold::First) => "a straight line",
            Holds::Each(_) => "held, or as a straight line,",
        };
        let text = format!(
            "time jumps in experiment `{label}` ({count}, the first: {first}): the input is taken as {meanwhile} meanwhile, \
             which is seldom what happened; fit the pieces between (Experiment::without_gaps)"
        );
        Some(with_care(WarningCode::TimeGaps, text).about(About::Experiment(e)))
    };
    records.filter_map(gaps).collect()
}
