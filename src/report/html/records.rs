//! The records on the page: measured and predicted, what is left, and what it was tested for.

use super::super::chart::Size;
use super::super::markup::Markup;
use super::super::{OutputFit, Record, Report, plots, tables, words};
use super::{figure, section, sentence, table};
use crate::diagnose::residuals::Residuals;
use crate::estimate::number;

pub(super) fn fits(main: &mut Markup, report: &Report) {
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
                let banded = fit.overview.as_ref().is_some_and(|trace| !trace.prediction.low.is_empty());
                let keys = [("measured", "measured"), ("predicted", "predicted"), ("residual", "residual")];
                let bands = [("prediction", "holds 95 % of measurements"), ("confidence", "95 % of the model alone")];
                for (class, name) in keys.iter().chain(bands.iter().filter(|_| banded)) {
                    legend.words("span", &[("class", &format_args!("key {class}"))], name);
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
        article.node("div", &[("class", &"panels")], |panels| panels_of(panels, record, fit));
        against_signals(article, record, fit);
        let tests = &fit.residuals.tests;
        if tests.is_empty() {
            let text = "The residuals are too few, or do not vary: they were not tested.";
            return article.words("p", &[("class", &"note")], text);
        }
        table(article, &format!("Tests of the residual of {}", fit.name), "cards", &tables::tests(tests));
        outliers(article, fit);
    });
}

fn panels_of(panels: &mut Markup, record: &Record, fit: &OutputFit) {
    let worst = format!(
        "About the largest residual, {} {} at {} s",
        number(fit.largest, 3),
        fit.unit,
        number(fit.largest_at, 6)
    );
    if let [Some(response), Some(residual)] = &plots::closeup(record, fit) {
        figure(panels, response, &worst);
        figure(panels, residual, "Residual there");
    }
    let (mean, deviation) = (fit.residuals.mean, fit.residuals.standard_deviation);
    let spread = format!(
        "Residuals: mean {}, standard deviation {} {}; the line is a normal distribution",
        number(mean, 2),
        number(deviation, 3),
        fit.unit
    );
    plots::histogram(record, fit).iter().for_each(|plot| figure(panels, plot, &spread));
    let white = "Autocorrelation of the residuals; white ones stay between the dashed lines at 99 % of the lags";
    plots::autocorrelation(record, fit).iter().for_each(|plot| figure(panels, plot, white));
}

/// Behind a line to open: many small pictures, for who looks for a cause.
fn against_signals(article: &mut Markup, record: &Record, fit: &OutputFit) {
    let plots = plots::against_signals(record, fit);
    if plots.is_empty() {
        return;
    }
    article.node("details", &[], |details| {
        details.words("summary", &[], format_args!("The residual of {} against each signal", fit.name));
        details.node("div", &[("class", &"panels")], |panels| {
            plots.iter().for_each(|plot| figure(panels, plot, plot.title()));
        });
    });
}

fn outliers(article: &mut Markup, fit: &OutputFit) {
    const NAMED: usize = 5;
    let Residuals { outliers, outlier_count, unit, .. } = &fit.residuals;
    if outliers.is_empty() {
        return;
    }
    let named = outliers.iter().take(NAMED).map(|outlier| {
        let (residual, time) = (number(outlier.residual, 3), number(outlier.time, 6));
        format!("{residual} {unit} at {time} s (sample {})", outlier.sample)
    });
    let named: Vec<String> = named.collect();
    let text = match *outlier_count {
        1 => format!("One residual is further out than a normal distribution allows: {}.", named.join("")),
        count => format!(
            "{count} residuals are further out than a normal distribution allows, furthest {}.",
            named.join("; ")
        ),
    };
    article.node("p", &[], |p| sentence(p, &text));
}

pub(super) fn data(main: &mut Markup, report: &Report) {
    section(main, "Data", |section| {
        for record in &report.records {
            section.words("h3", &[], &record.name);
            section.words("p", &[], words::extent(record));
            table(section, &format!("Signals of {}", record.name), "", &tables::signals(record));
        }
    });
}
