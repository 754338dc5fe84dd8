//! Signals over time on a page: the drawing of the whole record, and the numbers that a reader zooms into.

use crate::report::chart::{self, Size, keys, time_axis};
use crate::report::markup::Markup;
use crate::section::{Plot, Stretch, Timeline, Trace};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use core::fmt::Display;
use serde::Serialize;

/// The numbers of a drawing, as `timeline.js` reads them.
#[derive(Serialize)]
struct Numbers<'a> {
    /// Label of the axis of time.
    time: String,
    time_unit: &'a str,
    panels: &'a [crate::section::Panel],
    stretches: Vec<Packed>,
}

/// A stretch with its numbers as bytes, little end first, in letters (RFC 4648, section 4).
#[derive(Serialize)]
struct Packed {
    per: u64,
    /// Begin and step of even columns, else each column's time as 64-bit floats.
    even: Option<(f64, f64)>,
    t: String,
    traces: Vec<PackedTrace>,
}

/// Values less `shift`, as 32-bit floats; not a number where there is none.
#[derive(Serialize)]
struct PackedTrace {
    shift: f64,
    low: String,
    high: String,
    mean: String,
}

/// Legend, drawing and numbers.
pub(super) fn draw(to: &mut Markup, plot: &Plot, timeline: &Timeline, size: Size) {
    let attributes: [(&str, &dyn Display); 4] =
        [("class", &"timeline"), ("tabindex", &"0"), ("role", &"group"), ("aria-label", &plot.title)];
    to.node("div", &attributes, |node| {
        node.node("p", &[("class", &"legend")], |legend| {
            for (class, name) in keys(timeline) {
                legend.words("span", &[("class", &format_args!("key {class}"))], name);
            }
        });
        chart::draw(plot, node, size);
        node.node("script", &[("type", &"application/json")], |script| script.verbatim(&numbers(timeline)));
    });
}

fn numbers(timeline: &Timeline) -> String {
    let numbers = Numbers {
        time: time_axis(timeline).name,
        time_unit: &timeline.time_unit,
        panels: &timeline.panels,
        stretches: timeline.stretches.iter().map(packed).collect(),
    };
    // Numbers and names have a form in JSON; and a script ends at no name that is written so.
    serde_json::to_string(&numbers).unwrap_or_default().replace('<', "\\u003c")
}

fn packed(stretch: &Stretch) -> Packed {
    let even = even(&stretch.t);
    let t = match even {
        Some(_) => String::new(),
        None => STANDARD.encode(stretch.t.iter().flat_map(|t| t.to_le_bytes()).collect::<Vec<u8>>()),
    };
    Packed { per: stretch.samples_per_column, even, t, traces: stretch.traces.iter().map(packed_trace).collect() }
}

/// Begin and step, if all columns are even to a thousandth of a step.
fn even(t: &[f64]) -> Option<(f64, f64)> {
    let (first, last) = (*t.first()?, *t.last()?);
    let step = (last - first) / (t.len().max(2) - 1) as f64;
    let off = |(k, t): (usize, &f64)| (t - (first + k as f64 * step)).abs() > 1e-3 * step;
    (!t.iter().enumerate().any(off)).then_some((first, step))
}

fn packed_trace(trace: &Trace) -> PackedTrace {
    // Values far from zero keep their digits as distances from one of them.
    let shift = trace.low.iter().flatten().next().copied().unwrap_or(0.0);
    let bytes = |values: &[Option<f64>]| {
        let value = |value: &Option<f64>| value.map_or(f32::NAN, |value| (value - shift) as f32).to_le_bytes();
        STANDARD.encode(values.iter().flat_map(value).collect::<Vec<u8>>())
    };
    PackedTrace { shift, low: bytes(&trace.low), high: bytes(&trace.high), mean: bytes(&trace.mean) }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers far from zero come back to seven digits of their differences; what is missing stays so.
    #[test]
    fn numbers_come_back() {
        let trace = Trace { low: vec![Some(1e9), None, Some(1e9 + 0.125)], ..Trace::default() };
        let packed = packed_trace(&trace);
        let bytes = STANDARD.decode(&packed.low).unwrap();
        let value = |k: usize| f32::from_le_bytes(bytes[4 * k..4 * k + 4].try_into().unwrap());
        assert_eq!((packed.shift + f64::from(value(0)), packed.shift + f64::from(value(2))), (1e9, 1e9 + 0.125));
        assert!(value(1).is_nan() && packed.high.is_empty());
    }

    #[test]
    fn even_time_needs_no_stamps() {
        let t: Vec<f64> = (0..1000).map(|k| f64::from(k) * 0.1 + 3.0).collect();
        let (begin, step) = even(&t).unwrap();
        assert!(begin == 3.0 && (step - 0.1).abs() < 1e-12);
        assert_eq!(even(&[0.0, 1.0, 2.1]), None);
    }
}
