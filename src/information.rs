//! [`Information`]: what weighted rows say about a vector of unknowns, kept as a square-root triangle.
//!
//! Rows `(phi, y)` ask for the `d` that minimizes `|y - Phi d|^2`. Orthogonal reflections reduce `[Phi | y]` to its
//! upper triangle `R`, row block by row block, so the memory does not grow with the rows and the accuracy is that of a QR
//! factorization: the normal equations, which square the condition number, are never formed (Golub and Van Loan, Matrix
//! Computations, 4th ed., section 5.3; Lawson and Hanson, Solving Least Squares Problems, chapter 27).
//!
//! In a nonlinear fit `phi` is the slope of the prediction, `y` the prediction error, both times the square root of the
//! weight, and the solution is the Gauss-Newton step.
//!
//! Triangles of different widths fit together: a column that a triangle or a row does not have is a column of zeros.

mod block;
mod chain;
mod covariance;
mod elimination;
mod gathering;
mod inverse;
mod matrix;
mod reflect;
mod solve;
mod spectrum;
mod triangles;

pub use block::Block;
pub(crate) use chain::Chain;
pub use covariance::Covariance;
pub use elimination::{BadPiece, Elimination, Undetermined};
pub(crate) use gathering::Gathering;
pub use matrix::SquareMatrix;
pub use solve::RankDeficient;
pub use spectrum::{NoSpectrum, Spectrum};
pub use triangles::Triangles;

use serde::{Deserialize, Serialize};

/// The upper triangle `R` of `[Phi | y]`, `Phi` the regressors (one column per unknown) and `y` what they should sum up
/// to. Its diagonal is nonnegative, which makes it unique where the columns are independent.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Stored")]
pub struct Information {
    columns: usize,
    rows: u64,
    // Row after row, each from its diagonal on; the last holds the root of the residual sum of squares.
    #[serde(with = "crate::real")]
    triangle: Vec<f64>,
}

impl Information {
    /// Nothing known about `columns` unknowns.
    pub fn new(columns: usize) -> Self {
        let width = columns + 1;
        Information { columns, rows: 0, triangle: vec![0.0; width * (width + 1) / 2] }
    }

    /// How many unknowns.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// How many rows were absorbed, directly or by [`merge`](Self::merge); rows of damping do not count.
    pub fn rows(&self) -> u64 {
        self.rows
    }

    /// Absorbs the rows of a block and empties it, without allocation, by the widest vector unit of the processor.
    pub fn absorb(&mut self, block: &mut Block) {
        if block.columns() != self.columns {
            return self.absorb_other_width(block);
        }
        self.rows += block.len() as u64;
        reflect::absorb(&mut self.triangle, block);
        block.clear();
    }

    /// Puts one row into a block of this width that gathers rows, and absorbs the block when it is full.
    #[inline(always)]
    pub(crate) fn gather(&mut self, block: &mut Block, phi: &[f64], y: f64) {
        if !block.push(phi, y) {
            self.absorb(block);
            let fits = block.push(phi, y);
            debug_assert!(fits, "a row of {} slopes for a block of {}", phi.len(), block.columns());
        }
    }

    #[cold]
    fn absorb_other_width(&mut self, block: &mut Block) {
        let mut other = Information::new(block.columns());
        other.absorb(block);
        self.merge(&other);
    }

    /// Absorbs one row by Givens rotations. It allocates a copy of the row; in a loop over samples, fill a [`Block`].
    pub fn absorb_row(&mut self, phi: &[f64], y: f64) {
        self.widen(phi.len());
        let mut row = phi.to_vec();
        row.resize(self.columns, 0.0);
        row.push(y);
        self.rotate(&mut row, 0);
        self.rows += 1;
    }

