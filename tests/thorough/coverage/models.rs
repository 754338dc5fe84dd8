//! Models of the table of coverage, beside those that all tests share.

use crate::common::Current;
use greybox::{Model, Scalar, signals};

signals! { pub struct Angle { q: "rad", v: "rad/s" } }
signals! { pub struct Torque { u: "N m" } }
signals! { pub struct Body { gravity: "1/s^2", damping: "1/s", gain: "1/kg m^2" } }

/// `dv/dt = gravity sin q - damping v + gain u`: a pendulum about its upper end.
#[derive(Clone)]
pub struct Pendulum;

impl Model for Pendulum {
    type State = Angle;
    type Input = Torque;
    type Output = Angle;
    type Parameters = Body;

    fn derivative<S: Scalar>(&self, _t: S, x: &Angle<S>, u: &Torque<S>, p: &Body<S>) -> Angle<S> {
        Angle { q: x.v, v: p.gravity * x.q.sin() - p.damping * x.v + p.gain * u.u }
    }

    fn output<S: Scalar>(&self, _t: S, x: &Angle<S>, _u: &Torque<S>, _p: &Body<S>) -> Angle<S> {
        *x
    }
}

signals! { pub struct Supply { u: "V", w: "rad/s" } }
signals! { pub struct Winding { r: "ohm", l: "H", ke: "V s/rad" } }

/// `l di/dt = u - r i - ke w`.
#[derive(Clone)]
pub struct Armature;

impl Model for Armature {
    type State = Current;
    type Input = Supply;
    type Output = Current;
    type Parameters = Winding;

    fn derivative<S: Scalar>(&self, _t: S, x: &Current<S>, u: &Supply<S>, p: &Winding<S>) -> Current<S> {
        Current { i: (u.u - p.r * x.i - p.ke * u.w) / p.l }
    }

    fn output<S: Scalar>(&self, _t: S, x: &Current<S>, _u: &Supply<S>, _p: &Winding<S>) -> Current<S> {
        *x
    }
}
