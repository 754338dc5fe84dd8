//! The records: measured and predicted over time, and what is left of each output.

use super::outputs::extent;
use super::{quoted, residuals, states};
use crate::numeral::{counted, rounded, unit_after};
use crate::report::facts::{Facts, Record};
use crate::section::{Drawing, Section};

/// Gaps that are named.
const NAMED: usize = 5;

/// Plots of residuals against signals, in all and of one output.
const AGAINST: usize = 120;

/// A section for each record that is drawn, and after it one for its states by a filter; of several, those of the record reproduced worst are
/// open.
pub(super) fn sections(facts: &Facts) -> Vec<Section> {
    let drawn = || facts.records.iter().filter(|record| record.timeline.is_some());
    let outputs = drawn().map(|record| record.fits.len()).sum::<usize>();
    let against = (AGAINST / outputs.max(1)).clamp(4, 16);
    let worst = |record: &Record| record.fits.iter().filter_map(|fit| fit.fit_percent).fold(f64::INFINITY, f64::min);
    let least = drawn().map(worst).fold(f64::INFINITY, f64::min);
    let open = drawn().position(|record| worst(record) == least).unwrap_or(0);
    let (count, left) = (drawn().count(), facts.records.len() - drawn().count());
    let of_record = |(i, record): (usize, &Record)| {
        let mut of_outputs = section(i + 1, record, against);
        if left > 0 && i + 1 == count {
            let text =
                format!("{}, reproduced better than those drawn, are not drawn.", counted(left as u64, "more record"));
            of_outputs.sentences.push(text);
        }
        let all = [Some(of_outputs), states::section(i + 1, record)].into_iter().flatten();
        all.map(move |section| Section { folded: i != open, ..section })
    };
    drawn().enumerate().flat_map(of_record).collect()
}

fn section(number: usize, record: &Record, against: usize) -> Section {
    let title = format!("Measured and predicted: {}", record.name);
    let section = Section::new(format!("record-{number}"), title).says(format!("{}.", extent(record)));
    let section = sentences(record).into_iter().fold(section, Section::says);
    let section = section.plot(record.timeline.clone());
    record.fits.iter().fold(section, |section, fit| {
        section.part(residuals::of_output(&format!("record-{number}"), record, fit, against))
    })
}

/// Explanation of the drawing of a record, with its limits.
fn sentences(record: &Record) -> Vec<String> {
    let mut said = vec![];
    let Some(Drawing::Timeline(timeline)) = record.timeline.as_ref().and_then(|plot| plot.drawing.as_ref()) else {
        return said;
    };
    if let Some(per_column) = timeline.stretches.first().map(|whole| whole.samples_per_column).filter(|n| *n > 1) {
        said.push(format!(
            "Each column of the drawing spans {per_column} samples, from the least value to the greatest. About the largest residual \
             of each output, samples are shown one by one as one zooms in."
        ));
    }
    for fit in record.fits.iter().filter(|fit| fit.unpredicted > 0) {
        said.push(format!("{} has no prediction in {} samples; they are gaps.", quoted(&fit.name), fit.unpredicted));
    }
    if !record.gaps.is_empty() {
        let after = |t: f64| rounded(t - record.begin, record.sample_time);
        let unit = unit_after(record.time_unit.name());
        let one = |(from, to): &(f64, f64)| format!("from {}{unit} to {}{unit}", after(*from), after(*to));
        let named: Vec<String> = record.gaps.iter().take(NAMED).map(one).collect();
        let more = match record.gaps.len().saturating_sub(NAMED) {
            0 => String::new(),
            more => format!("; {more} more"),
        };
        said.push(format!("Without samples, from the start: {}{more}.", named.join("; ")));
    }
    said
}
