//! [`SquareMatrix`]: a covariance or correlation to be kept, printed and stored.

use core::ops::{Index, IndexMut};
use serde::{Deserialize, Serialize};

/// A dense square matrix, indexed `m[(row, column)]`; serialized as a list of rows.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Rows", into = "Rows")]
pub struct SquareMatrix {
    size: usize,
    entries: Vec<f64>,
}

impl SquareMatrix {
    /// All zeros.
    pub fn zeros(size: usize) -> Self {
        SquareMatrix { size, entries: vec![0.0; size * size] }
    }

    /// The matrix whose entry `(i, j)` is `f(i, j)`.
    pub fn from_fn(size: usize, mut f: impl FnMut(usize, usize) -> f64) -> Self {
        let entries = (0..size * size).map(|at| f(at / size, at % size)).collect();
        SquareMatrix { size, entries }
    }

    /// Number of rows and of columns.
    pub fn size(&self) -> usize {
        self.size
    }

    /// The rows in order.
    pub fn rows(&self) -> impl Iterator<Item = &[f64]> {
        // Chunks of zero entries are not allowed, and an empty matrix has none.
        self.entries.chunks_exact(self.size.max(1))
    }

    /// The entries `(i, i)`.
    pub fn diagonal(&self) -> Vec<f64> {
        (0..self.size).map(|i| self[(i, i)]).collect()
    }
}

impl Index<(usize, usize)> for SquareMatrix {
    type Output = f64;
    /// # Panics
    /// If row or column is not below [`size`](SquareMatrix::size).
    #[track_caller]
    fn index(&self, (i, j): (usize, usize)) -> &f64 {
        assert!(i < self.size && j < self.size, "entry ({i}, {j}) of a square matrix of size {}", self.size);
        &self.entries[i * self.size + j]
    }
}

impl IndexMut<(usize, usize)> for SquareMatrix {
    #[track_caller]
    fn index_mut(&mut self, (i, j): (usize, usize)) -> &mut f64 {
        assert!(i < self.size && j < self.size, "entry ({i}, {j}) of a square matrix of size {}", self.size);
        &mut self.entries[i * self.size + j]
    }
}

/// The matrix as it is stored.
#[derive(Serialize, Deserialize)]
struct Rows(#[serde(with = "crate::real")] Vec<Vec<f64>>);

impl From<SquareMatrix> for Rows {
    fn from(matrix: SquareMatrix) -> Self {
        Rows(matrix.into())
    }
}

impl TryFrom<Rows> for SquareMatrix {
    type Error = String;
    fn try_from(Rows(rows): Rows) -> Result<Self, String> {
        rows.try_into()
    }
}

impl From<SquareMatrix> for Vec<Vec<f64>> {
    fn from(matrix: SquareMatrix) -> Self {
        matrix.rows().map(<[f64]>::to_vec).collect()
    }
}

impl TryFrom<Vec<Vec<f64>>> for SquareMatrix {
    type Error = String;
    fn try_from(rows: Vec<Vec<f64>>) -> Result<Self, String> {
        let size = rows.len();
        match rows.iter().position(|row| row.len() != size) {
            None => Ok(SquareMatrix { size, entries: rows.concat() }),
            Some(i) => Err(format!("row {i} of a square matrix with {size} rows has {} entries", rows[i].len())),
        }
    }
}

impl From<&SquareMatrix> for nalgebra::DMatrix<f64> {
    fn from(matrix: &SquareMatrix) -> Self {
        nalgebra::DMatrix::from_row_slice(matrix.size, matrix.size, &matrix.entries)
    }
}
