//! Dead times of inputs: simulations and slopes against closed forms, and fits that find them.

#[path = "../common/mod.rs"]
mod common;

use argmin::core::{CostFunction, Gradient};
use common::Noise;
use greybox::optimize::Severity;
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
    fn diffusion<S: Scalar>(&self, _p: &Process<S>) -> Excess<S> {
        Excess { z: S::from(0.01) }
    }
    fn noise<S: Scalar>(&self, _p: &Process<S>) -> Sensor<S> {
        Sensor { y: S::from(0.1) }
    }
}

/// The answer to a step of the input at time `at` by one, or to a ramp of one per second from then on, of which `hold` is each.
fn answer<S: Scalar>(p: &Process<S>, hold: Hold, at: f64, t: f64) -> S {
    let since = -p.theta + (t - at);
    let decay = (-since / p.tau).exp();
    let form = match hold {
        Hold::Zero => -decay + 1.0,
        Hold::First => since - p.tau * (-decay + 1.0),
    };
    // At its first instant the slope is that of a longer dead time.
    let before = since.value() <= 0.0;
    p.k * if before { S::from(0.0) } else { form }
}

fn uneven(samples: usize) -> Time {
    Time::Stamps((0..samples).map(|k| k as f64 + if k % 3 == 1 { 0.3 } else { 0.0 }).collect())
}

/// A step (held) or a ramp (interpolated) at sample 3; dead times between samples, at whole numbers of them and zero; even and uneven
/// time. Values and gradient are those of the closed form; at a whole number the slope is that of a longer dead time. 20 steps of fourth order
/// per sample of a twentieth of the time constant err by less than 1e-12.
#[test]
fn steps_and_ramps_by_their_closed_forms() {
    for time in [Time::Uniform { start: 0.0, step: 1.0 }, uneven(40)] {
        for (hold, theta) in
            [Hold::Zero, Hold::First].into_iter().flat_map(|hold| [0.0, 0.4, 2.0, 4.7].map(|theta| (hold, theta)))
        {
            let truth = Process { y0: 2.0, k: 1.5, tau: 5.0, theta };
            let at = time.at(3);
            let input = |k: usize| match hold {
                Hold::Zero => f64::from(u8::from(k >= 3)),
                Hold::First => (time.at(k) - at).max(0.0),
            };
            let inputs: Vec<Valve> = (0..40).map(|k| Valve { u: input(k) }).collect();
            let fine = Rk4 { substeps: 20 };
            let run = Simulator::new(&Heated)
                .hold(hold)
                .integrator(fine)
                .run(&truth, &Excess { z: 0.0 }, time.clone(), &inputs)
                .unwrap();
            for (k, y) in run.outputs.iter().enumerate() {
                let exact = 2.0 + answer(&truth, hold, at, time.at(k));
                assert!((y.y - exact).abs() < 1e-10, "{hold:?} {theta} {k}: {} {exact}", y.y);
            }
            // Against outputs of zero, with a noise of one, the cost is half the sum of squares.
            let outputs = vec![Sensor { y: 0.0 }; 40];
            let record = Experiment::new(&Heated, time.clone(), inputs, outputs).unwrap().hold(hold);
            let record = record.initial(Excess { z: fixed(0.0) });
            let parameters = Process { y0: free(2.0), k: free(1.5), tau: free(5.0), theta: free(theta) };
            let fit = Fit::new(&Heated, &record).parameters(parameters).noise(Sensor { y: 1.0 });
            let problem = fit.integrator(fine).problem().unwrap();
            let objective = problem.objective().unwrap();
            let p: Vec<Dual<4>> =
                [2.0, 1.5, 5.0, theta].into_iter().enumerate().map(|(i, p)| Dual::variable(p, i)).collect();
            let p = Process { y0: p[0], k: p[1], tau: p[2], theta: p[3] };
            let square = |k: usize| {
                let y = p.y0 + answer(&p, hold, at, time.at(k));
                y * y * 0.5
            };
            let exact = (0..40).map(square).reduce(|a, b| a + b).unwrap();
            let found = (objective.cost(&objective.start()).unwrap(), objective.gradient(&objective.start()).unwrap());
            assert!((found.0 / exact.value - 1.0).abs() < 1e-10, "{hold:?} {theta}: {} {}", found.0, exact.value);
            for (found, exact) in found.1.iter().zip(exact.slopes) {
                assert!((found - exact).abs() < 1e-9 * exact.abs().max(1.0), "{hold:?} {theta}: {found} {exact}");
            }
        }
    }
}

/// From the field: dead time 12.4 s, lag 48 s, sampled every second.
fn record() -> ExperimentOf<Heated> {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/fopdt.csv");
    Experiment::from_file(&Heated, path).unwrap().initial(Excess { z: fixed(0.0) })
}

