//! Pictures of an output of a record: what was measured and predicted, and what is left.

use super::super::chart::{Axis, Curves, Layer};
use super::super::trace::Trace;
use super::super::{OutputFit, Record};
use super::{Drawing, PANEL, Plot, file_name, plot};
use crate::diagnose::residuals::{Correlation, Spread};

/// Measured and predicted over time.
pub(in crate::report) fn response<'a>(record: &Record, fit: &'a OutputFit) -> Option<Plot<'a>> {
    let title = format!("Output {} of {}: measured and predicted over time", fit.name, record.name);
    Some(plot(&stem("response", record, fit), title, over_time(fit, fit.overview.as_ref()?, 240.0)))
}

/// The same about the largest residual.
pub(in crate::report) fn closeup<'a>(record: &Record, fit: &'a OutputFit) -> [Option<Plot<'a>>; 2] {
    let Some(trace) = &fit.closeup else { return [None, None] };
    let title = format!("Output {} of {} about its largest residual: measured and predicted", fit.name, record.name);
    let of_residuals = format!("Residual of {} of {} about the largest one", fit.name, record.name);
    [
        Some(plot(&stem("closeup", record, fit), title, over_time(fit, trace, PANEL))),
        Some(plot(&stem("closeup-residual", record, fit), of_residuals, residual_over_time(fit, trace, PANEL))),
    ]
}

/// What is left over time.
pub(in crate::report) fn residuals<'a>(record: &Record, fit: &'a OutputFit) -> Option<Plot<'a>> {
    let title = format!("Residual of {} of {} over time: measured less predicted", fit.name, record.name);
    Some(plot(&stem("residual", record, fit), title, residual_over_time(fit, fit.overview.as_ref()?, 130.0)))
}

fn over_time<'a>(fit: &OutputFit, trace: &'a Trace, height: f64) -> Drawing<'a> {
    let range = joined(trace.measured.range(), trace.predicted.range());
    let band = |class, y| Layer::Band { class, x: &trace.t, y };
    let area = |class, y| Layer::Area { class, x: &trace.t, y };
    let layers = vec![
        area("prediction", &trace.prediction),
        area("confidence", &trace.confidence),
        band("measured", &trace.measured),
        band("predicted", &trace.predicted),
    ];
    Drawing::Curves(Curves { x: time(trace), y: Axis::new(&fit.name, &fit.unit, range).with_room(), layers, height })
}

fn residual_over_time<'a>(fit: &OutputFit, trace: &'a Trace, height: f64) -> Drawing<'a> {
    let y = Axis::new("residual", &fit.unit, trace.residual.range()).with_room();
    let layers = vec![Layer::Band { class: "residual", x: &trace.t, y: &trace.residual }];
    Drawing::Curves(Curves { x: time(trace), y, layers, height })
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

/// How often which residual occurs, beside the normal distribution of the same mean and spread.
pub(in crate::report) fn histogram<'a>(record: &Record, fit: &OutputFit) -> Option<Plot<'a>> {
    let histogram = &fit.histogram;
    let total = fit.residuals.samples.max(1) as f64;
    let heights: Vec<f64> = histogram.counts.iter().map(|count| 100.0 * *count as f64 / total).collect();
    let highest = heights.iter().copied().reduce(f64::max)?;
    let to = histogram.from + histogram.width * heights.len() as f64;
    let (mean, sigma) = (fit.residuals.mean, fit.residuals.standard_deviation);
    let normal = |i: u32| {
        let e = histogram.from + (to - histogram.from) * f64::from(i) / 200.0;
        let density = (-0.5 * ((e - mean) / sigma).powi(2)).exp() / (sigma * std::f64::consts::TAU.sqrt());
        (e, 100.0 * histogram.width * density)
    };
    let points: Vec<_> = if sigma > 0.0 { (0..=200).map(normal).collect() } else { vec![] };
    let highest = points.iter().map(|(_, share)| *share).fold(highest, f64::max);
    let title = format!("Histogram of the residual of {} of {}", fit.name, record.name);
    let drawing = Drawing::Curves(Curves {
        x: Axis::new("residual", &fit.unit, Some((histogram.from, to))),
        y: Axis::new("share", "%", Some((0.0, 1.05 * highest))),
        layers: vec![
            Layer::Bars { first: histogram.from, width: histogram.width, heights },
            Layer::Curve { class: "normal", points },
        ],
        height: PANEL,
    });
    Some(plot(&stem("histogram", record, fit), title, drawing))
}

