//! Nonlinear least squares: [`LevenbergMarquardt`] and [`GaussNewton`], on the information triangle.
//!
//! A problem returns one [`Linearization`] per point: cost and triangle from a single pass over the data. The searches
//! use no residual vector and never form normal equations. Each is a [`Machine`], which returns the evaluation that it needs next
//! and is given the result; as a solver of argmin it evaluates its problem itself.

mod descent;
mod gauss_newton;
mod levenberg_marquardt;
mod linearization;
mod machine;
mod outcome;
mod point;

pub use crate::scaling::{JacobianColumns, Nominal, OwnSize, Scaling, Seen, Unscaled};
pub use gauss_newton::GaussNewton;
pub use levenberg_marquardt::LevenbergMarquardt;
pub use linearization::Linearization;
pub use machine::{Domain, Machine, Request};
pub use outcome::{Outcome, SearchLimit};
pub(crate) use point::{is_negligible, limit_of_precision, within_tolerance};

use crate::error::Error;
use serde::{Deserialize, Serialize};

/// Contents of argmin's state for both solvers: the point, the gradient there, the cost.
pub type LeastSquaresState = argmin::core::IterState<Vec<f64>, Vec<f64>, (), (), (), f64>;

/// Where no step lowers the cost, a cosine up to this is rounding too.
const PRECISION: f64 = 1e-6;

/// A sum of squares to be minimized.
pub trait LeastSquares {
    /// Cost, slopes and residuals at `x`, in one pass.
    ///
    /// A slope may be infinite at a bound (the root of an initial level of zero). An unknown on its bound whose column is
    /// given as zeros is left there, and tried inside before the search ends.
    ///
    /// # Errors
    /// [`Infeasible`], where there is no cost at `x`: the search then tries a shorter step.
    fn linearize(&self, x: &[f64]) -> Result<Linearization, Infeasible>;

    /// As [`linearize`](Self::linearize), with the second derivatives of the errors (measured less predicted) at `x + t along`,
    /// `t = 0`, in the place of the errors: the rows whose damped solution is the geodesic acceleration. The cost does not
    /// matter. `None` for a problem that has no second derivatives; its steps are then not bent.
    fn curvature(&self, _x: &[f64], _along: &[f64]) -> Option<Result<Linearization, Infeasible>> {
        None
    }

    /// Lower and upper bound of each unknown; infinite where there is none. None at all unless said otherwise.
    fn bounds(&self) -> Vec<(f64, f64)> {
        Vec::new()
    }

    /// The size of those unknowns whose magnitude does not tell it: one for a logarithm. Their magnitudes, unless said
    /// otherwise.
    fn sizes(&self) -> Vec<Option<f64>> {
        Vec::new()
    }

    /// Which unknowns are logarithms. Where the cost is least without such a quantity, its logarithm has no minimum and is held where
    /// its influence has become negligible. None, unless said otherwise.
    fn logarithms(&self) -> Vec<bool> {
        Vec::new()
    }
}

impl<T: LeastSquares + ?Sized> LeastSquares for &T {
    fn linearize(&self, x: &[f64]) -> Result<Linearization, Infeasible> {
        (**self).linearize(x)
    }

    fn curvature(&self, x: &[f64], along: &[f64]) -> Option<Result<Linearization, Infeasible>> {
        (**self).curvature(x, along)
    }

    fn bounds(&self) -> Vec<(f64, f64)> {
        (**self).bounds()
    }

    fn sizes(&self) -> Vec<Option<f64>> {
        (**self).sizes()
    }

    fn logarithms(&self) -> Vec<bool> {
        (**self).logarithms()
    }
}

/// Why there is no cost at a point.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Infeasible {
    /// The model cannot be evaluated there.
    #[error("{0}")]
    Failed(String),
    /// The user or the clock stopped the evaluation.
    #[error("the evaluation was cancelled")]
    Cancelled,
}

/// When to stop.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Stop {
    /// Converged, if no unknown would move by more than this part of itself (or, near zero, of its standard error).
    #[serde(with = "crate::real")]
    pub step: f64,
    /// Converged, if the residual is orthogonal to every column of the Jacobian to this cosine.
    #[serde(with = "crate::real")]
    pub gradient: f64,
    /// Converged, if the next step, undamped, would lower the cost by no more than this part of it; zero switches the test
    /// off. As an offset from the minimum (Bates and Watts 1981) it is the root of this part times the number of
    /// measurements, in standard errors; on hard problems it stops with few right digits.
    #[serde(with = "crate::real")]
    pub cost: f64,
    /// Most trial steps.
    pub iterations: u64,
}

impl Stop {
    /// Tolerances of this size at least.
    pub(crate) fn rough(self, tolerance: f64) -> Self {
        Stop { step: self.step.max(tolerance), gradient: self.gradient.max(tolerance), ..self }
    }

    /// At most so many trial steps.
    pub(crate) fn limited(self, iterations: u64) -> Self {
        Stop { iterations: self.iterations.min(iterations), ..self }
    }

    /// Refuses tolerances that are no numbers or negative.
    pub(crate) fn check(&self) -> Result<(), Error> {
        let tolerances = [("step", self.step), ("gradient", self.gradient), ("cost", self.cost)];
        match tolerances.into_iter().find(|(_, value)| !(*value >= 0.0 && value.is_finite())) {
            None => Ok(()),
            Some((what, value)) => Err(Error::Option(format!(
                "the tolerance Stop::{what} is {value}; it must be finite and not negative (zero: as far as rounding allows)"
            ))),
        }
    }
}

impl Default for Stop {
    /// Step 1e-10 and gradient 1e-8, both; at most 5,000 trial steps.
    fn default() -> Self {
        Stop { step: 1e-10, gradient: 1e-8, cost: 0.0, iterations: 5000 }
    }
}

#[cfg(test)]
mod tests {
    use super::Stop;

    #[test]
    fn a_rough_search_stops_early() {
        let Stop { step, gradient, cost, iterations } = Stop::default().rough(1e-3);
        assert_eq!((step, gradient), (1e-3, 1e-3));
        assert_eq!((cost, iterations), (Stop::default().cost, Stop::default().iterations));
        let rougher = Stop { step: 0.1, gradient: 0.2, ..Stop::default() };
        assert_eq!((rougher.rough(1e-3).step, rougher.rough(1e-3).gradient), (0.1, 0.2));
        assert_eq!([rougher.limited(7).iterations, Stop { iterations: 5, ..rougher }.limited(7).iterations], [7, 5]);
    }
}
