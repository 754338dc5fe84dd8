//! Plants with a mode far faster than their samples, by default settings: a fit takes the implicit method by itself, and gives
//! it up soon where a model explodes.

use greybox::*;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

const EXACT: Esdirk = Esdirk { relative: 1e-11, absolute: 1e-14 };

signals! { pub struct Volt { u: "V" } }
signals! { pub struct Drive { i: "A", w: "rad/s" } }
signals! { pub struct Motor { r: "ohm", l: "H", k: "V s/rad", j: "kg m2", d: "N m s" } }

/// A direct-current motor, with a fan that takes so much torque at 1 rad/s (N m), growing with the square of the speed.
#[derive(Clone)]
pub struct Direct {
    pub fan: f64,
}

/// One that takes no part of the torque that could be measured, but makes the equations nonlinear.
pub const FANNED: Direct = Direct { fan: 1e-9 };

impl Model for Direct {
    type State = Drive;
    type Input = Volt;
    type Output = Drive;
    type Parameters = Motor;
    fn derivative<S: Scalar>(&self, _t: S, x: &Drive<S>, u: &Volt<S>, p: &Motor<S>) -> Drive<S> {
        let torque = p.k * x.i - p.d * x.w;
        let torque = if self.fan == 0.0 { torque } else { torque - x.w * x.w.abs() * self.fan };
        Drive { i: (u.u - p.r * x.i - p.k * x.w) / p.l, w: torque / p.j }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Drive<S>, _u: &Volt<S>, _p: &Motor<S>) -> Drive<S> {
        *x
    }
}

/// The motor whose current settles with this rate per sample of 10 ms, and a record of 300 samples with noise.
pub fn motor(direct: &Direct, rate: f64) -> (Motor, ExperimentOf<Direct>) {
    let p = Motor { r: 1.0, l: 1e-2 / rate, k: 0.1, j: 1e-2, d: 1e-3 };
    let voltage = |k: usize| 10.0 * (0.03 * k as f64).sin() + if (k / 25).is_multiple_of(2) { 12.0 } else { 6.0 };
    let input: Vec<Volt> = (0..300).map(|k| Volt { u: voltage(k) }).collect();
    let time = Time::Uniform { start: 0.0, step: 1e-2 };
    let run = Simulator::new(direct).integrator(EXACT).run(&p, &Drive::default(), time, &input).unwrap();
    let record = run.with_noise(Drive { i: 0.1, w: 1.0 }, 3).experiment(direct).unwrap();
    (p, record.initial(Drive::map(Drive::default(), fixed)))
}

pub fn off(p: Motor) -> Motor<Parameter> {
    Motor { r: free(2.0), l: fixed(p.l), k: free(0.05), j: free(2e-2), d: free(5e-4) }
}

/// Each unknown is known, and within three standard errors of the truth; the method is this.
fn is_right<M: Model>(fit: &Estimate<M>, truth: &[f64], method: &str) {
    assert!(fit.outcome.converged() && fit.severity() == Severity::Usable, "{fit}");
    assert!(fit.method.integrator.contains(method), "{fit}");
    for (unknown, truth) in fit.unknowns.iter().zip(truth) {
        let error = unknown.knowledge.standard_error().unwrap();
        assert!((unknown.value - truth).abs() < 3.0 * error, "{fit}");
    }
}

/// Runge-Kutta's method with 64 steps per sample is stable up to rates of 178. Linear equations take no steps.
#[test]
fn a_motor_with_a_fast_current_is_fitted() {
    let nonlinear = [(3.0, "steps per sample"), (30.0, "steps per sample"), (1e4, "implicit"), (1e7, "implicit")];
    let linear = [3.0, 30.0, 1e4, 1e7].map(|rate| (Direct { fan: 0.0 }, rate, "exact transition of linear equations"));
    for (direct, rate, method) in nonlinear.map(|(rate, method)| (FANNED, rate, method)).into_iter().chain(linear) {
        let (p, record) = motor(&direct, rate);
        let fit = Fit::new(&direct, &record).parameters(off(p)).run().unwrap();
        is_right(&fit, &[p.r, p.k, p.j, p.d], method);
        let again = fit.predict(&direct, &record).unwrap();
        assert!(again.residuals.iter().all(|residual| residual.i.abs() < 0.5), "five standard deviations");
        let fleet = Fleet::new(&direct).parameters(off(p)).fleet().unwrap();
        for answer in fleet.run(vec![record.clone(); 3]) {
            let answer = answer.unwrap();
            assert_eq!(answer.method.integrator, fit.method.integrator);
            for (a, b) in answer.unknowns.iter().zip(&fit.unknowns) {
                // Two orders of the same sums; unknowns are found to 1e-8 of a standard error or so.
                let error = b.knowledge.standard_error().unwrap();
                assert!((a.value - b.value).abs() < 1e-5 * error, "{rate}: {} {} {}", a.name, a.value, b.value);
            }
        }
    }
}

