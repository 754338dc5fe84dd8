//! Initial states that follow from the parameters: those of rest, and those that the model says.

use crate::common::Noise;
use argmin::core::{CostFunction, Gradient};
use greybox::*;

signals! { pub struct Motion { x: "m", v: "m/s" } }
signals! { pub struct Position { x: "m" } }
signals! { pub struct Force { f: "N" } }
signals! { pub struct Spring { c: "1/s^2", d: "1/s", b: "1/(m^2 s^2)", q: "m/s^1.5", r: "m" } }

/// A mass on a spring that hardens, its position measured; `dv = (f - c x - b x^3 - d v) dt + q dw`. It says its state at the first sample, or not.
#[derive(Clone)]
struct Oscillator {
    says: bool,
}

/// The position of rest at a force: Cardano's root of `b x^3 + c x = f`.
fn position<S: Scalar>(f: S, c: S, b: S) -> S {
    let (p, q) = (c / b, -(f / b));
    let root = (q * q * 0.25 + p * p * p / 27.0).sqrt();
    (root - q * 0.5).cbrt() - (root + q * 0.5).cbrt()
}

impl Model for Oscillator {
    type State = Motion;
    type Input = Force;
    type Output = Position;
    type Parameters = Spring;

    fn derivative<S: Scalar>(&self, _t: S, x: &Motion<S>, u: &Force<S>, p: &Spring<S>) -> Motion<S> {
        Motion { x: x.v, v: u.f - p.c * x.x - p.b * x.x.powi(3) - p.d * x.v }
    }

    fn output<S: Scalar>(&self, _t: S, x: &Motion<S>, _u: &Force<S>, _p: &Spring<S>) -> Position<S> {
        Position { x: x.x }
    }

    fn diffusion<S: Scalar>(&self, _t: S, _x: &Motion<S>, _u: &Force<S>, p: &Spring<S>) -> Motion<S> {
        Motion { x: S::from(0.0), v: p.q }
    }

    fn noise<S: Scalar>(&self, _t: S, _x: &Motion<S>, _u: &Force<S>, p: &Spring<S>) -> Position<S> {
        Position { x: p.r }
    }

    fn initial<S: Scalar>(&self, u: &Force<S>, p: &Spring<S>) -> Motion<S> {
        let nan = S::from(f64::NAN);
        if self.says { Motion { x: position(u.f, p.c, p.b), v: S::from(0.0) } } else { Motion { x: nan, v: nan } }
    }
}

const TRUTH: Spring = Spring { c: 2.0, d: 0.4, b: 0.5, q: 0.05, r: 0.02 };

fn start() -> Spring<Parameter> {
    Spring { c: free(1.5), d: free(0.6), b: free(0.8), q: fixed(TRUTH.q), r: fixed(TRUTH.r) }
}

/// From rest at 3 N, with noise or without.
fn record(model: &Oscillator, samples: usize, noise: f64) -> ExperimentOf<Oscillator> {
    let mut random = Noise(3);
    let inputs: Vec<Force> = (0..samples).map(|k| Force { f: 3.0 - 2.0 * (k / 60 % 2) as f64 }).collect();
    let time = Time::Uniform { start: 0.0, step: 0.05 };
    let from = Motion { x: position(3.0, TRUTH.c, TRUTH.b), v: 0.0 };
    let run = simulate(model, &TRUTH, &from, time.clone(), &inputs).unwrap();
    let outputs = run.outputs.iter().map(|y| Position { x: y.x + noise * random.gauss() }).collect();
    Experiment::new(model, time, inputs, outputs).unwrap()
}

/// Without noise the parameters come back to eight digits, with no unknown of the initial state, in programs and in dual numbers.
#[test]
fn a_plant_that_begins_at_rest() {
    for says in [false, true] {
        let model = Oscillator { says };
        let record = record(&model, 600, 0.0);
        let record = if says { record } else { record.initially_at_rest() };
        for adaptive in [false, true] {
            let fit = Fit::new(&model, &record).parameters(start());
            let found = if adaptive { fit.integrator(Rk45::default()).run() } else { fit.run() }.unwrap();
            assert_eq!(found.unknowns.len(), 3, "{found}");
            // Those of the adaptive method are as good as its tolerance of 1e-6.
            let tolerance = if adaptive { 1e-4 } else { 1e-8 };
            for (found, truth) in [(found.parameters.c, 2.0), (found.parameters.d, 0.4), (found.parameters.b, 0.5)] {
                assert!((found / truth - 1.0).abs() < tolerance, "{found} {truth}");
            }
            let state = &found.experiments[0].initial_state;
            let x = position(3.0, found.parameters.c, found.parameters.b);
            assert!((state.x / x - 1.0).abs() < 1e-12 && state.v.abs() < 1e-12, "{state:?} {x}");
        }
    }
}

