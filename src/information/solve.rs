//! The minimizing step, and what there is to say when there is none.

use super::Information;

/// A pivot below this part of its column's norm is no more than rounding, per column of the triangle. (A dependent one of
/// four columns keeps 5e-14 after ten million rows in blocks of two, 5e-15 in blocks of 256.)
const NEGLIGIBLE: f64 = 4e-14;

/// The data do not determine the unknowns: one column is zero or a combination of those before it.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error(
    "column {column} {}: fix or remove that unknown, give it a prior, or take data that excite it",
    if *norm == 0.0 { "is zero (its unknown has no influence)".to_string() }
    else if norm.is_finite() { format!("depends on those before it (only {independence:.1e} of it is independent)") }
    else { "is not finite".to_string() }
)]
pub struct RankDeficient {
    /// The first column without a usable pivot.
    pub column: usize,
    /// Its Euclidean norm.
    pub norm: f64,
    /// Norm of its part that is independent of the columns before, relative to `norm`.
    pub independence: f64,
}

impl Information {
    /// The minimizer `d` of `|y - Phi d|^2`.
    ///
    /// # Errors
    /// Names the first column whose pivot is zero, or no more than rounding of the column.
    pub fn solve(&self) -> Result<Vec<f64>, RankDeficient> {
        self.full_rank()?;
        let n = self.columns();
        let mut d: Vec<f64> = (0..n).map(|i| self.at(i, n)).collect();
        for i in (0..n).rev() {
            let known: f64 = (i + 1..n).map(|j| self.at(i, j) * d[j]).sum();
            d[i] = (d[i] - known) / self.at(i, i);
        }
        Ok(d)
    }

    /// Relative size at which a pivot, or a singular value of columns scaled to unit norm, is no more than rounding.
    pub fn tolerance(&self) -> f64 {
        NEGLIGIBLE * self.columns() as f64
    }

    /// Checks every pivot against its column; the column norms if all are usable.
    pub(super) fn full_rank(&self) -> Result<Vec<f64>, RankDeficient> {
        let norms = self.column_norms();
        for (column, &norm) in norms.iter().enumerate() {
            let independence = self.at(column, column) / norm;
            // Also false for NaN.
            let usable = independence > self.tolerance() && norm.is_finite();
            if !usable {
                let independence = if norm == 0.0 { 0.0 } else { independence };
                return Err(RankDeficient { column, norm, independence });
            }
        }
        Ok(norms)
    }
}

#[cfg(test)]
mod tests {
    use crate::information::Information;

    /// Whether columns depend on each other is a matter of their directions, not of their units.
    #[test]
    fn rank_has_no_unit() {
        let of = |second: [f64; 2], units: [f64; 2]| {
            let mut triangle = Information::new(2);
            for (first, second) in [3.0, 4.0].into_iter().zip(second) {
                triangle.absorb_row(&[units[0] * first, units[1] * second], 1.0);
            }
            triangle.solve()
        };
        for units in [[1.0, 1.0], [1e-12, 1.0], [1e12, 1e-12], [1e12, 1e12]] {
            // A right angle: each coefficient is that of a regression by itself, 7 / 25 and -1 / 25.
            let found = of([-4.0, 3.0], units).unwrap();
            assert!((found[0] * units[0] * 25.0 - 7.0).abs() < 1e-12, "{found:?} {units:?}");
            assert!((found[1] * units[1] * 25.0 + 1.0).abs() < 1e-12, "{found:?} {units:?}");
            let dependent = of([6.0, 8.0], units).unwrap_err();
            assert!(dependent.column == 1 && dependent.independence < 1e-14, "{dependent:?}");
            assert!((dependent.norm / (10.0 * units[1]) - 1.0).abs() < 1e-14, "{dependent:?}");
        }
    }
}
