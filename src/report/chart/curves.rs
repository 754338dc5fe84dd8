//! [`Curves`]: curves, bars and levels over one pair of axes.

mod labels;

use super::scale::Scale;
use super::{Frame, LETTER, Margins, Short, Size, class};
use crate::report::markup::Markup;
use crate::section::{Axis, Curves, Layer, Style};
use core::fmt::{Display, Write};

/// Room for so many letters is left beside every drawing, so that those below each other are in line.
pub(super) const LETTERS: usize = 6;
/// Height of the drawing without its margins (px).
const HEIGHT: f64 = 160.0;

/// Draws them under a name for those who cannot see it.
pub(super) fn draw(curves: &Curves, to: &mut Markup, size: Size, name: &str) {
    let (x, y) = (across(curves), upwards(curves));
    surface(
        to,
        size,
        name,
        (HEIGHT, Along::Titled),
        (&x, &y),
        |frame, svg| {
            for layer in &curves.layers {
                layers(layer, frame, svg, &x, &y);
            }
        },
        |frame, svg| {
            for layer in &curves.layers {
                labels::draw(layer, curves, frame, svg, (&x, &y));
            }
        },
    );
}

/// The text along the horizontal axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Along {
    /// Numbers and a title.
    Titled,
    /// Numbers.
    Numbered,
    /// Nothing: a drawing below has the same axis.
    Bare,
}

impl Along {
    /// Room below the drawing (px).
    pub fn room(self) -> f64 {
        match self {
            Along::Titled => 40.0,
            Along::Numbered => 24.0,
            Along::Bare => 10.0,
        }
    }
}

/// Axes with grid and ticks; on them what is stretched with the surface, and what is not.
pub(super) fn surface(
    to: &mut Markup,
    size: Size,
    name: &str,
    (height, along): (f64, Along),
    (x, y): (&Scale, &Scale),
    stretched: impl FnOnce(&Frame, &mut Markup),
    upright: impl FnOnce(&Frame, &mut Markup),
) {
    let ticks = y.ticks();
    let letters = ticks.iter().map(|tick| tick.label.chars().count()).fold(LETTERS, usize::max);
    let margins = Margins { left: letters as f64 * LETTER + 12.0, right: 14.0, top: 24.0, bottom: along.room() };
    Frame { size, margins, height }.draw(to, name, |frame, svg| {
        let (h, left) = (frame.height, -frame.margins.left);
        svg.words("text", &[("class", &"name"), ("x", &left), ("y", &-10)], y.title());
        svg.node("g", &[("class", &"up")], |group| {
            for tick in ticks {
                let y = Short(h * (1.0 - tick.at));
                let ends: [(&str, &dyn Display); 4] =
                    [("class", &"grid"), ("x2", &frame.x(1.0)), ("y1", &y), ("y2", &y)];
                group.leaf("line", &ends);
                group.words("text", &[("class", &"tick end"), ("x", &-6), ("y", &y), ("dy", &4)], tick.label);
            }
        });
        svg.node("g", &[("class", &"along")], |group| {
            for tick in x.ticks() {
                let x = frame.x(tick.at);
                group.leaf("line", &[("class", &"grid"), ("x1", &x), ("x2", &x), ("y2", &h)]);
                if along != Along::Bare {
                    let place: [(&str, &dyn Display); 3] = [("class", &"tick middle"), ("x", &x), ("y", &(h + 16.0))];
                    group.words("text", &place, tick.label);
                }
            }
        });
        if along == Along::Titled {
            let place: [(&str, &dyn Display); 3] = [("class", &"name end"), ("x", &frame.x(1.0)), ("y", &(h + 34.0))];
            svg.words("text", &place, x.title());
        }
        let view = format!("0 0 {} {}", Short(frame.width()), Short(h));
        let attributes: [(&str, &dyn Display); 5] = [
            ("class", &"layers"),
            ("width", &frame.x(1.0)),
            ("height", &h),
            ("viewBox", &view),
            ("preserveAspectRatio", &"none"),
        ];
        svg.node("svg", &attributes, |svg| stretched(frame, svg));
        upright(frame, svg);
    });
}

/// The range of the layers, of points that both axes can show.
fn span(curves: &Curves, of: impl Fn((f64, f64)) -> f64) -> Option<(f64, f64)> {
    let shown = |axis: &Axis, value: f64| value.is_finite() && (!axis.logarithmic || value > 0.0);
    let points = curves.layers.iter().flat_map(|layer| -> Vec<(f64, f64)> {
        match layer {
            Layer::Line { points, .. } | Layer::Dots { points, .. } => points.clone(),
            Layer::Bars { first, width, heights, .. } => {
                let end = first + width * heights.len() as f64;
                let ends = [(*first, 0.0), (end, 0.0)];
                let tops = heights.iter().enumerate().map(|(i, height)| (first + width * (i as f64 + 0.5), *height));
                ends.into_iter().chain(tops).collect()
            }
            Layer::Level { .. } | Layer::Mark { .. } => vec![],
        }
    });
    let values = points.filter(|(x, y)| shown(&curves.x, *x) && shown(&curves.y, *y)).map(of);
    values.fold(None, |range, value| match range {
        None => Some((value, value)),
        Some((low, high)) => Some((f64::min(low, value), f64::max(high, value))),
    })
}

