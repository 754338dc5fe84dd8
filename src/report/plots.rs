//! [`Plot`]: the pictures of a report, for its page and as files.

use super::chart::{Axis, Curves, Forest, ForestRow, Heat, Layer, Size};
use super::markup::Markup;
use super::trace::Trace;
use super::{OutputFit, ProfileCurve, Record, Report, file};
use crate::error::Error;
use crate::estimate::{Knowledge, Unknown};
use std::path::Path;

/// A picture of a report.
///
/// [`save`](Plot::save) writes it as an SVG file of its own, on white; the page draws it by the same code.
#[derive(Clone, Debug)]
pub struct Plot<'a> {
    name: String,
    title: String,
    drawing: Drawing<'a>,
}

#[derive(Clone, Debug)]
enum Drawing<'a> {
    Curves(Curves<'a>),
    Forest(Forest),
    Heat(Heat<'a>),
}

/// Width of a picture in a file of its own (px).
const WIDTH: f64 = 960.0;

impl Plot<'_> {
    /// A name made of letters, digits and `-`, fit for a file.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// What it shows, in one sentence.
    pub fn title(&self) -> &str {
        &self.title
    }

    /// The picture as an SVG document.
    pub fn to_svg(&self) -> String {
        let mut svg = Markup::default();
        self.draw(&mut svg, Size::Fixed(WIDTH));
        svg.finish()
    }

    /// Writes the picture as an SVG file; beside first and then renamed, so that there is never half a file.
    ///
    /// # Errors
    /// A path that cannot be written to; nothing is left behind.
    pub fn save(&self, path: impl AsRef<Path>) -> Result<(), Error> {
        file::write(path.as_ref(), self.to_svg().as_bytes())
    }

    pub(super) fn draw(&self, to: &mut Markup, size: Size) {
        match &self.drawing {
            Drawing::Curves(curves) => curves.draw(to, size, &self.title),
            Drawing::Forest(forest) => forest.draw(to, size, &self.title),
            Drawing::Heat(heat) => heat.draw(to, size, &self.title),
        }
    }
}

/// Every picture there is.
pub(super) fn all(report: &Report) -> Vec<Plot<'_>> {
    let fits = report.records.iter().flat_map(|record| record.fits.iter().map(move |fit| (record, fit)));
    let of_fit = |(record, fit)| {
        let drawn =
            [response(record, fit), residuals(record, fit), histogram(record, fit), autocorrelation(record, fit)];
        drawn.into_iter().chain(closeup(record, fit)).flatten()
    };
    let of_report = [parameters(report), correlation(report)].into_iter().flatten();
    of_report.chain(report.profiles.iter().map(profile)).chain(fits.flat_map(of_fit)).collect()
}

/// Estimates with their intervals.
pub(super) fn parameters(report: &Report) -> Option<Plot<'_>> {
    let rows: Vec<ForestRow> = report.unknowns.iter().map(forest_row).collect();
    let title = "95 % intervals of the estimates, relative to them".to_owned();
    (!rows.is_empty()).then(|| plot("parameters", title, Drawing::Forest(Forest { rows })))
}

fn forest_row(unknown: &Unknown) -> ForestRow {
    let relative = |end: f64| 100.0 * (end - unknown.value) / unknown.value.abs();
    let interval = match unknown.knowledge {
        Knowledge::Known { .. } if unknown.value == 0.0 => Err("the estimate is 0"),
        Knowledge::Known { lower, upper, .. } => Ok((relative(lower), relative(upper))),
        Knowledge::Held { .. } => Err("held at its bound"),
        Knowledge::Unidentified => Err("not determined"),
        Knowledge::Fixed => Err("fixed"),
    };
    ForestRow { name: unknown.name.clone(), interval: interval.map_err(str::to_owned) }
}

/// Which estimates go together; from two on.
pub(super) fn correlation(report: &Report) -> Option<Plot<'_>> {
    let names: Vec<&str> = report.unknowns.iter().map(|unknown| unknown.name.as_str()).collect();
    let title = "Correlation of the estimates".to_owned();
    (names.len() > 1 && names.len() == report.correlation.size())
        .then(|| plot("correlation", title, Drawing::Heat(Heat { names, matrix: &report.correlation })))
}

/// Measured and predicted over time.
pub(super) fn response<'a>(record: &Record, fit: &'a OutputFit) -> Option<Plot<'a>> {
    let title = format!("Output {} of {}: measured and predicted over time", fit.name, record.name);
    Some(plot(&stem("response", record, fit), title, over_time(fit, fit.overview.as_ref()?, &fit.name)))
}

/// The same about the largest residual.
pub(super) fn closeup<'a>(record: &Record, fit: &'a OutputFit) -> [Option<Plot<'a>>; 2] {
    let Some(trace) = &fit.closeup else { return [None, None] };
    let title = format!("Output {} of {} about its largest residual: measured and predicted", fit.name, record.name);
    let of_residuals = format!("Residual of {} of {} about the largest one", fit.name, record.name);
    [
        Some(plot(&stem("closeup", record, fit), title, over_time(fit, trace, &fit.name))),
        Some(plot(&stem("closeup-residual", record, fit), of_residuals, residual_over_time(fit, trace))),
    ]
}

