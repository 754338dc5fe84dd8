//! [`Discrete`]: the step of a discrete-time model.

use super::{Integrator, Stuck, System};
use crate::layout::Kind;
use serde::{Deserialize, Serialize};

/// The step of a discrete-time model: [`Model::next`](crate::Model::next), once per sample.
///
/// ```
/// # use greybox::{Discrete, Fit, Time, free, simulate};
/// # use greybox::pmsm::{Currents, Drive, ExactStep, ExactSurface, HeldIn, Winding};
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let model = ExactSurface(ExactStep::new(4, 0.25e-3, HeldIn::Rotor)?); // a discrete model
/// # let record = greybox::Experiment::from_file(&model, "examples/data/pmsm.csv")?;
/// let start = Winding { rs: free(1.0), ls: free(2e-3), ke: free(0.7) };
/// let estimate = Fit::new(&model, &record).parameters(start).integrator(Discrete).run()?; // the default for it
/// assert!((estimate.parameters.ls / 4e-3 - 1.0).abs() < 0.002);
/// # Ok(())
/// # }
/// ```
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
