//! Pictures of what is known of the unknowns.

use super::super::Report;
use super::super::chart::{Axis, Cell, Curves, Forest, ForestRow, Heat, Layer};
use super::{Drawing, PANEL, Plot, file_name, plot};
use crate::diagnose::{Profile, ProfilePoint};
use crate::estimate::{Knowledge, Unknown};

/// Estimates with their intervals.
pub(in crate::report) fn parameters(report: &Report) -> Option<Plot<'_>> {
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
pub(in crate::report) fn correlation(report: &Report) -> Option<Plot<'_>> {
    let n = report.unknowns.len();
    if n < 2 || n != report.correlation.size() {
        return None;
    }
    let known = |i: usize| report.unknowns[i].knowledge.standard_error().is_some();
    let cell = |i: usize, j: usize| {
        let r = report.correlation[(i, j)];
        if !(known(i) && known(j)) {
            return Cell { class: "none", strength: 1.0, text: "–".to_owned() };
        }
        // Adding a zero takes the sign from one.
        let text = format!("{:.2}", (r * 100.0).round() / 100.0 + 0.0).replace('-', "−");
        Cell { class: if r < 0.0 { "negative" } else { "positive" }, strength: r.abs(), text }
    };
    let heat = Heat {
        rows: report.unknowns.iter().enumerate().map(|(i, unknown)| format!("{} {}", i + 1, unknown.name)).collect(),
        columns: (1..=n).map(|j| j.to_string()).collect(),
        cells: (0..n).map(|i| (0..n).map(|j| cell(i, j)).collect()).collect(),
    };
    Some(plot("correlation", "Correlation of the estimates".to_owned(), Drawing::Heat(heat)))
}

/// Where in the records each unknown is excited.
pub(in crate::report) fn excitation(report: &Report) -> Option<Plot<'_>> {
    let excitation = &report.identifiability.excitation;
    let segments = &excitation.first()?.segments;
    let cells = |i: usize| {
        let shares = excitation[i].segments.iter().map(|segment| segment.share);
        let most = shares.clone().fold(f64::MIN_POSITIVE, f64::max);
        let cell = |share: f64| {
            let text = format!("{:.0}", 100.0 * share);
            Cell { class: "excited", strength: share / most, text: if text == "0" { String::new() } else { text } }
        };
        shares.map(cell).collect()
    };
    // The number of the tenth, from one in each record.
    let mut number = 0;
    let columns = segments.iter().enumerate().map(|(i, segment)| {
        let first = i == 0 || segments[i - 1].experiment != segment.experiment;
        number = if first { 1 } else { number + 1 };
        if segments.len() <= 10 { number.to_string() } else { String::new() }
    });
    let heat = Heat {
        columns: columns.collect(),
        rows: excitation.iter().map(|excited| excited.name.clone()).collect(),
        cells: (0..excitation.len()).map(cells).collect(),
    };
    let title = "Part of what is known of each unknown that comes from each tenth of the records (%)".to_owned();
    Some(plot("excitation", title, Drawing::Heat(heat)))
}

/// A profile is drawn in so many parts between two points.
const PARTS: u32 = 8;

/// How the fit worsens away from an estimate, the others refitted.
pub(in crate::report) fn profile(profile: &Profile) -> Plot<'_> {
    // Far above the threshold a curve says nothing more.
    let shown = profile.points.iter().filter(|point| point.rise <= 3.0 * profile.threshold);
    // Between points the signed root of the rise is next to straight.
    let root = |point: &ProfilePoint| (point.value, point.rise.sqrt().copysign(point.value - profile.value));
    let roots: Vec<(f64, f64)> = shown.map(root).collect();
    let between = |pair: &[(f64, f64)]| {
        let ((a, low), (b, high)) = (pair[0], pair[1]);
        (0..=PARTS).map(f64::from).map(move |i| i / f64::from(PARTS)).map(move |part| {
            let root = low + part * (high - low);
            (a + part * (b - a), root * root)
        })
    };
    let points: Vec<(f64, f64)> = roots.windows(2).flat_map(between).collect();
    let range = points.first().zip(points.last()).map(|(first, last)| (first.0, last.0));
    let tallest = points.iter().map(|(_, rise)| *rise).fold(profile.threshold, f64::max);
    let title = format!("Profile of {}: rise of the deviance as it is moved, the others refitted", profile.name);
    let drawing = Drawing::Curves(Curves {
        x: Axis::new(&profile.name, &profile.unit, range).with_room(),
        y: Axis::new("rise of -2 ln L", "", Some((0.0, 1.05 * tallest))),
        layers: vec![Layer::Curve { class: "curve", points }, Layer::Level(profile.threshold)],
        height: PANEL,
    });
    plot(&file_name(&format!("profile-{}", profile.name)), title, drawing)
}
