//! A report as Markdown (GitHub's flavor, for its tables).

use super::Report;
use super::tables::{self, Table};
use super::words;

pub(super) fn page(report: &Report) -> String {
    let mut lines = vec![format!("# {}", escaped(&report.title)), String::new()];
    let verdict = words::verdict(report.severity);
    lines.push(format!("**{} {verdict}.** {}", words::sign(report.severity), sentence(&words::search(report))));
    lines.push(String::new());
    items(&mut lines, words::reasons(report).iter().map(|(_, text)| text));
    heading(&mut lines, "Parameters");
    table(&mut lines, &tables::parameters(report));
    heading(&mut lines, "Outputs");
    table(&mut lines, &tables::outputs(report));
    heading(&mut lines, "What the data tell apart");
    items(&mut lines, [&words::rank(report)].into_iter().chain(&report.identifiability.advice));
    items(&mut lines, words::correlated(report).iter().map(|pair| format!("strongly correlated: {pair}")));
    lines.push(String::new());
    table(&mut lines, &tables::excitation(report));
    let failures = words::failures(report);
    if !failures.is_empty() {
        heading(&mut lines, "Tests of the residuals that failed");
        items(&mut lines, failures.iter());
    }
    if !report.profiles.is_empty() {
        heading(&mut lines, "Profiles");
        table(&mut lines, &tables::profiles(report));
    }
    if let Some(found) = &report.bootstrap {
        heading(&mut lines, &words::refits(found));
        table(&mut lines, &tables::bootstrap(found));
    }
    if let Some(found) = &report.restarts {
        heading(&mut lines, "Restarts");
        lines.push(sentence(&found.meaning));
    }
    if !report.findings.is_empty() {
        heading(&mut lines, "Further tests");
        for (about, of_it) in words::by_subject(report) {
            lines.push(format!("**{}**\n", escaped(about)));
            table(&mut lines, &tables::tests(of_it));
            lines.push(String::new());
        }
    }
    heading(&mut lines, "Data");
    for record in &report.records {
        lines.push(format!("**{}**: {}", escaped(&record.name), escaped(&words::extent(record))));
        items(&mut lines, words::unpredicted(record).iter());
        lines.push(String::new());
        table(&mut lines, &tables::signals(record));
        lines.push(String::new());
    }
    heading(&mut lines, "To reproduce");
    table(&mut lines, &tables::declared(report));
    lines.push(String::new());
    table(&mut lines, &tables::settings(report));
    lines.push(String::new());
    table(&mut lines, &tables::figures(report));
    lines.push(String::new());
    lines.join("\n")
}

fn items(lines: &mut Vec<String>, texts: impl Iterator<Item = impl AsRef<str>>) {
    lines.extend(texts.map(|text| format!("- {}", sentence(text.as_ref()))));
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
