use super::units::Constant;
use super::{Currents, Drive, MotorError, MotorModel, PolePairs, SQRT_2_3, Winding};
use crate::{Model, Scalar};
use serde::{Deserialize, Serialize};

/// Currents of a motor with surface magnets, `Ld = Lq = ls` (thesis (3.15), (3.16); the EMF's sign as there, which
/// its (5.6) has wrong):
///
/// ```text
/// ls did/dt = ud - rs id + we ls iq
/// ls diq/dt = uq - rs iq - we ls id - sqrt(2/3) ke w
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Surface {
    pole_pairs: PolePairs,
}

impl Surface {
    /// A motor with this many pole pairs.
    ///
    /// # Errors
    /// Zero pole pairs.
    pub const fn new(pole_pairs: u32) -> Result<Self, MotorError> {
        match PolePairs::new(pole_pairs) {
            Ok(pole_pairs) => Ok(Surface { pole_pairs }),
            Err(error) => Err(error),
        }
    }
}

impl MotorModel for Surface {
    fn pole_pairs(&self) -> PolePairs {
        self.pole_pairs
    }

    /// `kt iq` (N m).
    #[inline]
    fn torque<S: Scalar>(&self, x: &Currents<S>, _theta: S, p: &Winding<S>) -> S {
        Constant::TorquePerPeak.from_ke(p.ke) * x.iq
    }
}

impl Model for Surface {
    type State = Currents;
    type Input = Drive;
    type Output = Currents;
    type Parameters = Winding;

    #[inline]
    fn derivative<S: Scalar>(&self, _t: S, x: &Currents<S>, u: &Drive<S>, p: &Winding<S>) -> Currents<S> {
        let we = self.pole_pairs.electrical(u.w);
        Currents {
            id: (u.ud - p.rs * x.id) / p.ls + we * x.iq,
            iq: (u.uq - p.rs * x.iq - p.ke * u.w * SQRT_2_3) / p.ls - we * x.id,
        }
    }

    #[inline]
    fn output<S: Scalar>(&self, _t: S, x: &Currents<S>, _u: &Drive<S>, _p: &Winding<S>) -> Currents<S> {
        *x
    }
}
