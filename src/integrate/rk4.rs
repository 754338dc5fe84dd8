//! [`Rk4`]: the classical Runge-Kutta method of order 4 (Kutta 1901).

use super::{Integrator, Stuck, System};
use crate::layout::Kind;

use serde::{Deserialize, Serialize};

/// Classical Runge-Kutta of order 4, with a fixed number of steps from sample to sample.
///
/// The fastest choice where the sample time is short against the model's time constants; a report warns where doubling
/// the steps moves the answer.
///
/// ```
/// # use greybox::{Experiment, Fit, free, pmsm::{Surface, Winding}};
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// # let model = Surface::new(4)?;
/// # let record = Experiment::from_file(&model, "examples/data/pmsm.csv")?;
/// # let start = Winding { rs: free(1.0), ls: free(2e-3), ke: free(0.7) };
/// let estimate = Fit::new(&model, &record).parameters(start).integrator(greybox::Rk4 { substeps: 2 }).run()?;
/// assert_eq!(estimate.method.integrator, "Runge-Kutta 4, 2 steps per sample");
/// assert!((estimate.parameters.rs / 0.63 - 1.0).abs() < 0.002);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Rk4 {
    /// Steps from sample to sample; zero counts as one.
    pub substeps: u32,
}

impl Default for Rk4 {
    fn default() -> Self {
        Rk4 { substeps: 1 }
    }
}

/// Node and weight of each stage.
const STAGES: [(f64, f64); 4] = [(0.0, 1.0 / 6.0), (0.5, 1.0 / 3.0), (0.5, 1.0 / 3.0), (1.0, 1.0 / 6.0)];

impl Integrator for Rk4 {
    const FIXED: bool = true;

    // One call site of the derivative: it is inlined once, which the vector unit needs (3 times faster than four).
    #[inline(always)]
    fn advance<Y: System>(
        &self,
        system: &Y,
        mut x: Y::Vector<Y::Scalar>,
        _step: &mut f64,
    ) -> Result<Y::Vector<Y::Scalar>, Stuck> {
        let steps = self.substeps.max(1);
        let part = 1.0 / f64::from(steps);
        let mut sum = x.clone();
        let mut k = system.vector(|_| Y::Scalar::from(0.0));
        for step in 0..steps {
            for (node, weight) in STAGES {
                let at = system.along(&x, part * node, &k);
                k = system.derivative((f64::from(step) + node) * part, &at);
                sum = system.along(&sum, part * weight, &k);
            }
            x = sum.clone();
        }
        Ok(x)
    }

    fn serves(&self, kind: Kind) -> bool {
        kind == Kind::Continuous
    }

    fn refined(&self, _kind: Kind) -> Option<Self> {
        Some(Rk4 { substeps: self.substeps.max(1).saturating_mul(2) })
    }

    #[cfg(feature = "std")]
    fn describe(&self, _kind: Kind) -> String {
        let steps = self.substeps.max(1);
        format!("Runge-Kutta 4, {steps} step{} per sample", if steps == 1 { "" } else { "s" })
    }
}
