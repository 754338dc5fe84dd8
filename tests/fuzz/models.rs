//! Models of every kind, with sound and with broken equations.

use greybox::{Kind, Model, Nothing, Scalar, signals};

signals! {
    pub struct In { u: "V", v: "N" }
    pub struct One { y: "m" }
    pub struct Two { y: "m", z: "m/s" }
    pub struct Gains { a: "1", b: "m", c: "1" }
    pub struct Rates { k: "1/s", g: "m/V", x0: "m" }
    pub struct Spring { w: "rad/s", d: "1/s", g: "1" }
}

/// `y = a c u + b`: two of three parameters are known only as a product.
#[derive(Clone)]
pub struct Line;

impl Model for Line {
    type State = Nothing;
    type Input = In;
    type Output = One;
    type Parameters = Gains;
    const KIND: Kind = Kind::Static;
    fn output<S: Scalar>(&self, _t: S, _x: &Nothing, u: &In<S>, p: &Gains<S>) -> One<S> {
        One { y: p.a * p.c * u.u + p.b }
    }
}

/// `y = ln(a u) + b sqrt(v) / c`: not a number for many inputs and parameters.
#[derive(Clone)]
pub struct Broken;

impl Model for Broken {
    type State = Nothing;
    type Input = In;
    type Output = One;
    type Parameters = Gains;
    const KIND: Kind = Kind::Static;
    fn output<S: Scalar>(&self, _t: S, _x: &Nothing, u: &In<S>, p: &Gains<S>) -> One<S> {
        One { y: (p.a * u.u).ln() + p.b * u.v.sqrt() / p.c }
    }
}

/// `y[k+1] = a y[k] + b u[k] + c`
#[derive(Clone)]
pub struct Regression;

impl Model for Regression {
    type State = One;
    type Input = In;
    type Output = One;
    type Parameters = Gains;
    const KIND: Kind = Kind::Discrete;
    fn next<S: Scalar>(&self, _t: S, x: &One<S>, u: &In<S>, p: &Gains<S>) -> One<S> {
        One { y: p.a * x.y + p.b * u.u + p.c }
    }
    fn output<S: Scalar>(&self, _t: S, x: &One<S>, _u: &In<S>, _p: &Gains<S>) -> One<S> {
        *x
    }
}

/// `dy/dt = k (g u - y)`, seen with an offset
#[derive(Clone)]
pub struct Lag;

impl Model for Lag {
    type State = One;
    type Input = In;
    type Output = One;
    type Parameters = Rates;
    fn derivative<S: Scalar>(&self, _t: S, x: &One<S>, u: &In<S>, p: &Rates<S>) -> One<S> {
        One { y: p.k * (p.g * u.u - x.y) }
    }
    fn output<S: Scalar>(&self, _t: S, x: &One<S>, _u: &In<S>, p: &Rates<S>) -> One<S> {
        One { y: x.y + p.x0 }
    }
}

/// A spring with damping `d`, which may feed energy, driven by `g u`
#[derive(Clone)]
pub struct Oscillator;

impl Model for Oscillator {
    type State = Two;
    type Input = In;
    type Output = Two;
    type Parameters = Spring;
    fn derivative<S: Scalar>(&self, _t: S, x: &Two<S>, u: &In<S>, p: &Spring<S>) -> Two<S> {
        Two { y: x.z, z: p.g * u.u - p.w * p.w * x.y - p.d * x.z }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Two<S>, _u: &In<S>, _p: &Spring<S>) -> Two<S> {
        *x
    }
}

/// A pendulum of which only the angle is seen, by code that cannot be traced
#[derive(Clone)]
pub struct Pendulum;

impl Model for Pendulum {
    type State = Two;
    type Input = In;
    type Output = One;
    type Parameters = Spring;
    fn derivative<S: Scalar>(&self, _t: S, x: &Two<S>, u: &In<S>, p: &Spring<S>) -> Two<S> {
        let friction = if x.z.value() > 0.0 { p.d } else { -p.d };
        Two { y: x.z, z: p.g * u.v - p.w * p.w * x.y.sin() - friction }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Two<S>, _u: &In<S>, _p: &Spring<S>) -> One<S> {
        One { y: x.y }
    }
}
