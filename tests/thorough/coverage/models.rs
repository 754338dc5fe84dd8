//! Models of the table of coverage.

use greybox::{Kind, Model, Nothing, Scalar, signals};

signals! { pub struct Level { x: "V" } }
signals! { pub struct Voltage { u: "V" } }
signals! { pub struct Lag { k: "1", tau: "s" } }

/// `tau dx/dt = k u - x`.
#[derive(Clone)]
pub struct FirstOrder;

impl Model for FirstOrder {
    type State = Level;
    type Input = Voltage;
    type Output = Level;
    type Parameters = Lag;

    fn derivative<S: Scalar>(&self, _t: S, x: &Level<S>, u: &Voltage<S>, p: &Lag<S>) -> Level<S> {
        Level { x: (p.k * u.u - x.x) / p.tau }
    }

    fn output<S: Scalar>(&self, _t: S, x: &Level<S>, _u: &Voltage<S>, _p: &Lag<S>) -> Level<S> {
        *x
    }
}

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

signals! { pub struct Current { i: "A" } }
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

signals! { pub struct Pair { y: "V", z: "V" } }
signals! { pub struct Affine { slope: "1", offset: "V" } }

/// `y = slope u + offset`, `z = offset u - slope`.
#[derive(Clone)]
pub struct Line;

impl Model for Line {
    type State = Nothing;
    type Input = Voltage;
    type Output = Pair;
    type Parameters = Affine;
    const KIND: Kind = Kind::Static;

    fn output<S: Scalar>(&self, _t: S, _x: &Nothing, u: &Voltage<S>, p: &Affine<S>) -> Pair<S> {
        Pair { y: p.slope * u.u + p.offset, z: p.offset * u.u - p.slope }
    }
}
