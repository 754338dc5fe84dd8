//! [`Forest`]: estimates as dots with their intervals as bars.

use super::scale::{Scale, round_step};
use super::{Frame, LETTER, Margins, Short, Size, cut};
use crate::report::markup::Markup;
use crate::section::{Axis, Forest, Interval};
use core::fmt::Display;

const ROW: f64 = 28.0;
/// An interval so many times as wide as the middle one is cut, lest it leave nothing to see of the others.
const WIDEST: f64 = 4.0;
const LETTERS: usize = 14;

/// Draws it under a name for those who cannot see it.
pub(super) fn draw(forest: &Forest, to: &mut Markup, size: Size, name: &str) {
    let reach = reach(forest);
    let scale = Scale::new(&Axis::new(&forest.scale, "%"), Some((-reach, reach)));
    let letters = forest.rows.iter().map(|row| row.name.chars().count()).max().unwrap_or(0).min(LETTERS);
    let margins = Margins { left: letters as f64 * LETTER + 20.0, right: 18.0, top: 6.0, bottom: 40.0 };
    let height = ROW * forest.rows.len() as f64;
    Frame { size, margins, height }.draw(to, name, |frame, svg| {
        for tick in scale.ticks() {
            let x = frame.x(tick.at);
            let class = if tick.label == "0" { "zero" } else { "grid" };
            svg.leaf("line", &[("class", &class), ("x1", &x), ("x2", &x), ("y2", &height)]);
            let place: [(&str, &dyn Display); 3] = [("class", &"tick middle"), ("x", &x), ("y", &(height + 16.0))];
            svg.words("text", &place, tick.label);
        }
        let place: [(&str, &dyn Display); 3] = [("class", &"name end"), ("x", &frame.x(1.0)), ("y", &(height + 34.0))];
        svg.words("text", &place, scale.title());
        for (i, interval) in forest.rows.iter().enumerate() {
            row(interval, frame, svg, &scale, ROW * (i as f64 + 0.5));
        }
    });
}

/// The end of the axis (%): the widest interval fits, or four of the middle one do.
fn reach(forest: &Forest) -> f64 {
    let known = forest.rows.iter().filter_map(|row| row.ends);
    let mut widths: Vec<f64> = known.map(|(lower, upper)| upper.max(-lower)).filter(|w| w.is_finite()).collect();
    widths.sort_by(f64::total_cmp);
    match (widths.get(widths.len() / 2), widths.last()) {
        (Some(middle), Some(widest)) if *middle > 0.0 => round_step(1.1 * widest.min(WIDEST * middle)),
        _ => 1.0,
    }
}

fn row(interval: &Interval, frame: &Frame, svg: &mut Markup, scale: &Scale, y: f64) {
    let place: [(&str, &dyn Display); 4] = [("class", &"end"), ("x", &-14), ("y", &y), ("dy", &4)];
    svg.words("text", &place, cut(&interval.name, LETTERS));
    let Some((lower, upper)) = interval.ends else {
        let place: [(&str, &dyn Display); 4] = [("class", &"tick"), ("x", &6), ("y", &y), ("dy", &4)];
        return svg.words("text", &place, &interval.why);
    };
    let (begin, end) = (scale.at(lower).clamp(0.0, 1.0), scale.at(upper).clamp(0.0, 1.0));
    let y = Short(y);
    let bar: [(&str, &dyn Display); 5] =
        [("class", &"interval"), ("x1", &frame.x(begin)), ("x2", &frame.x(end)), ("y1", &y), ("y2", &y)];
    svg.leaf("line", &bar);
    for (beyond, at, shift, class, arrow) in
        [(lower < scale.from, 0.0, 1, "beyond end", "◀"), (upper > scale.to, 1.0, -1, "beyond", "▶")]
    {
        if beyond {
            let place: [(&str, &dyn Display); 5] =
                [("class", &class), ("x", &frame.x(at)), ("y", &y), ("dx", &shift), ("dy", &4)];
            svg.words("text", &place, arrow);
        }
    }
    svg.leaf("circle", &[("class", &"dot"), ("cx", &frame.x(scale.at(0.0))), ("cy", &y), ("r", &4.5)]);
}
