//! [`Rk4`]: the classical Runge-Kutta method of order 4 (Kutta 1901).

use super::{Integrator, Stuck, axpy};
use crate::interval::Interval;
use crate::model::{Kind, Model};
use crate::scalar::Scalar;
use crate::signals::{Of, Signals};
use serde::{Deserialize, Serialize};

/// Classical Runge-Kutta of order 4, with a fixed number of steps from sample to sample.
///
/// The fastest choice where the sample time is short against the model's time constants; a report warns where doubling
/// the steps moves the answer.
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

impl<M: Model> Integrator<M> for Rk4 {
    type Memory = ();

    // One call site of the derivative: it is inlined once, which the vector unit needs (3 times faster than four).
    #[inline(always)]
    fn advance<S: Scalar>(
        &self,
        model: &M,
        interval: &Interval<M::Input>,
        mut x: Of<M::State, S>,
        p: &Of<M::Parameters, S>,
        _memory: &mut (),
    ) -> Result<Of<M::State, S>, Stuck> {
        let steps = self.substeps.max(1);
        let h = (interval.t1 - interval.t0) / steps as f64;
        let fraction = 1.0 / steps as f64;
        let mut sum = x;
        let mut k = M::State::splat(S::from(0.0));
        for step in 0..steps {
            for (node, weight) in STAGES {
                let position = step as f64 + node;
                let u = interval.input::<S>(position * fraction);
                k = model.derivative(interval.t0 + position * h, &axpy::<M::State, S>(x, h * node, k), &u, p);
                sum = axpy::<M::State, S>(sum, h * weight, k);
            }
            x = sum;
        }
        Ok(x)
    }

    fn serves(&self, kind: Kind) -> bool {
        kind == Kind::Continuous
    }

    fn refined(&self) -> Option<Self> {
        Some(Rk4 { substeps: self.substeps.max(1).saturating_mul(2) })
    }

    #[cfg(feature = "std")]
    fn describe(&self) -> String {
        format!("Runge-Kutta 4, {} step(s) per sample", self.substeps.max(1))
    }
}
