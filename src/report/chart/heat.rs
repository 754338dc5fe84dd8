//! [`Heat`]: a correlation matrix as colored cells.

use super::{Frame, LETTER, Margins, Size, cut};
use crate::information::SquareMatrix;
use crate::report::markup::Markup;
use core::fmt::Display;

/// A matrix of numbers from -1 to 1.
#[derive(Clone, Debug)]
pub(in crate::report) struct Heat<'a> {
    pub names: Vec<&'a str>,
    pub matrix: &'a SquareMatrix,
}

const LETTERS: usize = 14;
/// Of more columns than these, the numbers would not fit on a narrow screen.
const WRITTEN: usize = 6;
/// The strongest color that letters are still read on.
const STRENGTH: f64 = 0.6;

impl Heat<'_> {
    /// Draws it under a name for those who cannot see it.
    pub(in crate::report) fn draw(&self, to: &mut Markup, size: Size, name: &str) {
        let n = self.matrix.size();
        let row = if n <= WRITTEN { 34.0 } else { 22.0 };
        let labels: Vec<String> = self.names.iter().enumerate().map(|(i, name)| format!("{} {name}", i + 1)).collect();
        let letters = labels.iter().map(|label| label.chars().count()).max().unwrap_or(0).min(LETTERS);
        let margins = Margins { left: letters as f64 * LETTER + 12.0, right: 8.0, top: 24.0, bottom: 8.0 };
        Frame { size, margins, height: row * n as f64 }.draw(to, name, |frame, svg| {
            let middle = |i: usize| (i as f64 + 0.5) / n as f64;
            for (i, label) in labels.iter().enumerate() {
                let y = row * (i as f64 + 0.5);
                svg.words("text", &[("class", &"end"), ("x", &-6), ("y", &y), ("dy", &4)], cut(label, LETTERS));
                svg.words("text", &[("class", &"middle"), ("x", &frame.x(middle(i))), ("y", &-8)], i + 1);
                for j in 0..n {
                    let r = self.matrix[(i, j)];
                    let class = if r < 0.0 { "cell negative" } else { "cell positive" };
                    let strength = format!("{:.2}", STRENGTH * r.abs().min(1.0));
                    let cell: [(&str, &dyn Display); 6] = [
                        ("class", &class),
                        ("x", &frame.x(j as f64 / n as f64)),
                        ("y", &(row * i as f64)),
                        ("width", &frame.x(1.0 / n as f64)),
                        ("height", &row),
                        ("fill-opacity", &strength),
                    ];
                    svg.leaf("rect", &cell);
                    if n <= WRITTEN {
                        let place: [(&str, &dyn Display); 4] =
                            [("class", &"middle"), ("x", &frame.x(middle(j))), ("y", &y), ("dy", &4)];
                        svg.words("text", &place, format!("{r:.2}").replace('-', "−"));
                    }
                }
            }
        });
    }
}
