//! Warnings about the data themselves: outputs that stand still, have few values, or are missing.

use super::*;
use crate::record::{ChannelInspection, Inspection, Record};
use std::sync::Arc;

pub(crate) const CONSTANT_OUTPUTS: Check = Check::new(
    "outputs move",
    "Has an output one value throughout? A note where a controller holds it and the model gives the same.",
    &[WarningCode::ConstantOutput],
    |evidence, _| constant_outputs(evidence, &inspected(evidence)).into(),
)
.levels(&[level(
    "the error of an output that the model holds, in parts of its value",
    REPRODUCED,
    "rounding of records with six digits",
)]);

pub(crate) const COARSE: Check = Check::new(
    "outputs have more than a few values",
    "Has an output few values, and errors that are not far below the step between them?",
    &[WarningCode::CoarseOutput],
    |evidence, _| coarse(evidence).into(),
)
.levels(&[
    level("the number of values", FEW as f64, "three bits"),
    level("the number where errors are about those of rounding alone", ROUNDED as f64, "five bits"),
    level("errors of rounding alone, in steps, at most", UNDITHERED, "noise of a third of a step beside it"),
    level("how often each occurs", TIMES as f64, "fewer say nothing of the sensor"),
    level("the error, in steps", PART_OF_STEP, "rounding alone is 0.29"),
]);

pub(crate) const MISSING_PART: Check = Check::new(
    "outputs are measured",
    "Is most of an output missing?",
    &[WarningCode::MissingMeasurements],
    |evidence, _| missing(evidence, &inspected(evidence)).into(),
)
.levels(&[level("the missing part", MISSING, "a half")]);

/// Errors below this part of an output's range or level are rounding: the model reproduces what is suspicious.
pub(crate) const REPRODUCED: f64 = 1e-6;
/// Outputs with so few values are coarse, where each occurs so many times and the errors are larger than this part of a step.
const FEW: usize = 8;
pub(crate) const TIMES: usize = 4;
pub(crate) const PART_OF_STEP: f64 = 0.1;
/// Of outputs with so many values, all multiples of a step apart, errors below this part of the step are those of rounding alone. Noise of half a step makes
/// errors of rounding independent of the output; without it they depend on the output, and bias the parameters. Of first-order plants under steps, with 9, 11, 17 and 21 values, intervals hold the truth in 15, 3, 27 and 50 %; with 41
/// as they should.
const ROUNDED: usize = 32;
const UNDITHERED: f64 = 0.4;
/// An output that was measured at fewer instants does not show whether it moves.
const INSTANTS: usize = 3;
/// Missing part of an output from which on there is a note.
const MISSING: f64 = 0.5;

/// What the look at the columns of each record found.
pub(crate) fn inspected(evidence: &Evidence<'_>) -> Vec<Arc<Inspection>> {
    evidence.point.objective.problem.records.iter().map(Record::inspect_some).collect()
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
        Some(Warning::new(WarningCode::ConstantOutput, severity, text).about(About::Output(j)))
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

/// Outputs of few values, whose errors are not far below the step between them.
fn coarse(evidence: &Evidence<'_>) -> Vec<Warning> {
    let outputs = evidence.point.objective.problem.layout().outputs.iter().enumerate();
    let one = |(j, output): (usize, &crate::layout::Quantity)| {
        let values = distinct(&evidence.point.objective.problem.records, j, ROUNDED)?;
        let step = values.windows(2).map(|pair| pair[1] - pair[0]).reduce(f64::min)?;
        let levels = values.len();
        let rmse = evidence.residuals.outputs[j].rmse;
        let often = evidence.residuals.outputs[j].samples >= (TIMES * levels) as u64;
        let is_rounding = levels <= FEW || steps(&values).is_some() && rmse < UNDITHERED * step;
        (often && is_rounding && rmse > PART_OF_STEP * step).then(|| {
            let text = format!(
                "the output `{}` has {levels} values only, {}{} apart{}: its rounding is no noise, and parameters are off \
                 by it; measure it finer",
                output.name,
                number(step, 3),
                unit_after(&output.unit),
                if levels > FEW { format!(", and its errors are {} of a step", percent(rmse / step, 2)) } else { String::new() }
            );
            with_care(WarningCode::CoarseOutput, text).about(About::Output(j))
        })
    };
    outputs.filter_map(one).collect()
}

/// The values of an output in all records, in their order, if there are so many at most.
pub(crate) fn distinct(records: &[Record], output: usize, most: usize) -> Option<Vec<f64>> {
    let mut values: Vec<f64> = vec![];
    let measured = records.iter().flat_map(|record| record.outputs()[output].values.iter());
    // Rounding gives zeros of both signs.
    for value in measured.filter(|value| !value.is_nan()).map(|value| value + 0.0) {
        if let Err(at) = values.binary_search_by(|one| one.total_cmp(&value)) {
            values.insert(at, value);
            if values.len() > most {
                return None;
            }
        }
    }
    Some(values)
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
            note(WarningCode::MissingMeasurements, text).about(About::Output(j))
        })
    };
    outputs.filter_map(one).collect()
}

/// The number of values and the quantization step, where there are more than [`FEW`], all multiples of one step apart.
pub(crate) fn steps(values: &[f64]) -> Option<(usize, f64)> {
    let apart = || values.windows(2).map(|pair| pair[1] - pair[0]);
    let step = apart().reduce(f64::min)?;
    let multiple = |apart: f64| (apart / step - (apart / step).round()).abs() < 1e-6;
    (values.len() > FEW && apart().all(multiple)).then_some((values.len(), step))
}

#[cfg(test)]
mod tests {
    use super::instants;
    use crate::record::{Channel, Record, Time};

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
