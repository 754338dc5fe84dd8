//! Every integrator against problems with known solutions: orders of values and slopes, held inputs, tolerances,
//! stiffness, and what happens when a model fails.

use crate::spiral::{Plane, Rates, Spiral};
use approx::assert_relative_eq;
use greybox::check::order;
use greybox::integrate::{Integrator, ModelSystem, Stuck};
use greybox::*;

const RK45: Rk45 = Rk45 { relative: 1e-9, absolute: 1e-12 };
const ESDIRK: Esdirk = Esdirk { relative: 1e-9, absolute: 1e-12 };

/// A tolerance so large that an interval is one step.
const ANY: f64 = 1e300;

/// From 32 to 64 steps the next term of the error still moves the apparent order, by less than 0.2.
#[test]
fn orders() {
    let cases = [
        ("Rk4", order(&Rk4::default()), 4.0),
        ("Rk4, three substeps", order(&Rk4 { substeps: 3 }), 4.0),
        ("Automatic", order(&Automatic::default()), 4.0),
        ("Rk45", order(&Rk45 { relative: ANY, absolute: ANY }), 5.0),
        ("Esdirk", order(&Esdirk { relative: ANY, absolute: ANY }), 4.0),
    ];
    for (name, found, expected) in cases {
        let [values, slopes] = found.unwrap();
        println!("{name}: {found:?}");
        assert!((values - expected).abs() < 0.2, "{name}: {found:?}");
        assert!((slopes - expected).abs() < 0.2, "{name}: {found:?}");
    }
}

/// Steps from sample to sample, at `times`, with the inputs held as said.
fn simulate<M: Model, I: Integrator, S: Scalar>(
    model: &M,
    integrator: &I,
    times: &[f64],
    hold: Hold,
    input: impl Fn(f64) -> Of<M::Input, f64>,
    x: Of<M::State, S>,
    p: &Of<M::Parameters, S>,
) -> Result<Of<M::State, S>, Stuck> {
    let mut step = 0.0;
    times.windows(2).try_fold(x, |x, t| {
        let u1 = if hold == Hold::First { input(t[1]) } else { input(t[0]) };
        let interval = Interval { t0: t[0], t1: t[1], u0: input(t[0]), u1, hold };
        ModelSystem { model, interval: &interval, p }.step(integrator, x, &mut step)
    })
}

fn grid(end: f64, intervals: usize) -> Vec<f64> {
    (0..=intervals).map(|k| end * k as f64 / intervals as f64).collect()
}

signals! { pub struct Level { x: "V" } }
signals! { pub struct Source { u: "V" } }
signals! { pub struct Time1 { tau: "s" } }

/// `tau dx/dt = u - x`.
struct Lag;
impl Model for Lag {
    type State = Level;
    type Input = Source;
    type Output = Level;
    type Parameters = Time1;
    fn derivative<S: Scalar>(&self, _t: S, x: &Level<S>, u: &Source<S>, p: &Time1<S>) -> Level<S> {
        Level { x: (u.u - x.x) / p.tau }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Level<S>, _u: &Source<S>, _p: &Time1<S>) -> Level<S> {
        *x
    }
}

/// The exact response over intervals of `h` with the input held or along straight lines.
fn lag_exactly(h: f64, steps: usize, hold: Hold, input: impl Fn(f64) -> f64, tau: Dual<1>) -> Dual<1> {
    let decay = (tau.recip() * -h).exp();
    (0..steps).fold(Dual::constant(0.0), |x, k| {
        let (u0, u1) = (input(h * k as f64), input(h * (k + 1) as f64));
        let slope = if hold == Hold::First { (u1 - u0) / h } else { 0.0 };
        // x = u - tau slope + (x0 - u0 + tau slope) e^{-t/tau}
        let lagging = tau * -slope;
        (x - u0 - lagging) * decay + lagging + (u0 + slope * h)
    })
}

