//! Warnings about the data themselves: what the look at the columns found, where the errors confirm it.

use crate::estimate::{Warning, WarningCode};
use crate::judge::check::{Check, Examined, Level, Pass};
use crate::judge::evidence::Evidence;
use crate::judge::evidence::suspects::{Split, Suspect, splits};
use crate::numeral::{counted, exact, number, percent, unit_after};
use crate::optimize::Severity;
use crate::record::{ChannelInspection, Inspection, Record, Suspicion};
use std::sync::Arc;

pub(crate) const CONSTANT_OUTPUTS: Check = Check {
    name: "outputs move",
    asks: "Has an output one value throughout? A note where a controller holds it and the model gives the same.",
    codes: &[WarningCode::ConstantOutput],
    costs: &[],
    levels: &[Level {
        of: "the error of an output that the model holds, in parts of its value",
        value: REPRODUCED,
        source: "rounding of records with six digits",
    }],
    examine: |evidence, _| constant_outputs(evidence, &inspected(evidence)).into(),
};

pub(crate) const SUSPICIONS: Check = Check {
    name: "no stretch of an output was invented",
    asks: "Are the errors larger, or does the prediction move, where the columns look like sentinels, limits, stuck sensors, held values or blocks written twice?",
    codes: &[
        WarningCode::Sentinel,
        WarningCode::Clipped,
        WarningCode::Frozen,
        WarningCode::HeldOutput,
        WarningCode::Repeated,
    ],
    costs: &[Pass::Values(1)],
    levels: &[
        Level {
            of: "the mean squared error there, in those elsewhere",
            value: LARGER,
            source: "one in 34 of stretches of ten good errors",
        },
        Level { of: "the part of the sum of squares that decides the estimate", value: DECIDE, source: "a half" },
        Level {
            of: "the movement of the prediction where the output stands still, in parts of that of the output",
            value: MOVES,
            source: "noise of a tenth of an output moves it less",
        },
        Level { of: "the part of the samples that decides the estimate", value: LONG, source: "a quarter" },
    ],
    examine: |evidence, _| {
        let pieces = has_long(evidence).then_some("samples between pieces of columns of more than 16,384");
        Examined::from(suspicions(evidence, &inspected(evidence))).without(pieces)
    },
};

pub(crate) const COARSE: Check = Check {
    name: "outputs have more than a few values",
    asks: "Has an output few values, and errors that are not far below the step between them?",
    codes: &[WarningCode::CoarseOutput],
    costs: &[],
    levels: &[
        Level { of: "the number of values", value: FEW as f64, source: "three bits" },
        Level { of: "how often each occurs", value: TIMES as f64, source: "fewer say nothing of the sensor" },
        Level { of: "the error, in steps", value: PART_OF_STEP, source: "rounding alone is 0.29" },
    ],
    examine: |evidence, _| coarse(evidence, &inspected(evidence)).into(),
};

pub(crate) const INPUT_SENTINELS: Check = Check {
    name: "no input has sentinels",
    asks: "Has an input one exact value far from all others?",
    codes: &[WarningCode::Sentinel],
    costs: &[],
    levels: &[],
    examine: |evidence, _| sentinels_of_inputs(evidence, &inspected(evidence)).into(),
};

pub(crate) const MISSING_PART: Check = Check {
    name: "outputs are measured",
    asks: "Is most of an output missing?",
    codes: &[WarningCode::MissingMeasurements],
    costs: &[],
    levels: &[Level { of: "the missing part", value: MISSING, source: "a half" }],
    examine: |evidence, _| missing(evidence, &inspected(evidence)).into(),
};

pub(crate) const TWICE: Check = Check {
    name: "no record counts twice",
    asks: "Do two records hold the same measurements?",
    codes: &[WarningCode::Repeated],
    costs: &[],
    levels: &[],
    examine: |evidence, _| {
        let more = evidence.point.objective.experiments() > COMPARED;
        Examined::from(twice(evidence)).without(more.then_some("records beyond the first 300"))
    },
};

