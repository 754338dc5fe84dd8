//! A report for a terminal.

use super::Report;
use super::trace::Trace;
use super::words::{self, Table};
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
    for warning in &report.warnings {
        page.painted(warning.severity, &format!("  {} ", words::sign(warning.severity)));
        page.line(&warning.text);
    }
    page.line("");
    page.table(&words::parameters(report));
    page.table(&words::outputs(report));
    for record in &report.records {
        page.line(&format!("{}: {}", record.name, words::extent(record)));
        words::unpredicted(record).iter().for_each(|text| page.line(&format!("  {text}")));
        for fit in &record.fits {
            if let Some(trace) = &fit.overview {
                let largest = format!("{} {}", number(fit.residuals.largest, 3), fit.unit);
                let at = number(fit.residuals.largest_at, 6);
                page.line(&format!("  |residual of {}|, largest {largest} at {at} s", fit.name));
                page.line(&format!("  {}", sparkline(trace)));
            }
        }
    }
    let strong = words::correlated(report);
    if !strong.is_empty() {
        page.line(&format!("\nstrongly correlated: {}", strong.join("; ")));
    }
    page.line("");
    for finding in report.findings.iter().filter(|finding| finding.severity > Severity::Usable) {
        page.painted(finding.severity, words::sign(finding.severity));
        page.line(&format!(" {}, {}: {}. {}", finding.about, finding.test, finding.result, finding.meaning));
    }
    page.table(&words::figures(report));
    page.table(&words::settings(report));
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