/// The default step is wrong at the start, so that all searches cross the intervals exactly. By that step each of four starts would end elsewhere.
#[test]
fn searches_of_a_fast_linear_plant_begin_without_steps() {
    for rate in [30.0, 1e4] {
        let (p, record) = motor(&Direct { fan: 0.0 }, rate);
        let fit = || Fit::new(&Direct { fan: 0.0 }, &record).parameters(off(p));
        let (alone, many) = (fit().run().unwrap(), fit().starts(4).run().unwrap());
        is_right(&many, &[p.r, p.k, p.j, p.d], "exact transition of linear equations");
        assert_eq!((alone.method.refinement, many.method.refinement), (1, 1));
        assert_eq!(many.starts.as_ref().map(|starts| (starts.agreed, starts.failed.len())), Some((4, 0)), "{many}");
        for (a, b) in many.unknowns.iter().zip(&alone.unknowns) {
            assert!((a.value - b.value).abs() < 1e-5 * b.knowledge.standard_error().unwrap(), "{many}");
        }
    }
}

signals! { pub struct Species { a: "", b: "", c: "" } }
signals! { pub struct Measured { a: "", c: "" } }
signals! { pub struct Rates { k1: "1/s", k2: "1/s", k3: "1/s" } }

/// H. H. Robertson's autocatalytic reaction (1966), in the constants of Hairer and Wanner, section IV.1.
#[derive(Clone)]
struct Robertson;

impl Model for Robertson {
    type State = Species;
    type Input = Nothing;
    type Output = Measured;
    type Parameters = Rates;
    fn derivative<S: Scalar>(&self, _t: S, x: &Species<S>, _u: &Nothing, p: &Rates<S>) -> Species<S> {
        let (one, two, three) = (p.k1 * x.a, p.k2 * x.b * x.b, p.k3 * x.b * x.c);
        Species { a: three - one, b: one - two - three, c: two }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Species<S>, _u: &Nothing, _p: &Rates<S>) -> Measured<S> {
        Measured { a: x.a, c: x.c }
    }
}

#[test]
fn robertsons_kinetics_are_fitted() {
    let (p, start) = (Rates { k1: 0.04, k2: 3e7, k3: 1e4 }, Species { a: 1.0, ..Species::default() });
    // From 0.1 s to 7,500 s, eight in a decade.
    let times: Vec<f64> = std::iter::once(0.0).chain((0..40).map(|k| 10f64.powf(f64::from(k) / 8.0 - 1.0))).collect();
    let input = vec![Nothing; times.len()];
    let run = Simulator::new(&Robertson).integrator(EXACT).run(&p, &start, Time::Stamps(times), &input).unwrap();
    let record = run.with_noise(Measured { a: 3e-3, c: 3e-3 }, 3).experiment(&Robertson).unwrap();
    let record = record.initial(Species::map(start, fixed));
    for factor in [0.2, 1.5, 5.0] {
        // The slow part of the reaction tells the ratio of k2 and k3 alone.
        let start = Rates { k1: free(p.k1 * factor).log(), k2: fixed(p.k2), k3: free(p.k3 / factor).log() };
        let fit = Fit::new(&Robertson, &record).parameters(start).run().unwrap();
        is_right(&fit, &[p.k1, p.k3], "implicit");
    }
}

signals! { pub struct Swing { x: "", v: "1/s" } }
signals! { pub struct Position { x: "" } }
signals! { pub struct Damping { mu: "1/s" } }

/// Van der Pol's relaxation oscillator.
#[derive(Clone)]
struct Relaxation;

