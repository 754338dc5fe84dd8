//! Plants, and what their records are made of.

use crate::dc_motor::DcMotor;
pub use crate::records::*;
use greybox::pmsm::Surface;
use greybox::{Kind, Model, Nothing, Scalar, signals};

signals! { pub struct Level { y: "V" } }
signals! { pub struct Force { u: "V" } }
signals! { pub struct Lag { k: "1", tau: "s" } }
signals! { pub struct Spring { m: "kg", d: "N s/m", c: "N/m" } }
signals! { pub struct Motion { x: "m", v: "m/s" } }
signals! { pub struct Tank { a: "m^2", c: "m^2" } }
signals! { pub struct Masses { t1: "K", t2: "K" } }
signals! { pub struct Walls { c1: "J/K", c2: "J/K", r12: "K/W", ra: "K/W" } }
signals! { pub struct Poles { a: "1", b: "1" } }
signals! { pub struct Line { a: "1", b: "V" } }
signals! { pub struct Two { y: "V", z: "V" } }
signals! { pub struct Factors { a: "1", b: "1" } }
signals! { pub struct Plane { a: "1", b: "1", c: "V" } }
signals! { pub struct Ringing { d: "1/s", c: "1/s^2" } }

/// `tau dy/dt = k u - y`.
pub struct FirstOrder;

impl Model for FirstOrder {
    type State = Level;
    type Input = Force;
    type Output = Level;
    type Parameters = Lag;
    fn derivative<S: Scalar>(&self, _t: S, x: &Level<S>, u: &Force<S>, p: &Lag<S>) -> Level<S> {
        Level { y: (p.k * u.u - x.y) / p.tau }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Level<S>, _u: &Force<S>, _p: &Lag<S>) -> Level<S> {
        *x
    }
}

/// A mass on a spring under a force, its position measured.
pub struct Oscillator;

impl Model for Oscillator {
    type State = Motion;
    type Input = Force;
    type Output = Level;
    type Parameters = Spring;
    fn derivative<S: Scalar>(&self, _t: S, x: &Motion<S>, u: &Force<S>, p: &Spring<S>) -> Motion<S> {
        Motion { x: x.v, v: (u.u - p.d * x.v - p.c * x.x) / p.m }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Motion<S>, _u: &Force<S>, _p: &Spring<S>) -> Level<S> {
        Level { y: x.x }
    }
}

/// The level of a tank with an outlet.
pub struct Vessel;

impl Model for Vessel {
    type State = Level;
    type Input = Force;
    type Output = Level;
    type Parameters = Tank;
    fn derivative<S: Scalar>(&self, _t: S, x: &Level<S>, u: &Force<S>, p: &Tank<S>) -> Level<S> {
        Level { y: (u.u - p.c * (x.y * x.y + 1e-6).sqrt().sqrt()) / p.a }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Level<S>, _u: &Force<S>, _p: &Tank<S>) -> Level<S> {
        *x
    }
}

/// A heated mass and one behind it, both temperatures above the surroundings' measured.
pub struct Heated;

impl Model for Heated {
    type State = Masses;
    type Input = Force;
    type Output = Masses;
    type Parameters = Walls;
    fn derivative<S: Scalar>(&self, _t: S, x: &Masses<S>, u: &Force<S>, p: &Walls<S>) -> Masses<S> {
        let flow = (x.t1 - x.t2) / p.r12;
        Masses { t1: (u.u - flow) / p.c1, t2: (flow - x.t2 / p.ra) / p.c2 }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Masses<S>, _u: &Force<S>, _p: &Walls<S>) -> Masses<S> {
        *x
    }
}

/// `x[k+1] = a x[k] + b u[k]`.
pub struct Recursion;

impl Model for Recursion {
    type State = Level;
    type Input = Force;
    type Output = Level;
    type Parameters = Poles;
    const KIND: Kind = Kind::Discrete;
    fn next<S: Scalar>(&self, _t: S, x: &Level<S>, u: &Force<S>, p: &Poles<S>) -> Level<S> {
        Level { y: p.a * x.y + p.b * u.u }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Level<S>, _u: &Force<S>, _p: &Poles<S>) -> Level<S> {
        *x
    }
}

/// `y = a u + b`.
pub struct Straight;

impl Model for Straight {
    type State = Nothing;
    type Input = Force;
    type Output = Level;
    type Parameters = Line;
    const KIND: Kind = Kind::Static;
    fn output<S: Scalar>(&self, _t: S, _x: &Nothing, u: &Force<S>, p: &Line<S>) -> Level<S> {
        Level { y: p.a * u.u + p.b }
    }
}

