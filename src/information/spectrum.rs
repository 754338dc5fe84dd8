//! Singular values of the triangle: rank, condition, and the directions that the data do not see.

use super::Information;
use faer::Mat;

/// Singular values of `Phi diag(scales)`, descending, each with its direction in the space of the scaled unknowns
/// (`d_i = scales_i v_i`).
#[derive(Clone, Debug, PartialEq)]
pub struct Spectrum {
    /// Singular values, largest first.
    pub values: Vec<f64>,
    /// Unit right singular vectors, in the order of `values`.
    pub directions: Vec<Vec<f64>>,
}

/// The triangle or the scales hold something that is not a finite number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("there is no singular value decomposition: column {column} of the scaled slopes is not finite")]
pub struct NoSpectrum {
    /// The first column that is not finite.
    pub column: usize,
}

impl Information {
    /// Singular value decomposition of `Phi diag(scales)` (a missing scale is one). With `scales` the inverse of the
    /// [column norms](Self::column_norms), rank and condition do not depend on units.
    ///
    /// # Errors
    /// If an entry of the triangle times its scale is not finite.
    pub fn decomposition(&self, scales: &[f64]) -> Result<Spectrum, NoSpectrum> {
        let n = self.columns();
        let scaled = |i: usize, j: usize| self.at(i, j) * scales.get(j).copied().unwrap_or(1.0);
        if let Some(column) = (0..n).find(|&j| !(0..=j).all(|i| scaled(i, j).is_finite())) {
            return Err(NoSpectrum { column });
        }
        let svd = Mat::from_fn(n, n, scaled).svd().map_err(|_| NoSpectrum { column: 0 })?;
        let (s, v) = (svd.S().column_vector(), svd.V());
        Ok(Spectrum {
            values: (0..n).map(|k| s[k]).collect(),
            directions: (0..n).map(|k| (0..n).map(|i| v[(i, k)]).collect()).collect(),
        })
    }
}

impl Spectrum {
    /// How many singular values exceed `tolerance` times the largest.
    pub fn rank(&self, tolerance: f64) -> usize {
        let largest = self.values.first().copied().unwrap_or(0.0);
        self.values.iter().filter(|&&value| value > tolerance * largest).count()
    }

    /// Unit directions along which the unknowns change nothing, by the same rule as [`rank`](Self::rank).
    pub fn null_directions(&self, tolerance: f64) -> &[Vec<f64>] {
        &self.directions[self.rank(tolerance)..]
    }

    /// Largest over smallest singular value; infinite if the smallest is zero, one if there is none.
    pub fn condition(&self) -> f64 {
        match (self.values.first(), self.values.last()) {
            (Some(_), Some(&0.0)) => f64::INFINITY,
            (Some(largest), Some(smallest)) => largest / smallest,
            _ => 1.0,
        }
    }
}