/// Cost and gradient where the state of rest is solved for are those where the model says it, by each predictor; the gradient is that of
/// differences of the cost.
#[test]
fn slopes_of_the_state_of_rest() {
    let (solved, said) = (Oscillator { says: false }, Oscillator { says: true });
    let at = vec![1.7, 0.5, 0.7];
    let both = [(&solved, record(&solved, 400, 0.02).initially_at_rest()), (&said, record(&said, 400, 0.02))];
    for predictor in ["simulation", "kalman", "kalman:stationary"] {
        let found = both.each_ref().map(|(model, record)| {
            let fit = Fit::new(*model, record).parameters(start()).predictor_by_name(predictor).unwrap();
            let problem = fit.noise(Position { x: 0.02 }).problem();
            let problem = problem.unwrap_or_else(|error| panic!("{predictor}: {error}"));
            let objective = problem.objective().unwrap();
            let gradient = objective.gradient(&at).unwrap();
            let difference = |i: usize| {
                let cost = |h: f64| {
                    let mut there = at.clone();
                    there[i] += h;
                    objective.cost(&there).unwrap()
                };
                (cost(1e-5) - cost(-1e-5)) / 2e-5
            };
            let size = gradient.iter().fold(0.0, |size: f64, slope| size.max(slope.abs()));
            for (i, slope) in gradient.iter().enumerate() {
                // Second differences leave 1e-10 of third derivatives; rounding 1e-11 of the cost.
                assert!((slope - difference(i)).abs() < 1e-6 * size, "{predictor} {i}: {slope} {}", difference(i));
            }
            (objective.cost(&at).unwrap(), gradient)
        });
        let [(cost, gradient), (other, others)] = &found;
        assert!((cost / other - 1.0).abs() < 1e-12, "{predictor}: {cost} {other}");
        let size = gradient.iter().fold(0.0, |size: f64, slope| size.max(slope.abs()));
        for (one, other) in gradient.iter().zip(others) {
            assert!((one - other).abs() < 1e-10 * size, "{predictor}: {one} {other}");
        }
    }
}

signals! { pub struct Current { i: "A" } }
signals! { pub struct Voltage { u: "V" } }
signals! { pub struct Recursion { a: "1", b: "A/V", i0: "A" } }

/// `i[k+1] = a i[k] + b u[k]`, from `i0`.
#[derive(Clone)]
struct Coil;

impl Model for Coil {
    type State = Current;
    type Input = Voltage;
    type Output = Current;
    type Parameters = Recursion;
    const KIND: Kind = Kind::Discrete;

    fn next<S: Scalar>(&self, _t: S, x: &Current<S>, u: &Voltage<S>, p: &Recursion<S>) -> Current<S> {
        Current { i: p.a * x.i + p.b * u.u }
    }

    fn output<S: Scalar>(&self, _t: S, x: &Current<S>, _u: &Voltage<S>, _p: &Recursion<S>) -> Current<S> {
        *x
    }

    fn initial<S: Scalar>(&self, _u: &Voltage<S>, p: &Recursion<S>) -> Current<S> {
        Current { i: p.i0 }
    }
}

fn coil(samples: usize, from: f64, noise: f64, seed: u64) -> ExperimentOf<Coil> {
    let mut random = Noise(seed);
    let inputs: Vec<Voltage> = (0..samples).map(|k| Voltage { u: 2.0 - (k / 25 % 3) as f64 }).collect();
    let truth = Recursion { a: 0.95, b: 0.1, i0: from };
    let time = Time::Uniform { start: 0.0, step: 1.0 };
    let run = simulate(&Coil, &truth, &Current { i: from }, time.clone(), &inputs).unwrap();
    let outputs = run.outputs.iter().map(|y| Current { i: y.i + noise * random.gauss() }).collect();
    Experiment::new(&Coil, time, inputs, outputs).unwrap()
}

/// Of a discrete model the state that the next sample does not change; also where the record is cut into segments that run side by side.
#[test]
fn a_discrete_plant_at_rest() {
    for samples in [200, 40_000] {
        let record = coil(samples, 2.0 * 0.1 / 0.05, 0.0, 1).initially_at_rest();
        let start = Recursion { a: free(0.9), b: free(0.2), i0: fixed(0.0) };
        let found = Fit::new(&Coil, &record).parameters(start).run().unwrap();
        assert!((found.parameters.a / 0.95 - 1.0).abs() < 1e-9, "{found}");
        assert!((found.parameters.b / 0.1 - 1.0).abs() < 1e-9, "{found}");
    }
}