#[test]
fn a_first_order_plant_with_dead_time_from_the_field() {
    let record = record();
    for theta in [1.0, 5.0, 20.0, 30.0] {
        let theta = free(theta).within(0.0, 60.0);
        let parameters = Process { y0: free(20.0), k: free(1.0), tau: free(20.0).log(), theta };
        let estimate = Fit::new(&Heated, &record).parameters(parameters).run().unwrap();
        println!("{estimate}");
        assert_eq!(estimate.severity(), Severity::Usable, "{estimate}");
        for (name, truth) in [("tau", 48.0), ("theta", 12.4)] {
            let unknown = estimate.unknowns.iter().find(|unknown| unknown.name == name).unwrap();
            let error = unknown.knowledge.standard_error().unwrap();
            assert!((unknown.value - truth).abs() < 2.0 * error, "{name}: {} +- {error}", unknown.value);
        }
    }
}

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
    fn diffusion<S: Scalar>(&self, p: &Spring<S>) -> Speeds<S> {
        Speeds { x: S::from(0.0), v: p.q }
    }
    fn noise<S: Scalar>(&self, p: &Spring<S>) -> Excess<S> {
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

/// A start before zero names the input and the remedy; a dead time longer than the record, of an input that moves, has no influence.
#[test]
fn dead_times_that_cannot_be() {
    let inputs: Vec<Valve> = (0..50).map(|k| Valve { u: f64::from(u8::from(k >= 5)) }).collect();
    let truth = Process { y0: 1.0, k: 2.0, tau: 5.0, theta: 3.0 };
    let time = Time::Uniform { start: 0.0, step: 1.0 };
    let run = simulate(&Heated, &truth, &Excess { z: 0.0 }, time.clone(), &inputs).unwrap();
    let record = run.with_noise(Sensor { y: 0.01 }, 1).experiment(&Heated).unwrap().initial(Excess { z: fixed(0.0) });
    let fitted = |theta: Parameter| {
        let parameters = Process { y0: free(1.0), k: fixed(2.0), tau: fixed(5.0), theta };
        Fit::new(&Heated, &record).parameters(parameters).run()
    };
    let error = fitted(free(-1.0)).unwrap_err().to_string();
    assert!(error.contains("the dead time of input `u` is -1") && error.contains(".within(0.0, ..)"), "{error}");
    let error = simulate(&Heated, &Process { theta: -1.0, ..truth }, &Excess { z: 0.0 }, time, &inputs).unwrap_err();
    assert!(error.to_string().contains("the dead time of input `u` is -1"), "{error}");
    let estimate = fitted(free(60.0)).unwrap();
    let theta = estimate.unknowns.iter().find(|unknown| unknown.name == "theta").unwrap();
    assert!(matches!(theta.knowledge, Knowledge::Unidentified { .. }), "{estimate}");
}

/// The model as text gives the estimates of its Rust twin, and so does the text that is written of the twin.
#[test]
fn in_a_text_model() {
    let text = r#"
greybox = 1
[inputs]
u = { unit = "%", delay = "theta" }
[parameters]
y0 = { unit = "K", start = 20 }
k = { unit = "K/%", start = 1 }
tau = { unit = "s", start = 20, positive = true }
theta = { unit = "s", start = 5, within = [0, 60] }
[states]
z = { unit = "K", derivative = "(k*u - z)/tau", initial = 0 }
[outputs]
y = { value = "y0 + z", unit = "K" }
"#;
    let read = text::Model::named("process.toml", text).unwrap();
    assert!(read.warnings().is_empty(), "{:?}", read.warnings());
    let typed = record().record().clone();
    let found = read.fit(&[read.prepare(typed.clone()).unwrap()]).unwrap().run().unwrap();
    let theta = free(5.0).within(0.0, 60.0);
    let parameters = Process { y0: free(20.0), k: free(1.0), tau: free(20.0).log(), theta };
    let expected = Fit::new(&Heated, &record()).parameters(parameters).run().unwrap();
    let close = |found: &estimate::Summary| {
        for (found, expected) in found.unknowns.iter().zip(&expected.unknowns) {
            assert!(
                (found.value / expected.value - 1.0).abs() < 1e-9,
                "{}: {} {}",
                found.name,
                found.value,
                expected.value
            );
        }
    };
    close(&found);
    let equations = equations::Equations::trace(&Heated).unwrap();
    let written = text::Model::of(&equations, "process", read.parameters()).unwrap();
    assert!(written.to_toml().contains("u = { unit = \"%\", delay = \"theta\" }"), "{}", written.to_toml());
    close(&written.fit(&[typed]).unwrap().run().unwrap());
    // A dead time is a time.
    let wrong = text::Model::named("process.toml", &text.replace("delay = \"theta\"", "delay = \"k\"")).unwrap();
    assert!(
        wrong.warnings().iter().any(|one| one.to_string().contains("the dead time of `u`")),
        "{:?}",
        wrong.warnings()
    );
}
