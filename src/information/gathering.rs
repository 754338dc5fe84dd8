//! [`Gathering`]: a triangle with the rows that it has not absorbed yet.

use super::{Block, Information};

/// Rows that are absorbed together: they fill the fast cache without leaving it.
const ROWS: usize = 256;

/// A triangle that takes row by row and absorbs many together.
#[derive(Debug)]
pub(crate) struct Gathering {
    triangle: Information,
    block: Block,
}

impl Gathering {
    pub fn new(columns: usize) -> Self {
        Gathering::in_blocks(columns, ROWS)
    }

    /// Absorbs so many rows together, where many triangles are kept.
    pub fn in_blocks(columns: usize, rows: usize) -> Self {
        Gathering { triangle: Information::new(columns), block: Block::new(columns, rows) }
    }

    #[inline(always)]
    pub fn take(&mut self, phi: &[f64], y: f64) {
        self.triangle.gather(&mut self.block, phi, y);
    }

    /// Adds the rows of another one behind its own.
    pub fn append(&mut self, later: Self) {
        self.triangle.absorb(&mut self.block);
        self.triangle.merge(&later.triangle());
    }

    /// The triangle of all rows.
    pub fn triangle(mut self) -> Information {
        self.triangle.absorb(&mut self.block);
        self.triangle
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// More rows than one block holds, in two pieces: the triangle of the rows one by one, to the rounding of sums of 600 numbers.
    #[test]
    fn pieces_give_the_triangle_of_all_rows() {
        let row = |k: u32| ([f64::from(k % 7), f64::from(k * k % 11) - 5.0], f64::from(k % 3));
        let of = |range: std::ops::Range<u32>| {
            let mut rows = Gathering::new(2);
            range.map(row).for_each(|(phi, y)| rows.take(&phi, y));
            rows
        };
        let (mut found, mut expected) = (of(0..300), Information::new(2));
        found.append(of(300..600));
        (0..600).map(row).for_each(|(phi, y)| expected.absorb_row(&phi, y));
        let found = found.triangle();
        assert_eq!(found.rows(), 600);
        for (i, j) in [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)] {
            let (a, b) = (found.at(i, j).abs(), expected.at(i, j).abs());
            assert!((a - b).abs() < 1e-12 * expected.at(0, 0), "{i} {j}: {a} {b}");
        }
    }

    /// Rows times a number give the triangle times it, and as many rows.
    #[test]
    fn rows_times_a_number() {
        let row = |k: u32| ([f64::from(k % 7), f64::from(k * k % 11) - 5.0], f64::from(k % 3));
        let of = |factor: f64| {
            let mut rows = Gathering::new(2);
            (0..30).map(row).for_each(|(phi, y)| rows.take(&phi.map(|phi| factor * phi), factor * y));
            rows.triangle()
        };
        let (found, expected) = (of(1.0).times(3.0), of(3.0));
        assert_eq!(found.rows(), 30);
        for (i, j) in [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)] {
            assert!((found.at(i, j) - expected.at(i, j)).abs() < 1e-12 * expected.at(0, 0), "{i} {j}");
        }
    }
}
