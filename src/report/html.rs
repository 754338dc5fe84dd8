//! A report as one HTML page: verdict first, then what it rests on.

mod prose;
mod signals;
mod table;
mod terms;

use super::chart::{self, COLUMNS, PALETTE, STYLE, Size};
use super::markup::{Attributes, Markup};
use super::{Report, words};
use crate::section::{Drawing, Plot, Section, Table};
use crate::severity::Severity;
use core::fmt::Display;
use prose::Prose;

/// Nothing is fetched, and nothing runs but what stands in the page.
const POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; base-uri 'none'; \
                      form-action 'none'";
/// The scripts of the page, each in a scope of its own.
const SCRIPTS: [&str; 4] = [
    include_str!("html/axis.js"),
    include_str!("html/timeline.js"),
    include_str!("html/zoom.js"),
    include_str!("html/terms.js"),
];

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
            let mut prose = Prose::new(sizes(report));
            verdict(body, report, &mut prose);
            contents(body, report);
            body.node("main", &[], |main| {
                report.sections.iter().for_each(|part| section(main, part, 2, &mut prose));
            });
            body.words("footer", &[], format_args!("Made by greybox {}", report.estimate.method.version));
            prose.explanations(body);
            body.node("script", &[], |script| {
                script.verbatim("\"use strict\";\n{\n");
                SCRIPTS.iter().for_each(|text| script.verbatim(text));
                script.verbatim("}\n");
            });
        });
    });
    page.finish()
}

/// How finely signals are drawn before anyone zooms, of what is open at first and of what is closed: the more of them, the
/// less so. What is opened is drawn anew.
fn sizes(report: &Report) -> [Size; 2] {
    /// Columns of all lines together, some 26 bytes each, and the fewest of one.
    const ALL: usize = 10_000;
    const FEWEST: usize = 60;
    let counted = report.sections.iter().map(|section| lines(section, false));
    let [open, closed] = counted.fold([0, 0], |sum, lines| [sum[0] + lines[0], sum[1] + lines[1]]);
    [open, closed].map(|lines| Size::Fluid((ALL / lines.max(1)).clamp(FEWEST, COLUMNS)))
}

/// Lines over time that are open at first, and those that are closed.
fn lines(section: &Section, within_closed: bool) -> [usize; 2] {
    let closed = within_closed || section.folded;
    let of_plot = |plot: &Plot| match &plot.drawing {
        Some(Drawing::Timeline(timeline)) => timeline.lines().count(),
        _ => 0,
    };
    let mut found = [0, 0];
    found[usize::from(closed)] = section.plots.iter().map(of_plot).sum();
    let parts = section.parts.iter().map(|part| lines(part, closed));
    parts.fold(found, |sum, lines| [sum[0] + lines[0], sum[1] + lines[1]])
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

fn verdict(body: &mut Markup, report: &Report, prose: &mut Prose) {
    body.node("header", &[("class", &class(report.severity))], |header| {
        header.words("h1", &[], &report.title);
        header.node("p", &[("class", &"verdict")], |p| {
            p.words("span", &[("class", &"sign"), ("aria-hidden", &"true")], words::sign(report.severity));
            p.text(words::verdict(report.severity));
        });
        header.node("p", &[], |p| prose.sentence(p, &words::search(report)));
        let reasons = report.reasons();
        if !reasons.is_empty() {
            header.node("ul", &[("class", &"reasons")], |list| {
                for (severity, text) in reasons {
                    list.node("li", &[("class", &class(severity))], |item| prose.sentence(item, text));
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

/// Links to the sections that are open.
fn contents(body: &mut Markup, report: &Report) {
    const LINKS: usize = 16;
    let linked = report.sections.iter().filter(|section| !section.is_empty() && !section.folded);
    body.node("nav", &[("aria-label", &"Sections")], |nav| {
        nav.node("ul", &[], |list| {
            for section in linked.take(LINKS) {
                list.node("li", &[], |item| {
                    item.words("a", &[("href", &format_args!("#{}", section.id))], &section.title);
                });
            }
        });
    });
}

/// A section, its heading of this level; those within are articles, and details are closed.
fn section(to: &mut Markup, section: &Section, level: usize, prose: &mut Prose) {
    if section.is_empty() {
        return;
    }
    prose.begin();
    let tag = if level == 2 { "section" } else { "article" };
    let heading = format!("h{}", level.min(6));
    to.node(tag, &[("id", &section.id)], |to| {
        if section.folded {
            to.node("details", &[], |details| {
                details.node("summary", &[], |summary| {
                    summary.node(&heading, &[], |node| title(node, section));
                });
                prose.closed += 1;
                content(details, section, level, prose);
                prose.closed -= 1;
            });
        } else {
            to.node(&heading, &[], |node| title(node, section));
            content(to, section, level, prose);
        }
    });
}

/// The title, and a sign where the section is a reason not to use the estimate as it is.
fn title(to: &mut Markup, section: &Section) {
    to.text(&section.title);
    if section.severity > Severity::Usable {
        let class = format!("mark {}", class(section.severity));
        let attributes: [(&str, &dyn Display); 4] = [
            ("class", &class),
            ("role", &"img"),
            ("aria-label", &"named in the verdict"),
            ("title", &"named in the verdict"),
        ];
        to.words("span", &attributes, words::sign(section.severity));
    }
}

fn content(to: &mut Markup, section: &Section, level: usize, prose: &mut Prose) {
    let wide = |plot: &&Plot| matches!(plot.drawing, Some(Drawing::Timeline(_)));
    let (timelines, small): (Vec<&Plot>, Vec<&Plot>) =
        section.plots.iter().filter(|plot| plot.drawing.is_some()).partition(wide);
    paragraphs(to, section, prose);
    match (section.tables.as_slice(), small.as_slice()) {
        ([first, rest @ ..], [plot]) => {
            beside(to, first, plot, prose);
            rest.iter().for_each(|other| table::draw(to, other, prose));
        }
        // Tables and plots of one number stand beside each other.
        (tables, plots) if tables.len() == plots.len() && tables.len() < 4 => {
            for (one, plot) in tables.iter().zip(plots) {
                beside(to, one, plot, prose);
            }
        }
        (tables, plots) => {
            tables.iter().for_each(|one| table::draw(to, one, prose));
            if !plots.is_empty() {
                let panels: Attributes<'_> = &[("class", &"panels")];
                to.node("div", panels, |panels| plots.iter().for_each(|plot| figure(panels, plot, prose)));
            }
        }
    }
    timelines.iter().for_each(|plot| figure(to, plot, prose));
    section.parts.iter().for_each(|part| self::section(to, part, level + 1, prose));
}

/// A table and a plot that show the same.
fn beside(to: &mut Markup, table: &Table, plot: &Plot, prose: &mut Prose) {
    to.node("div", &[("class", &"pair table-first")], |pair| {
        table::draw(pair, table, prose);
        figure(pair, plot, prose);
    });
}

/// Each sentence is a paragraph.
fn paragraphs(to: &mut Markup, section: &Section, prose: &mut Prose) {
    section.sentences.iter().for_each(|text| to.node("p", &[], |p| prose.sentence(p, text)));
}

fn figure(to: &mut Markup, plot: &Plot, prose: &mut Prose) {
    to.node("figure", &[], |figure| {
        if !plot.caption.is_empty() {
            figure.node("figcaption", &[], |caption| prose.sentence(caption, &plot.caption));
        }
        match &plot.drawing {
            Some(Drawing::Timeline(timeline)) => signals::draw(figure, plot, timeline, prose.size()),
            _ => chart::draw(plot, figure, prose.size()),
        }
    });
}
