//! Covariances out of triangles, without normal equations.
//!
//! Columns are scaled to unit norm first, so that unknowns of any magnitude cost no accuracy.

use super::{Information, RankDeficient, SquareMatrix};

impl Information {
    /// `(Phi^T Phi)^-1`: the covariance of the solution per unit variance of `y`.
    ///
    /// # Errors
    /// As [`solve`](Self::solve).
    pub fn covariance(&self) -> Result<SquareMatrix, RankDeficient> {
        let norms = self.full_rank()?;
        let inverse = self.scaled_inverse(&norms);
        let n = norms.len();
        Ok(SquareMatrix::from_fn(n, |i, j| {
            (i.max(j)..n).map(|k| (inverse[(i, k)] / norms[i]) * (inverse[(j, k)] / norms[j])).sum()
        }))
    }

    /// `(Phi^T Phi)^-1 M (Phi^T Phi)^-1` with `M = Phi_m^T Phi_m` of the triangle `meat`: the covariance of the solution
    /// when the rows' weights are not their inverse variances. The rows of `meat` are the weighted slopes times the
    /// influence of their error (White, Econometrica 48 (1980) 817; Huber, 1967); its `y` is not used.
    ///
    /// # Errors
    /// As [`solve`](Self::solve).
    pub fn sandwich(&self, meat: &Information) -> Result<SquareMatrix, RankDeficient> {
        let norms = self.full_rank()?;
        let inverse = self.scaled_inverse(&norms);
        let n = norms.len();
        // With R the scaled triangle and S the meat's, scaled alike: W = S R^-1 R^-T, covariance W^T W.
        let half =
            SquareMatrix::from_fn(n, |i, j| (i..=j).map(|k| meat.slope(i, k) / norms[k] * inverse[(k, j)]).sum());
        let whole = SquareMatrix::from_fn(n, |i, j| (i.max(j)..n).map(|k| half[(i, k)] * inverse[(j, k)]).sum());
        Ok(SquareMatrix::from_fn(n, |i, j| {
            (0..n).map(|k| (whole[(k, i)] / norms[i]) * (whole[(k, j)] / norms[j])).sum()
        }))
    }

    /// `phi (Phi^T Phi)^-1 phi`: the variance of the prediction `phi . d` per unit variance of `y`. For a row that was
    /// absorbed it is its leverage, between 0 and 1: how much of its own value its prediction takes over (Belsley, Kuh
    /// and Welsch, Regression Diagnostics, 1980, section 2.1). Missing entries of `phi` are zero.
    ///
    /// # Errors
    /// As [`solve`](Self::solve).
    pub fn leverage(&self, phi: &[f64]) -> Result<f64, RankDeficient> {
        self.full_rank()?;
        let mut v: Vec<f64> = (0..self.columns()).map(|j| phi.get(j).copied().unwrap_or(0.0)).collect();
        for j in 0..v.len() {
            let known: f64 = (0..j).map(|i| self.at(i, j) * v[i]).sum();
            v[j] = (v[j] - known) / self.at(j, j);
        }
        Ok(v.iter().map(|v| v * v).sum())
    }

    // Entry of the triangle among the slopes; zero where there is no such column.
    fn slope(&self, i: usize, j: usize) -> f64 {
        if j < self.columns() { self.at(i, j) } else { 0.0 }
    }

    // Inverse of the triangle whose columns are divided by these norms, column by column.
    fn scaled_inverse(&self, norms: &[f64]) -> SquareMatrix {
        let mut inverse = SquareMatrix::zeros(norms.len());
        for j in 0..norms.len() {
            inverse[(j, j)] = norms[j] / self.at(j, j);
            for i in (0..j).rev() {
                let known: f64 = (i + 1..=j).map(|k| self.at(i, k) / norms[k] * inverse[(k, j)]).sum();
                inverse[(i, j)] = -known / (self.at(i, i) / norms[i]);
            }
        }
        inverse
    }
}
