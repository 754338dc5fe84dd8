//! [`GivenNoise`] against [`Kalman`], whose covariance is no square of a root.

use crate::common::Noise;
use argmin::core::{CostFunction, Gradient};
use greybox::predict::GivenNoise;
use greybox::*;

signals! { pub struct Motion { x: "m", v: "m/s", w: "m/s" } }
signals! { pub struct Force { u: "N" } }
signals! { pub struct Gauges { x: "m", sum: "m/s" } }
signals! { pub struct Spring { k: "1", d: "1" } }

/// A mass, sampled once in a second, with a lag of the speed: three states, two gauges, and a force that grows with the cube of the way.
#[derive(Clone)]
struct Mass;

const DIFFUSION: [f64; 3] = [0.02, 0.1, 0.05];
const NOISE: [f64; 2] = [0.1, 0.2];

impl Model for Mass {
    type State = Motion;
    type Input = Force;
    type Output = Gauges;
    type Parameters = Spring;
    const KIND: Kind = Kind::Discrete;

    fn next<S: Scalar>(&self, _t: S, x: &Motion<S>, u: &Force<S>, p: &Spring<S>) -> Motion<S> {
        let pull = p.k * x.x + x.x * x.x * x.x * 0.002;
        Motion { x: x.x + x.v, v: x.v * (-p.d + 1.0) - pull + u.u, w: x.w * 0.7 + x.v * 0.3 }
    }

    fn diffusion<S: Scalar>(&self, _t: S, _x: &Motion<S>, _u: &Force<S>, _p: &Spring<S>) -> Motion<S> {
        let [x, v, w] = DIFFUSION.map(S::from);
        Motion { x, v, w }
    }

    fn noise<S: Scalar>(&self, _t: S, _x: &Motion<S>, _u: &Force<S>, _p: &Spring<S>) -> Gauges<S> {
        let [x, sum] = NOISE.map(S::from);
        Gauges { x, sum }
    }

    fn output<S: Scalar>(&self, _t: S, x: &Motion<S>, _u: &Force<S>, _p: &Spring<S>) -> Gauges<S> {
        Gauges { x: x.x, sum: x.v + x.w }
    }
}

/// Likelihood and gradient of two filters that differ in how they keep the covariance, in compiled code, with outputs that are missing: to the
/// rounding of 400 terms.
#[test]
fn a_root_gives_the_likelihood_of_the_covariance() {
    let mut random = Noise(3);
    let inputs: Vec<Force> = (0..200).map(|k| Force { u: f64::from(k * 37 % 11) / 11.0 - 0.5 }).collect();
    let mut x = Motion { x: 0.0, v: 0.0, w: 0.0 };
    let spring = Spring { k: 0.3, d: 0.4 };
    let outputs = (0..200).map(|k| {
        let y = Mass.output(0.0, &x, &inputs[k], &spring);
        let next = Mass.next(0.0, &x, &inputs[k], &spring);
        let [a, b, c] = DIFFUSION.map(|level| level * random.gauss());
        x = Motion { x: next.x + a, v: next.v + b, w: next.w + c };
        let x = if k % 5 == 2 { f64::NAN } else { y.x + NOISE[0] * random.gauss() };
        Gauges { x, sum: if k % 7 == 3 { f64::NAN } else { y.sum + NOISE[1] * random.gauss() } }
    });
    let outputs = outputs.collect();
    let time = Time::Uniform { start: 0.0, step: 1.0 };
    let rest = Motion { x: free(0.1), v: fixed(0.0), w: fixed(0.0) };
    let record = Experiment::new(&Mass, time, inputs.clone(), outputs).unwrap().initial(rest);
    let fit = || Fit::new(&Mass, &record).parameters(Spring { k: free(0.25), d: free(0.5) });
    let given = GivenNoise { states: DIFFUSION.to_vec(), outputs: NOISE.to_vec() };
    let [kalman, root] = [fit().predictor(Kalman), fit().predictor(given)].map(|fit| fit.problem().unwrap());
    let [kalman, root] = [&kalman, &root].map(|problem| {
        let objective = problem.objective().unwrap();
        let at = objective.start();
        (objective.cost(&at).unwrap(), objective.gradient(&at).unwrap())
    });
    assert!((kalman.0 - root.0).abs() < 1e-12 * kalman.0.abs(), "{} {}", kalman.0, root.0);
    for (kalman, root) in kalman.1.iter().zip(&root.1) {
        assert!((kalman - root).abs() < 1e-10 * kalman.abs(), "{kalman} {root}");
    }
}

/// Levels that are not positive, and too few of them, are refused by name.
#[test]
fn levels_of_noise_are_checked() {
    let (time, outputs) = (Time::Uniform { start: 0.0, step: 1.0 }, vec![Gauges { x: 0.0, sum: 1.0 }; 20]);
    let record = Experiment::new(&Mass, time, vec![Force { u: 1.0 }; 20], outputs).unwrap();
    let refused = |states: &[f64], outputs: &[f64]| {
        let given = GivenNoise { states: states.to_vec(), outputs: outputs.to_vec() };
        let fit = Fit::new(&Mass, &record).parameters(Spring { k: free(0.25), d: free(0.5) });
        fit.predictor(given).run().unwrap_err().to_string()
    };
    assert!(refused(&[1.0, 1.0], &NOISE).contains("given for 2 states, but the model has 3"));
    assert!(refused(&DIFFUSION, &[1.0]).contains("given for 1 outputs, but the model has 2"));
    assert!(refused(&[1.0, 0.0, 1.0], &NOISE).contains("the level of noise of `v`"));
    assert!(refused(&DIFFUSION, &[f64::NAN, 1.0]).contains("the level of noise of `x`"));
}
