//! How well the outputs are reproduced, over all records and record by record.

use crate::estimate::OutputEstimate;
use crate::numeral::{counted, exact, number, rounded, unit_after};
use crate::report::facts::{Facts, Record};
use crate::section::{Axis, Cell, Curves, Drawing, Layer, Plot, Section, Style, Table};

/// Records that a reader looks at; of more, those reproduced worst.
const SHOWN: usize = 50;
/// Outputs with a column of their own in the table of records.
const OUTPUTS: usize = 4;

pub(super) fn section(facts: &Facts) -> Section {
    let rows = facts.estimate.outputs.iter().map(|OutputEstimate { name, unit, fit: q }| {
        let fit = Cell::fit(q.fit_percent);
        let (rmse, sigma) = (Cell::number(q.rmse, 3), Cell::number(q.sigma, 3));
        [name.as_str().into(), fit, rmse, sigma, unit.as_str().into(), q.samples.into()]
    });
    let columns = ["output", "fit", "rms error", "noise", "unit", "samples"];
    let section = Section::new("outputs", "Outputs").table(Table::new("Fit and errors", columns).rows(rows));
    if facts.single() {
        return section;
    }
    section.table(records(facts)).plot(overview(facts))
}

fn worst(record: &Record) -> f64 {
    record.fits.iter().filter_map(|fit| fit.fit_percent).fold(f64::INFINITY, f64::min)
}

/// The records, the worst first.
fn records(facts: &Facts) -> Table {
    let outputs = facts.records.first().map_or(0, |record| record.fits.len());
    let named = facts.records.iter().take(1).flat_map(|record| &record.fits).take(OUTPUTS);
    let fits = named.map(|fit| format!("fit of {}", fit.name));
    let more = (outputs > OUTPUTS).then(|| "worst fit".to_owned());
    let length = ["samples", "duration"];
    let columns = ["record".to_owned()].into_iter().chain(fits).chain(more).chain(length.map(str::to_owned)).collect();
    let mut order: Vec<&Record> = facts.records.iter().collect();
    order.sort_by(|a, b| worst(a).total_cmp(&worst(b)));
    let row = |record: &&Record| {
        let fits = record.fits.iter().take(OUTPUTS).map(|fit| Cell::fit(fit.fit_percent));
        let more = (outputs > OUTPUTS).then(|| Cell::fit(Some(worst(record)).filter(|fit| fit.is_finite())));
        let duration = record.end - record.begin;
        let text = format!("{}{}", number(duration, 4), unit_after(record.time_unit.name()));
        let length = [record.samples.into(), Cell::Number { value: duration, text }];
        [record.name.as_str().into()].into_iter().chain(fits).chain(more).chain(length).collect::<Vec<_>>()
    };
    let table = Table { columns, ..Table::new("Records, the worst first", []) };
    table.rows(order.iter().map(row)).at_most(SHOWN)
}

/// The fit of each record, in their order.
fn overview(facts: &Facts) -> Option<Plot> {
    /// More points than these are not told apart.
    const POINTS: usize = 1000;
    let fits = facts.records.iter().enumerate().map(|(i, record)| ((i + 1) as f64, worst(record)));
    let points: Vec<(f64, f64)> = fits.filter(|(_, fit)| fit.is_finite()).collect();
    let step = points.len().div_ceil(POINTS).max(1);
    // Of those that share a point, the worst.
    let least = |chunk: &[(f64, f64)]| chunk.iter().copied().min_by(|a, b| a.1.total_cmp(&b.1));
    let points: Vec<(f64, f64)> = points.chunks(step).filter_map(least).collect();
    let several = facts.records.first().is_some_and(|record| record.fits.len() > 1);
    let name = if several { "fit of the worst output" } else { "fit" };
    let drawing = Curves {
        x: Axis::new("record, in the order of the fit", "").from(1.0),
        y: Axis::new(name, "%"),
        layers: vec![Layer::Dots { style: Style::Main, points }],
    };
    let title = "Fit of each record, in the order they were handed over";
    Some(Plot::of("records", "Fit of each record", title, Drawing::Curves(drawing)))
}

/// A record in one sentence.
pub(super) fn extent(record: &Record) -> String {
    let Record { samples, begin, end, sample_time, gaps, .. } = record;
    let unit = unit_after(record.time_unit.name());
    let gaps = match gaps.len() {
        0 => "no gap in time".to_owned(),
        count => format!("{} in time", counted(count as u64, "gap")),
    };
    let day = if record.time_unit.name() == "s" { date(*begin) } else { String::new() };
    let start = match begin {
        0.0 => String::new(),
        begin => format!(" from t = {}{unit}{day}", exact(*begin)),
    };
    let (duration, step) = (rounded(end - begin, *sample_time), number(*sample_time, 4));
    format!("{} over {duration}{unit}{start}, every {step}{unit}; {gaps}", counted(*samples, "sample"))
}

/// The day of a time that counts from 1970 (POSIX time), if it is in this half of the century.
fn date(time: f64) -> String {
    /// From 2001 to 2049.
    const LIKELY: core::ops::Range<f64> = 1e9..2.5e9;
    if !LIKELY.contains(&time) {
        return String::new();
    }
    let stamp = std::time::UNIX_EPOCH + std::time::Duration::from_secs_f64(time);
    let text = humantime::format_rfc3339_seconds(stamp).to_string();
    format!(" ({} UTC, if it counts from 1970)", text.trim_end_matches('Z').replace('T', " "))
}
