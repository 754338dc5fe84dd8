//! A report as Markdown (GitHub's flavor, for its tables).

use super::{Report, words};
use crate::section::{Section, Table};

pub(super) fn page(report: &Report) -> String {
    let mut lines = vec![format!("# {}", escaped(&report.title)), String::new()];
    let verdict = words::verdict(report.severity);
    lines.push(format!("**{} {verdict}.** {}", words::sign(report.severity), sentence(&words::search(report))));
    lines.push(String::new());
    for (severity, text) in report.reasons() {
        lines.push(format!("- {} {}", words::sign_of_reason(severity), sentence(text)));
    }
    report.sections.iter().for_each(|part| section(&mut lines, part, 2));
    lines.push(String::new());
    lines.join("\n")
}

fn section(lines: &mut Vec<String>, part: &Section, depth: usize) {
    if part.sentences.is_empty() && part.tables.is_empty() && part.parts.is_empty() {
        return;
    }
    lines.extend([String::new(), format!("{} {}", "#".repeat(depth.min(6)), escaped(&part.title))]);
    part.sentences.iter().for_each(|text| lines.extend([String::new(), sentence(text)]));
    for one in &part.tables {
        if part.tables.len() > 1 {
            lines.extend([String::new(), format!("**{}**", escaped(&one.caption))]);
        }
        lines.push(String::new());
        table(lines, one);
    }
    part.parts.iter().for_each(|part| section(lines, part, depth + 1));
}

fn table(lines: &mut Vec<String>, table: &Table) {
    let line = |cells: Vec<String>| format!("| {} |", cells.join(" | "));
    lines.push(line(table.columns.iter().map(|name| escaped(name)).collect()));
    let rule = |i: usize| if i == 0 || table.is_prose(i) { ":--" } else { "--:" }.to_owned();
    lines.push(line((0..table.columns.len()).map(rule).collect()));
    let cell =
        |row: &Vec<crate::section::Cell>, i: usize| row.get(i).map_or(String::new(), |cell| escaped(cell.text()));
    lines.extend(table.rows.iter().map(|row| line((0..table.columns.len()).map(|i| cell(row, i)).collect())));
    lines.extend(table.remainder().into_iter().flat_map(|more| [String::new(), more]));
}

/// A sentence with names as code.
fn sentence(text: &str) -> String {
    words::pieces(text).map(|(name, piece)| if name { code(piece) } else { escaped(piece) }).collect()
}

fn code(text: &str) -> String {
    // Not every reader of Markdown keeps markup out of code.
    if text.contains('<') {
        return escaped(text);
    }
    let text: String = text.chars().map(|letter| if letter.is_control() { ' ' } else { letter }).collect();
    format!("`{text}`")
}

/// Text that means itself: no markup, no HTML, no end of the row.
fn escaped(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for letter in text.chars() {
        match letter {
            '\\' | '`' | '*' | '_' | '[' | ']' | '|' | '#' | '~' => escaped.extend(['\\', letter]),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '&' => escaped.push_str("&amp;"),
            letter if letter.is_control() => escaped.push(' '),
            letter => escaped.push(letter),
        }
    }
    escaped
}
