//! [`Whitening`]: from prediction errors to standardized ones.

use crate::information::SquareMatrix;
use crate::sweep::Window;

/// How the measurement noise is given.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Noise {
    /// Its standard deviation per output.
    Given(Vec<f64>),
    /// Its standard deviation for some outputs; for the others it is estimated.
    SomeGiven(Vec<Option<f64>>),
    /// Estimated per output.
    PerOutput,
    /// Estimated as a full covariance.
    Covariance,
    /// The predictor predicts its variance.
    Predicted,
}

impl Noise {
    /// The standard deviation that was given for output `j`.
    pub fn given(&self, j: usize) -> Option<f64> {
        match self {
            Noise::Given(sigma) => Some(sigma[j]),
            Noise::SomeGiven(sigma) => sigma[j],
            _ => None,
        }
    }
}

/// How errors are standardized: divided by their standard deviations, or multiplied by the inverse Cholesky factor of
/// their covariance.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Whitening {
    Diagonal(Vec<f64>),
    Full { covariance: SquareMatrix, inverse: SquareMatrix },
}

impl Whitening {
    /// Errors in the units of the outputs.
    pub fn none(outputs: usize) -> Self {
        Whitening::Diagonal(vec![1.0; outputs])
    }

    pub fn full(covariance: SquareMatrix) -> Option<Self> {
        let inverse = inverse_factor(&covariance)?;
        Some(Whitening::Full { covariance, inverse })
    }

    /// Standard deviation of each output.
    pub fn sigma(&self) -> Vec<f64> {
        match self {
            Whitening::Diagonal(sigma) => sigma.clone(),
            Whitening::Full { covariance, .. } => covariance.diagonal().iter().map(|v| v.sqrt()).collect(),
        }
    }

    /// Logarithm of the determinant of the covariance of a sample of which these outputs were measured.
    pub fn log_determinant(&self, here: &[usize]) -> f64 {
        match self {
            Whitening::Diagonal(sigma) => 2.0 * here.iter().map(|&j| sigma[j].ln()).sum::<f64>(),
            Whitening::Full { covariance, .. } => {
                -2.0 * factor_of_part(covariance, here).diagonal().iter().map(|l| l.ln()).sum::<f64>()
            }
        }
    }

    /// The same with all standard deviations multiplied by a factor.
    pub fn widened(&self, factor: f64) -> Self {
        match self {
            Whitening::Diagonal(sigma) => Whitening::Diagonal(sigma.iter().map(|s| s * factor).collect()),
            Whitening::Full { covariance, inverse } => {
                let n = covariance.size();
                Whitening::Full {
                    covariance: SquareMatrix::from_fn(n, |i, j| covariance[(i, j)] * factor * factor),
                    inverse: SquareMatrix::from_fn(n, |i, j| inverse[(i, j)] / factor),
                }
            }
        }
    }

    /// Standardizes the rows of a lane by a full covariance; does nothing where there is none.
    pub fn decorrelate(&self, window: &mut Window, lane: usize) {
        let Whitening::Full { covariance, inverse } = self else { return };
        for k in 0..window.samples[lane] {
            mix(covariance, inverse, window, k, lane);
        }
    }
}

/// Multiplies the rows of one sample of a lane by the inverse factor of the covariance of what was measured.
fn mix(covariance: &SquareMatrix, inverse: &SquareMatrix, window: &mut Window, k: usize, lane: usize) {
    let outputs = covariance.size();
    let here: Vec<usize> = (0..outputs).filter(|&j| window.is_measured(k, j, lane)).collect();
    // Where outputs are missing, the covariance is that of the measured ones.
    let part = (here.len() < outputs).then(|| factor_of_part(covariance, &here));
    let factor = part.as_ref().unwrap_or(inverse);
    let lanes = window.lanes();
    for column in 0..window.columns() {
        for a in (0..here.len()).rev() {
            let value = (0..=a).map(|b| factor[(a, b)] * window.at(k, here[b], column, lane)).sum();
            window.row_mut(k, here[a])[column * lanes + lane] = value;
        }
    }
}

/// Inverse of the lower Cholesky factor; `None` if the matrix is not positive definite.
fn inverse_factor(covariance: &SquareMatrix) -> Option<SquareMatrix> {
    let n = covariance.size();
    let matrix = nalgebra::DMatrix::from_fn(n, n, |i, j| covariance[(i, j)]);
    let inverse = matrix.cholesky()?.l().try_inverse()?;
    Some(SquareMatrix::from_fn(n, |i, j| inverse[(i, j)]))
}

/// The same of the rows and columns of some outputs.
fn factor_of_part(covariance: &SquareMatrix, here: &[usize]) -> SquareMatrix {
    let part = SquareMatrix::from_fn(here.len(), |a, b| covariance[(here[a], here[b])]);
    // A part of a positive definite matrix is one.
    inverse_factor(&part).unwrap_or_else(|| SquareMatrix::zeros(here.len()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The rows of one lane, a slope and an error of each output, are multiplied by the inverse of the factor of the covariance:
    /// `[[4, 2], [2, 10]] = L L'` with `L = [[2, 0], [1, 3]]`. What another lane holds stays.
    #[test]
    fn rows_of_a_lane_are_decorrelated() {
        let full = Whitening::full(SquareMatrix::from_fn(2, |i, j| [[4.0, 2.0], [2.0, 10.0]][i][j])).unwrap();
        for lane in 0..3 {
            let mut window = Window::new(3, 2, 1, 2, false);
            window.samples.fill(2);
            let before =
                |k: usize, j: usize, column: usize, lane: usize| (1 + k + 3 * j + 5 * column + 11 * lane) as f64;
            for (k, j) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                window.set_measured(k, j, 0b111);
                let entry = |i: usize| before(k, j, i / 3, i % 3);
                window.row_mut(k, j).iter_mut().enumerate().for_each(|(i, value)| *value = entry(i));
            }
            full.decorrelate(&mut window, lane);
            for (k, column, other) in (0..12).map(|i| (i % 2, i / 2 % 2, i / 4)) {
                let (y, z) = (before(k, 0, column, other), before(k, 1, column, other));
                let expected = if other == lane { [y / 2.0, (z - y / 2.0) / 3.0] } else { [y, z] };
                for (j, expected) in expected.into_iter().enumerate() {
                    let found = window.at(k, j, column, other);
                    assert!((found - expected).abs() < 1e-13, "{lane} {k} {j} {column} {other}: {found} {expected}");
                }
            }
        }
    }

    /// Determinants by hand: 35 of the whole, 4 and 9 of its parts; 36 where the outputs are independent.
    #[test]
    fn determinants_of_parts() {
        let entry = |i: usize, j: usize| [[4.0, 1.0], [1.0, 9.0]][i][j];
        let full = Whitening::full(SquareMatrix::from_fn(2, entry)).unwrap();
        for (here, determinant) in [(&[0, 1][..], 35.0f64), (&[0], 4.0), (&[1], 9.0)] {
            assert!((full.log_determinant(here) - determinant.ln()).abs() < 1e-12, "{here:?}");
        }
        let diagonal = Whitening::Diagonal(vec![2.0, 3.0]);
        assert!((diagonal.log_determinant(&[0, 1]) - 36f64.ln()).abs() < 1e-12);
        assert!((diagonal.widened(2.0).log_determinant(&[1]) - 36f64.ln()).abs() < 1e-12);
        assert!((full.widened(2.0).log_determinant(&[0, 1]) - (16.0f64 * 35.0).ln()).abs() < 1e-12);
    }
}