/// What is left over time.
pub(super) fn residuals<'a>(record: &Record, fit: &'a OutputFit) -> Option<Plot<'a>> {
    let title = format!("Residual of {} of {} over time: measured less predicted", fit.name, record.name);
    Some(plot(&stem("residual", record, fit), title, residual_over_time(fit, fit.overview.as_ref()?)))
}

fn over_time<'a>(fit: &OutputFit, trace: &'a Trace, name: &str) -> Drawing<'a> {
    let range = joined(trace.measured.range(), trace.predicted.range());
    let layer = |class, band| Layer::Band { class, x: &trace.t, y: band };
    let layers = vec![layer("measured", &trace.measured), layer("predicted", &trace.predicted)];
    Drawing::Curves(Curves { x: time(trace), y: Axis::new(name, &fit.unit, range).with_room(), layers, height: 240.0 })
}

fn residual_over_time<'a>(fit: &OutputFit, trace: &'a Trace) -> Drawing<'a> {
    let y = Axis::new("residual", &fit.unit, trace.residual.range()).with_room();
    let layers = vec![Layer::Band { class: "residual", x: &trace.t, y: &trace.residual }];
    Drawing::Curves(Curves { x: time(trace), y, layers, height: 130.0 })
}

fn time(trace: &Trace) -> Axis {
    Axis::new("time", "s", trace.t.first().copied().zip(trace.t.last().copied()))
}

fn joined(a: Option<(f64, f64)>, b: Option<(f64, f64)>) -> Option<(f64, f64)> {
    match (a, b) {
        (Some(a), Some(b)) => Some((a.0.min(b.0), a.1.max(b.1))),
        (a, b) => a.or(b),
    }
}

/// How the fit worsens away from an estimate, the others refitted.
pub(super) fn profile(profile: &ProfileCurve) -> Plot<'_> {
    let range = profile.values.first().copied().zip(profile.values.last().copied());
    let title = format!("Profile of {}: rise of the deviance as it is moved, the others refitted", profile.name);
    // Far above the level a curve says nothing more.
    let highest = profile.rise.iter().flatten().copied().fold(profile.level, f64::max).min(4.0 * profile.level);
    let drawing = Drawing::Curves(Curves {
        x: Axis::new(&profile.name, &profile.unit, range),
        y: Axis::new("rise of -2 ln L", "", Some((0.0, 1.05 * highest))),
        layers: vec![Layer::Curve { x: &profile.values, y: &profile.rise }, Layer::Level(profile.level)],
        height: 160.0,
    });
    plot(&file_name(&format!("profile-{}", profile.name)), title, drawing)
}

/// How often which residual occurs.
pub(super) fn histogram<'a>(record: &Record, fit: &OutputFit) -> Option<Plot<'a>> {
    let histogram = &fit.residuals.histogram;
    let total = fit.residuals.count.max(1) as f64;
    let heights: Vec<f64> = histogram.counts.iter().map(|count| 100.0 * *count as f64 / total).collect();
    let highest = heights.iter().copied().reduce(f64::max)?;
    let to = histogram.from + histogram.width * heights.len() as f64;
    let title = format!("Histogram of the residual of {} of {}", fit.name, record.name);
    let drawing = Drawing::Curves(Curves {
        x: Axis::new("residual", &fit.unit, Some((histogram.from, to))),
        y: Axis::new("share", "%", Some((0.0, 1.05 * highest))),
        layers: vec![Layer::Bars { first: histogram.from, width: histogram.width, heights }],
        height: 160.0,
    });
    Some(plot(&stem("histogram", record, fit), title, drawing))
}

/// How far a residual tells the next ones.
pub(super) fn autocorrelation<'a>(record: &Record, fit: &OutputFit) -> Option<Plot<'a>> {
    let r = &fit.residuals.autocorrelation;
    let bound = fit.residuals.white_bound();
    let least = r.iter().copied().reduce(f64::min)?.min(-bound);
    let title = format!("Autocorrelation of the residual of {} of {}", fit.name, record.name);
    let drawing = Drawing::Curves(Curves {
        x: Axis::new("lag", "samples", Some((0.0, r.len() as f64 + 0.5))),
        y: Axis::new("autocorrelation", "", Some((1.1 * least, 1.05))),
        layers: vec![
            Layer::Bars { first: 0.5, width: 1.0, heights: r.clone() },
            Layer::Level(bound),
            Layer::Level(-bound),
        ],
        height: 160.0,
    });
    Some(plot(&stem("autocorrelation", record, fit), title, drawing))
}

fn plot<'a>(name: &str, title: String, drawing: Drawing<'a>) -> Plot<'a> {
    Plot { name: name.to_owned(), title, drawing }
}

/// A name for a file, whatever the record is called.
fn stem(what: &str, record: &Record, fit: &OutputFit) -> String {
    file_name(&format!("{what}-{}-{}", record.name, fit.name))
}

fn file_name(text: &str) -> String {
    text.chars().map(|letter| if letter.is_alphanumeric() { letter } else { '-' }).collect()
}
