//! A report as one HTML page: verdict first, then what it rests on.

mod records;
mod unknowns;

use super::Report;
use super::chart::{PALETTE, STYLE, Size};
use super::markup::{Attributes, Markup};
use super::plots::Plot;
use super::tables::{self, Table};
use super::words;
use crate::optimize::Severity;
use core::fmt::Display;

/// Nothing is fetched, and nothing runs but what stands in the page.
const POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; base-uri 'none'; \
                      form-action 'none'";

pub(super) fn page(report: &Report) -> String {
    let mut page = Markup::default();
    page.verbatim("<!DOCTYPE html>\n");
    page.node("html", &[("lang", &"en")], |html| {
        html.node("head", &[], |head| {
            head.leaf("meta", &[("charset", &"utf-8")]);
            head.leaf("meta", &[("name", &"viewport"), ("content", &"width=device-width, initial-scale=1")]);
            head.leaf("meta", &[("http-equiv", &"Content-Security-Policy"), ("content", &POLICY)]);
            head.words("title", &[], &report.title);
            head.node("style", &[], |style| {
                style.verbatim(&theme());
                style.verbatim(STYLE);
                style.verbatim(include_str!("html/page.css"));
            });
        });
        html.node("body", &[], |body| {
            verdict(body, report);
            body.node("main", &[], |main| {
                unknowns::parameters(main, report);
                records::fits(main, report);
                unknowns::identifiability(main, report);
                unknowns::profiles(main, report);
                unknowns::refits(main, report);
                findings(main, report);
                records::data(main, report);
                reproduce(main, report);
            });
            body.words("footer", &[], format_args!("Made by greybox {}", report.method.version));
            body.node("script", &[], |script| script.verbatim(include_str!("html/zoom.js")));
        });
    });
    page.finish()
}

/// The colors of both themes, as variables; paper is light.
fn theme() -> String {
    let colors = |pick: fn(&(&str, &'static str, &'static str)) -> &'static str| {
        PALETTE.iter().map(|color| format!("--{}:{};", color.0, pick(color))).collect::<String>()
    };
    let (light, dark) = (colors(|color| color.1), colors(|color| color.2));
    format!(
        ":root{{color-scheme:light dark;{light}}}\n@media screen and (prefers-color-scheme:dark){{:root{{{dark}}}}}\n"
    )
}

fn verdict(body: &mut Markup, report: &Report) {
    body.node("header", &[("class", &class(report.severity))], |header| {
        header.words("h1", &[], &report.title);
        header.node("p", &[("class", &"verdict")], |p| {
            p.words("span", &[("class", &"sign"), ("aria-hidden", &"true")], words::sign(report.severity));
            p.text(words::verdict(report.severity));
        });
        header.node("p", &[], |p| sentence(p, &words::search(report)));
        let reasons = words::reasons(report);
        if !reasons.is_empty() {
            header.node("ul", &[], |list| {
                for (severity, text) in &reasons {
                    list.node("li", &[("class", &class(*severity))], |item| sentence(item, text));
                }
            });
        }
    });
}

fn class(severity: Severity) -> &'static str {
    match severity {
        Severity::Usable => "good",
        Severity::UsableWithCare => "care",
        Severity::NotUsable => "bad",
    }
}

fn findings(main: &mut Markup, report: &Report) {
    if !report.findings.is_empty() {
        section(main, "Further tests", |section| {
            for (about, of_it) in words::by_subject(report) {
                table(section, about, "cards", &tables::tests(of_it));
            }
        });
    }
}

fn reproduce(main: &mut Markup, report: &Report) {
    section(main, "To reproduce", |section| {
        table(section, "What was declared of the parameters", "", &tables::declared(report));
        section.node("div", &[("class", &"pair")], |pair| {
            table(pair, "Settings", "", &tables::settings(report));
            table(pair, "Figures", "", &tables::figures(report));
        });
    });
}

fn section(main: &mut Markup, title: &str, content: impl FnOnce(&mut Markup)) {
    main.node("section", &[], |section| {
        section.words("h2", &[], title);
        content(section);
    });
}

fn figure(to: &mut Markup, plot: &Plot<'_>, caption: &str) {
    to.node("figure", &[], |figure| {
        figure.words("figcaption", &[], typeset(caption));
        plot.draw(figure, Size::Fluid);
    });
}

/// A table that scrolls where the screen is too narrow, or whose rows become cards there.
fn table(to: &mut Markup, caption: &str, kind: &str, table: &Table) {
    let cards: Attributes<'_> = &[("class", &"cards")];
    let scroll: Attributes<'_> =
        &[("class", &"scroll"), ("tabindex", &"0"), ("role", &"group"), ("aria-label", &caption)];
    to.node("div", if kind == "cards" { cards } else { scroll }, |around| {
        around.node("table", &[("role", &"table")], |node| {
            node.words("caption", &[], caption);
            node.node("thead", &[("role", &"rowgroup")], |head| {
                head.node("tr", &[("role", &"row")], |row| {
                    for name in table.columns {
                        let attributes: Attributes<'_> =
                            &[("scope", &"col"), ("role", &"columnheader"), ("data-name", name)];
                        row.words("th", attributes, name);
                    }
                });
            });
            node.node("tbody", &[("role", &"rowgroup")], |body| {
                for cells in &table.rows {
                    body.node("tr", &[("role", &"row")], |row| cells_of(row, table.columns, cells));
                }
            });
        });
    });
}

/// Roles are said, for a table that is laid out as cards is none to a browser any more.
fn cells_of(row: &mut Markup, columns: &[&str], cells: &[String]) {
    for (i, (name, cell)) in columns.iter().zip(cells).enumerate() {
        match i {
            0 => row.words("th", &[("scope", &"row"), ("role", &"rowheader")], cell),
            _ => {
                let mut attributes: Vec<(&str, &dyn Display)> = vec![("role", &"cell"), ("data-name", name)];
                if cell.is_empty() {
                    attributes.push(("class", &"empty"));
                }
                row.words("td", &attributes, cell);
            }
        }
    }
}

fn list(to: &mut Markup, items: &[String]) {
    to.node("ul", &[], |list| {
        items.iter().for_each(|item| list.node("li", &[], |node| sentence(node, item)));
    });
}

/// A sentence with names as code.
fn sentence(to: &mut Markup, text: &str) {
    for (name, piece) in words::pieces(text) {
        if name { to.words("code", &[], piece) } else { to.text(typeset(piece)) }
    }
}

/// A minus that does not part from its number at the end of a line. Tables keep the plain one, for those who copy numbers.
fn typeset(text: &str) -> String {
    let mut typeset = String::with_capacity(text.len());
    let mut letters = text.chars().peekable();
    while let Some(letter) = letters.next() {
        let before_digit = letters.peek().is_some_and(char::is_ascii_digit);
        typeset.push(if letter == '-' && before_digit { '−' } else { letter });
    }
    typeset
}
