//! A report for a terminal of 80 columns.

use super::{Report, words};
use crate::section::{Drawing, PanelKind, Section, Timeline, Trace, visible, wrapped};
use crate::severity::Severity;
use core::fmt::Write;

/// Cells of a sparkline.
const CELLS: usize = 60;

/// The report as text; with color by ANSI escapes (ECMA-48, 8.3.117) if wanted.
pub(super) fn page(report: &Report, color: bool) -> String {
    let mut page = Page { text: String::new(), color };
    page.paragraph(&report.title, 0);
    page.text.push('\n');
    let verdict = format!("{} {}.", words::sign(report.severity), words::verdict(report.severity));
    page.painted(report.severity, &verdict, &words::search(report), 0);
    for (severity, text) in report.reasons() {
        page.painted(severity, words::sign_of_reason(severity), text, 2);
    }
    report.sections.iter().filter(|section| !section.folded).for_each(|section| page.section(section, 0));
    page.left_out(&report.sections);
    page.text.truncate(page.text.trim_end().len());
    page.text
}

struct Page {
    text: String,
    color: bool,
}

impl Page {
    /// A paragraph, all of it indented.
    fn paragraph(&mut self, text: &str, indent: usize) {
        self.text.extend(core::iter::repeat_n(' ', indent));
        self.text += &wrapped(&visible(text), indent, indent);
        self.text.push('\n');
    }

    /// A sentence after a colored sign.
    fn painted(&mut self, severity: Severity, sign: &str, text: &str, indent: usize) {
        let begin = indent + sign.chars().count() + 1;
        let color = match severity {
            Severity::Usable => 32,
            Severity::UsableWithCare => 33,
            Severity::NotUsable => 31,
        };
        let text = wrapped(&visible(text), begin, indent + 2);
        // Writing to a string does not fail.
        let _ = match self.color {
            true => writeln!(self.text, "{:indent$}\x1b[1;{color}m{sign}\x1b[0m {text}", ""),
            false => writeln!(self.text, "{:indent$}{sign} {text}", ""),
        };
    }

    fn section(&mut self, section: &Section, depth: usize) {
        let mut lines = vec![];
        for plot in &section.plots {
            if let Some(Drawing::Timeline(timeline)) = plot.drawing.as_ref().filter(|_| depth == 0) {
                lines.extend(sparklines(timeline));
            }
        }
        if section.sentences.is_empty() && section.tables.is_empty() && section.parts.is_empty() && lines.is_empty() {
            return;
        }
        self.text.push('\n');
        let title = visible(&section.title);
        let rule = if depth == 0 { "=" } else { "-" }.repeat(title.chars().count().min(crate::section::WIDTH));
        self.paragraph(&title, 0);
        self.paragraph(&rule, 0);
        section.sentences.iter().for_each(|text| self.paragraph(text, 0));
        lines.iter().for_each(|line| self.text += line);
        for (i, table) in section.tables.iter().enumerate() {
            if i > 0 || !section.sentences.is_empty() || !lines.is_empty() {
                self.text.push('\n');
            }
            if section.tables.len() > 1 {
                self.paragraph(&table.caption, 0);
            }
            // Writing to a string does not fail.
            let _ = writeln!(self.text, "{table}");
        }
        section.parts.iter().filter(|part| !part.folded).for_each(|part| self.section(part, depth + 1));
        self.left_out(&section.parts);
    }

    /// Names the details that only the other forms of the report show.
    fn left_out(&mut self, parts: &[Section]) {
        const NAMED: usize = 3;
        let folded: Vec<&str> = parts.iter().filter(|part| part.folded).map(|part| part.title.as_str()).collect();
        let more = match folded.len().saturating_sub(NAMED) {
            0 => String::new(),
            more => format!("; {more} more"),
        };
        if !folded.is_empty() {
            let named = folded[..folded.len().min(NAMED)].join("; ");
            self.paragraph(&format!("(not shown here: {named}{more})"), 0);
        }
    }
}

/// The size of each residual over time.
fn sparklines(timeline: &Timeline) -> Vec<String> {
    let Some(whole) = timeline.stretches.first() else { return vec![] };
    let residuals = timeline.lines().zip(&whole.traces).filter(|((panel, _), _)| panel.kind == PanelKind::Residual);
    let line = |((panel, _), trace): ((&crate::section::Panel, _), &Trace)| {
        format!("size of the {}\n  {}\n", visible(&panel.name), sparkline(trace))
    };
    residuals.map(line).collect()
}

/// The largest value in each cell, from none to the largest of all.
fn sparkline(trace: &Trace) -> String {
    const LEVELS: [char; 8] = ['▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];
    let size = |column: Option<(f64, f64)>| column.map(|(low, high)| low.abs().max(high.abs()));
    let sizes: Vec<Option<f64>> = trace.extremes().map(size).collect();
    let largest = sizes.iter().flatten().copied().fold(0.0, f64::max);
    let cell = |sizes: &[Option<f64>]| match sizes.iter().flatten().copied().reduce(f64::max) {
        Some(size) if largest > 0.0 => LEVELS[((size / largest * 8.0) as usize).min(7)],
        Some(_) => LEVELS[0],
        None => ' ',
    };
    sizes.chunks(sizes.len().div_ceil(CELLS).max(1)).map(cell).collect()
}