fn across(curves: &Curves) -> Scale {
    let marks = curves.layers.iter().filter_map(|layer| match layer {
        Layer::Mark { value, .. } => Some(*value),
        _ => None,
    });
    let bars = curves.layers.iter().any(|layer| matches!(layer, Layer::Bars { .. }));
    ranged(&curves.x, span(curves, |(x, _)| x), marks, !bars)
}

fn upwards(curves: &Curves) -> Scale {
    let levels = curves.layers.iter().filter_map(|layer| match layer {
        Layer::Level { value, .. } => Some(*value),
        _ => None,
    });
    ranged(&curves.y, span(curves, |(_, y)| y), levels, true)
}

/// An axis over a range and some values; with room at the ends that are not given.
fn ranged(axis: &Axis, range: Option<(f64, f64)>, also: impl Iterator<Item = f64>, room: bool) -> Scale {
    let wider = |(low, high): (f64, f64), value: f64| (low.min(value), high.max(value));
    let also = also.chain(axis.from).filter(|value| !axis.logarithmic || *value > 0.0);
    let range = also.fold(range, |range, value| Some(range.map_or((value, value), |range| wider(range, value))));
    let range = range.map(|(low, high)| (low, axis.to.unwrap_or(high)));
    let tight = Scale::new(axis, range);
    let wide = if room { tight.clone().with_room() } else { tight.clone() };
    let given = |end: Option<f64>, value: f64| end.is_some_and(|end| range.is_some() && end == value);
    let (low, high) = range.unwrap_or((0.0, 1.0));
    let from = if given(axis.from, low) { tight.from } else { wide.from };
    let to = if given(axis.to, high) { tight.to } else { wide.to };
    Scale { from, to, ..wide }
}

/// Draws what is stretched with the surface.
fn layers(layer: &Layer, frame: &Frame, svg: &mut Markup, x: &Scale, y: &Scale) {
    let (w, h) = (frame.width(), frame.height);
    let (x, y) = (|v: f64| w * x.at(v), |v: f64| h * (1.0 - y.at(v)));
    let mut d = String::new();
    // Writing to a string does not fail.
    match layer {
        Layer::Line { points, .. } => {
            let places = points.iter().map(|(a, b)| Some((x(*a), y(*b))).filter(|(x, y)| (x + y).is_finite()));
            d = path(places);
        }
        Layer::Bars { first, width, heights, .. } => {
            for (i, height) in heights.iter().enumerate().filter(|(_, height)| **height != 0.0) {
                let (begin, end) = (first + width * (i as f64 + 0.1), first + width * (i as f64 + 0.9));
                let (zero, top) = (Short(y(0.0)), Short(y(*height)));
                let _ = write!(d, "M{} {zero}V{top}H{}V{zero}Z", Short(x(begin)), Short(x(end)));
            }
        }
        Layer::Level { value, .. } => {
            let _ = write!(d, "M0 {}H{}", Short(y(*value)), Short(w));
        }
        Layer::Mark { value, .. } => {
            let _ = write!(d, "M{} 0V{}", Short(x(*value)), Short(h));
        }
        Layer::Dots { .. } => return,
    }
    let (shape, style) = match layer {
        Layer::Bars { style, .. } => ("bar ", class(*style)),
        Layer::Line { style, .. } | Layer::Dots { style, .. } => ("line ", class(*style)),
        Layer::Level { .. } => ("level", ""),
        Layer::Mark { .. } => ("mark", ""),
    };
    svg.leaf("path", &[("class", &format_args!("{shape}{style}")), ("d", &d)]);
}

/// A line through places, broken where there is none; a lone place is a line of no length, whose round ends are seen.
pub(super) fn path(places: impl Iterator<Item = Option<(f64, f64)>>) -> String {
    let mut d = String::new();
    let mut drawing = false;
    for place in places {
        if let Some((x, y)) = place {
            // Writing to a string does not fail.
            let _ = match drawing {
                true => write!(d, "L{} {}", Short(x), Short(y)),
                false => write!(d, "M{0} {1}L{0} {1}", Short(x), Short(y)),
            };
        }
        drawing = place.is_some();
    }
    d
}

/// The styles that are drawn as filled surfaces.
pub(super) fn is_band(style: Style) -> bool {
    matches!(style, Style::Confidence | Style::Prediction)
}
