//! A spring that hardens, driven by noise: the plant of tests of filters.
#![allow(dead_code, reason = "each test uses some of it")]

use crate::common::Noise;
use greybox::*;

signals! { pub struct Deflection { x: "m" } }
signals! { pub struct Pull { u: "N" } }
signals! { pub struct Gauges { y: "m", z: "m" } }
signals! { pub struct Spring { a: "1/s", b: "1/(m^2 s)", c: "m/(N s)", q: "m/s^0.5", r: "m" } }

pub const TRUTH: Spring = Spring { a: 1.0, b: 0.5, c: 1.0, q: 0.3, r: 0.1 };
/// Noise by which the slopes of the spring change by their own size within a standard deviation of the state.
pub const STRONG: Spring = Spring { a: 1.0, b: 0.5, c: 1.0, q: 1.0, r: 0.3 };

/// `dx = (c u - a x - b x^3) dt + q dw`, seen as `y = x + e` with an error of size `r`; `z = x + x^2 / 2`, twice as noisy, is a second gauge.
#[derive(Clone)]
pub struct Hardening;

impl Model for Hardening {
    type State = Deflection;
    type Input = Pull;
    type Output = Gauges;
    type Parameters = Spring;
    fn derivative<S: Scalar>(&self, _t: S, x: &Deflection<S>, u: &Pull<S>, p: &Spring<S>) -> Deflection<S> {
        Deflection { x: p.c * u.u - p.a * x.x - p.b * x.x.powi(3) }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Deflection<S>, _u: &Pull<S>, _p: &Spring<S>) -> Gauges<S> {
        Gauges { y: x.x, z: x.x + x.x * x.x * 0.5 }
    }
    fn diffusion<S: Scalar>(&self, _t: S, _x: &Deflection<S>, _u: &Pull<S>, p: &Spring<S>) -> Deflection<S> {
        Deflection { x: p.q }
    }
    fn noise<S: Scalar>(&self, _t: S, _x: &Deflection<S>, _u: &Pull<S>, p: &Spring<S>) -> Gauges<S> {
        Gauges { y: p.r, z: p.r * 2.0 }
    }
}

/// A record of the plant by Euler's method in steps of a fiftieth of a sample, which err by less than a hundredth of a standard error; the
/// second gauge is read at one sample in `every`. The state at the first sample is zero.
pub fn disturbed(time: Time, samples: usize, every: usize, noise: &mut Noise) -> ExperimentOf<Hardening> {
    driven(&TRUTH, time, samples, every, noise)
}

/// The same by other parameters.
pub fn driven(truth: &Spring, time: Time, samples: usize, every: usize, noise: &mut Noise) -> ExperimentOf<Hardening> {
    const STEPS: usize = 50;
    let (mut x, mut inputs, mut outputs) = (0.0, vec![], vec![]);
    for k in 0..samples {
        let u = [2.0, -1.0, 0.5, -2.0, 1.0][k / 15 % 5];
        let (y, z) = (x + truth.r * noise.gauss(), x + 0.5 * x * x + 2.0 * truth.r * noise.gauss());
        outputs.push(Gauges { y, z: if k % every == 0 { z } else { f64::NAN } });
        inputs.push(Pull { u });
        let h = (time.at(k + 1) - time.at(k)) / STEPS as f64;
        for _ in 0..STEPS {
            x += h * (truth.c * u - truth.a * x - truth.b * x * x * x) + truth.q * h.sqrt() * noise.gauss();
        }
    }
    Experiment::new(&Hardening, time, inputs, outputs).unwrap().initial(Deflection { x: fixed(0.0) })
}

/// A start at some distance, levels by their logarithms.
pub fn start() -> Spring<Parameter> {
    Spring { a: free(0.7), b: free(0.8), c: free(0.8), q: free(0.6).log(), r: free(0.2).log() }
}

/// Mean and variance after so many steps of Runge-Kutta's method, each `h` long.
pub fn runge_kutta<S: Scalar>(mut z: [S; 2], h: f64, steps: u32, rate: impl Fn([S; 2]) -> [S; 2]) -> [S; 2] {
    for _ in 0..steps {
        let along = |k: [S; 2], h: f64| [z[0] + k[0] * h, z[1] + k[1] * h];
        let k1 = rate(z);
        let k2 = rate(along(k1, h / 2.0));
        let k3 = rate(along(k2, h / 2.0));
        let k4 = rate(along(k3, h));
        let sum = |i: usize| (k1[i] + (k2[i] + k3[i]) * 2.0 + k4[i]) * (h / 6.0);
        z = [z[0] + sum(0), z[1] + sum(1)];
    }
    z
}
