//! A report as one HTML page: verdict first, then what it rests on.

use super::chart::{PALETTE, STYLE, Size};
use super::markup::{Attributes, Markup};
use super::plots::{self, Plot};
use super::words::{self, Table};
use super::{OutputFit, Record, Report};
use crate::estimate::number;
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
                parameters(main, report);
                fits(main, report);
                identifiability(main, report);
                profiles(main, report);
                findings(main, report);
                data(main, report);
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
        if !report.warnings.is_empty() {
            header.node("ul", &[], |list| {
                for warning in &report.warnings {
                    list.node("li", &[("class", &class(warning.severity))], |item| sentence(item, &warning.text));
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

fn parameters(main: &mut Markup, report: &Report) {
    section(main, "Parameters", |section| {
        section.node("div", &[("class", &"pair")], |pair| {
            table(pair, "Parameters", "cards", &words::parameters(report));
            plots::parameters(report).iter().for_each(|plot| figure(pair, plot, "Intervals beside each other"));
        });
        table(section, "Outputs", "cards", &words::outputs(report));
    });
}

fn fits(main: &mut Markup, report: &Report) {
    let drawn = |fit: &&OutputFit| fit.overview.is_some();
    for record in report.records.iter().filter(|record| record.fits.iter().any(|fit| drawn(&fit))) {
        section(main, &format!("Measured and predicted: {}", record.name), |section| {
            for text in words::unpredicted(record) {
                section.node("p", &[], |p| sentence(p, &text));
            }
            record.fits.iter().filter(drawn).for_each(|fit| output(section, record, fit));
        });
    }
    let left = report.records.iter().filter(|record| record.fits.iter().all(|fit| !drawn(&fit))).count();
    if left > 0 {
        let text = format!("The {left} records that are reproduced better than these are not drawn.");
        main.words("p", &[("class", &"note")], text);
    }
}

fn output(section: &mut Markup, record: &Record, fit: &OutputFit) {
    section.node("article", &[], |article| {
        article.node("h3", &[], |h3| {
            h3.text(&fit.name);
            if let Some(percent) = fit.fit_percent {
                h3.words("small", &[], format_args!(" reproduced to {percent:.2} %"));
            }
        });
        article.node("div", &[("class", &"zoom")], |zoom| {
            zoom.node("p", &[("class", &"legend")], |legend| {
                for name in ["measured", "predicted", "residual"] {
                    legend.node("span", &[("class", &format_args!("key {name}"))], |key| key.text(name));
                }
            });
            plots::response(record, fit).iter().for_each(|plot| plot.draw(zoom, Size::Fluid));
            plots::residuals(record, fit).iter().for_each(|plot| plot.draw(zoom, Size::Fluid));
        });
        if let Some(trace) = &fit.overview
            && trace.samples_per_column > 1
        {
            let text = format!(
                "Each column of the drawing spans the least to the greatest of {} samples.",
                trace.samples_per_column
            );
            article.words("p", &[("class", &"note")], text);
        }
        article.node("div", &[("class", &"panels")], |panels| {
            let worst = format!(
                "About the largest residual, {} {} at {} s",
                number(fit.residuals.largest, 3),
                fit.unit,
                number(fit.residuals.largest_at, 6)
            );
            if let [Some(response), Some(residual)] = &plots::closeup(record, fit) {
                figure(panels, response, &worst);
                figure(panels, residual, "Residual there");
            }
            let spread = format!(
                "Residuals: mean {}, rms {} {}",
                number(fit.residuals.mean, 2),
                number(fit.residuals.rms, 3),
                fit.unit
            );
            plots::histogram(record, fit).iter().for_each(|plot| figure(panels, plot, &spread));
            let white =
                "Autocorrelation of the residuals; white ones stay between the dashed lines at 95 % of the lags";
            plots::autocorrelation(record, fit).iter().for_each(|plot| figure(panels, plot, white));
        });
    });
}

fn identifiability(main: &mut Markup, report: &Report) {
    section(main, "What the data tell apart", |section| {
        section.node("div", &[("class", &"pair")], |pair| {
            pair.node("div", &[], |column| {
                let together: Vec<String> =
                    report.directions.iter().map(|d| words::together(d, &report.unknowns) + ".").collect();
                match together.is_empty() {
                    true => column.words("p", &[], "Every estimated quantity has an influence of its own."),
                    false => list(column, &together),
                }
                let strong = words::correlated(report);
                match strong.is_empty() {
                    true => column.words("p", &[], "No two estimates are correlated by more than 0.95."),
                    false => {
                        column.words("p", &[], "Strongly correlated estimates, known better together than alone:");
                        list(column, &strong);
                    }
                }
            });
            plots::correlation(report).iter().for_each(|plot| figure(pair, plot, "Correlation of the estimates"));
        });
    });
}

fn profiles(main: &mut Markup, report: &Report) {
    if report.profiles.is_empty() {
        return;
    }
    section(main, "Profiles", |section| {
        let text = "Each curve tells how much worse the fit gets as one parameter is moved and the others are estimated \
                    anew. Where it crosses the dashed line the interval ends; where it never does, the data set no end.";
        section.words("p", &[], text);
        section.node("div", &[("class", &"panels")], |panels| {
            report.profiles.iter().for_each(|profile| figure(panels, &plots::profile(profile), &profile.name));
        });
    });
}

fn findings(main: &mut Markup, report: &Report) {
    if !report.findings.is_empty() {
        section(main, "Tests", |section| table(section, "What tests found", "cards", &words::findings(report)));
    }
}

fn data(main: &mut Markup, report: &Report) {
    section(main, "Data", |section| {
        for record in &report.records {
            section.words("h3", &[], &record.name);
            section.words("p", &[], words::extent(record));
            table(section, &format!("Signals of {}", record.name), "", &words::signals(record));
        }
    });
}

fn reproduce(main: &mut Markup, report: &Report) {
    section(main, "To reproduce", |section| {
        table(section, "What was declared of the parameters", "", &words::declared(report));
        section.node("div", &[("class", &"pair")], |pair| {
            table(pair, "Settings", "", &words::settings(report));
            table(pair, "Figures", "", &words::figures(report));
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
        figure.words("figcaption", &[], caption);
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
                        row.words("th", &[("scope", &"col"), ("role", &"columnheader")], name);
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
        if name { to.words("code", &[], piece) } else { to.text(piece) }
    }
}
