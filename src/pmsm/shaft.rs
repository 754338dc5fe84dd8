use super::MotorError;
use super::units::Constant;
use crate::{Model, Scalar, Signals};
use serde::{Deserialize, Serialize};

crate::signals! {
    /// Motion of the rotor.
    pub struct ShaftMotion {
        /// Mechanical speed.
        w: "rad/s",
        /// Mechanical angle, not wrapped.
        theta: "rad",
    }
    /// Input of the rotor.
    pub struct Torque {
        /// Current that makes torque, phase peak.
        iq: "A",
    }
    /// Parameters of a rotor's load, seen from the motor's side of the gear.
    pub struct Load {
        /// Inertia; must be positive.
        j: "kg m^2",
        /// Viscous friction.
        bv: "N m s",
        /// Coulomb friction.
        tc: "N m",
        /// Gravity's torque where the arm is level.
        tg: "N m",
    }
    /// Parameters of the mechanics, seen from the motor's side of the gear.
    pub struct Mechanics {
        /// Inertia; must be positive.
        j: "kg m^2",
        /// Viscous friction.
        bv: "N m s",
        /// Coulomb friction.
        tc: "N m",
        /// Gravity's torque where the arm is level.
        tg: "N m",
        /// Line-to-line rms back-EMF per mechanical speed: the scale of the torque.
        ke: "V s/rad",
    }
}

/// Speed within which Coulomb friction turns over (rad/s): `tc tanh(w / 0.5)`.
pub(super) const COULOMB_WIDTH: f64 = 0.5;

/// The rotor and its load (thesis (3.17), (3.18)):
///
/// ```text
/// j dw/dt = sqrt(3/2) ke iq - tc tanh(w/0.5) - bv w - tg cos(theta/gear)      dtheta/dt = w
/// ```
///
/// With measured current as input it identifies inertia, friction and gravity; all torques scale with `ke`, which is
/// therefore to be fixed (or known from the electrical fit).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Shaft {
    gear: f64,
}

impl Shaft {
    /// A rotor behind a gear that turns the arm once in `gear` turns of the motor.
    ///
    /// # Errors
    /// A gear that is not positive.
    pub fn new(gear: f64) -> Result<Self, MotorError> {
        Ok(Shaft { gear: MotorError::positive("gear ratio", gear, "turns")? })
    }

    /// Turns of the motor per turn of the arm.
    pub const fn gear(&self) -> f64 {
        self.gear
    }

    /// Torque (N m) that the load takes at this motion.
    #[inline]
    pub fn load<S: Scalar>(&self, x: &ShaftMotion<S>, p: &Load<S>) -> S {
        p.tc * (x.w / COULOMB_WIDTH).tanh() + p.bv * x.w + p.tg * (x.theta / self.gear).cos()
    }

    /// Slope of the motion under a torque (N m) of the motor.
    #[inline]
    pub fn accelerated<S: Scalar>(&self, torque: S, x: &ShaftMotion<S>, p: &Load<S>) -> ShaftMotion<S> {
        ShaftMotion { w: (torque - self.load(x, p)) / p.j, theta: x.w }
    }
}

impl Model for Shaft {
    type State = ShaftMotion;
    type Input = Torque;
    type Output = ShaftMotion;
    type Parameters = Mechanics;

    #[inline]
    fn derivative<S: Scalar>(&self, _t: S, x: &ShaftMotion<S>, u: &Torque<S>, p: &Mechanics<S>) -> ShaftMotion<S> {
        self.accelerated(Constant::TorquePerPeak.from_ke(p.ke) * u.iq, x, &Mechanics::part::<Load, S>(*p))
    }

    #[inline]
    fn output<S: Scalar>(&self, _t: S, x: &ShaftMotion<S>, _u: &Torque<S>, _p: &Mechanics<S>) -> ShaftMotion<S> {
        *x
    }
}