/// A step in the middle of the record, at a sample: held inputs are met exactly, so the error is that of a smooth problem.
#[test]
fn a_step_of_the_input_costs_no_accuracy() {
    fn check<I: Integrator>(integrator: &I, tolerance: f64) {
        let (tau, h, steps) = (Dual::<1>::variable(0.3, 0), 0.05, 40);
        let input = |t: f64| if t > 0.9999 { 2.0 } else { 1.0 };
        for hold in [Hold::Zero, Hold::First] {
            let times = grid(h * steps as f64, steps);
            let start = Level { x: Dual::constant(0.0) };
            let found =
                simulate(&Lag, integrator, &times, hold, |t| Source { u: input(t) }, start, &Time1 { tau }).unwrap().x;
            let exact = lag_exactly(h, steps, hold, input, tau);
            println!(
                "{}: {:e}, {:e}",
                integrator.describe(Kind::Continuous),
                found.value - exact.value,
                found.slopes[0] - exact.slopes[0]
            );
            assert_relative_eq!(found.value, exact.value, max_relative = tolerance);
            assert_relative_eq!(found.slopes[0], exact.slopes[0], max_relative = 20.0 * tolerance);
        }
    }
    // Rk4: h^4/120 (h/tau)^4-like, 1e-6 here, and 16 times less with half the step; adaptive: the tolerance, times the
    // steps within the memory of the lag.
    check(&Rk4 { substeps: 1 }, 2e-6);
    check(&Rk4 { substeps: 2 }, 2e-6 / 16.0);
    check(&RK45, 1e-8);
    check(&ESDIRK, 1e-8);
}

/// A held input that jumps at every sample: each halving of all steps still divides the error by 2^order.
#[test]
fn jumps_at_every_sample_do_not_lower_the_order() {
    fn errors<I: Integrator>(integrator: &I) -> f64 {
        let (tau, h, steps) = (Dual::<1>::variable(0.1, 0), 0.05, 20);
        let input = |t: f64| (t * 20.0).round() % 3.0;
        let times = grid(h * steps as f64, steps);
        let start = Level { x: Dual::constant(0.0) };
        let found = simulate(&Lag, integrator, &times, Hold::Zero, |t| Source { u: input(t) }, start, &Time1 { tau });
        (found.unwrap().x.value - lag_exactly(h, steps, Hold::Zero, input, tau).value).abs()
    }
    let apparent = (errors(&Rk4 { substeps: 2 }) / errors(&Rk4 { substeps: 4 })).log2();
    assert!((apparent - 4.0).abs() < 0.25, "{apparent}");
}

/// The error follows the tolerance: within a factor of 300 of it, over eight decades, values and slopes.
#[test]
fn the_error_is_in_proportion_to_the_tolerance() {
    fn check<I: Integrator>(make: impl Fn(f64) -> I, finest: i32) {
        let start = Plane { x: Dual::<4>::variable(0.4, 0), y: Dual::variable(-0.3, 1) };
        let p = Rates { growth: Dual::variable(1.2, 2), turn: Dual::variable(6.0, 3) };
        let exact = Spiral.solution(4.0, &start, &p);
        for power in 3..=finest {
            let tolerance = 10f64.powi(-power);
            let x = simulate(&Spiral, &make(tolerance), &grid(4.0, 7), Hold::Zero, |_| Nothing, start, &p).unwrap();
            let (dx, dy) = (x.x - exact.x, x.y - exact.y);
            let error = dx.value.abs().max(dy.value.abs());
            let slope = dx.slopes.iter().chain(&dy.slopes).fold(0.0f64, |m, s| m.max(s.abs()));
            println!("tolerance {tolerance:e}: values {error:e}, slopes {slope:e}");
            assert!(error < 300.0 * tolerance && error > 1e-3 * tolerance, "{tolerance:e}: {error:e}");
            assert!(slope < 1500.0 * tolerance, "{tolerance:e}: {slope:e}");
        }
    }
    check(|relative| Rk45 { relative, absolute: 0.0 }, 11);
    check(|relative| Esdirk { relative, absolute: 0.0 }, 10);
}

