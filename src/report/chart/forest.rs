//! [`Forest`]: estimates as dots with their intervals as bars.

use super::axes::{Axis, round_step};
use super::{Frame, LETTER, Margins, Short, Size, cut};
use crate::report::markup::Markup;
use core::fmt::Display;

/// Intervals relative to their estimates, all on one scale.
#[derive(Clone, Debug)]
pub(in crate::report) struct Forest {
    pub rows: Vec<Row>,
}

/// One estimate.
#[derive(Clone, Debug)]
pub(in crate::report) struct Row {
    pub name: String,
    /// Ends of the interval relative to the estimate (%), or why there is none.
    pub interval: Result<(f64, f64), String>,
}

const ROW: f64 = 28.0;
/// An interval so many times as wide as the middle one is cut, lest it leave nothing to see of the others.
const WIDEST: f64 = 4.0;
const LETTERS: usize = 14;

impl Forest {
    /// Draws it under a name for those who cannot see it.
    pub(in crate::report) fn draw(&self, to: &mut Markup, size: Size, name: &str) {
        let reach = self.reach();
        let axis = Axis::new("95 % interval about the estimate", "%", Some((-reach, reach)));
        let letters = self.rows.iter().map(|row| row.name.chars().count()).max().unwrap_or(0).min(LETTERS);
        let margins = Margins { left: letters as f64 * LETTER + 14.0, right: 18.0, top: 6.0, bottom: 40.0 };
        let height = ROW * self.rows.len() as f64;
        Frame { size, margins, height }.draw(to, name, |frame, svg| {
            for tick in axis.ticks() {
                let x = frame.x(tick.at);
                let class = if tick.label == "0" { "zero" } else { "grid" };
                svg.leaf("line", &[("class", &class), ("x1", &x), ("x2", &x), ("y2", &height)]);
                let place: [(&str, &dyn Display); 3] = [("class", &"tick middle"), ("x", &x), ("y", &(height + 16.0))];
                svg.words("text", &place, tick.label);
            }
            let place: [(&str, &dyn Display); 3] =
                [("class", &"name end"), ("x", &frame.x(1.0)), ("y", &(height + 34.0))];
            svg.words("text", &place, axis.title());
            for (i, row) in self.rows.iter().enumerate() {
                row.draw(frame, svg, &axis, ROW * (i as f64 + 0.5));
            }
        });
    }
}

impl Forest {
    /// The end of the axis (%): the widest interval fits, or four of the middle one do.
    fn reach(&self) -> f64 {
        let known = self.rows.iter().filter_map(|row| row.interval.as_ref().ok());
        let mut widths: Vec<f64> = known.map(|(lower, upper)| upper.max(-lower)).filter(|w| w.is_finite()).collect();
        widths.sort_by(f64::total_cmp);
        match (widths.get(widths.len() / 2), widths.last()) {
            (Some(middle), Some(widest)) if *middle > 0.0 => round_step(1.1 * widest.min(WIDEST * middle)),
            _ => 1.0,
        }
    }
}

impl Row {
    fn draw(&self, frame: &Frame, svg: &mut Markup, axis: &Axis, y: f64) {
        let place: [(&str, &dyn Display); 4] = [("class", &"end"), ("x", &-8), ("y", &y), ("dy", &4)];
        svg.words("text", &place, cut(&self.name, LETTERS));
        let (lower, upper) = match &self.interval {
            Ok(interval) => *interval,
            Err(why) => {
                let place: [(&str, &dyn Display); 4] = [("class", &"tick"), ("x", &6), ("y", &y), ("dy", &4)];
                return svg.words("text", &place, why);
            }
        };
        let (begin, end) = (axis.at(lower).clamp(0.0, 1.0), axis.at(upper).clamp(0.0, 1.0));
        let y = Short(y);
        let bar: [(&str, &dyn Display); 5] =
            [("class", &"interval"), ("x1", &frame.x(begin)), ("x2", &frame.x(end)), ("y1", &y), ("y2", &y)];
        svg.leaf("line", &bar);
        for (beyond, at, arrow) in [(lower < axis.from, 0.0, "◂"), (upper > axis.to, 1.0, "▸")] {
            if beyond {
                let place: [(&str, &dyn Display); 4] =
                    [("class", &"beyond middle"), ("x", &frame.x(at)), ("y", &y), ("dy", &4)];
                svg.words("text", &place, arrow);
            }
        }
        svg.leaf("circle", &[("class", &"dot"), ("cx", &frame.x(axis.at(0.0))), ("cy", &y), ("r", &4.5)]);
    }
}
