//! [`SecondOrder`]: a filter for plants that are curved within a standard deviation of their state.

use super::gaussian::{Filter, Order};
use super::{Moments, Plant};
use crate::scalar::Scalar;
use serde::{Deserialize, Serialize};

/// The modified Gaussian second-order filter (A. H. Jazwinski, *Stochastic Processes and Filtering Theory*, 1970, section 9.3), for strong
/// noise and long intervals, where the extended filter ([`Kalman`](super::Kalman)) is biased: means of the model's functions `g` and of
/// their slopes are taken over a Gaussian state, to the second order in its standard deviation,
///
/// ```text
/// E g(x) = g + 1/2 sum_ij P_ij d2g/dx_i dx_j        dx/dt = E f        dP/dt = A P + P A' + Q,  A = E df/dx
/// ```
///
/// which is exact of polynomials up to the third degree; the state itself is Gaussian by assumption. An output has the variance that its
/// curvature adds, `1/2 tr(H P H P)` with `H = d2g/dx2`. Models that are affine in their state give what [`Kalman`](super::Kalman) gives, to
/// rounding. Derivatives are those of the model's graph; a choice (dry friction, a limit) has no curvature where it is not taken, so that what
/// it does within the spread of the state is not seen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SecondOrder;

impl Filter for SecondOrder {
    type Order = Self;

    fn name(&self) -> &'static str {
        "one-step prediction by a Gaussian filter of second order"
    }
}

impl Order for SecondOrder {
    fn state<S: Scalar>(plant: &dyn Plant<S>, position: f64, carry: &[S]) -> Moments<S> {
        plant.state_moments(position, carry)
    }

    fn jump<S: Scalar>(plant: &dyn Plant<S>, carry: &[S]) -> Moments<S> {
        plant.jump_moments(carry)
    }

    fn outputs<S: Scalar>(plant: &dyn Plant<S>, carry: &[S]) -> Moments<S> {
        plant.output_moments(carry)
    }
}
