use super::{Currents, Drive, MotorError, MotorModel, PolePairs, SQRT_2_3, SQRT_3_2};
use crate::{Model, Scalar};
use serde::{Deserialize, Serialize};

crate::signals! {
    /// Parameters of a motor whose inductance differs between the axes.
    pub struct SalientWinding {
        /// Phase resistance; must be positive.
        rs: "ohm",
        /// Inductance along the magnet flux; must be positive.
        ld: "H",
        /// Inductance 90 electrical degrees ahead of it; must be positive.
        lq: "H",
        /// Line-to-line rms back-EMF per mechanical speed.
        ke: "V s/rad",
    }
}

/// Currents of a motor with `Ld != Lq` (buried magnets, or surface magnets seen closely):
///
/// ```text
/// ld did/dt = ud - rs id + we lq iq
/// lq diq/dt = uq - rs iq - we ld id - sqrt(2/3) ke w
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Salient {
    pole_pairs: PolePairs,
}

impl Salient {
    /// A motor with this many pole pairs.
    ///
    /// # Errors
    /// Zero pole pairs.
    pub const fn new(pole_pairs: u32) -> Result<Self, MotorError> {
        match PolePairs::new(pole_pairs) {
            Ok(pole_pairs) => Ok(Salient { pole_pairs }),
            Err(error) => Err(error),
        }
    }

    /// A motor with these pole pairs.
    pub const fn with(pole_pairs: PolePairs) -> Self {
        Salient { pole_pairs }
    }
}

impl MotorModel for Salient {
    fn pole_pairs(&self) -> PolePairs {
        self.pole_pairs
    }

    /// `kt iq + 3/2 np (ld - lq) id iq` (N m).
    #[inline]
    fn torque<S: Scalar>(&self, x: &Currents<S>, _theta: S, p: &SalientWinding<S>) -> S {
        (p.ke * SQRT_3_2 + (p.ld - p.lq) * x.id * (1.5 * self.pole_pairs.get())) * x.iq
    }
}

impl Model for Salient {
    type State = Currents;
    type Input = Drive;
    type Output = Currents;
    type Parameters = SalientWinding;

    #[inline]
    fn derivative<S: Scalar>(&self, _t: S, x: &Currents<S>, u: &Drive<S>, p: &SalientWinding<S>) -> Currents<S> {
        let we = self.pole_pairs.electrical(u.w);
        Currents {
            id: (u.ud - p.rs * x.id + we * p.lq * x.iq) / p.ld,
            iq: (u.uq - p.rs * x.iq - we * p.ld * x.id - p.ke * u.w * SQRT_2_3) / p.lq,
        }
    }

    #[inline]
    fn output<S: Scalar>(&self, _t: S, x: &Currents<S>, _u: &Drive<S>, _p: &SalientWinding<S>) -> Currents<S> {
        *x
    }
}
