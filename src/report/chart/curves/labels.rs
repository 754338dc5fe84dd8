//! The parts of a drawing of curves that are not scaled: points, and the labels of levels and marks.

use super::super::scale::Scale;
use super::super::{Frame, Short, class};
use crate::report::markup::Markup;
use crate::section::{Curves, Layer};
use core::fmt::Display;

/// Where letters stand above or below their line (px).
const ABOVE: f64 = -5.0;
const BELOW: f64 = 14.0;
/// How far letters reach above and under their base line, and the mean width of one (px).
const HEIGHT: f64 = 11.0;
const UNDER: f64 = 3.0;
const WIDTH: f64 = 6.3;
/// Margin at both ends of a label (px).
const BESIDE: f64 = 4.0;
/// The least width of a drawing on a page (px).
const NARROW: f64 = 275.0;

/// Draws the points of a layer, or its label.
pub(super) fn draw(layer: &Layer, curves: &Curves, frame: &Frame, svg: &mut Markup, axes: (&Scale, &Scale)) {
    let (x, y) = axes;
    let h = frame.height;
    let inside = |at: f64| (-1e-9..=1.0 + 1e-9).contains(&at);
    match layer {
        Layer::Dots { style, points } => {
            for (a, b) in points.iter().map(|(a, b)| (x.at(*a), y.at(*b))).filter(|(a, b)| inside(*a) && inside(*b)) {
                let (cx, cy) = (frame.x(a), Short(h * (1.0 - b)));
                let class = format!("point {}", class(*style));
                let dot: [(&str, &dyn Display); 4] = [("class", &class), ("cx", &cx), ("cy", &cy), ("r", &3)];
                svg.leaf("circle", &dot);
            }
        }
        Layer::Level { value, label } if !label.is_empty() && inside(y.at(*value)) => {
            let (end, base) = place(label, h * (1.0 - y.at(*value)), h, &obstacles(curves, h, axes));
            let place: [(&str, &dyn Display); 3] = [("class", &"note end"), ("x", &frame.x(end)), ("y", &Short(base))];
            svg.words("text", &place, label);
        }
        Layer::Mark { value, label } if !label.is_empty() && inside(x.at(*value)) => {
            let at = x.at(*value);
            let (side, shift) = if at > 0.7 { ("note end", -4) } else { ("note", 4) };
            let place: [(&str, &dyn Display); 4] = [("class", &side), ("x", &frame.x(at)), ("y", &12), ("dx", &shift)];
            svg.words("text", &place, label);
        }
        _ => {}
    }
}

/// Where a label beside a level ends (part of the width), and its base line (px from above): where the fewest obstacles cross
/// it, of such places at the nearest to the right end, and above the level rather than below.
fn place(label: &str, level: f64, height: f64, obstacles: &[(f64, f64)]) -> (f64, f64) {
    const PLACES: u32 = 100;
    let width = label.chars().count() as f64 * WIDTH / NARROW;
    let ends = (0..=PLACES).rev().map(|i| f64::from(i) / f64::from(PLACES)).filter(|end| *end >= width.min(1.0));
    let places = ends.flat_map(|end| [ABOVE, BELOW].map(|shift| (end, level + shift)));
    let places = places.filter(|(_, base)| *base > HEIGHT && *base < height);
    let crossed = |&(end, base): &(f64, f64)| {
        let beside = BESIDE / NARROW;
        let (across, upright) = (end - width - beside..=end + beside, base - HEIGHT..=base + UNDER);
        obstacles.iter().filter(|(x, y)| across.contains(x) && upright.contains(y)).count()
    };
    places.min_by_key(crossed).unwrap_or((1.0, level + BELOW))
}

/// Points of all lines, bars, dots and marks, close to each other: the part of the width and the distance from above (px).
fn obstacles(curves: &Curves, height: f64, (x, y): (&Scale, &Scale)) -> Vec<(f64, f64)> {
    /// Points of a piece of a line.
    const PARTS: u32 = 16;
    let place = |(a, b): (f64, f64)| (x.at(a), height * (1.0 - y.at(b)));
    let between = |from: (f64, f64), to: (f64, f64)| {
        (0..=PARTS).map(move |i| {
            let part = f64::from(i) / f64::from(PARTS);
            (from.0 + part * (to.0 - from.0), from.1 + part * (to.1 - from.1))
        })
    };
    let of = |layer: &Layer| -> Vec<(f64, f64)> {
        match layer {
            Layer::Line { points, .. } => {
                points.windows(2).flat_map(|pair| between(place(pair[0]), place(pair[1]))).collect()
            }
            Layer::Dots { points, .. } => points.iter().map(|point| place(*point)).collect(),
            Layer::Bars { first, width, heights, .. } => {
                let bars = heights.iter().enumerate().filter(|(_, top)| **top != 0.0);
                bars.flat_map(|(i, top)| {
                    let at = first + width * (i as f64 + 0.5);
                    between(place((at, 0.0)), place((at, *top)))
                })
                .collect()
            }
            Layer::Mark { value, .. } => between((x.at(*value), 0.0), (x.at(*value), height)).collect(),
            Layer::Level { .. } => vec![],
        }
    };
    curves.layers.iter().flat_map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A parabola crosses a level near both ends, a mark in the middle: the label stands between.
    #[test]
    fn labels_are_not_crossed() {
        let parabola = |i: u32| (f64::from(i) / 100.0, 160.0 - 160.0 * (f64::from(i) / 50.0 - 1.0).powi(2));
        let obstacles: Vec<(f64, f64)> = (0..=100).map(parabola).chain((0..160).map(|y| (0.5, f64::from(y)))).collect();
        let level = 160.0 / 3.0;
        let (end, base) = place("95 % threshold", level, 160.0, &obstacles);
        // The parabola meets the lower edge of the letters, 51.3 px from above, at 0.5 + 0.5 sqrt(1 - 51.3 / 160) = 0.912.
        assert!(end < 0.92 && end - 14.0 * WIDTH / NARROW > 0.5 && base == level + ABOVE, "{end} {base}");
        assert_eq!(place("all", 80.0, 160.0, &[]), (1.0, 80.0 + ABOVE));
        assert_eq!(place("all", 4.0, 160.0, &[]).1, 4.0 + BELOW, "there is no room above");
    }
}