/// `y = a u + c`, `z = a b u - c`.
pub struct Planar;

impl Model for Planar {
    type State = Nothing;
    type Input = Force;
    type Output = Two;
    type Parameters = Plane;
    const KIND: Kind = Kind::Static;
    fn output<S: Scalar>(&self, _t: S, _x: &Nothing, u: &Force<S>, p: &Plane<S>) -> Two<S> {
        Two { y: p.a * u.u + p.c, z: p.a * p.b * u.u - p.c }
    }
}

/// `y = a b u`: two parameters that only their product is known of.
#[derive(Clone)]
pub struct Product;

impl Model for Product {
    type State = Nothing;
    type Input = Force;
    type Output = Level;
    type Parameters = Factors;
    const KIND: Kind = Kind::Static;
    fn output<S: Scalar>(&self, _t: S, _x: &Nothing, u: &Force<S>, p: &Factors<S>) -> Level<S> {
        Level { y: p.a * p.b * u.u }
    }
}

/// An oscillator without an input.
pub struct Free;

impl Model for Free {
    type State = Motion;
    type Input = Nothing;
    type Output = Motion;
    type Parameters = Ringing;
    fn derivative<S: Scalar>(&self, _t: S, x: &Motion<S>, _u: &Nothing, p: &Ringing<S>) -> Motion<S> {
        Motion { x: x.v, v: -(p.d * x.v + p.c * x.x) }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Motion<S>, _u: &Nothing, _p: &Ringing<S>) -> Motion<S> {
        *x
    }
}

pub fn lag() -> Bench<FirstOrder> {
    bench(FirstOrder, &[2.0, 0.3], 0.05, &[(0.3, 1.0, 13)], &[0.0])
}

pub fn oscillator() -> Bench<Oscillator> {
    Bench { told: true, ..bench(Oscillator, &[0.5, 0.4, 8.0], 0.05, &[(0.0, 3.0, 17)], &[0.0, 0.0]) }
}

pub fn tank() -> Bench<Vessel> {
    bench(Vessel, &[0.8, 0.6], 0.5, &[(1.0, 0.5, 15)], &[1.5])
}

pub fn heated() -> Bench<Heated> {
    bench(Heated, &[900.0, 4000.0, 0.4, 0.8], 60.0, &[(25.0, 25.0, 25)], &[0.0, 0.0])
}

pub fn surface() -> Bench<Surface> {
    let drive = [(0.0, 3.0, 11), (6.0, 8.0, 17), (10.0, 12.0, 60)];
    bench(Surface::new(4).unwrap(), &[0.6, 4e-3, 0.5], 5e-4, &drive, &[0.0, 0.0])
}

pub fn brushed() -> Bench<DcMotor> {
    bench(DcMotor, &[1.2, 2e-3, 0.06, 5e-5, 2e-4], 5e-4, &[(2.0, 12.0, 20), (0.0, 0.05, 45)], &[0.0, 0.0])
}

pub fn recursion() -> Bench<Recursion> {
    bench(Recursion, &[0.6, 0.4], 1.0, &[(0.2, 1.0, 5)], &[0.0])
}

pub fn line() -> Bench<Straight> {
    bench(Straight, &[2.5, -0.7], 0.1, &[(0.5, 2.0, 3)], &[])
}

pub fn plane() -> Bench<Planar> {
    bench(Planar, &[2.0, 0.5, 0.3], 0.1, &[(0.5, 2.0, 3)], &[])
}

pub fn ringing() -> Bench<Free> {
    bench(Free, &[0.3, 9.0], 0.05, &[], &[1.0, 0.0])
}

/// The plants that faults of a record are tried on, one after the other.
pub fn plant(number: u64) -> Box<dyn Plant> {
    match number % 7 {
        0 => Box::new(lag()),
        1 => Box::new(surface()),
        2 => Box::new(oscillator()),
        3 => Box::new(brushed()),
        4 => Box::new(tank()),
        5 => Box::new(recursion()),
        _ => Box::new(heated()),
    }
}

/// Those with two outputs.
pub fn plant_of_two(number: u64) -> Box<dyn Plant> {
    match number % 3 {
        0 => Box::new(surface()),
        1 => Box::new(brushed()),
        _ => Box::new(heated()),
    }
}
