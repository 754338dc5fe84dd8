//! The small models of the guide's chapters.

use greybox::{Model, Scalar, signals};

signals! {
    pub struct Speed { w: "rad/s" }
    pub struct Torque { m: "N m" }
    pub struct Rotor { j: "kg m^2", b: "N m s", c: "N m" }
    pub struct Current { i: "A" }
    pub struct Voltage { u: "V" }
    pub struct Coil { r: "ohm", l: "H", lost: "V" }
    pub struct Swing { x: "m", v: "m/s" }
    pub struct Force { f: "N" }
    pub struct Position { x: "m" }
    pub struct Spring { k: "N/m", d: "N s/m" }
}

/// The rotor of chapter 1.
#[derive(Clone)]
pub struct Shaft;

impl Model for Shaft {
    type State = Speed;
    type Input = Torque;
    type Output = Speed;
    type Parameters = Rotor;
    fn derivative<S: Scalar>(&self, _t: S, x: &Speed<S>, u: &Torque<S>, p: &Rotor<S>) -> Speed<S> {
        Speed { w: (u.m - p.b * x.w - p.c * (x.w * 5.0).tanh()) / p.j }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Speed<S>, _u: &Torque<S>, _p: &Rotor<S>) -> Speed<S> {
        *x
    }
}

/// The coil behind an inverter of chapter 8.
#[derive(Clone)]
pub struct Behind;

impl Model for Behind {
    type State = Current;
    type Input = Voltage;
    type Output = Current;
    type Parameters = Coil;
    fn derivative<S: Scalar>(&self, _t: S, x: &Current<S>, u: &Voltage<S>, p: &Coil<S>) -> Current<S> {
        Current { i: (u.u - p.lost * (x.i * 5.0).tanh() - p.r * x.i) / p.l }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Current<S>, _u: &Voltage<S>, _p: &Coil<S>) -> Current<S> {
        *x
    }
}

/// The mass on a spring of chapter 10, 1 kg.
#[derive(Clone)]
pub struct Mass;

impl Model for Mass {
    type State = Swing;
    type Input = Force;
    type Output = Position;
    type Parameters = Spring;
    fn derivative<S: Scalar>(&self, _t: S, x: &Swing<S>, u: &Force<S>, p: &Spring<S>) -> Swing<S> {
        Swing { x: x.v, v: u.f - p.k * x.x - p.d * x.v }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Swing<S>, _u: &Force<S>, _p: &Spring<S>) -> Position<S> {
        Position { x: x.x }
    }
}
