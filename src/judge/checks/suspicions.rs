//! Values that the look at the columns takes for invented, where the errors confirm it.

use super::*;
use crate::judge::checks::data::{REPRODUCED, inspected};
use crate::judge::evidence::suspects::{Split, Suspect, splits};
use crate::record::{ChannelInspection, Inspection, Suspicion};
use std::sync::Arc;

pub(crate) const SUSPICIONS: Check = Check::new(
    "no stretch of an output was invented",
    "Are the errors larger, or does the prediction move, where the columns look like sentinels, limits, stuck \
     sensors, held values or blocks written twice?",
    &[WarningCode::Sentinel, WarningCode::Clipped, WarningCode::Frozen, WarningCode::HeldOutput, WarningCode::Repeated],
    |evidence, _| {
        let pieces = has_long(evidence).then_some("samples between pieces of columns of more than 16,384");
        Examined::from(suspicions(evidence, &inspected(evidence))).without(pieces)
    },
)
.costs(&[Pass::Values(1)])
.levels(&[
    level("the mean squared error there, in those elsewhere", LARGER, "one in 34 of stretches of ten good errors"),
    level("the part of the sum of squares that decides the estimate", DECIDE, "a half"),
    level(
        "the movement of the prediction where the output stands still, in parts of that of the output",
        MOVES,
        "noise of a tenth of an output moves it less",
    ),
    level("the part of the samples that decides the estimate", LONG, "a quarter"),
]);

pub(crate) const INPUT_SENTINELS: Check = Check::new(
    "no input has sentinels",
    "Has an input one exact value far from all others?",
    &[WarningCode::Sentinel],
    |evidence, _| sentinels_of_inputs(evidence, &inspected(evidence)).into(),
);

/// Mean squared errors at suspicious samples beyond so many times those elsewhere confirm the suspicion.
const LARGER: f64 = 2.0;
/// Suspicious samples that make so much of the sum of squares decide the estimate.
const DECIDE: f64 = 0.5;
/// A prediction that moves by more than this part of what the output moves, while that stands still, confirms that it should have moved;
/// one that stands still for more than `LONG` of the samples decides the estimate.
const MOVES: f64 = 0.1;
const LONG: f64 = 0.25;
/// Warnings of one kind; more are counted.
pub(crate) const NAMED: usize = 4;

/// Whether a record is longer than what is looked at.
fn has_long(evidence: &Evidence<'_>) -> bool {
    evidence.point.objective.problem.records.iter().any(|record| !record.is_inspected_whole())
}

/// ` of experiment ...`, if there are several.
fn of_experiment(evidence: &Evidence<'_>, e: usize) -> String {
    let labels = &evidence.point.objective.problem.unknowns.labels;
    if labels.len() > 1 { format!(" of experiment `{}`", labels[e]) } else { String::new() }
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
            warnings.push(Warning { code, severity, text });
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
        Some(with_care(WarningCode::Sentinel, text))
    };
    channels.filter_map(one).take(NAMED).collect()
}