/// The residual against each signal: its correlation over lags, its size over the signal's range.
pub(in crate::report) fn against_signals<'a>(record: &Record, fit: &OutputFit) -> Vec<Plot<'a>> {
    let correlations = fit.residuals.correlations.iter().map(|with| cross_correlation(record, fit, with));
    let spreads = fit.residuals.spreads.iter().map(|over| spread(record, fit, over));
    correlations.chain(spreads).flatten().collect()
}

/// How far a residual tells the next ones.
pub(in crate::report) fn autocorrelation<'a>(record: &Record, fit: &OutputFit) -> Option<Plot<'a>> {
    let r = &fit.residuals.autocorrelation;
    let title = format!("Autocorrelation of the residual of {} of {}", fit.name, record.name);
    let drawing = lags("autocorrelation", 1, r, fit.residuals.autocorrelation_band)?;
    Some(plot(&stem("autocorrelation", record, fit), title, drawing))
}

/// Correlation of the residual with a signal.
fn cross_correlation<'a>(record: &Record, fit: &OutputFit, with: &Correlation) -> Option<Plot<'a>> {
    let Correlation { signal, role, first_lag, values, band } = with;
    let title =
        format!("Correlation of the residual of {} of {} with {role} {signal} before it", fit.name, record.name);
    let drawing = lags("correlation", *first_lag, values, *band)?;
    Some(plot(&stem(&format!("correlation-{signal}"), record, fit), title, drawing))
}

fn lags<'a>(name: &str, first: i64, values: &[f64], band: f64) -> Option<Drawing<'a>> {
    let least = values.iter().copied().reduce(f64::min)?.min(-band);
    let greatest = values.iter().copied().reduce(f64::max)?.max(band);
    let first = first as f64 - 0.5;
    Some(Drawing::Curves(Curves {
        x: Axis::new("lag", "samples", Some((first.min(0.0), first + values.len() as f64))),
        y: Axis::new(name, "", Some((least, greatest))).with_room(),
        layers: vec![
            Layer::Bars { first, width: 1.0, heights: values.to_vec() },
            Layer::Level(band),
            Layer::Level(-band),
        ],
        height: PANEL,
    }))
}

/// Size of the residual over the range of a signal.
fn spread<'a>(record: &Record, fit: &OutputFit, over: &Spread) -> Option<Plot<'a>> {
    let Spread { signal, role, unit, at, deviation, .. } = over;
    let title = format!("Size of the residual of {} of {} over {role} {signal}", fit.name, record.name);
    let highest = deviation.iter().copied().reduce(f64::max)?;
    let drawing = Drawing::Curves(Curves {
        x: Axis::new(signal, unit, at.first().copied().zip(at.last().copied())).with_room(),
        y: Axis::new("standard deviation", &fit.unit, Some((0.0, 1.1 * highest))),
        layers: vec![
            Layer::Curve { class: "curve", points: at.iter().copied().zip(deviation.iter().copied()).collect() },
            Layer::Level(fit.residuals.standard_deviation),
        ],
        height: PANEL,
    });
    Some(plot(&stem(&format!("spread-{}-{signal}", role.replace(' ', "-")), record, fit), title, drawing))
}

/// A name for a file, whatever the record is called.
fn stem(what: &str, record: &Record, fit: &OutputFit) -> String {
    file_name(&format!("{what}-{}-{}", record.name, fit.name))
}
