//! [`Heat`]: a table of colored cells.

use super::{Frame, LETTER, Margins, Short, Size, cut};
use crate::numeral::number;
use crate::report::markup::Markup;
use crate::section::Heat;
use core::fmt::Display;

const LETTERS: usize = 14;
/// Numbers are written into so many columns on any screen, and into so many where the drawing is wide.
const FEW: usize = 5;
const MANY: usize = 12;
/// Width of the cells on the narrowest screen (px).
const NARROWEST: f64 = 200.0;
/// The strongest color that letters are still read on.
const STRENGTH: f64 = 0.6;

/// Draws it under a name for those who cannot see it.
pub(super) fn draw(heat: &Heat, to: &mut Markup, size: Size, name: &str) {
    let n = heat.columns.len().max(1);
    let height = if n <= MANY { 30.0 } else { 22.0 };
    let letters = heat.rows.iter().map(|label| label.chars().count()).max().unwrap_or(0).min(LETTERS);
    let margins = Margins { left: letters as f64 * LETTER + 12.0, right: 8.0, top: 24.0, bottom: 8.0 };
    Frame { size, margins, height: height * heat.rows.len() as f64 }.draw(to, name, |frame, svg| {
        let middle = |j: usize| frame.x((j as f64 + 0.5) / n as f64);
        for (j, label) in heat.columns.iter().enumerate().step_by(every(&heat.columns)) {
            svg.words("text", &[("class", &"middle"), ("x", &middle(j)), ("y", &-8)], label);
        }
        for (i, (label, cells)) in heat.rows.iter().zip(&heat.cells).enumerate() {
            let y = height * (i as f64 + 0.5);
            svg.words("text", &[("class", &"end"), ("x", &-6), ("y", &y), ("dy", &4)], cut(label, LETTERS));
            let largest = cells.iter().flatten().copied().fold(f64::MIN_POSITIVE, f64::max);
            for (j, cell) in cells.iter().enumerate().take(n) {
                // Values that are not finite have no color.
                let cell = &cell.filter(|value| value.is_finite());
                let (class, strength) = match cell {
                    None => ("none", 1.0),
                    Some(part) if heat.percent => ("excited", part / largest),
                    Some(value) => (if *value < 0.0 { "negative" } else { "positive" }, value.abs()),
                };
                let rect: [(&str, &dyn Display); 6] = [
                    ("class", &format_args!("cell {class}")),
                    ("x", &frame.x(j as f64 / n as f64)),
                    ("y", &(height * i as f64)),
                    ("width", &frame.x(1.0 / n as f64)),
                    ("height", &height),
                    ("fill-opacity", &Short(STRENGTH * strength.clamp(0.0, 1.0))),
                ];
                svg.leaf("rect", &rect);
                if n <= MANY {
                    let class = if n <= FEW { "middle" } else { "middle wide" };
                    let place: [(&str, &dyn Display); 4] =
                        [("class", &class), ("x", &middle(j)), ("y", &y), ("dy", &4)];
                    svg.words("text", &place, text(*cell, heat.percent));
                }
            }
        }
    });
}

/// One label of so many is written, lest they overlap on a narrow screen.
fn every(labels: &[String]) -> usize {
    let longest = labels.iter().map(|label| label.chars().count()).max().unwrap_or(0);
    let width = (longest + 1) as f64 * LETTER * labels.len() as f64;
    (width / NARROWEST).ceil().max(1.0) as usize
}

fn text(cell: Option<f64>, percent: bool) -> String {
    match cell {
        None => "–".to_owned(),
        Some(part) if percent && part < 5e-3 => String::new(),
        Some(part) if percent => format!("{:.0}", 100.0 * part),
        // A correlation that is not quite one is not written as one.
        Some(value) if value.abs() > 0.99 && value.abs() < 1.0 => {
            number((value * 1e3).trunc() / 1e3, 3).replace('-', "−")
        }
        Some(value) => number((value * 100.0).round() / 100.0, 2).replace('-', "−"),
    }
}

#[cfg(test)]
mod tests {
    use super::{every, text};

    /// Labels of `n` columns, each as wide as its letters and one more, fit the narrowest drawing.
    #[test]
    fn labels_do_not_overlap() {
        for (columns, longest) in [(10, "10"), (24, "24"), (40, "a name"), (3, "record of bench 3")] {
            let labels = vec![longest.to_owned(); columns];
            let written = columns.div_ceil(every(&labels));
            let width = written as f64 * (longest.len() + 1) as f64 * 7.0;
            assert!(written == 1 || width <= 200.0 + (longest.len() + 1) as f64 * 7.0, "{columns}: {width} px");
        }
        assert_eq!(every(&vec!["1".to_owned(); 5]), 1);
    }

    #[test]
    fn correlations_are_short() {
        assert_eq!(text(Some(-0.9996), false), "−0.999");
        assert_eq!((text(Some(1.0), false), text(Some(-0.004), false)), ("1".to_owned(), "0".to_owned()));
        assert_eq!((text(Some(0.126), true), text(Some(0.001), true)), ("13".to_owned(), String::new()));
    }
}
