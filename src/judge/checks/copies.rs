//! Columns that are copies of another one.

use super::*;
use crate::judge::checks::suspicions::NAMED;
use crate::record::Record;

pub(crate) const COPIES: Check = Check::new(
    "no column is a copy",
    "Is an input or an output another column sample by sample, in all records? Inputs of different dead times do not count.",
    &[WarningCode::IdenticalColumns],
    |evidence, _| copies(evidence).into(),
);

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
    let same = |a: usize, b: usize| are_same(records.iter().map(|record| (column(record, a), column(record, b))));
    let parameters = evidence.point.objective.values_of(0, &evidence.point.end.coordinates).p;
    let late = evidence.point.objective.sweep.late(&parameters);
    // An input that acts after several dead times has a column for each.
    let delay = |i: usize| late.get(i).copied().flatten().unwrap_or(0.0);
    let are_apart = |a: usize, b: usize| b < inputs && delay(a) != delay(b);
    let name = |i: usize| match i.checked_sub(inputs) {
        None => format!("the input `{}`", first.inputs()[i].name),
        Some(j) => format!("the output `{}`", first.outputs()[j].name),
    };
    let one = |b: usize| {
        let a = (0..b).find(|a| !are_apart(*a, b) && same(*a, b))?;
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
        Some(with_care(WarningCode::IdenticalColumns, text))
    };
    (1..inputs + outputs).filter_map(one).take(NAMED).collect()
}

/// Whether pairs of columns are the same, and any of them moves.
pub(super) fn are_same<'c>(mut pairs: impl Iterator<Item = (&'c [f64], &'c [f64])> + Clone) -> bool {
    let equal = |(a, b): (&f64, &f64)| a == b || a.is_nan() && b.is_nan();
    let all = pairs.clone().all(|(a, b)| a.len() == b.len() && a.iter().zip(b).all(equal));
    all && pairs.any(|(a, _)| moves(a))
}

/// Whether measurements are not all the same.
fn moves(values: &[f64]) -> bool {
    let mut measured = values.iter().filter(|y| !y.is_nan());
    let first = measured.next();
    measured.any(|y| Some(y) != first)
}

#[cfg(test)]
mod tests {
    use super::moves;

    #[test]
    fn a_missing_measurement_is_no_movement() {
        let nan = f64::NAN;
        assert_eq!([&[][..], &[nan], &[3.0, nan, 3.0], &[nan, 3.0, 3.0]].map(moves), [false; 4]);
        assert_eq!([&[3.0, 4.0][..], &[nan, 3.0, nan, 4.0], &[0.0, 0.0, 1.0]].map(moves), [true; 3]);
    }
}
