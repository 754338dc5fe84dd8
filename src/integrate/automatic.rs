//! [`Automatic`]: the step that the model's kind asks for.

use super::{Discrete, Integrator, Rk4, Stuck};
use crate::interval::Interval;
use crate::model::{Kind, Model};
use crate::scalar::Scalar;
use crate::signals::Of;
use serde::{Deserialize, Serialize};

/// What a fit uses when nothing is said: [`Rk4`] for continuous models, [`Discrete`] for discrete ones, nothing for
/// static ones.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Automatic {
    /// The method for a continuous model.
    pub continuous: Rk4,
}

impl<M: Model> Integrator<M> for Automatic {
    type Memory = ();

    #[inline(always)]
    fn advance<S: Scalar>(
        &self,
        model: &M,
        interval: &Interval<M::Input>,
        x: Of<M::State, S>,
        p: &Of<M::Parameters, S>,
        memory: &mut (),
    ) -> Result<Of<M::State, S>, Stuck> {
        match M::KIND {
            Kind::Continuous => self.continuous.advance(model, interval, x, p, memory),
            Kind::Discrete => Discrete.advance(model, interval, x, p, memory),
            Kind::Static => Ok(x),
        }
    }

    fn serves(&self, _kind: Kind) -> bool {
        true
    }

    fn refined(&self) -> Option<Self> {
        match M::KIND {
            Kind::Continuous => Integrator::<M>::refined(&self.continuous).map(|continuous| Automatic { continuous }),
            Kind::Discrete | Kind::Static => None,
        }
    }

    #[cfg(feature = "std")]
    fn describe(&self) -> String {
        match M::KIND {
            Kind::Continuous => Integrator::<M>::describe(&self.continuous),
            Kind::Discrete => Integrator::<M>::describe(&Discrete),
            Kind::Static => "static model".to_owned(),
        }
    }
}