/// Errors below this part of an output's range or level are rounding: the model reproduces what is suspicious.
const REPRODUCED: f64 = 1e-6;
/// Mean squared errors at suspicious samples beyond so many times those elsewhere confirm the suspicion.
const LARGER: f64 = 2.0;
/// Suspicious samples that make so much of the sum of squares decide the estimate.
const DECIDE: f64 = 0.5;
/// A prediction that moves by more than this part of what the output moves, while that stands still, confirms that it should have moved;
/// one that stands still for more than `LONG` of the samples decides the estimate.
const MOVES: f64 = 0.1;
const LONG: f64 = 0.25;
/// Outputs with so few values are coarse, where each occurs so many times and the errors are larger than this part of a step.
pub(crate) const FEW: usize = 8;
pub(crate) const TIMES: usize = 4;
pub(crate) const PART_OF_STEP: f64 = 0.1;
/// An output that was measured at fewer instants does not show whether it moves.
const INSTANTS: usize = 3;
/// Missing part of an output from which on there is a note.
const MISSING: f64 = 0.5;
/// Warnings of one kind; more are counted.
pub(crate) const NAMED: usize = 4;
/// Of so many records each is compared with each other.
const COMPARED: usize = 300;

pub(crate) fn warning(code: WarningCode, severity: Severity, text: String) -> Warning {
    Warning { code, severity, text }
}

/// What the look at the columns of each record found.
pub(crate) fn inspected(evidence: &Evidence<'_>) -> Vec<Arc<Inspection>> {
    evidence.point.objective.problem.records.iter().map(Record::inspect_some).collect()
}

/// Whether a record is longer than what is looked at.
fn has_long(evidence: &Evidence<'_>) -> bool {
    evidence.point.objective.problem.records.iter().any(|record| !record.is_inspected_whole())
}

/// ` of experiment ...`, if there are several.
fn of_experiment(evidence: &Evidence<'_>, e: usize) -> String {
    let labels = &evidence.point.objective.problem.unknowns.labels;
    if labels.len() > 1 { format!(" of experiment `{}`", labels[e]) } else { String::new() }
}

/// The value of a channel that is the same in all records.
pub(crate) fn constant<'i>(
    found: &'i [Arc<Inspection>],
    of: impl Fn(&'i Inspection) -> &'i ChannelInspection,
) -> Option<f64> {
    let mut values = found.iter().map(|one| of(one).constant());
    let first = values.next()??;
    values.all(|value| value == Some(first)).then_some(first)
}

fn constant_outputs(evidence: &Evidence<'_>, found: &[Arc<Inspection>]) -> Vec<Warning> {
    let outputs = &evidence.point.objective.problem.layout().outputs;
    let still: Vec<Option<f64>> = (0..outputs.len()).map(|j| constant(found, |one| &one.outputs[j])).collect();
    let all = still.iter().all(Option::is_some);
    let records = &evidence.point.objective.problem.records;
    let one = |(j, value): (usize, &Option<f64>)| {
        if records.iter().flat_map(|record| instants(record, j)).take(INSTANTS).count() < INSTANTS {
            return None;
        }
        let (value, rmse) = ((*value)?, evidence.residuals.outputs[j].rmse);
        // A controller may hold an output; the model then gives the same.
        let held = !all && rmse <= REPRODUCED * value.abs();
        let (name, unit) = (&outputs[j].name, unit_after(&outputs[j].unit));
        let text = format!(
            "the output `{name}` is {}{unit} throughout: it never moves and says nothing of the parameters; check the \
             sensor, or excite the plant",
            exact(value)
        );
        let severity = if held { Severity::Usable } else { Severity::NotUsable };
        Some(warning(WarningCode::ConstantOutput, severity, text))
    };
    still.iter().enumerate().filter_map(one).collect()
}

/// The instants at which an output was measured, each once.
fn instants(record: &Record, output: usize) -> impl Iterator<Item = f64> {
    let values = &record.outputs()[output].values;
    let measured = (0..record.len()).filter(|&k| !values[k].is_nan()).map(|k| record.time(k));
    let mut before = f64::NAN;
    measured.filter(move |&time| std::mem::replace(&mut before, time) != time)
}

/// Suspicious values of an output that the errors confirm.
fn suspicions(evidence: &Evidence<'_>, found: &[Arc<Inspection>]) -> Vec<Warning> {
    let mut suspects: Vec<Suspect<'_>> = vec![];
    for (experiment, inspection) in found.iter().enumerate() {
        for (output, channel) in inspection.outputs.iter().enumerate() {
            let of = |suspicion| Suspect { experiment, output, suspicion };
            suspects.extend(channel.suspicions.iter().map(of));
        }
    }
    if suspects.is_empty() {
        return vec![];
    }
    let splits = splits(evidence.point.objective, &evidence.point.end.coordinates, &suspects);
    let mut warnings = vec![];
    for (suspect, split) in suspects.iter().zip(&splits) {
        let (channel, suspicion) = (&found[suspect.experiment].outputs[suspect.output], suspect.suspicion);
        let Some((code, severity, advice)) = confirmed(evidence, channel, suspicion, (suspect.output, split)) else {
            continue;
        };
        if warnings.len() < NAMED {
            let of = of_experiment(evidence, suspect.experiment);
            let text = format!(
                "the output `{}`{of} {suspicion}, and the model differs there by {}{}: {advice}",
                channel.name,
                number(split.rms(), 2),
                unit_after(&evidence.point.objective.problem.layout().outputs[suspect.output].unit)
            );
            warnings.push(warning(code, severity, text));
        }
    }
    warnings
}