    /// Rotates a row into the triangle: its entries from this column on, and `y`. They are used up.
    fn rotate(&mut self, row: &mut [f64], first: usize) {
        let width = self.columns + 1;
        let (mut rest, begin) = (row, first * (2 * width + 1 - first) / 2);
        let mut triangle = &mut self.triangle[begin..];
        while let Some((&mut pivot, tail)) = rest.split_first_mut() {
            let (above, below) = triangle.split_at_mut(tail.len() + 1);
            if let Some((diagonal, above)) = above.split_first_mut()
                && pivot != 0.0
            {
                let norm = norm([*diagonal, pivot].into_iter());
                let (c, s) = (*diagonal / norm, pivot / norm);
                *diagonal = norm;
                for (r, v) in above.iter_mut().zip(tail.iter_mut()) {
                    (*r, *v) = (c * *r + s * *v, c * *v - s * *r);
                }
            }
            (rest, triangle) = (tail, below);
        }
    }

    /// The same, said to be made of so many rows.
    pub(crate) fn of_rows(self, rows: u64) -> Self {
        Information { rows, ..self }
    }

    /// The triangle of the same rows, all of them times a positive number.
    pub(crate) fn times(&self, factor: f64) -> Self {
        Information { triangle: self.triangle.iter().map(|entry| factor * entry).collect(), ..*self }
    }

    /// Whether all its numbers are finite.
    pub(crate) fn is_finite(&self) -> bool {
        self.triangle.iter().all(|entry| entry.is_finite())
    }

    /// Multiplies each column by a positive number, as if the slopes had been taken with respect to unknowns in other units.
    pub(crate) fn scale_columns(&mut self, scales: &[f64]) {
        let mut at = 0;
        for i in 0..=self.columns {
            for scale in scales.get(i..self.columns).unwrap_or_default() {
                self.triangle[at] *= scale;
                at += 1;
            }
            at += 1;
        }
    }

    /// Adds all that `other` knows: the result is as if its rows had been absorbed here.
    pub fn merge(&mut self, other: &Information) {
        self.widen(other.columns);
        let all: Vec<usize> = (0..self.columns).collect();
        let mut block = other.block_of(&all);
        self.absorb(&mut block);
        // The rows of the triangle stand for the rows it absorbed.
        self.rows = self.rows - (other.columns as u64 + 1) + other.rows;
    }

    /// The information on the remaining unknowns after the first `first` columns were minimized out.
    pub fn eliminate(&self, first: usize) -> Information {
        let columns = self.columns.saturating_sub(first);
        let size = (columns + 1) * (columns + 2) / 2;
        let triangle = self.triangle[self.triangle.len() - size..].to_vec();
        Information { columns, rows: self.rows, triangle }
    }

    /// The first columns of `Phi` alone, as far as their rows reach; with `y` zero.
    fn leading(&self, columns: usize) -> Information {
        let mut leading = Information::new(columns);
        leading.rows = self.rows;
        let mut start = 0;
        for i in 0..columns {
            leading.triangle[start..start + columns - i].copy_from_slice(&self.row(i).1[..columns - i]);
            start += columns + 1 - i;
        }
        leading
    }

    /// The information on these columns, in this order, with all others held at a zero step.
    pub fn select(&self, columns: &[usize]) -> Information {
        let mut selected = Information::new(columns.len());
        selected.absorb(&mut self.block_of(columns));
        selected.rows = self.rows;
        selected
    }

    /// The information on the unknowns counted from `d`: `y - Phi d` in the place of `y`. Missing entries of `d` are zero.
    pub fn about(&self, d: &[f64]) -> Information {
        let (mut moved, mut start, width) = (self.clone(), 0, self.columns + 1);
        for i in 0..self.columns {
            let known: f64 = (i..self.columns).zip(d.iter().skip(i)).map(|(j, d)| self.at(i, j) * d).sum();
            start += width - i;
            moved.triangle[start - 1] -= known;
        }
        moved
    }

    /// With the rows `diag(diagonal) d = 0` added: Levenberg-Marquardt damping, or a prior with zero mean.
    pub fn damped(&self, diagonal: &[f64]) -> Information {
        let mut damped = self.clone();
        damped.widen(diagonal.len());
        let mut block = Block::new(damped.columns, diagonal.len());
        for (i, &value) in diagonal.iter().enumerate() {
            block.column_mut(i)[i] = value;
        }
        block.set_len(diagonal.len());
        damped.absorb(&mut block);
        damped.rows = self.rows;
        damped
    }

