//! A report for a terminal.

use super::Report;
use super::tables::{self, Table};
use super::trace::Trace;
use super::words;
use crate::estimate::number;
use crate::optimize::Severity;
use core::fmt::Write;

/// Cells of a sparkline.
const CELLS: usize = 60;

/// The report as text; with color by ANSI escapes (ECMA-48, 8.3.117) if wanted.
pub(super) fn page(report: &Report, color: bool) -> String {
    let mut page = Page { text: String::new(), color };
    page.line(&format!("{}\n", report.title));
    page.painted(report.severity, &format!("{} {}", words::sign(report.severity), words::verdict(report.severity)));
    page.line(&format!(". {}", words::search(report)));
    for (severity, text) in words::reasons(report) {
        page.painted(severity, &format!("  {} ", words::sign(severity)));
        page.line(&text);
    }
    page.line("");
    page.table(&tables::parameters(report));
    page.table(&tables::outputs(report));
    for record in &report.records {
        page.line(&format!("{}: {}", record.name, words::extent(record)));
        words::unpredicted(record).iter().for_each(|text| page.line(&format!("  {text}")));
        for fit in &record.fits {
            if let Some(trace) = &fit.overview {
                let largest = format!("{} {}", number(fit.largest, 3), fit.unit);
                let at = number(fit.largest_at, 6);
                page.line(&format!("  |residual of {}|, largest {largest} at {at} s", fit.name));
                page.line(&format!("  {}", sparkline(trace)));
            }
        }
    }
    page.section("\nwhat the data tell apart", [words::rank(report)]);
    page.items(report.identifiability.advice.iter());
    page.items(words::correlated(report).iter().map(|pair| format!("strongly correlated: {pair}")));
    page.line("");
    page.table(&tables::excitation(report));
    let failures = words::failures(report);
    if !failures.is_empty() {
        page.section("tests of the residuals that failed", []);
        page.items(failures.iter());
        page.line("");
    }
    if !report.profiles.is_empty() {
        page.table(&tables::profiles(report));
    }
    if let Some(found) = &report.bootstrap {
        page.section(&words::refits(found), []);
        page.table(&tables::bootstrap(found));
    }
    if let Some(found) = &report.restarts {
        page.section("restarts", [found.meaning.clone()]);
        page.line("");
    }
    for (about, of_it) in words::by_subject(report) {
        page.section(about, []);
        page.table(&tables::tests(of_it));
    }
    page.table(&tables::figures(report));
    page.table(&tables::settings(report));
    page.text.truncate(page.text.trim_end().len());
    page.text
}

struct Page {
    text: String,
    color: bool,
}

impl Page {
    fn line(&mut self, text: &str) {
        // A name must not move the cursor.
        let visible = |letter: char| if letter.is_control() && letter != '\n' { '\u{FFFD}' } else { letter };
        self.text.extend(text.trim_end_matches(' ').chars().map(visible).chain(['\n']));
    }

    fn section<const N: usize>(&mut self, title: &str, lines: [String; N]) {
        self.line(title);
        self.items(lines.iter());
    }

    fn items(&mut self, items: impl Iterator<Item = impl AsRef<str>>) {
        items.for_each(|item| self.line(&format!("  {}", item.as_ref())));
    }

    fn painted(&mut self, severity: Severity, text: &str) {
        let code = match severity {
            Severity::Usable => 32,
            Severity::UsableWithCare => 33,
            Severity::NotUsable => 31,
        };
        // Writing to a string does not fail.
        let _ = match self.color {
            true => write!(self.text, "\x1b[1;{code}m{text}\x1b[0m"),
            false => write!(self.text, "{text}"),
        };
    }

    /// The first column to the left, the others to the right.
    fn table(&mut self, table: &Table) {
        let header: Vec<String> = table.columns.iter().map(|name| (*name).to_owned()).collect();
        let rows = || [&header].into_iter().chain(&table.rows);
        let width = |column: usize| rows().map(|row| row[column].chars().count()).max().unwrap_or(0);
        let widths: Vec<usize> = (0..header.len()).map(width).collect();
        for row in rows() {
            let mut line = format!("{:<1$}", row[0], widths[0]);
            for (cell, width) in row.iter().zip(&widths).skip(1) {
                // Writing to a string does not fail.
                let _ = write!(line, "  {cell:>width$}");
            }
            self.line(&line);
        }
        self.line("");
    }
}

/// The largest residual in each cell, from none to the largest of all.
fn sparkline(trace: &Trace) -> String {
    const LEVELS: [char; 8] = ['▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];
    let ends = trace.residual.low.iter().zip(&trace.residual.high);
    let sizes: Vec<Option<f64>> = ends.map(|(low, high)| Some(low.as_ref()?.abs().max(high.as_ref()?.abs()))).collect();
    let largest = sizes.iter().flatten().copied().fold(0.0, f64::max);
    let cell = |sizes: &[Option<f64>]| match sizes.iter().flatten().copied().reduce(f64::max) {
        Some(size) if largest > 0.0 => LEVELS[((size / largest * 8.0) as usize).min(7)],
        Some(_) => LEVELS[0],
        None => ' ',
    };
    sizes.chunks(sizes.len().div_ceil(CELLS).max(1)).map(cell).collect()
}
