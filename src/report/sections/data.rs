//! The records and their signals.

use super::outputs::extent;
use crate::numeral::{counted, number};
use crate::report::facts::{Facts, Record};
use crate::section::{Cell, Section, Table};

/// Records whose signals are listed.
const SHOWN: usize = 12;

pub(super) fn section(facts: &Facts) -> Section {
    let section = Section::new("data", "Data");
    let section = match facts.records.as_slice() {
        [single] => {
            let section = section.says(format!("{}: {}.", super::quoted(&single.name), extent(single)));
            remarks(single).into_iter().fold(section.table(signals(single)), Section::says)
        }
        records => records.iter().take(SHOWN).enumerate().fold(section, |section, (i, record)| {
            let part = Section::new(format!("data-{}", i + 1), record.name.as_str());
            let part = part.says(format!("{}.", extent(record))).table(signals(record));
            section.part(remarks(record).into_iter().fold(part, Section::says).folded())
        }),
    };
    let section = if facts.single() { section } else { section.folded() };
    match facts.records.len().saturating_sub(SHOWN) {
        0 => section,
        more => section.says(format!("The signals of {} are not listed.", counted(more as u64, "more record"))),
    }
}

/// A value with four digits, and none below a ten-thousandth of the range: the mean of an alternating signal is zero.
fn size(value: f64, range: f64) -> Cell {
    let rounding = value.abs() < 5e-5 * range;
    Cell::Number { value, text: number(if rounding { 0.0 } else { value }, 4) }
}

/// Remarks on the values of the signals, independent of the model: a sentence for each signal that needs one.
fn remarks(record: &Record) -> Vec<String> {
    let said = record.signals.iter().filter(|signal| !signal.remarks.is_empty());
    said.map(|signal| format!("`{}`: {}.", signal.name, signal.remarks.join("; "))).collect()
}

/// The columns of a record.
fn signals(record: &Record) -> Table {
    let rows = record.signals.iter().map(|signal| {
        let value = |i: usize| signal.values.map_or("-".into(), |values| size(values[i], values[2] - values[0]));
        let (name, role, unit) = (signal.name.as_str().into(), signal.role.into(), signal.unit.as_str().into());
        [name, role, unit, value(0), value(1), value(2), signal.missing.into()]
    });
    let columns = ["signal", "role", "unit", "least", "mean", "greatest", "missing"];
    Table::new(format!("Signals of {}", record.name), columns).rows(rows)
}
