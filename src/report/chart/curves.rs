//! [`Curves`]: curves, bars and levels over one pair of axes.

use super::axes::Axis;
use super::{Frame, LETTER, Margins, Short, Size};
use crate::report::markup::Markup;
use crate::report::trace::Band;
use core::fmt::{Display, Write};

/// Room for so many letters is left beside every drawing, so that those below each other are in line.
const LETTERS: usize = 6;

/// A drawing over axes.
#[derive(Clone, Debug)]
pub(in crate::report) struct Curves<'a> {
    pub x: Axis,
    pub y: Axis,
    /// From the lowest to the topmost.
    pub layers: Vec<Layer<'a>>,
    /// Height without margins (px).
    pub height: f64,
}

/// One of the things drawn.
#[derive(Clone, Debug)]
pub(in crate::report) enum Layer<'a> {
    /// A curve that spans a range in each column.
    Band { class: &'static str, x: &'a [f64], y: &'a Band },
    /// The surface between the least and the greatest of each column.
    Area { class: &'static str, x: &'a [f64], y: &'a Band },
    /// A curve through points.
    Curve { class: &'static str, points: Vec<(f64, f64)> },
    /// Bars of equal width, standing on zero.
    Bars { first: f64, width: f64, heights: Vec<f64> },
    /// A value of `y` to compare with.
    Level(f64),
}

impl Curves<'_> {
    /// Draws it under a name for those who cannot see it.
    pub(in crate::report) fn draw(&self, to: &mut Markup, size: Size, name: &str) {
        let ticks = self.y.ticks();
        let letters = ticks.iter().map(|tick| tick.label.chars().count()).fold(LETTERS, usize::max);
        let margins = Margins { left: letters as f64 * LETTER + 12.0, right: 14.0, top: 24.0, bottom: 40.0 };
        Frame { size, margins, height: self.height }.draw(to, name, |frame, svg| {
            let (h, left) = (frame.height, -frame.margins.left);
            svg.words("text", &[("class", &"name"), ("x", &left), ("y", &-10)], self.y.title());
            for tick in ticks {
                let y = Short(h * (1.0 - tick.at));
                let ends: [(&str, &dyn Display); 4] =
                    [("class", &"grid"), ("x2", &frame.x(1.0)), ("y1", &y), ("y2", &y)];
                svg.leaf("line", &ends);
                svg.words("text", &[("class", &"tick end"), ("x", &-6), ("y", &y), ("dy", &4)], tick.label);
            }
            svg.node("g", &[("class", &"along")], |group| {
                for tick in self.x.ticks() {
                    let place: [(&str, &dyn Display); 3] =
                        [("class", &"tick middle"), ("x", &frame.x(tick.at)), ("y", &(h + 16.0))];
                    group.words("text", &place, tick.label);
                }
            });
            let place: [(&str, &dyn Display); 3] = [("class", &"name end"), ("x", &frame.x(1.0)), ("y", &(h + 34.0))];
            svg.words("text", &place, self.x.title());
            self.draw_layers(frame, svg);
        });
    }

    /// The layers, clipped to the surface, and stretched to it where it is fluid.
    fn draw_layers(&self, frame: &Frame, svg: &mut Markup) {
        let (w, h) = (frame.width(), frame.height);
        let view = format!("0 0 {} {}", Short(w), Short(h));
        let factor = self.x.factor();
        let (from, to) = (self.x.from / factor, self.x.to / factor);
        let attributes: [(&str, &dyn Display); 7] = [
            ("class", &"layers"),
            ("width", &frame.x(1.0)),
            ("height", &h),
            ("viewBox", &view),
            ("preserveAspectRatio", &"none"),
            ("data-from", &from),
            ("data-to", &to),
        ];
        svg.node("svg", &attributes, |svg| {
            let (x, y) = (|v: f64| Short(w * self.x.at(v)), |v: f64| Short(h * (1.0 - self.y.at(v))));
            for layer in &self.layers {
                match layer {
                    Layer::Band { class, x: places, y: band } => {
                        svg.leaf("path", &[("class", class), ("d", &path(places, &band.low, &band.high, x, y))]);
                    }
                    Layer::Area { class, x: places, y: band } => {
                        svg.leaf("path", &[("class", class), ("d", &area(places, band, x, y))]);
                    }
                    Layer::Curve { class, points } => {
                        let mut d = String::new();
                        for (i, (place, value)) in points.iter().enumerate() {
                            // Writing to a string does not fail.
                            let _ = write!(d, "{}{} {}", if i == 0 { 'M' } else { 'L' }, x(*place), y(*value));
                        }
                        svg.leaf("path", &[("class", class), ("d", &d)]);
                    }
                    Layer::Bars { first, width, heights } => {
                        let mut d = String::new();
                        for (i, height) in heights.iter().enumerate().filter(|(_, height)| **height != 0.0) {
                            let (begin, end) = (first + width * (i as f64 + 0.1), first + width * (i as f64 + 0.9));
                            // Writing to a string does not fail.
                            let _ = write!(d, "M{} {}V{}H{}V{}Z", x(begin), y(0.0), y(*height), x(end), y(0.0));
                        }
                        svg.leaf("path", &[("class", &"bar"), ("d", &d)]);
                    }
                    Layer::Level(value) => {
                        let d = format!("M0 {0}H{1}", y(*value), Short(w));
                        svg.leaf("path", &[("class", &"level"), ("d", &d)]);
                    }
                }
            }
        });
    }
}

/// A line through all columns, up and down each, broken where there is nothing.
fn path(
    places: &[f64],
    low: &[Option<f64>],
    high: &[Option<f64>],
    x: impl Fn(f64) -> Short,
    y: impl Fn(f64) -> Short,
) -> String {
    let mut d = String::new();
    let mut before = None;
    for ((place, low), high) in places.iter().zip(low).zip(high) {
        let (Some(low), Some(high)) = (*low, *high) else {
            before = None;
            continue;
        };
        // From the end that is nearer to where the line stands.
        let upwards = before.is_none_or(|before: f64| (before - low).abs() <= (before - high).abs());
        let (first, last) = if upwards { (low, high) } else { (high, low) };
        let step = if before.is_none() { 'M' } else { 'L' };
        // Writing to a string does not fail. A lone point is drawn, too, by a line of no length.
        let _ = write!(d, "{step}{} {}", x(*place), y(first));
        if last != first || before.is_none() {
            let _ = write!(d, "V{}", y(last));
        }
        before = Some(last);
    }
    d
}

/// There along the greatest and back along the least, in pieces where there is nothing between.
fn area(places: &[f64], band: &Band, x: impl Fn(f64) -> Short, y: impl Fn(f64) -> Short) -> String {
    let columns: Vec<Option<(f64, f64, f64)>> = places
        .iter()
        .zip(band.low.iter().zip(&band.high))
        .map(|(place, (low, high))| Some((*place, (*low)?, (*high)?)))
        .collect();
    let mut d = String::new();
    for piece in columns.split(Option::is_none) {
        let there = piece.iter().flatten().map(|(place, _, high)| (place, high));
        let back = piece.iter().rev().flatten().map(|(place, low, _)| (place, low));
        for (i, (place, value)) in there.chain(back).enumerate() {
            // Writing to a string does not fail.
            let _ = write!(d, "{}{} {}", if i == 0 { 'M' } else { 'L' }, x(*place), y(*value));
        }
        d.push_str(if piece.is_empty() { "" } else { "Z" });
    }
    d
}