/// The slopes are those of the numbers computed, not only of the solution: with steps as coarse as they get, where the
/// values are off by some 1e-3, they match central differences of the computed values.
#[test]
fn slopes_are_those_of_the_numbers_computed() {
    fn check<I: Integrator>(integrator: &I, tolerance: f64) {
        let run = |v: [f64; 4]| {
            let (x, p) = (Plane { x: v[0], y: v[1] }, Rates { growth: v[2], turn: v[3] });
            let x = simulate(&Spiral, integrator, &grid(1.0, 2), Hold::Zero, |_| Nothing, x, &p).unwrap();
            [x.x, x.y]
        };
        let at = [0.4, -0.3, 1.2, 1.5];
        let x = Plane { x: Dual::<4>::variable(at[0], 0), y: Dual::variable(at[1], 1) };
        let p = Rates { growth: Dual::variable(at[2], 2), turn: Dual::variable(at[3], 3) };
        let x = simulate(&Spiral, integrator, &grid(1.0, 2), Hold::Zero, |_| Nothing, x, &p).unwrap();
        assert_eq!([x.x.value, x.y.value].map(|v| (v * 1e12).round()), run(at).map(|v| (v * 1e12).round()));
        for j in 0..4 {
            let h = 1e-4;
            let (mut up, mut down, mut far_up, mut far_down) = (at, at, at, at);
            (up[j], down[j], far_up[j], far_down[j]) = (at[j] + h, at[j] - h, at[j] + 2.0 * h, at[j] - 2.0 * h);
            // Fourth order, so that its own error is below 1e-11.
            for (i, exact) in [x.x.slopes[j], x.y.slopes[j]].into_iter().enumerate() {
                let near = (run(up)[i] - run(down)[i]) / (2.0 * h);
                let far = (run(far_up)[i] - run(far_down)[i]) / (4.0 * h);
                assert_relative_eq!(exact, (4.0 * near - far) / 3.0, epsilon = tolerance, max_relative = tolerance);
            }
        }
    }
    check(&Rk4::default(), 1e-9);
    check(&Rk45 { relative: ANY, absolute: ANY }, 1e-9);
    check(&Esdirk { relative: ANY, absolute: ANY }, 1e-9);
}

signals! { pub struct Species { a: "mol/l", b: "mol/l", c: "mol/l" } }
signals! { pub struct Speeds { k1: "1/s", k2: "l/(mol s)", k3: "l/(mol s)" } }

/// H. H. Robertson's chemical kinetics, 1966 (Hairer and Wanner, Solving Ordinary Differential Equations II, IV.1).
struct Robertson;
impl Model for Robertson {
    type State = Species;
    type Input = Nothing;
    type Output = Species;
    type Parameters = Speeds;
    fn derivative<S: Scalar>(&self, _t: S, x: &Species<S>, _u: &Nothing, p: &Speeds<S>) -> Species<S> {
        let (forth, back, on) = (p.k1 * x.a, p.k2 * x.b * x.c, p.k3 * x.b * x.b);
        Species { a: back - forth, b: forth - back - on, c: on }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Species<S>, _u: &Nothing, _p: &Speeds<S>) -> Species<S> {
        *x
    }
}

const SPEEDS: Speeds = Speeds { k1: 0.04, k2: 1e4, k3: 3e7 };

/// At 40 s the values of the LSODE and CVODE examples, to the digits that two methods of this crate at 1e-10 agree on;
/// at 1e11 s those of the test set of F. Mazzia and C. Magherini (Bari, 2008). Mass is conserved.
#[test]
fn robertsons_kinetics() {
    let start = Species { a: 1.0, b: 0.0, c: 0.0 };
    let run = |times: &[f64], integrator: Esdirk| {
        simulate(&Robertson, &integrator, times, Hold::Zero, |_| Nothing, start, &SPEEDS).unwrap()
    };
    let x = run(&[0.0, 0.4, 4.0, 40.0], ESDIRK);
    assert_relative_eq!(x.a, 0.71582706872, max_relative = 1e-9);
    assert_relative_eq!(x.b, 9.1855347646e-6, max_relative = 1e-9);
    assert_relative_eq!(x.c, 0.28416374575, max_relative = 1e-9);
    assert_relative_eq!(x.a + x.b + x.c, 1.0, epsilon = 1e-12);
    // Tiny values at the end: only a relative tolerance sees them.
    let x = run(&[0.0, 1e11], Esdirk { relative: 1e-8, absolute: 1e-22 });
    println!("{x:?}");
    assert_relative_eq!(x.a, 0.2083340149701255e-7, max_relative = 1e-6);
    assert_relative_eq!(x.b, 0.8333360770334713e-13, max_relative = 1e-6);
    assert_relative_eq!(x.c, 0.999999979166505, max_relative = 1e-12);
}