/// One unknown of twenty short records, each from the same state: its standard error is a twentieth's root of that of one record, and it holds the truth.
/// A record that declares a state of its own has that.
#[test]
fn records_share_an_initial_state() {
    let records: Vec<_> = (0..20).map(|seed| coil(12, 3.0, 0.1, seed + 1)).collect();
    let start = Recursion { a: fixed(0.95), b: fixed(0.1), i0: free(1.0) };
    let found = Fit::new(&Coil, &records).parameters(start).noise(Current { i: 0.1 }).run().unwrap();
    assert_eq!(found.unknowns.len(), 1);
    // The state at sample `k` has the slope `a^k`.
    let squares: f64 = (0..12).map(|k| 0.95f64.powi(2 * k)).sum();
    let exact = 0.1 / (20.0 * squares).sqrt();
    let error = found.unknowns[0].knowledge.standard_error().unwrap();
    assert!((error / exact - 1.0).abs() < 1e-9, "{error} {exact}");
    assert!((found.parameters.i0 - 3.0).abs() < 3.0 * exact, "{found}");
    let [first, second] = [coil(12, 3.0, 0.1, 1), coil(12, 5.0, 0.1, 2).initial(Current { i: free(1.0) })];
    let found = Fit::new(&Coil, &[first, second]).parameters(start).noise(Current { i: 0.1 }).run().unwrap();
    let states = [0, 1].map(|e| found.experiments[e].initial_state.i);
    assert_eq!(states[0], found.parameters.i0);
    assert!(found.unknowns.len() == 2 && (states[1] - 5.0).abs() < 0.2, "{found}");
    // A piece that begins later has a state of its own.
    let whole = coil(60, 3.0, 0.1, 7);
    let (begin, rest) = whole.split_at(30.0).unwrap();
    let found = Fit::new(&Coil, &[begin, rest]).parameters(start).noise(Current { i: 0.1 }).run().unwrap();
    let names: Vec<&str> = found.unknowns.iter().map(|unknown| unknown.name.as_str()).collect();
    assert!(
        names.len() == 2 && names[0] == "i0" && names[1].starts_with("i(0) [") && names[1].contains("part 2"),
        "{names:?}"
    );
    let estimated = whole.initial_estimated();
    let start = Recursion { i0: fixed(3.0), a: free(0.9), ..start };
    let found = Fit::new(&Coil, &estimated).parameters(start).noise(Current { i: 0.1 }).run().unwrap();
    assert_eq!(found.unknowns.len(), 2);
}

/// A plant that rests anywhere, and one that rests nowhere, are refused by the name of the state.
#[test]
fn plants_that_have_no_state_of_rest() {
    let refused = |f: f64, c: f64, b: f64| {
        let model = Oscillator { says: false };
        let inputs = vec![Force { f }; 50];
        let outputs = (0..50).map(|k| Position { x: 0.1 * k as f64 }).collect();
        let record = Experiment::new(&model, Time::Uniform { start: 0.0, step: 0.1 }, inputs, outputs).unwrap();
        let start = Spring { c: fixed(c), b: fixed(b), d: free(1.0), q: fixed(0.1), r: fixed(0.1) };
        let error = Fit::new(&model, &record.initially_at_rest()).parameters(start).run().err().unwrap();
        assert!(matches!(&error, Error::NotAtRest { .. }), "{error}");
        error.to_string()
    };
    let anywhere = refused(0.0, 0.0, 0.0);
    assert!(anywhere.contains("of state `x`, it rests at any value"), "{anywhere}");
    // `x^3 - 3 x` is at most 2 where x is negative, and this force is out of reach from there: Newton's steps end at the extremum.
    let nowhere = refused(1.0, 0.0, 0.0);
    assert!(nowhere.contains("of state `x`"), "{nowhere}");
}

signals! { struct Level { h: "m" } }
signals! { struct Inflow { q: "m^3/s" } }
signals! { struct Tank { a: "m^2", c: "m^2.5/s" } }

/// `a dh/dt = q - c sqrt(max(h, 0))`: below zero no rate depends on the level.
#[derive(Clone)]
struct Guarded;

impl Model for Guarded {
    type State = Level;
    type Input = Inflow;
    type Output = Level;
    type Parameters = Tank;

    fn derivative<S: Scalar>(&self, _t: S, x: &Level<S>, u: &Inflow<S>, p: &Tank<S>) -> Level<S> {
        Level { h: (u.q - p.c * x.h.max(S::from(0.0)).sqrt()) / p.a }
    }

