//! Dead times of inputs: simulations and slopes against closed forms, and fits that find them.

#[path = "../common/mod.rs"]
mod common;

mod engines;
mod field;
mod forms;
mod kinks;
mod late_output;
mod left_out;
mod own_code;
mod text;
mod two_inputs;

use greybox::*;

signals! { pub struct Excess { z: "K" } }
signals! { pub struct Valve { u: "%" } }
signals! { pub struct Sensor { y: "K" } }
signals! { pub struct Process { y0: "K", k: "K/%", tau: "s", theta: "s" } }

/// `tau dz/dt = k u(t - theta) - z`, seen as `y = y0 + z`.
#[derive(Clone, Debug)]
struct Heated;

impl Model for Heated {
    type State = Excess;
    type Input = Valve;
    type Output = Sensor;
    type Parameters = Process;
    fn derivative<S: Scalar>(&self, _t: S, x: &Excess<S>, u: &Valve<S>, p: &Process<S>) -> Excess<S> {
        Excess { z: (p.k * u.u - x.z) / p.tau }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Excess<S>, _u: &Valve<S>, p: &Process<S>) -> Sensor<S> {
        Sensor { y: p.y0 + x.z }
    }
    fn delay<S: Scalar>(&self, p: &Process<S>) -> Valve<S> {
        Valve { u: p.theta }
    }
    fn diffusion<S: Scalar>(&self, _t: S, _x: &Excess<S>, _u: &Valve<S>, _p: &Process<S>) -> Excess<S> {
        Excess { z: S::from(0.01) }
    }
    fn noise<S: Scalar>(&self, _t: S, _x: &Excess<S>, _u: &Valve<S>, _p: &Process<S>) -> Sensor<S> {
        Sensor { y: S::from(0.1) }
    }
}

/// From the field: dead time 12.4 s, lag 48 s, sampled every second.
fn record() -> ExperimentOf<Heated> {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/fopdt.csv");
    Experiment::from_file(&Heated, path).unwrap().initial(Excess { z: fixed(0.0) })
}

/// A start before zero names the input and the remedy; a dead time longer than the record, of an input that moves, has no influence, and further
/// starts lead to the right one.
#[test]
fn dead_times_that_cannot_be() {
    let inputs: Vec<Valve> = (0..50).map(|k| Valve { u: f64::from(u8::from(k >= 5)) }).collect();
    let truth = Process { y0: 1.0, k: 2.0, tau: 5.0, theta: 3.0 };
    let time = Time::Uniform { start: 0.0, step: 1.0 };
    let run = simulate(&Heated, &truth, &Excess { z: 0.0 }, time.clone(), &inputs).unwrap();
    let record = run.with_noise(Sensor { y: 0.01 }, 1).experiment(&Heated).unwrap().initial(Excess { z: fixed(0.0) });
    let fitted = |theta: Parameter| {
        let parameters = Process { y0: free(1.0), k: fixed(2.0), tau: fixed(5.0), theta };
        Fit::new(&Heated, &record).parameters(parameters)
    };
    let error = fitted(free(-1.0)).run().unwrap_err().to_string();
    assert!(error.contains("the dead time of input `u` is -1") && error.contains(".within(0.0, ..)"), "{error}");
    let error = simulate(&Heated, &Process { theta: -1.0, ..truth }, &Excess { z: 0.0 }, time, &inputs).unwrap_err();
    assert!(error.to_string().contains("the dead time of input `u` is -1"), "{error}");
    let estimate = fitted(free(60.0)).starts(1).run().unwrap();
    let theta = estimate.unknowns.iter().find(|unknown| unknown.name == "theta").unwrap();
    assert!(matches!(theta.knowledge, Knowledge::Unidentified), "{estimate}");
    let found = fitted(free(60.0)).run().unwrap();
    // A kink; the standard error is 0.03 s.
    assert!((found.parameters.theta - 3.0).abs() < 0.1 && found.severity() < Severity::NotUsable, "{found}");
}
