//! [`LinearEstimate`]: the parameters of a linear regression, and how well they are known.

use crate::information::SquareMatrix;
use crate::signals::{Of, Signals};
use core::fmt;
use serde::{Deserialize, Serialize};
use statrs::distribution::{ContinuousCDF, StudentsT};

/// Assumption of the standard errors on the residuals.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Assumption {
    /// Independent, all of the same variance.
    EqualVariance,
    /// Independent, each of its own variance.
    OwnVariance,
    /// Of any variance, and correlated up to so many rows apart.
    Correlated {
        /// How many rows.
        lags: usize,
    },
}

impl Assumption {
    /// The assumption for so many lags and these weights of rows; a row of weight zero is not used.
    pub(super) fn of(lags: Option<usize>, weights: impl Iterator<Item = f64>) -> Self {
        let mut used = weights.filter(|&weight| weight > 0.0);
        match (lags, used.next()) {
            (Some(lags), _) => Assumption::Correlated { lags },
            (None, Some(first)) if used.any(|weight| weight != first) => Assumption::OwnVariance,
            _ => Assumption::EqualVariance,
        }
    }
}

/// Index (%) above which a parameter is hardly determined: a change by two fifths of its value does no more than double the
/// squared residual.
const WEAK: f64 = 40.0;

/// The solution of a [`Regression`](super::Regression). It borrows nothing.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(bound(serialize = "Of<P, f64>: Serialize", deserialize = "Of<P, f64>: Deserialize<'de>"))]
pub struct LinearEstimate<P: Signals> {
    /// The parameters, each in its unit.
    pub parameters: Of<P, f64>,
    /// Their standard errors, in the same units.
    pub standard_errors: Of<P, f64>,
    /// Parametric error index (%): the change of a parameter, the others refitted, that doubles the squared residual,
    /// relative to the parameter: `100 sqrt(E2 ((sum phi phi^T)^-1)_ii) / |theta_i|` (M. Tenerz,
    /// LiTH-ISY-EX--11/4495--SE, 2011, eq. 5.12 to 5.14). Low is well excited; infinite for a parameter that is zero.
    pub index: Of<P, f64>,
    /// The index with the other parameters held: `100 sqrt(E2 / (sum phi phi^T)_ii) / |theta_i|`.
    pub index_others_held: Of<P, f64>,
    /// Covariance of the parameters, in the order of their declaration.
    pub covariance: SquareMatrix,
    /// Root mean square of the residuals, not weighted, in the unit of `y`.
    #[serde(with = "crate::real")]
    pub rms: f64,
    /// Rows with a weight above zero.
    pub rows: u64,
    /// Condition number of the weighted regressor columns, each scaled to unit norm.
    #[serde(with = "crate::real")]
    pub condition: f64,
    /// Assumption of the standard errors on the residuals.
    pub assumption: Assumption,
}

impl<P: Signals> LinearEstimate<P> {
    /// Correlation of the parameters; one on the diagonal, zero beside a parameter that is known exactly.
    pub fn correlation(&self) -> SquareMatrix {
        let deviation: Vec<f64> = self.covariance.diagonal().into_iter().map(f64::sqrt).collect();
        SquareMatrix::from_fn(deviation.len(), |i, j| {
            let product = deviation[i] * deviation[j];
            if i == j {
                1.0
            } else if product > 0.0 {
                (self.covariance[(i, j)] / product).clamp(-1.0, 1.0)
            } else {
                0.0
            }
        })
    }

    /// Intervals `[low, high]` that contain each true parameter with this probability (0.95 for 95 %), by Student's t
    /// distribution with `rows - parameters` degrees of freedom; the whole line for a level of one or more.
    pub fn intervals(&self, level: f64) -> Of<P, [f64; 2]> {
        let freedom = self.rows as f64 - P::LEN as f64;
        let quantile = match StudentsT::new(0.0, 1.0, freedom) {
            Ok(t) if (0.0..1.0).contains(&level) => t.inverse_cdf(0.5 + level / 2.0),
            _ => f64::INFINITY,
        };
        let (center, error) = (P::into_array(self.parameters), P::into_array(self.standard_errors));
        P::from_fn(|i| {
            let (center, half) = (center.as_ref()[i], quantile * error.as_ref()[i]);
            [center - half, center + half]
        })
    }

    /// Names of the parameters that the rows hardly determine, by an index above 40 %: what is left out of the equations may
    /// move them far more than their standard errors say.
    pub fn hardly_seen(&self) -> Vec<&'static str> {
        let index = P::into_array(self.index);
        let seen = |index: f64| index <= WEAK;
        P::NAMES.iter().zip(index.as_ref()).filter(|(_, index)| !seen(**index)).map(|(name, _)| *name).collect()
    }
}

impl<P: Signals> fmt::Display for LinearEstimate<P> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let width = P::NAMES.iter().map(|name| name.chars().count()).max().unwrap_or(0).max(9);
        writeln!(
            f,
            "{:width$}  {:>15} {:>12} {:>10} {:>10}  unit",
            "parameter", "value", "std. error", "index %", "held %"
        )?;
        let columns = [self.parameters, self.standard_errors, self.index, self.index_others_held].map(P::into_array);
        for (i, (name, unit)) in P::NAMES.iter().zip(P::UNITS).enumerate() {
            let [value, error, index, held] = columns.each_ref().map(|column| column.as_ref()[i]);
            writeln!(f, "{name:width$}  {value:>15.8e} {error:>12.2e} {index:>10.3} {held:>10.3}  {unit}")?;
        }
        let assumption = match self.assumption {
            Assumption::EqualVariance => "independent, of equal variance".to_owned(),
            Assumption::OwnVariance => "independent, each of its own variance".to_owned(),
            Assumption::Correlated { lags } => format!("correlated over {lags} rows"),
        };
        write!(
            f,
            "{} rows, residual rms {:.4e}, condition {:.1e}; standard errors take residuals as {assumption}",
            self.rows, self.rms, self.condition
        )
    }
}