    fn output<S: Scalar>(&self, _t: S, x: &Level<S>, _u: &Inflow<S>, _p: &Tank<S>) -> Level<S> {
        *x
    }
}

/// Newton's first step from the measured level, 0.36 m, at an outflow three times too large leads to -0.12 m, beyond the guard; the level of rest is
/// `(q / c)^2`. The outflow comes back to what the step of the integrator leaves.
#[test]
fn rest_beside_a_guard() {
    let (time, truth) = (Time::Uniform { start: 0.0, step: 2.0 }, Tank { a: 0.02, c: 5e-4 });
    let inputs: Vec<Inflow> = (0..200).map(|k| Inflow { q: if k < 50 { 3e-4 } else { 4e-4 } }).collect();
    let run = simulate(&Guarded, &truth, &Level { h: 0.36 }, time, &inputs).unwrap();
    let record = run.experiment(&Guarded).unwrap().initially_at_rest();
    for factor in [0.1, 3.0, 30.0] {
        let start = Tank { a: free(0.03), c: free(factor * truth.c) };
        let found = Fit::new(&Guarded, &record).parameters(start).run().unwrap();
        assert!((found.parameters.c / truth.c - 1.0).abs() < 1e-8, "{factor}: {found}");
        assert!((found.experiments[0].initial_state.h / 0.36 - 1.0).abs() < 1e-8, "{factor}: {found}");
    }
}

/// An oscillator of 4 s sampled at 0.8 s and at 40 s: one step of Runge and Kutta per sample is far off, or diverges. A simulation of equations
/// without an integrator is as good as finer steps are; one that was chosen is what was chosen.
#[test]
fn simulations_of_equations_take_steps_that_are_fine_enough() {
    let model = Oscillator { says: true };
    let equations = equations::Equations::trace(&model).unwrap();
    let none: [greybox::record::Record; 0] = [];
    let [c, d, b] = [2.0, 0.4, 0.5];
    let parameters = [c, d, b, 0.1, 0.1].map(fixed).to_vec();
    for step in [0.8, 40.0] {
        let inputs: Vec<Force> = (0..30).map(|k| Force { f: f64::from(k % 3) }).collect();
        let outputs = vec![Position { x: 0.0 }; 30];
        let time = Time::Uniform { start: 0.0, step };
        let record = Experiment::new(&model, time, inputs, outputs).unwrap();
        let fit = || Fit::new(&equations, &none).parameters(parameters.clone());
        let of = |fit: Fit<'_, equations::Equations>| -> Vec<f64> {
            fit.simulate(&[0.5, 0.0], record.record()).unwrap().outputs()[0].values.to_vec()
        };
        let exact = of(fit().integrator(Rk45 { relative: 1e-12, ..Rk45::default() }));
        let farthest = |found: &[f64]| found.iter().zip(&exact).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        // The finer one of two that differ by 1e-6.
        assert!(farthest(&of(fit())) < 1e-6, "{step}: {}", farthest(&of(fit())));
        if step < 1.0 {
            let one = farthest(&of(fit().integrator(Rk4 { substeps: 1 })));
            assert!(one > 1e-3, "{one}");
        }
    }
}

/// A simulation of equations begins where the model or the record says it, at zero where neither does.
#[test]
fn simulations_begin_as_the_model_says() {
    let of = |says: bool| {
        let model = Oscillator { says };
        let record = record(&model, 20, 0.0);
        let equations = equations::Equations::trace(&model).unwrap();
        let none: [greybox::record::Record; 0] = [];
        let parameters = [2.0, 0.4, 0.5, 0.1, 0.1].map(fixed).to_vec();
        let fit = Fit::new(&equations, &none).parameters(parameters);
        let begin = |record: &greybox::record::Record| fit.initial_state(record).unwrap();
        let rest = record.clone().initially_at_rest();
        let given = record.clone().initial(Motion { x: fixed(0.3), v: free(0.2) });
        [begin(record.record()), begin(rest.record()), begin(given.record())]
    };
    let x = position(3.0, 2.0, 0.5);
    let [said, rest, given] = of(true);
    assert!((said[0] / x - 1.0).abs() < 1e-14 && said[1] == 0.0, "{said:?} {x}");
    assert!((rest[0] / x - 1.0).abs() < 1e-12 && rest[1].abs() < 1e-12, "{rest:?} {x}");
    assert_eq!(given, [0.3, 0.2]);
    assert_eq!(of(false)[0], [0.0, 0.0]);
}