signals! { pub struct Relaxation { x: "1", v: "1/s" } }
signals! { pub struct Stiffness { mu: "1" } }

/// B. van der Pol's oscillator, whose jumps take 1e-6 of its period.
struct VanDerPol;
impl Model for VanDerPol {
    type State = Relaxation;
    type Input = Nothing;
    type Output = Relaxation;
    type Parameters = Stiffness;
    fn derivative<S: Scalar>(&self, _t: S, x: &Relaxation<S>, _u: &Nothing, p: &Stiffness<S>) -> Relaxation<S> {
        Relaxation { x: x.v, v: p.mu * (x.x * x.x * -1.0 + 1.0) * x.v - x.x }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Relaxation<S>, _u: &Nothing, _p: &Stiffness<S>) -> Relaxation<S> {
        *x
    }
}

/// Reference of the Bari test set, at t = 2 mu with mu = 1000.
#[test]
fn van_der_pols_oscillator() {
    let start = Relaxation { x: 2.0, v: 0.0 };
    let stiffness = Stiffness { mu: 1000.0 };
    let x = simulate(&VanDerPol, &ESDIRK, &grid(2000.0, 50), Hold::Zero, |_| Nothing, start, &stiffness).unwrap();
    println!("{x:?}");
    assert_relative_eq!(x.x, 1.706167732170483, max_relative = 1e-7);
    assert_relative_eq!(x.v, -0.8928097010247975e-3, max_relative = 1e-6);
    // The explicit method would need millions of steps.
    let explicit = simulate(&VanDerPol, &RK45, &[0.0, 800.0], Hold::Zero, |_| Nothing, start, &stiffness);
    assert_eq!(explicit, Err(Stuck));
}

#[test]
fn slopes_of_a_stiff_model() {
    let start = Species { a: Dual::<3>::constant(1.0), b: Dual::constant(0.0), c: Dual::constant(0.0) };
    let p = Speeds { k1: Dual::variable(0.04, 0), k2: Dual::variable(1e4, 1), k3: Dual::variable(3e7, 2) };
    let times = [0.0, 0.4, 4.0, 40.0];
    let fine = Esdirk { relative: 1e-12, absolute: 1e-16 };
    let x = simulate(&Robertson, &ESDIRK, &times, Hold::Zero, |_| Nothing, start, &p).unwrap();
    for j in 0..3 {
        let run = |step: f64| {
            let mut k: [f64; 3] = SPEEDS.into();
            k[j] *= 1.0 + step;
            let start = Species { a: 1.0, b: 0.0, c: 0.0 };
            <[f64; 3]>::from(simulate(&Robertson, &fine, &times, Hold::Zero, |_| Nothing, start, &k.into()).unwrap())
        };
        let (up, down) = (run(1e-3), run(-1e-3));
        let k = <[f64; 3]>::from(SPEEDS)[j];
        for (i, exact) in [x.a, x.b, x.c].map(|v| v.slopes[j]).into_iter().enumerate() {
            // Central differences of relative step 1e-3 are off by some 1e-6 themselves.
            assert_relative_eq!(exact, (up[i] - down[i]) / (2e-3 * k), max_relative = 1e-5);
        }
    }
}

signals! { pub struct Circuit { il: "A", uc: "V", id: "A" } }
signals! { pub struct Parts { r: "ohm", l: "H", c: "F", ls: "H" } }