impl Model for Relaxation {
    type State = Swing;
    type Input = Nothing;
    type Output = Position;
    type Parameters = Damping;
    fn derivative<S: Scalar>(&self, _t: S, x: &Swing<S>, _u: &Nothing, p: &Damping<S>) -> Swing<S> {
        Swing { x: x.v, v: p.mu * (-x.x * x.x + 1.0) * x.v - x.x }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Swing<S>, _u: &Nothing, _p: &Damping<S>) -> Position<S> {
        Position { x: x.x }
    }
}

/// Four turns within 100 samples of 40 s, each in some milliseconds.
#[test]
fn a_relaxation_oscillator_is_fitted() {
    let (time, start) = (Time::Uniform { start: 0.0, step: 40.0 }, Swing { x: 2.0, v: 0.0 });
    let run = Simulator::new(&Relaxation).integrator(EXACT).run(&Damping { mu: 1e3 }, &start, time, &[Nothing; 100]);
    let record = run.unwrap().with_noise(Position { x: 0.01 }, 3).experiment(&Relaxation).unwrap();
    let record = record.initial(Swing::map(start, fixed));
    for factor in [1.02, 1.1] {
        let fit = Fit::new(&Relaxation, &record).parameters(Damping { mu: free(1e3 * factor).log() }).run().unwrap();
        is_right(&fit, &[1e3], "implicit");
    }
}

signals! { pub struct Currents { i: "A", stray: "A" } }
signals! { pub struct Measurement { i: "A" } }
signals! { pub struct Coil { r: "ohm", l: "H" } }

/// A coil with a stray branch, whose current settles three times as fast as a sample of 1 ms lasts, and which saturates a little.
#[derive(Clone)]
struct Stray;

impl Model for Stray {
    type State = Currents;
    type Input = Volt;
    type Output = Measurement;
    type Parameters = Coil;
    fn derivative<S: Scalar>(&self, _t: S, x: &Currents<S>, u: &Volt<S>, p: &Coil<S>) -> Currents<S> {
        Currents { i: (u.u - p.r * (x.i + x.stray)) / p.l, stray: (u.u * 0.01 - x.stray - x.stray.powi(3)) * 3e3 }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Currents<S>, _u: &Volt<S>, _p: &Coil<S>) -> Measurement<S> {
        Measurement { i: x.i }
    }
}

/// Runge-Kutta's method with one step per sample makes the stray current grow by 1.4 in each: the search is led to a resistance of
/// zero, where it has no effect, which is no minimum of what a finer step makes of the model.
#[test]
fn a_search_that_fails_by_its_step_is_repeated_with_a_finer_one() {
    let input: Vec<Volt> = (0..300).map(|k| Volt { u: if k % 18 < 9 { 1.0 } else { -0.4 } }).collect();
    let (truth, time) = (Coil { r: 0.7, l: 5e-3 }, Time::Uniform { start: 0.0, step: 1e-3 });
    let run = Simulator::new(&Stray).integrator(EXACT).run(&truth, &Currents::default(), time, &input).unwrap();
    let record = run.with_noise(Measurement { i: 0.01 }, 3).experiment(&Stray).unwrap();
    let record = record.initial(Currents::map(Currents::default(), fixed));
    let fit = Fit::new(&Stray, &record).parameters(Coil { r: free(1.0), l: free(3e-3) }).run().unwrap();
    is_right(&fit, &[truth.r, truth.l], "4 steps per sample");
}

signals! { pub struct Torque { m: "N m" } }
signals! { pub struct Shaft { w1: "rad/s", w2: "rad/s", twist: "rad" } }
signals! { pub struct Speed { w1: "rad/s" } }
signals! { pub struct Masses { j1: "kg m^2", j2: "kg m^2", c: "N m/rad", d: "N m s", b: "N m s" } }

/// Two inertias on an elastic shaft that becomes softer, by 1e-5 in this record.
#[derive(Clone)]
struct TwoMass;

impl Model for TwoMass {
    type State = Shaft;
    type Input = Torque;
    type Output = Speed;
    type Parameters = Masses;
    fn derivative<S: Scalar>(&self, _t: S, x: &Shaft<S>, u: &Torque<S>, p: &Masses<S>) -> Shaft<S> {
        let torque = p.c * (x.twist - x.twist.powi(3)) + p.d * (x.w1 - x.w2);
        Shaft { w1: (u.m - p.b * x.w1 - torque) / p.j1, w2: torque / p.j2, twist: x.w1 - x.w2 }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Shaft<S>, _u: &Torque<S>, _p: &Masses<S>) -> Speed<S> {
        Speed { w1: x.w1 }
    }
}