    /// Gradient of `1/2 |y - Phi d|^2` at `d = 0`: `-Phi^T y`.
    pub fn gradient(&self) -> Vec<f64> {
        let column = |j| (0..=j).map(|i| -self.at(i, j) * self.at(i, self.columns)).sum();
        (0..self.columns).map(column).collect()
    }

    /// `|y|^2`: the sum of squares at `d = 0`.
    pub fn residual_at_zero(&self) -> f64 {
        (0..=self.columns).map(|i| self.at(i, self.columns).powi(2)).sum()
    }

    /// The smallest sum of squares `|y - Phi d|^2` over all `d`.
    pub fn residual(&self) -> f64 {
        self.at(self.columns, self.columns).powi(2)
    }

    /// Euclidean norm of each column of `Phi`.
    pub fn column_norms(&self) -> Vec<f64> {
        (0..self.columns).map(|j| self.column_norm(j)).collect()
    }

    fn column_norm(&self, j: usize) -> f64 {
        norm((0..=j).map(|i| self.at(i, j)))
    }

    /// Entry of the triangle, `i <= j`, the column `columns` being `y`; zero below the diagonal.
    pub fn at(&self, i: usize, j: usize) -> f64 {
        let width = self.columns + 1;
        if i > j || j >= width { 0.0 } else { self.triangle[i * (2 * width + 1 - i) / 2 + j - i] }
    }

    // Row `i` of the triangle: its `y`, and its slopes from the diagonal on.
    fn row(&self, i: usize) -> (f64, &[f64]) {
        let width = self.columns + 1;
        let start = i * (2 * width + 1 - i) / 2;
        let (slopes, y) = self.triangle[start..].split_at(self.columns - i);
        (y[0], slopes)
    }

    // The triangle's rows as a block, with these columns.
    fn block_of(&self, columns: &[usize]) -> Block {
        let rows = self.columns + 1;
        let mut block = Block::new(columns.len(), rows);
        let y = self.columns;
        let sources = columns.iter().map(|&j| if j < y { Some(j) } else { None }).chain([Some(y)]);
        for (target, source) in sources.enumerate() {
            if let Some(j) = source {
                for (i, entry) in block.column_mut(target)[..rows].iter_mut().enumerate() {
                    *entry = self.at(i, j);
                }
            }
        }
        block.set_len(rows);
        block
    }

    // Appends columns of zeros.
    fn widen(&mut self, columns: usize) {
        if columns > self.columns {
            let all: Vec<usize> = (0..columns).map(|j| if j < self.columns { j } else { usize::MAX }).collect();
            *self = self.select(&all);
        }
    }
}

/// Euclidean norm without overflow or underflow.
pub(crate) fn norm(entries: impl Iterator<Item = f64> + Clone) -> f64 {
    let squares: f64 = entries.clone().map(|entry| entry * entry).sum();
    if (1e-200..1e200).contains(&squares) { squares.sqrt() } else { entries.fold(0.0, f64::hypot) }
}

#[derive(Deserialize)]
struct Stored {
    columns: usize,
    rows: u64,
    #[serde(with = "crate::real")]
    triangle: Vec<f64>,
}

impl TryFrom<Stored> for Information {
    type Error = String;
    fn try_from(stored: Stored) -> Result<Self, String> {
        let Stored { columns, rows, triangle } = stored;
        // In wide integers: a width made to overflow must not pass for a small one.
        let width = columns as u128 + 1;
        let size = width.div_ceil(2) * (width + (width + 1) % 2);
        if triangle.len() as u128 == size {
            Ok(Information { columns, rows, triangle })
        } else {
            Err(format!("the triangle of {columns} columns has {size} entries, not {}", triangle.len()))
        }
    }
}
