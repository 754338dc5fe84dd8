//! A direct-current motor, of which all parameters are determined.

use greybox::{Model, Scalar, signals};

signals! {
    /// States of a direct-current motor, which are its measured outputs.
    pub struct Rotation {
        /// Armature current.
        i: "A",
        /// Speed.
        w: "rad/s",
    }
    /// Inputs of a direct-current motor.
    pub struct Feed {
        /// Armature voltage.
        u: "V",
        /// Load torque besides viscous friction.
        tau_l: "N m",
    }
    /// Parameters of a direct-current motor with its rotor.
    pub struct Armature {
        /// Armature resistance; must be positive.
        r: "ohm",
        /// Armature inductance; must be positive.
        l: "H",
        /// Motor constant: EMF per speed (V s/rad), and torque per current (N m/A), which are the same number.
        k: "V s/rad",
        /// Inertia; must be positive.
        j: "kg m^2",
        /// Viscous friction; negative is not physical.
        b: "N m s",
    }
}

/// A direct-current motor with constant excitation (W. Leonhard, *Control of Electrical Drives*, 3rd ed. 2001,
/// section 5.1):
///
/// ```text
/// l di/dt = u - r i - k w
/// j dw/dt = k i - b w - tau_l
/// ```
///
/// From voltage, current and speed all five parameters are known. From voltage and speed alone only four combinations
/// are: current, and with it `r`, `l`, `k` and `j`, may be scaled together.
#[derive(Clone, Copy, Debug)]
pub struct DcMotor;

impl Model for DcMotor {
    type State = Rotation;
    type Input = Feed;
    type Output = Rotation;
    type Parameters = Armature;

    fn derivative<S: Scalar>(&self, _t: S, x: &Rotation<S>, u: &Feed<S>, p: &Armature<S>) -> Rotation<S> {
        Rotation { i: (u.u - p.r * x.i - p.k * x.w) / p.l, w: (p.k * x.i - p.b * x.w - u.tau_l) / p.j }
    }

    fn output<S: Scalar>(&self, _t: S, x: &Rotation<S>, _u: &Feed<S>, _p: &Armature<S>) -> Rotation<S> {
        *x
    }
}
