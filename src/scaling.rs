//! [`Scaling`]: the length of a step, when unknowns have different units.

use core::fmt::Debug;
use serde::{Deserialize, Serialize};

/// How much a unit step of each unknown counts: the diagonal `D` by which an optimizer damps its steps.
pub trait Scaling: Clone + Debug + Send + Sync {
    /// The scale of each unknown, from those of the iteration before (empty at the first), the point, and the norms of
    /// the Jacobian's columns there. A zero or non-finite scale counts as one.
    fn scales(&self, before: &[f64], x: &[f64], column_norms: &[f64]) -> Vec<f64>;
}

/// Each unknown counts by its own number (Levenberg 1944).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Unscaled;

/// Each unknown counts relative to a nominal magnitude.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Nominal(
    /// One positive magnitude per unknown, in the optimizer's coordinates; where missing, that of the start.
    pub Vec<f64>,
);

/// Each unknown counts by what it does to the prediction, the largest norm of its Jacobian column so far: free of units
/// (More, *The Levenberg-Marquardt algorithm*, 1978). The default.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct JacobianColumns;

impl Scaling for Unscaled {
    fn scales(&self, _before: &[f64], x: &[f64], _column_norms: &[f64]) -> Vec<f64> {
        vec![1.0; x.len()]
    }
}

impl Scaling for Nominal {
    fn scales(&self, before: &[f64], x: &[f64], _column_norms: &[f64]) -> Vec<f64> {
        if before.len() == x.len() {
            return before.to_vec();
        }
        x.iter().enumerate().map(|(i, x)| 1.0 / self.0.get(i).copied().unwrap_or(x.abs())).collect()
    }
}

impl Scaling for JacobianColumns {
    fn scales(&self, before: &[f64], _x: &[f64], column_norms: &[f64]) -> Vec<f64> {
        column_norms.iter().enumerate().map(|(i, &norm)| before.get(i).map_or(norm, |&b| norm.max(b))).collect()
    }
}
