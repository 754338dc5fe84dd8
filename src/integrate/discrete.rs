//! [`Discrete`]: the step of a discrete-time model.

use super::{Integrator, Stuck};
use crate::interval::Interval;
use crate::model::{Kind, Model};
use crate::scalar::Scalar;
use crate::signals::Of;
use serde::{Deserialize, Serialize};

/// The step of a discrete-time model: [`Model::next`], once per sample.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Discrete;

impl<M: Model> Integrator<M> for Discrete {
    type Memory = ();

    #[inline(always)]
    fn advance<S: Scalar>(
        &self,
        model: &M,
        interval: &Interval<M::Input>,
        x: Of<M::State, S>,
        p: &Of<M::Parameters, S>,
        _memory: &mut (),
    ) -> Result<Of<M::State, S>, Stuck> {
        Ok(model.next(interval.t0, &x, &interval.input::<S>(0.0), p))
    }

    fn serves(&self, kind: Kind) -> bool {
        kind == Kind::Discrete
    }

    fn refined(&self) -> Option<Self> {
        None
    }

    #[cfg(feature = "std")]
    fn describe(&self) -> String {
        "discrete steps".to_owned()
    }
}