/// Whether a sample of an output is suspicious by the look at its column.
pub(crate) fn is_named(evidence: &Evidence<'_>, e: usize, j: usize, sample: usize) -> bool {
    let record = &evidence.point.objective.problem.records[e];
    let suspicions = &record.inspect_some().outputs[j].suspicions;
    suspicions.iter().any(|suspicion| suspicion.holds(&record.outputs()[j].values, sample))
}

/// Code, severity and remedy of a suspicion that the errors confirm.
fn confirmed(
    evidence: &Evidence<'_>,
    channel: &ChannelInspection,
    suspicion: &Suspicion,
    (output, split): (usize, &Split),
) -> Option<(WarningCode, Severity, &'static str)> {
    let (least, greatest) = channel.range?;
    let (_, moves) = evidence.residuals.levels[output];
    if split.rms() <= REPRODUCED * (greatest - least) {
        return None;
    }
    let decides = |bad: bool| if bad { Severity::NotUsable } else { Severity::UsableWithCare };
    let dominates = split.share() > DECIDE;
    match suspicion {
        Suspicion::Sentinel { .. } => (split.ratio() > LARGER).then_some((
            WarningCode::Sentinel,
            decides(dominates && !evidence.point.objective.is_robust()),
            "it stands for a missing measurement; mark it as missing",
        )),
        Suspicion::Clipped { .. } => Some((
            WarningCode::Clipped,
            decides(dominates),
            "the sensor is at its limit; mark these samples as missing, or use a wider range",
        )),
        // A long one makes the errors elsewhere as large.
        Suspicion::Frozen { .. } => (split.ratio() > LARGER || split.spread() > MOVES * moves).then_some((
            WarningCode::Frozen,
            decides(dominates || split.part() > LONG),
            "the sensor was stuck; mark these samples as missing",
        )),
        Suspicion::Held { .. } => Some((
            WarningCode::HeldOutput,
            Severity::UsableWithCare,
            "the sensor measures less often, or rounds away what changes in between, so that measurements count more than \
             once and may come late; mark all but the first of each value as missing",
        )),
        Suspicion::Repeated { .. } => {
            Some((WarningCode::Repeated, decides(dominates), "a buffer was written twice; leave one of the blocks out"))
        }
    }
}

/// Outputs of few values, whose errors are not far below the step between them.
fn coarse(evidence: &Evidence<'_>, found: &[Arc<Inspection>]) -> Vec<Warning> {
    let outputs = evidence.point.objective.problem.layout().outputs.iter().enumerate();
    let one = |(j, output): (usize, &crate::layout::Quantity)| {
        let few = |one: &Arc<Inspection>| one.outputs[j].levels.is_some_and(|levels| levels <= FEW);
        let values =
            found.iter().all(few).then(|| distinct(&evidence.point.objective.problem.records, j, FEW)).flatten()?;
        let step = values.windows(2).map(|pair| pair[1] - pair[0]).reduce(f64::min)?;
        let levels = values.len();
        let rmse = evidence.residuals.outputs[j].rmse;
        let often = evidence.residuals.outputs[j].samples >= (TIMES * levels) as u64;
        (often && rmse > PART_OF_STEP * step).then(|| {
            let text = format!(
                "the output `{}` has {levels} values only, {}{} apart: its rounding is no noise, and parameters are off \
                 by it; measure it finer",
                output.name,
                number(step, 3),
                unit_after(&output.unit)
            );
            warning(WarningCode::CoarseOutput, Severity::UsableWithCare, text)
        })
    };
    outputs.filter_map(one).collect()
}

/// The values of an output in all records, in their order, if there are so many at most.
pub(crate) fn distinct(records: &[Record], output: usize, most: usize) -> Option<Vec<f64>> {
    let mut values: Vec<f64> = vec![];
    let measured = records.iter().flat_map(|record| record.outputs()[output].values.iter());
    for value in measured.filter(|value| !value.is_nan()) {
        if let Err(at) = values.binary_search_by(|one| one.total_cmp(value)) {
            values.insert(at, *value);
            if values.len() > most {
                return None;
            }
        }
    }
    Some(values)
}