/// Three samples per period of a shaft that is damped by 0.009: Runge-Kutta's method with one step per sample damps more than that, so that a
/// damping of the wrong sign fits. With a finer step that one grows beyond all bounds, where slopes tell nothing; the fit goes on
/// from its start by a finer method. Where the one step is asked for, it is refused.
#[test]
fn a_plant_that_a_coarse_step_keeps_stable_is_fitted_by_a_finer_one() {
    let truth = Masses { j1: 3e-3, j2: 8e-3, c: 2406.0, d: 0.0419, b: 0.02 };
    let levels = crate::common::levels(250, 7, 2);
    let input: Vec<Torque> = levels.into_iter().map(|m| Torque { m: 5.0 * m }).collect();
    let time = Time::Uniform { start: 0.0, step: 2e-3 };
    let run = Simulator::new(&TwoMass).integrator(EXACT).run(&truth, &Shaft::default(), time, &input).unwrap();
    let record = run.with_noise(Speed { w1: 6e-3 }, 3).experiment(&TwoMass).unwrap();
    let record = record.initial(Shaft::map(Shaft::default(), fixed));
    let start = Masses { j1: free(3.1e-3), j2: free(7.6e-3), c: free(2480.0), d: free(0.0), b: free(0.018) };
    let fit = || Fit::new(&TwoMass, &record).parameters(start);
    is_right(&fit().run().unwrap(), &[3e-3, 8e-3, 2406.0, 0.0419, 0.02], "steps per sample");
    let coarse = fit().integrator(Rk4 { substeps: 1 }).run().unwrap();
    assert!(coarse.parameters.d < -0.1 && coarse.severity() == Severity::NotUsable, "{coarse}");
    assert!(coarse.warnings.iter().any(|warning| warning.code == WarningCode::CoarseStep), "{coarse}");
}

signals! { pub struct Growth { gain: "1/s", turn: "rad/s" } }

/// Grows beyond all bounds within a finite time, and turns; counts how often its equations are evaluated.
#[derive(Clone)]
struct Exploding(Arc<AtomicU64>);

impl Model for Exploding {
    type State = Swing;
    type Input = Nothing;
    type Output = Position;
    type Parameters = Growth;
    fn derivative<S: Scalar>(&self, _t: S, x: &Swing<S>, _u: &Nothing, p: &Growth<S>) -> Swing<S> {
        self.0.fetch_add(1, Ordering::Relaxed);
        let square = x.x * x.x + x.v * x.v;
        Swing { x: p.gain * square * x.x - p.turn * x.v, v: p.gain * square * x.v + p.turn * x.x }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Swing<S>, _u: &Nothing, _p: &Growth<S>) -> Position<S> {
        Position { x: x.x }
    }
}

/// From the start on, within the search, or turning 500 times in each of the 200 samples. 20 trial steps of 200 samples by each of 4, 16, 64 and
/// 256 steps of four evaluations are 5.4 million; the implicit method comes on top of that.
#[test]
fn what_explodes_or_is_fast_is_given_up_soon() {
    for (gain, turn) in [(1e3, 1.0), (1e-3, 1.0), (0.3, 3e3), (-1e-4, 3e3)] {
        let model = Exploding(Arc::default());
        let junk = |k: usize| if (k / 7).is_multiple_of(2) { 30.0 + k as f64 } else { -40.0 };
        let outputs = (0..200).map(|k| Position { x: junk(k) }).collect();
        let time = Time::Uniform { start: 0.0, step: 1.0 };
        let record = Experiment::new(&model, time, vec![Nothing; 200], outputs).unwrap();
        let record = record.initial(Swing { x: fixed(1.0), v: fixed(0.0) });
        let found = Fit::new(&model, &record).parameters(Growth { gain: free(gain), turn: free(turn) }).run();
        let count = model.0.load(Ordering::Relaxed);
        println!("{gain} {turn}: {count}");
        assert!(found.is_err() || found.is_ok_and(|fit| fit.severity() == Severity::NotUsable), "{gain} {turn}");
        assert!(count < 6_500_000, "{gain} {turn}: {count}");
    }
}