/// A switched RLC filter with a stray inductance: time constants of 10 ms and 10 ns, sampled every 1 ms.
struct Snubber;
impl Model for Snubber {
    type State = Circuit;
    type Input = Source;
    type Output = Circuit;
    type Parameters = Parts;
    fn derivative<S: Scalar>(&self, _t: S, x: &Circuit<S>, u: &Source<S>, p: &Parts<S>) -> Circuit<S> {
        Circuit { il: (u.u - p.r * x.il - x.uc) / p.l, uc: (x.il - x.id) / p.c, id: (x.uc - x.id * 100.0) / p.ls }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Circuit<S>, _u: &Source<S>, _p: &Parts<S>) -> Circuit<S> {
        *x
    }
}

/// Linear, so that the matrix exponential is the answer; the voltage steps at every sample.
#[test]
fn a_stiff_circuit_with_a_switched_source() {
    use nalgebra::{Matrix3, Vector3};
    let (r, l, c, ls) = (0.5, 5e-3, 1e-4, 1e-6);
    let a = Matrix3::new(-r / l, -1.0 / l, 0.0, 1.0 / c, 0.0, -1.0 / c, 0.0, 1.0 / ls, -100.0 / ls);
    let (h, steps) = (1e-3, 50);
    let input = |t: f64| if (t / h).round() as i64 % 7 < 3 { 24.0 } else { 0.0 };
    let propagator = (a * h).exp();
    let mut exact = Vector3::zeros();
    for k in 0..steps {
        let settled = a.try_inverse().unwrap() * Vector3::new(-input(h * k as f64) / l, 0.0, 0.0);
        exact = propagator * (exact - settled) + settled;
    }
    let times = grid(h * steps as f64, steps);
    let start = Circuit { il: 0.0, uc: 0.0, id: 0.0 };
    let parts = Parts { r, l, c, ls };
    let x = simulate(&Snubber, &ESDIRK, &times, Hold::Zero, |t| Source { u: input(t) }, start, &parts).unwrap();
    println!("{x:?} {exact:?}");
    assert_relative_eq!(x.il, exact[0], max_relative = 1e-6);
    assert_relative_eq!(x.uc, exact[1], max_relative = 1e-6);
    assert_relative_eq!(x.id, exact[2], max_relative = 1e-6);
}

signals! { pub struct Many { x0: "", x1: "", x2: "", x3: "", x4: "", x5: "", x6: "", x7: "", x8: "", x9: "" } }
signals! { pub struct Speed { k: "1/s" } }

/// Heat in a rod of ten cells, two of which need a second pass of the Jacobian's columns.
struct Rod;
impl Model for Rod {
    type State = Many;
    type Input = Source;
    type Output = Many;
    type Parameters = Speed;
    fn derivative<S: Scalar>(&self, _t: S, x: &Many<S>, u: &Source<S>, p: &Speed<S>) -> Many<S> {
        let v: [S; 10] = (*x).into();
        let left = |i: usize| if i == 0 { u.u } else { v[i - 1] };
        let right = |i: usize| if i == 9 { v[9] } else { v[i + 1] };
        std::array::from_fn(|i| p.k * (left(i) - v[i] * 2.0 + right(i))).into()
    }
    fn output<S: Scalar>(&self, _t: S, x: &Many<S>, _u: &Source<S>, _p: &Speed<S>) -> Many<S> {
        *x
    }
}

#[test]
fn more_states_than_columns_of_one_pass() {
    let start = <Many as Signals>::splat(Dual::<1>::constant(0.0));
    let p = Speed { k: Dual::variable(1e4, 0) };
    let source = |t: f64| Source { u: 1.0 + t };
    let times = grid(1e-2, 5);
    let stiff: [Dual<1>; 10] = simulate(&Rod, &ESDIRK, &times, Hold::First, source, start, &p).unwrap().into();
    let fine = Rk45 { relative: 1e-12, absolute: 1e-12 };
    let explicit: [Dual<1>; 10] = simulate(&Rod, &fine, &times, Hold::First, source, start, &p).unwrap().into();
    for (a, b) in stiff.iter().zip(&explicit) {
        assert_relative_eq!(a.value, b.value, epsilon = 1e-8);
        assert_relative_eq!(a.slopes[0] * 1e4, b.slopes[0] * 1e4, epsilon = 1e-7);
    }
}

