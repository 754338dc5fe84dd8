//! [`Heat`]: a table of colored cells.

use super::{Frame, LETTER, Margins, Size, cut};
use crate::report::markup::Markup;
use core::fmt::Display;

/// Cells in rows, all of one width.
#[derive(Clone, Debug)]
pub(in crate::report) struct Heat {
    /// Names of the rows.
    pub rows: Vec<String>,
    /// What stands above the columns.
    pub columns: Vec<String>,
    /// Row by row.
    pub cells: Vec<Vec<Cell>>,
}

/// One cell.
#[derive(Clone, Debug)]
pub(in crate::report) struct Cell {
    /// Class of its color in the style sheet.
    pub class: &'static str,
    /// How strong its color is, from 0 to 1.
    pub strength: f64,
    /// What stands in it, where there is room.
    pub text: String,
}

const LETTERS: usize = 14;
/// Of more columns than these, the texts would not fit on a narrow screen.
const WRITTEN: usize = 10;
/// The strongest color that letters are still read on.
const STRENGTH: f64 = 0.6;

impl Heat {
    /// Draws it under a name for those who cannot see it.
    pub(in crate::report) fn draw(&self, to: &mut Markup, size: Size, name: &str) {
        let n = self.columns.len();
        let height = if n <= WRITTEN { 30.0 } else { 22.0 };
        let letters = self.rows.iter().map(|label| label.chars().count()).max().unwrap_or(0).min(LETTERS);
        let margins = Margins { left: letters as f64 * LETTER + 12.0, right: 8.0, top: 24.0, bottom: 8.0 };
        Frame { size, margins, height: height * self.rows.len() as f64 }.draw(to, name, |frame, svg| {
            let middle = |j: usize| frame.x((j as f64 + 0.5) / n as f64);
            for (j, label) in self.columns.iter().enumerate() {
                svg.words("text", &[("class", &"middle"), ("x", &middle(j)), ("y", &-8)], label);
            }
            for (i, (label, cells)) in self.rows.iter().zip(&self.cells).enumerate() {
                let y = height * (i as f64 + 0.5);
                svg.words("text", &[("class", &"end"), ("x", &-6), ("y", &y), ("dy", &4)], cut(label, LETTERS));
                for (j, Cell { class, strength, text }) in cells.iter().enumerate() {
                    let rect: [(&str, &dyn Display); 6] = [
                        ("class", &format_args!("cell {class}")),
                        ("x", &frame.x(j as f64 / n as f64)),
                        ("y", &(height * i as f64)),
                        ("width", &frame.x(1.0 / n as f64)),
                        ("height", &height),
                        ("fill-opacity", &format_args!("{:.2}", STRENGTH * strength.clamp(0.0, 1.0))),
                    ];
                    svg.leaf("rect", &rect);
                    if n <= WRITTEN {
                        let place: [(&str, &dyn Display); 4] =
                            [("class", &"middle"), ("x", &middle(j)), ("y", &y), ("dy", &4)];
                        svg.words("text", &place, text);
                    }
                }
            }
        });
    }
}
