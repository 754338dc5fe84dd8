//! [`Whitening`]: from prediction errors to standardized ones, and how large the noise is.

use super::objective::{Objective, Rows};
use crate::information::SquareMatrix;
use crate::loss::{Huber, Loss};
use crate::optimize::Infeasible;
use crate::predict::{WINDOW, Window};
use statrs::distribution::{Continuous, ContinuousCDF, Normal};

/// What is said of the measurement noise.
#[derive(Clone, Debug)]
pub(crate) enum Noise {
    /// Its standard deviation per output.
    Given(Vec<f64>),
    /// Estimated per output.
    PerOutput,
    /// Estimated as a full covariance.
    Covariance,
}

/// How errors are standardized: divided by their standard deviations, or multiplied by the inverse Cholesky factor of
/// their covariance.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Whitening {
    Diagonal(Vec<f64>),
    Full { covariance: SquareMatrix, inverse: SquareMatrix },
}

impl Whitening {
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
        let of = |inverse: &SquareMatrix| -2.0 * inverse.diagonal().iter().map(|l| l.ln()).sum::<f64>();
        match self {
            Whitening::Diagonal(sigma) => 2.0 * here.iter().map(|&j| sigma[j].ln()).sum::<f64>(),
            Whitening::Full { covariance, inverse } if here.len() == covariance.size() => of(inverse),
            Whitening::Full { covariance, .. } => of(&factor_of_part(covariance, here)),
        }
    }

    /// The same with all standard deviations longer by a factor.
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

    /// Standardizes a window in place.
    pub fn apply(&self, window: &mut Window) {
        match self {
            Whitening::Diagonal(sigma) => {
                for column in window.columns_mut() {
                    for (values, sigma) in column.chunks_exact_mut(WINDOW).zip(sigma) {
                        if *sigma != 1.0 {
                            let scale = 1.0 / sigma;
                            values.iter_mut().for_each(|value| *value *= scale);
                        }
                    }
                }
            }
            Whitening::Full { covariance, inverse } => {
                let outputs = covariance.size();
                for k in 0..window.samples {
                    let here: Vec<usize> = (0..outputs).filter(|j| window.measured[j * WINDOW + k]).collect();
                    // Where outputs are missing, those left have a covariance of their own.
                    let part = (here.len() < outputs).then(|| factor_of_part(covariance, &here));
                    let factor = part.as_ref().unwrap_or(inverse);
                    for column in window.columns_mut() {
                        for a in (0..here.len()).rev() {
                            let value = (0..=a).map(|b| factor[(a, b)] * column[here[b] * WINDOW + k]).sum();
                            column[here[a] * WINDOW + k] = value;
                        }
                    }
                }
            }
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

/// `E[psi^2]` of Huber's loss under the standard normal.
fn bent_variance(&Huber(c): &Huber) -> f64 {
    let normal = Normal::standard();
    2.0 * (normal.cdf(c) - 0.5 - c * normal.pdf(c) + c * c * normal.sf(c))
}

/// Noise below this part of the output's own size is rounding of the simulation.
const ROUNDING: f64 = 1e-15;
/// Errors below this part of the output's own size, in the mean, are all rounding: it adds up along a record.
const REPRODUCED: f64 = 1e-12;

impl Objective<'_> {
    /// Second moments of the (filtered) errors in the units of the outputs; each error through `bend` in units of
    /// `sigma`, for robust estimates.
    fn moments(
        &self,
        coordinates: &[f64],
        sigma: &[f64],
        bend: Option<&dyn Fn(f64) -> f64>,
    ) -> Result<SquareMatrix, Infeasible> {
        let outputs = self.outputs();
        let mut sums = SquareMatrix::zeros(outputs);
        let mut pairs = SquareMatrix::zeros(outputs);
        let plain = self.in_units();
        for e in 0..self.experiments() {
            let mut errors = vec![0.0; outputs];
            let visit = &mut |Rows { begin, samples, window }: Rows<'_>| {
                for k in 0..samples {
                    if self.source.weight(e, begin + k) <= 0.0 {
                        continue;
                    }
                    for (j, error) in errors.iter_mut().enumerate() {
                        let value = window.errors()[j * WINDOW + k];
                        *error = bend.map_or(value, |bend| bend(value / sigma[j]) * sigma[j]);
                    }
                    for i in 0..outputs {
                        for j in 0..outputs {
                            if window.measured[i * WINDOW + k] && window.measured[j * WINDOW + k] {
                                sums[(i, j)] += errors[i] * errors[j];
                                pairs[(i, j)] += 1.0;
                            }
                        }
                    }
                }
            };
            plain.walk(e, coordinates, false, visit).map_err(|halt| self.infeasible(e, coordinates, halt))?;
        }
        let covariance = SquareMatrix::from_fn(outputs, |i, j| sums[(i, j)] / pairs[(i, j)].max(1.0));
        if let Some(variance) = covariance.diagonal().iter().find(|variance| !variance.is_finite()) {
            return Err(Infeasible::Failed(format!("the variance of an output's errors is {variance}")));
        }
        Ok(covariance)
    }

    /// The noise that the errors at a point show: plainly, or robustly by Huber's proposal 2 (Huber, *Robust Statistics*,
    /// 1981, section 6.4) where a robust loss bends the large ones.
    pub(crate) fn estimate_noise(&self, coordinates: &[f64], noise: &Noise) -> Result<Whitening, Infeasible> {
        let outputs = self.outputs();
        let mut moments = self.moments(coordinates, &vec![1.0; outputs], None)?;
        let size = |size: f64| if size > 0.0 { size } else { 1.0 };
        let floor: Vec<f64> = self.magnitudes().into_iter().map(|magnitude| ROUNDING * size(magnitude)).collect();
        let sigma = |moments: &SquareMatrix| -> Vec<f64> {
            moments.diagonal().iter().zip(&floor).map(|(v, floor)| v.sqrt().max(*floor)).collect()
        };
        if self.is_robust() {
            let huber = Huber::default();
            let kappa = bent_variance(&huber);
            for _ in 0..50 {
                let before = sigma(&moments);
                moments = self.moments(coordinates, &before, Some(&|z| huber.psi(z)))?;
                moments = SquareMatrix::from_fn(outputs, |i, j| moments[(i, j)] / kappa);
                let change = |(a, b): (f64, &f64)| (a / b).ln().abs();
                if sigma(&moments).into_iter().zip(&before).map(change).fold(0.0, f64::max) < 1e-9 {
                    break;
                }
            }
        }
        let diagonal = Whitening::Diagonal(sigma(&moments));
        Ok(match noise {
            Noise::Covariance => Whitening::full(moments).unwrap_or(diagonal),
            Noise::Given(_) | Noise::PerOutput => diagonal,
        })
    }

    /// Whether the model reproduces the data but for rounding, whose errors lead no search anywhere.
    pub(crate) fn reproduces(&self, coordinates: &[f64]) -> bool {
        let reproduced = |moments: SquareMatrix| {
            let mut variances = moments.diagonal().into_iter().zip(self.magnitudes());
            variances.all(|(variance, size)| variance.sqrt() <= REPRODUCED * size)
        };
        self.moments(coordinates, &vec![1.0; self.outputs()], None).is_ok_and(reproduced)
    }

    /// Largest measured magnitude of each output.
    fn magnitudes(&self) -> Vec<f64> {
        let magnitude = |j: usize| {
            let mut values = vec![0.0; WINDOW];
            let mut largest = 0.0f64;
            for e in 0..self.experiments() {
                let samples = self.source.samples(e);
                for begin in (0..samples).step_by(WINDOW) {
                    let range = begin..samples.min(begin + WINDOW);
                    let values = &mut values[..range.len()];
                    self.source.measured(e, j, range, values);
                    largest = values.iter().fold(largest, |largest, y| largest.max(y.abs()));
                }
            }
            largest
        };
        (0..self.outputs()).map(magnitude).collect()
    }
}
