//! A model that unit tests share.

use crate::{Kind, Model, Nothing, Scalar, signals};

signals! { pub struct Voltage { u: "V" } }
signals! { pub struct Current { i: "A" } }
signals! { pub struct Gain { a: "A/V" } }

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