fn sentinels_of_inputs(evidence: &Evidence<'_>, found: &[Arc<Inspection>]) -> Vec<Warning> {
    let channels = found.iter().enumerate().flat_map(|(e, one)| one.inputs.iter().map(move |channel| (e, channel)));
    let one = |(e, channel): (usize, &ChannelInspection)| {
        let suspicion = channel.suspicions.first()?;
        let text = format!(
            "the input `{}`{} {suspicion}: if it stands for a missing measurement, give the value that acted on the \
             plant, or leave these samples out",
            channel.name,
            of_experiment(evidence, e)
        );
        Some(warning(WarningCode::Sentinel, Severity::UsableWithCare, text))
    };
    channels.filter_map(one).take(NAMED).collect()
}

/// Whether two records hold the same measurements.
fn twice(evidence: &Evidence<'_>) -> Option<Warning> {
    let (records, labels) =
        (&evidence.point.objective.problem.records, &evidence.point.objective.problem.unknowns.labels);
    let same = |a: &Record, b: &Record| {
        let columns = || a.outputs().iter().zip(b.outputs()).map(|(a, b)| (&a.values[..], &b.values[..]));
        let equal = |(a, b): (&f64, &f64)| a == b || a.is_nan() && b.is_nan();
        a.len() == b.len() && columns().all(|(a, b)| a.iter().zip(b).all(equal)) && columns().any(|(a, _)| moves(a))
    };
    let pairs = (1..records.len().min(COMPARED)).flat_map(|b| (0..b).map(move |a| (a, b)));
    let (a, b) = pairs.into_iter().find(|&(a, b)| same(&records[a], &records[b]))?;
    let text = format!(
        "the experiments `{}` and `{}` hold the same measurements, which count twice: intervals are too narrow; leave one \
         out",
        labels[a], labels[b]
    );
    Some(warning(WarningCode::Repeated, Severity::UsableWithCare, text))
}

fn missing(evidence: &Evidence<'_>, found: &[Arc<Inspection>]) -> Vec<Warning> {
    let outputs = evidence.point.objective.problem.layout().outputs.iter().enumerate();
    let one = |(j, output): (usize, &crate::layout::Quantity)| {
        let of = |count: fn(&ChannelInspection) -> usize| found.iter().map(|one| count(&one.outputs[j])).sum();
        let (missing, samples): (usize, usize) = (of(|one| one.missing), of(|one| one.samples));
        let part = missing as f64 / samples.max(1) as f64;
        (part > MISSING).then(|| {
            let text = format!(
                "{} of the measurements of `{}` are missing ({} are left)",
                percent(part, 2),
                output.name,
                counted(evidence.residuals.outputs[j].samples, "measurement")
            );
            warning(WarningCode::MissingMeasurements, Severity::Usable, text)
        })
    };
    outputs.filter_map(one).collect()
}

/// Whether measurements are not all the same.
pub(crate) fn moves(values: &[f64]) -> bool {
    let mut measured = values.iter().filter(|y| !y.is_nan());
    let first = measured.next();
    measured.any(|y| Some(y) != first)
}

#[cfg(test)]
mod tests {
    use super::{instants, moves};
    use crate::record::{Channel, Record, Time};

    #[test]
    fn a_missing_measurement_is_no_movement() {
        let nan = f64::NAN;
        assert_eq!([&[][..], &[nan], &[3.0, nan, 3.0], &[nan, 3.0, 3.0]].map(moves), [false; 4]);
        assert_eq!([&[3.0, 4.0][..], &[nan, 3.0, nan, 4.0], &[0.0, 0.0, 1.0]].map(moves), [true; 3]);
    }

    /// Several measurements at one instant count once.
    #[test]
    fn instants_of_measurements() {
        let of = |stamps: [f64; 4], values: [f64; 4]| {
            let channel = Channel::new("y", "", values.to_vec());
            let record = Record::new(vec![], Time::Stamps(stamps.to_vec()), vec![], vec![channel]).unwrap();
            instants(&record, 0).count()
        };
        assert_eq!(of([0.0, 0.0, 1.0, 2.0], [5.0; 4]), 3);
        assert_eq!(of([0.0, 0.0, 1.0, 2.0], [5.0, 5.0, f64::NAN, 5.0]), 2);
    }
}
