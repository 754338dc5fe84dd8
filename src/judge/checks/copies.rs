//! Columns that are copies of another one.

use crate::estimate::{Warning, WarningCode};
use crate::judge::check::Check;
use crate::judge::checks::data::{NAMED, moves, warning};
use crate::judge::evidence::Evidence;
use crate::optimize::Severity;
use crate::record::Record;

pub(crate) const COPIES: Check = Check {
    name: "no column is a copy",
    asks: "Is an input or an output another column sample by sample, in all records?",
    codes: &[WarningCode::IdenticalColumns],
    costs: &[],
    levels: &[],
    examine: |evidence, _| copies(evidence).into(),
};

/// The values of an input, or behind these of an output.
fn column(record: &Record, i: usize) -> &[f64] {
    let inputs = record.inputs();
    i.checked_sub(inputs.len()).map_or_else(|| &inputs[i].values[..], |j| &record.outputs()[j].values[..])
}

/// Columns that are the same in all records, each with the first that it is a copy of.
fn copies(evidence: &Evidence<'_>) -> Vec<Warning> {
    let records = &evidence.point.objective.problem.records;
    let Some(first) = records.first() else { return vec![] };
    let (inputs, outputs) = (first.inputs().len(), first.outputs().len());
    let same = |a: usize, b: usize| {
        let equal = |(a, b): (&f64, &f64)| a == b || a.is_nan() && b.is_nan();
        let pairs = || records.iter().map(|record| (column(record, a), column(record, b)));
        pairs().all(|(a, b)| a.iter().zip(b.iter()).all(equal)) && pairs().any(|(a, _)| moves(a))
    };
    let name = |i: usize| match i.checked_sub(inputs) {
        None => format!("the input `{}`", first.inputs()[i].name),
        Some(j) => format!("the output `{}`", first.outputs()[j].name),
    };
    let one = |b: usize| {
        let a = (0..b).find(|a| same(*a, b))?;
        let what = match (a < inputs, b < inputs) {
            (true, true) => "what each of them does is not told apart",
            (true, false) => "it was not measured",
            _ => "its measurements count twice",
        };
        let text = format!(
            "{} is {} sample by sample: {what}; check which columns were read, and leave the copy out (mark an output as missing)",
            name(b),
            name(a)
        );
        Some(warning(WarningCode::IdenticalColumns, Severity::UsableWithCare, text))
    };
    (1..inputs + outputs).filter_map(one).take(NAMED).collect()
}
