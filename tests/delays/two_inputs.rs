//! Two inputs, one of them late, of a plant that is not affine, simulated and filtered.

use crate::Excess;
use crate::common::Noise;
use argmin::core::{CostFunction, Gradient};
use greybox::*;

signals! { pub struct Two { early: "V", late: "V" } }
signals! { pub struct Speeds { x: "m", v: "m/s" } }
signals! { pub struct Spring { w: "1/s", d: "1", b: "m/(s^2 V)", c: "m/(s^2 V)", theta: "s", q: "m/s^1.5", r: "m" } }

/// `x'' = -w^2 x - 2 d w x' - x^3 + b early + c late(t - theta)`, with process noise.
#[derive(Clone)]
struct Driven;

impl Model for Driven {
    type State = Speeds;
    type Input = Two;
    type Output = Excess;
    type Parameters = Spring;
    fn derivative<S: Scalar>(&self, _t: S, x: &Speeds<S>, u: &Two<S>, p: &Spring<S>) -> Speeds<S> {
        let spring = p.w * p.w * x.x + p.d * p.w * x.v * 2.0 + x.x.powi(3);
        Speeds { x: x.v, v: p.b * u.early + p.c * u.late - spring }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Speeds<S>, _u: &Two<S>, _p: &Spring<S>) -> Excess<S> {
        Excess { z: x.x }
    }
    fn delay<S: Scalar>(&self, p: &Spring<S>) -> Two<S> {
        Two { early: S::from(0.0), late: p.theta }
    }
    fn diffusion<S: Scalar>(&self, _t: S, _x: &Speeds<S>, _u: &Two<S>, p: &Spring<S>) -> Speeds<S> {
        Speeds { x: S::from(0.0), v: p.q }
    }
    fn noise<S: Scalar>(&self, _t: S, _x: &Speeds<S>, _u: &Two<S>, p: &Spring<S>) -> Excess<S> {
        Excess { z: p.r }
    }
}

/// Two inputs of different holds, one of them late; simulation and filter. Gradients against central differences of the cost, whose slope jumps
/// only where the dead time is a whole number of samples: it is not.
#[test]
fn one_input_of_two_is_late() {
    let mut noise = Noise(5);
    let inputs: Vec<Two> = (0..150).map(|k| Two { early: (0.3 * k as f64).sin(), late: noise.gauss() }).collect();
    let outputs = (0..150).map(|k| Excess { z: (0.2 * k as f64).sin() }).collect();
    let time = Time::Uniform { start: 0.0, step: 0.1 };
    let record = Experiment::new(&Driven, time, inputs, outputs).unwrap();
    let record =
        record.holds(Two { early: Hold::First, late: Hold::Zero }).initial(Speeds { x: free(0.1), v: free(0.3) });
    let parameters = Spring {
        w: free(2.0),
        d: free(0.3),
        b: free(1.0),
        c: free(2.0),
        theta: free(0.234),
        q: free(0.5).log(),
        r: free(0.1).log(),
    };
    let fit = |parameters| Fit::new(&Driven, &record).parameters(parameters);
    let quiet = Spring { q: fixed(0.5), r: fixed(0.1), ..parameters };
    let simulated = fit(quiet).noise(Excess { z: 0.1 });
    for problem in [simulated.problem().unwrap(), fit(parameters).predictor(Kalman).problem().unwrap()] {
        let objective = problem.objective().unwrap();
        let at = objective.start();
        let found = objective.gradient(&at).unwrap();
        let size = found.iter().fold(0.0, |size: f64, g| size.max(g.abs()));
        for (i, found) in found.iter().enumerate() {
            let cost = |by: f64| {
                let mut to = at.clone();
                to[i] += by;
                objective.cost(&to).unwrap()
            };
            let h = 1e-3;
            let difference = (8.0 * (cost(h) - cost(-h)) - cost(2.0 * h) + cost(-2.0 * h)) / (12.0 * h);
            assert!((found - difference).abs() < 1e-6 * size, "{i}: {found} {difference}");
        }
    }
}
