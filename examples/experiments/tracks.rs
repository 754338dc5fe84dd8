//! What the record of experiment 3 looks like.

use crate::figure::{Figure, Panel, curve, thin};
use crate::methods::*;
use crate::report::Report;
use greybox::pmsm::Winding;
use greybox::pmsm::offline::{Axes, Form, Spans};

/// The record, how it is cut into cycles, and what the pre-filter does to it.
pub fn tracks(report: &mut Report, run: &Run) -> Result<()> {
    let (spans, ts) = (&run.spans, run.spans.ts);
    let trace = |range: core::ops::Range<usize>, of: &dyn Fn(usize) -> f64| {
        thin(range.filter(|&k| k < spans.spans.len()).map(|k| (k as f64 * ts, of(k))).collect())
    };
    let (speed, iq, uq) = (|k: usize| spans.spans[k].w, |k: usize| spans.spans[k].i0.iq, |k: usize| spans.spans[k].uq);
    let cycle = run.cycles[9].samples.clone();
    let one = |title: &str, of: &dyn Fn(usize) -> f64| Panel {
        title: title.to_owned(),
        series: vec![curve("measured", trace(cycle.clone(), of))],
    };
    let selected = |odd: usize| {
        let chosen = run.cycles.iter().skip(odd).step_by(2);
        let points = chosen.flat_map(|cycle| {
            let mut points = trace(cycle.samples.clone(), &speed);
            // A gap between one chosen cycle and the next.
            points.push((f64::NAN, f64::NAN));
            points
        });
        points.collect::<Vec<_>>()
    };
    let cycles = Panel {
        title: String::new(),
        series: vec![curve("cycles 1, 3, 5, ...", selected(0)), curve("cycles 2, 4, 6, ...", selected(1))],
    };
    let figure = |name: &str, title: &str, caption: &str, y, panels| Figure {
        name: name.to_owned(),
        title: title.to_owned(),
        caption: caption.to_owned(),
        x: "time (s)",
        y,
        panels,
        logarithmic: false,
    };
    report.figure(figure(
        "exp3-cycles",
        "Axis 1: the record and how it is cut into operating cycles",
        "Each cycle goes forth and back at one speed; each is fitted on its own, or together with the others.",
        "speed (rad/s)",
        vec![cycles],
    ));
    report.figure(figure(
        "exp3-track",
        "Axis 1: one operating cycle",
        "Speed, current that makes torque, and commanded voltage: acceleration, cruise, braking, and back.",
        "",
        vec![one("speed (rad/s)", &speed), one("iq (A)", &iq), one("uq (V)", &uq)],
    ));
    report.figure(filtered(run, figure)?);
    Ok(())
}

/// Sides of the q equation before and after the pre-filter.
fn filtered(run: &Run, figure: impl Fn(&str, &str, &str, &'static str, Vec<Panel>) -> Figure) -> Result<Figure> {
    let begin = run.cycles[9].samples.start + (0.2 / run.spans.ts) as usize;
    let spans: Spans = run.spans.cut(run.cycles[9].samples.start..begin + (0.25 / run.spans.ts) as usize);
    let seen = |winding: Winding| -> Result<[Vec<(f64, f64)>; 2]> {
        let filter = low_pass(spans.ts)?;
        let raw = spans.plain(Axes::Q, Form::Rotor);
        let filtered = raw.clone().prefiltered(&filter);
        let last = |pairs: Vec<Vec<(f64, f64)>>| {
            let rows = pairs.into_iter().next().unwrap_or_default();
            let first = rows.len() - (0.25 / spans.ts) as usize;
            rows[first..].iter().enumerate().map(|(k, (_, phi))| (k as f64 * spans.ts, *phi)).collect()
        };
        Ok([last(raw.predictions(&winding)), last(filtered.predictions(&winding))])
    };
    let panel = |title: &str, winding: Winding| -> Result<Panel> {
        let [raw, filtered] = seen(winding)?;
        let series = vec![curve("before the filter", thin(raw)), curve("after the filter", thin(filtered))];
        Ok(Panel { title: title.to_owned(), series })
    };
    let axis = &run.axis;
    let none = Winding { rs: 0.0, ls: 0.0, ke: 0.0 };
    Ok(figure(
        "exp3-filter",
        "Axis 1: terms of the q equation before and after the pre-filter (100 Hz)",
        "The derivative of the current is noise before the filter and a signal after it; the EMF hardly changes.",
        "voltage (V)",
        vec![
            panel("L (diq/dt + we id)", Winding { ls: axis.ls, ..none })?,
            panel("sqrt(2/3) Ke w", Winding { ke: axis.ke, ..none })?,
        ],
    ))
}
