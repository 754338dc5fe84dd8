//! [`Automatic`]: the step that the model's kind asks for.

use super::{Discrete, Integrator, Rk4, Stuck, System};
use crate::layout::Kind;
use serde::{Deserialize, Serialize};

/// The default integrator of a fit ([`Fit::integrator`](crate::Fit::integrator)): [`Rk4`] for continuous models, [`Discrete`] for discrete ones, nothing for
/// static ones.
///
/// ```
/// # use greybox::{Experiment, Fit, free, pmsm::{Surface, Winding}};
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// # let model = Surface::new(4)?;
/// # let record = Experiment::from_file(&model, "examples/data/pmsm.csv")?;
/// # let start = Winding { rs: free(1.0), ls: free(2e-3), ke: free(0.7) };
/// let four = greybox::Automatic { continuous: greybox::Rk4 { substeps: 4 } };
/// let estimate = Fit::new(&model, &record).parameters(start).integrator(four).run()?;
/// assert_eq!(estimate.method.integrator, "Runge-Kutta 4, 4 steps per sample");
/// assert!((estimate.parameters.rs / 0.63 - 1.0).abs() < 0.002);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Automatic {
    /// The method for a continuous model.
    pub continuous: Rk4,
}

impl Integrator for Automatic {
    const FIXED: bool = true;

    #[inline(always)]
    fn advance<Y: System>(
        &self,
        system: &Y,
        x: Y::Vector<Y::Scalar>,
        step: &mut f64,
    ) -> Result<Y::Vector<Y::Scalar>, Stuck> {
        match system.kind() {
            Kind::Continuous => self.continuous.advance(system, x, step),
            Kind::Discrete => Discrete.advance(system, x, step),
            Kind::Static => Ok(x),
        }
    }

    fn serves(&self, _kind: Kind) -> bool {
        true
    }

    fn refined(&self, kind: Kind) -> Option<Self> {
        match kind {
            Kind::Continuous => self.continuous.refined(kind).map(|continuous| Automatic { continuous }),
            Kind::Discrete | Kind::Static => None,
        }
    }

    #[cfg(feature = "std")]
    fn describe(&self, kind: Kind) -> String {
        match kind {
            Kind::Continuous => self.continuous.describe(kind),
            Kind::Discrete => Discrete.describe(kind),
            Kind::Static => "static model".to_owned(),
        }
    }
}
