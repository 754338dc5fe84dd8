//! A report as Markdown (GitHub's flavor, for its tables).

use super::Report;
use super::words::{self, Table};

pub(super) fn page(report: &Report) -> String {
    let mut lines = vec![format!("# {}", escaped(&report.title)), String::new()];
    let verdict = words::verdict(report.severity);
    lines.push(format!("**{} {verdict}.** {}", words::sign(report.severity), sentence(&words::search(report))));
    lines.push(String::new());
    lines.extend(report.warnings.iter().map(|warning| format!("- {}", sentence(&warning.text))));
    heading(&mut lines, "Parameters");
    table(&mut lines, &words::parameters(report));
    heading(&mut lines, "Outputs");
    table(&mut lines, &words::outputs(report));
    let strong = words::correlated(report);
    if !strong.is_empty() {
        heading(&mut lines, "Strongly correlated estimates");
        lines.extend(strong.iter().map(|pair| format!("- {}", sentence(pair))));
    }
    if !report.findings.is_empty() {
        heading(&mut lines, "Tests");
        table(&mut lines, &words::findings(report));
    }
    heading(&mut lines, "Data");
    for record in &report.records {
        lines.push(format!("**{}**: {}", escaped(&record.name), escaped(&words::extent(record))));
        lines.extend(words::unpredicted(record).iter().map(|text| format!("- {}", sentence(text))));
        lines.push(String::new());
        table(&mut lines, &words::signals(record));
        lines.push(String::new());
    }
    heading(&mut lines, "To reproduce");
    table(&mut lines, &words::declared(report));
    lines.push(String::new());
    table(&mut lines, &words::settings(report));
    lines.push(String::new());
    table(&mut lines, &words::figures(report));
    lines.push(String::new());
    lines.join("\n")
}

fn heading(lines: &mut Vec<String>, text: &str) {
    lines.extend([String::new(), format!("## {text}"), String::new()]);
}

fn table(lines: &mut Vec<String>, table: &Table) {
    let line = |cells: Vec<String>| format!("| {} |", cells.join(" | "));
    lines.push(line(table.columns.iter().map(|name| escaped(name)).collect()));
    let rule = table.columns.iter().enumerate().map(|(i, _)| if i == 0 { ":--" } else { "--:" }.to_owned());
    lines.push(line(rule.collect()));
    lines.extend(table.rows.iter().map(|row| line(row.iter().map(|cell| escaped(cell)).collect())));
}

/// A sentence with names as code.
fn sentence(text: &str) -> String {
    words::pieces(text).map(|(name, piece)| if name { code(piece) } else { escaped(piece) }).collect()
}

fn code(text: &str) -> String {
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
