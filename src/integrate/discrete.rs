//! [`Discrete`]: the step of a discrete-time model.

use super::{Integrator, Stuck, System};
use crate::layout::Kind;
use serde::{Deserialize, Serialize};

/// The step of a discrete-time model: [`Model::next`](crate::Model::next), once per sample.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Discrete;

impl Integrator for Discrete {
    const FIXED: bool = true;

    #[inline(always)]
    fn advance<Y: System>(
        &self,
        system: &Y,
        x: Y::Vector<Y::Scalar>,
        _step: &mut f64,
    ) -> Result<Y::Vector<Y::Scalar>, Stuck> {
        Ok(system.next(&x))
    }

    fn serves(&self, kind: Kind) -> bool {
        kind == Kind::Discrete
    }

    fn refined(&self, _kind: Kind) -> Option<Self> {
        None
    }

    #[cfg(feature = "std")]
    fn describe(&self, _kind: Kind) -> String {
        "discrete steps".to_owned()
    }
}
