//! Models that unit tests share.

use crate::{Kind, Model, Nothing, Scalar, signals};

signals! { pub struct Voltage { u: "V" } }
signals! { pub struct Current { i: "A" } }
signals! { pub struct Gain { a: "A/V" } }
signals! { pub struct Rate { a: "1/s" } }

/// `i = a u`.
#[derive(Clone)]
pub struct Line;

impl Model for Line {
    type State = Nothing;
    type Input = Voltage;
    type Output = Current;
    type Parameters = Gain;
    const KIND: Kind = Kind::Static;

    fn output<S: Scalar>(&self, _t: S, _x: &Nothing, u: &Voltage<S>, p: &Gain<S>) -> Current<S> {
        Current { i: p.a * u.u }
    }
}

/// `di/dt = a (u - i)`.
#[derive(Clone)]
pub struct Decay;

impl Model for Decay {
    type State = Current;
    type Input = Voltage;
    type Output = Current;
    type Parameters = Rate;

    fn derivative<S: Scalar>(&self, _t: S, x: &Current<S>, u: &Voltage<S>, p: &Rate<S>) -> Current<S> {
        Current { i: (u.u - x.i) * p.a }
    }

    fn output<S: Scalar>(&self, _t: S, x: &Current<S>, _u: &Voltage<S>, _p: &Rate<S>) -> Current<S> {
        *x
    }
}
