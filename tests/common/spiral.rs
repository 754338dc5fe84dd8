//! A continuous model whose solution is known.
#![allow(dead_code, reason = "each test uses some of it")]

use greybox::{Model, Nothing, Scalar, signals};

signals! {
    /// A point of the plane.
    pub struct Plane { x: "1", y: "1" }
}
signals! {
    /// How fast [`Spiral`] grows and turns.
    pub struct Rates { growth: "1/s", turn: "rad/s" }
}

/// A problem with a known solution: a point that spirals to the unit circle, at rates that vary with time. In polar
/// coordinates `dr/dt = growth cos(t) r (1 - r^2)` and `d angle/dt = turn (1 + sin t)`.
#[derive(Clone, Copy, Debug)]
pub struct Spiral;

impl Model for Spiral {
    type State = Plane;
    type Input = Nothing;
    type Output = Plane;
    type Parameters = Rates;

    fn derivative<S: Scalar>(&self, t: S, x: &Plane<S>, _u: &Nothing, p: &Rates<S>) -> Plane<S> {
        let growth = p.growth * t.cos() * ((x.x * x.x + x.y * x.y) * -1.0 + 1.0);
        let turn = p.turn * (t.sin() + 1.0);
        Plane { x: growth * x.x - turn * x.y, y: growth * x.y + turn * x.x }
    }

    fn output<S: Scalar>(&self, _t: S, x: &Plane<S>, _u: &Nothing, _p: &Rates<S>) -> Plane<S> {
        *x
    }
}

impl Spiral {
    /// Where the point is at time `t` (s) if it starts at `x` at time zero.
    pub fn solution<S: Scalar>(&self, t: f64, x: &Plane<S>, p: &Rates<S>) -> Plane<S> {
        let start = (x.x * x.x + x.y * x.y).recip() - 1.0;
        let radius = (start * (p.growth * (-2.0 * t.sin())).exp() + 1.0).sqrt().recip();
        let (sin, cos) = (x.y.atan2(x.x) + p.turn * (t + 1.0 - t.cos())).sin_cos();
        Plane { x: radius * cos, y: radius * sin }
    }
}