/// A model that leaves the numbers: the step shrinks, and then the method says so instead of running on.
struct Broken(f64);
impl Model for Broken {
    type State = Level;
    type Input = Nothing;
    type Output = Level;
    type Parameters = Nothing;
    fn derivative<S: Scalar>(&self, t: S, x: &Level<S>, _u: &Nothing, _p: &Nothing) -> Level<S> {
        Level { x: if t > self.0 { x.x * f64::NAN } else { x.x * x.x } }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Level<S>, _u: &Nothing, _p: &Nothing) -> Level<S> {
        *x
    }
}

#[test]
fn what_is_not_finite_is_stuck() {
    fn check<I: Integrator>(integrator: &I) {
        let run = |model: &Broken, x: f64, end: f64| {
            simulate(model, integrator, &grid(end, 3), Hold::Zero, |_| Nothing, Level { x }, &Nothing)
        };
        assert_eq!(run(&Broken(0.5), 0.1, 1.0), Err(Stuck), "not a number from 0.5 s on");
        assert_eq!(run(&Broken(-1.0), 0.1, 1.0), Err(Stuck), "not a number at all");
        assert_eq!(run(&Broken(9.0), 1.0, 2.0), Err(Stuck), "1 / (1 - t) at t = 1");
        assert_eq!(run(&Broken(9.0), f64::NAN, 1.0), Err(Stuck), "not a number to start with");
        assert_eq!(run(&Broken(9.0), f64::INFINITY, 1.0), Err(Stuck), "infinite to start with");
        assert_relative_eq!(run(&Broken(9.0), 1.0, 0.5).unwrap().x, 2.0, max_relative = 1e-7);
    }
    check(&RK45);
    check(&ESDIRK);
    // Tolerances that make no sense are met as well as rounding allows.
    check(&Rk45 { relative: f64::NAN, absolute: f64::NAN });
    check(&Rk45 { relative: 0.0, absolute: -1.0 });
    check(&Esdirk { relative: -1.0, absolute: f64::NAN });
}

/// A state that is zero but for rounding, or zero throughout, does not stop the others.
#[test]
fn a_state_at_zero() {
    fn check<I: Integrator>(integrator: &I) {
        let rest = simulate(
            &Lag,
            integrator,
            &grid(1.0, 4),
            Hold::Zero,
            |_| Source { u: 0.0 },
            Level { x: 0.0 },
            &Time1 { tau: 0.1 },
        );
        assert_eq!(rest.unwrap().x, 0.0);
        let noise = simulate(
            &Lag,
            integrator,
            &grid(1.0, 4),
            Hold::Zero,
            |t| Source { u: 1e-18 * t },
            Level { x: 0.0 },
            &Time1 { tau: 0.1 },
        );
        assert!(noise.unwrap().x.abs() < 1e-17);
    }
    check(&RK45);
    check(&ESDIRK);
}

#[test]
fn integrators_describe_and_refine_themselves_and_round_trip() {
    let (rk45, esdirk) = (Rk45::default(), Esdirk::default());
    assert_eq!(serde_json::from_str::<Rk45>(&serde_json::to_string(&rk45).unwrap()).unwrap(), rk45);
    assert_eq!(serde_json::from_str::<Esdirk>(&serde_json::to_string(&esdirk).unwrap()).unwrap(), esdirk);
    let finer = rk45.refined(Kind::Continuous).unwrap();
    assert!(finer.relative < 0.1 * rk45.relative && finer.absolute < 0.1 * rk45.absolute);
    assert!(esdirk.refined(Kind::Continuous).unwrap().relative < 0.1 * esdirk.relative);
    assert!(rk45.describe(Kind::Continuous).contains("1e-8"));
    for kind in [Kind::Continuous, Kind::Discrete, Kind::Static] {
        assert_eq!(rk45.serves(kind), kind == Kind::Continuous);
        assert_eq!(esdirk.serves(kind), kind == Kind::Continuous);
    }
}
