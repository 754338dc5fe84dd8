//! Fits from starts that are far off, at bounds, or where the cost is rough: how they end, and after how many steps.

use crate::common::Noise;
use crate::shared::shared;
use approx::assert_relative_eq;
use greybox::models::{AxisMotion, AxisParameters, Positioning};
use greybox::optimize::LeastSquares;
use greybox::*;

signals! { pub struct Levels { upper: "m", lower: "m" } }
signals! { pub struct Flow { q: "m/s" } }
signals! { pub struct Level { lower: "m" } }
signals! { pub struct Valves { upper: "", lower: "", pump: "" } }

/// Two tanks above each other, the flows by Torricelli's law: slopes that are infinite at an empty tank.
#[derive(Clone)]
struct Tanks;

impl Model for Tanks {
    type State = Levels;
    type Input = Flow;
    type Output = Level;
    type Parameters = Valves;
    fn derivative<S: Scalar>(&self, _t: S, x: &Levels<S>, u: &Flow<S>, p: &Valves<S>) -> Levels<S> {
        let between = p.upper * x.upper.sqrt();
        Levels { upper: p.pump * u.q - between, lower: between - p.lower * x.lower.sqrt() }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Levels<S>, _u: &Flow<S>, _p: &Valves<S>) -> Level<S> {
        Level { lower: x.lower }
    }
}

const VALVES: Valves = Valves { upper: 0.5, lower: 0.4, pump: 0.3 };

/// A record from these levels, without noise.
fn tanks(lower: f64, samples: usize) -> ExperimentOf<Tanks> {
    let input: Vec<Flow> = (0..samples).map(|k| Flow { q: if k % 100 < 60 { 1.0 } else { 0.2 } }).collect();
    let time = Time::Uniform { start: 0.0, step: 0.1 };
    let run = Simulator::new(&Tanks).run(&VALVES, &Levels { upper: 0.5, lower }, time.clone(), &input).unwrap();
    Experiment::new(&Tanks, time, input, run.outputs).unwrap()
}

/// With 200 samples the record is one piece, with 1,000 several: in either the slope with respect to the level of an empty
/// tank is infinite at the start.
#[test]
fn an_empty_tank_is_a_start_like_any_other() {
    let empty = free(0.0).within(0.0, f64::INFINITY);
    let upper = free(0.3).within(0.0, f64::INFINITY);
    for samples in [200, 1_000] {
        for (level, initial) in [
            (0.0, Levels { upper: fixed(0.5), lower: fixed(0.0) }),
            (0.0, Levels { upper: fixed(0.5), lower: empty }),
            (0.0, Levels { upper, lower: empty }),
            (0.4, Levels { upper, lower: empty }),
        ] {
            let record = tanks(level, samples).initial(initial);
            let start = Valves { upper: free(0.2), lower: free(0.8), pump: free(0.1) };
            let fit = Fit::new(&Tanks, &record).parameters(start).run().unwrap();
            assert!(fit.outcome.converged() && fit.iterations < 60, "{} {}", fit.iterations, fit.outcome);
            // No noise: what is left is rounding, which the collinearity of valves and levels makes up to 1e-11 of.
            assert_relative_eq!(fit.parameters.upper, VALVES.upper, max_relative = 1e-8);
            assert_relative_eq!(fit.parameters.lower, VALVES.lower, max_relative = 1e-8);
            assert_relative_eq!(fit.parameters.pump, VALVES.pump, max_relative = 1e-8);
            if let Some(found) = fit.unknowns.iter().find(|unknown| unknown.name == "lower(0)") {
                assert!((found.value - level).abs() < 1e-8, "{}", found.value);
            }
        }
    }
}

signals! { pub struct Temperatures { core: "K", case: "K", sink: "K" } }
signals! { pub struct Heat { power: "W", ambient: "K" } }
signals! { pub struct Core { core: "K" } }
signals! { pub struct Thermal { c1: "J/K", c2: "J/K", c3: "J/K", g1: "W/K", g2: "W/K", g3: "W/K" } }

/// Three bodies in a row, of which the first is heated and measured.
#[derive(Clone)]
struct Bodies;

impl Model for Bodies {
    type State = Temperatures;
    type Input = Heat;
    type Output = Core;
    type Parameters = Thermal;
    fn derivative<S: Scalar>(&self, _t: S, x: &Temperatures<S>, u: &Heat<S>, p: &Thermal<S>) -> Temperatures<S> {
        let (first, second, third) = ((x.core - x.case) * p.g1, (x.case - x.sink) * p.g2, (x.sink - u.ambient) * p.g3);
        Temperatures { core: (u.power - first) / p.c1, case: (first - second) / p.c2, sink: (second - third) / p.c3 }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Temperatures<S>, _u: &Heat<S>, _p: &Thermal<S>) -> Core<S> {
        Core { core: x.core }
    }
}

/// Six strongly collinear parameters, each three times off; not by their logarithms, so that they may pass through zero (where
/// the first edition ended).
#[test]
fn a_thermal_model_does_not_creep() {
    let (time, ambient) = (Time::Uniform { start: 0.0, step: 10.0 }, 20.0);
    let power = |k: usize| [50.0, 10.0, 80.0][(k / 700).min(2)];
    let input: Vec<Heat> = (0..2_000).map(|k| Heat { power: power(k), ambient }).collect();
    let truth = [100.0, 500.0, 3000.0, 5.0, 3.0, 1.5];
    let cold = Temperatures { core: ambient, case: ambient, sink: ambient };
    let run = Simulator::new(&Bodies).run(&Thermal::from(truth), &cold, time.clone(), &input).unwrap();
    for sigma in [0.0, 0.01] {
        let mut noise = Noise(5);
        let output = run.outputs.iter().map(|y| Core { core: y.core + sigma * noise.gauss() }).collect();
        let record = Experiment::new(&Bodies, time.clone(), input.clone(), output).unwrap();
        let record = record.initial(Temperatures::map(cold, fixed));
        for off in [[3.0; 6], [1.0 / 3.0; 6], [3.0, 1.0 / 3.0, 3.0, 1.0 / 3.0, 3.0, 1.0 / 3.0]] {
            let start = Thermal::from_fn(|i| free(truth[i] * off[i]));
            let fit = Fit::new(&Bodies, &record).parameters(start).run().unwrap();
            assert!(fit.outcome.converged() && fit.iterations < 70, "{} {}", fit.iterations, fit.outcome);
            // Another set of parameters has the same response, so that the error tells. Of 2,000 errors the deviation is known
            // to 1.6 %; without noise it is rounding of temperatures of 80 K.
            let error = fit.outputs[0].fit.rmse;
            assert!(error < 1.05 * sigma + 1e-9, "{error}: {} {}", fit.iterations, fit.outcome);
        }
    }
}

signals! { pub struct Masses { first: "rad/s", twist: "rad", second: "rad/s" } }
signals! { pub struct Torque { tau: "N m" } }
signals! { pub struct First { first: "rad/s" } }
signals! { pub struct Coupling { j1: "kg m2", j2: "kg m2", c: "N m", d: "N m s", f: "N m" } }

/// Two masses and a stiff coupling.
#[derive(Clone)]
pub struct Coupled;

impl Model for Coupled {
    type State = Masses;
    type Input = Torque;
    type Output = First;
    type Parameters = Coupling;
    fn derivative<S: Scalar>(&self, _t: S, x: &Masses<S>, u: &Torque<S>, p: &Coupling<S>) -> Masses<S> {
        let spring = p.c * x.twist + p.d * (x.first - x.second);
        let first = (u.tau - spring - p.f * (x.first * 50.0).tanh()) / p.j1;
        Masses { first, twist: x.first - x.second, second: spring / p.j2 }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Masses<S>, _u: &Torque<S>, _p: &Coupling<S>) -> First<S> {
        First { first: x.first }
    }
}

/// A second of samples under a square wave of torque, from rest, with noise of this standard deviation (rad/s) on the speed.
pub fn coupled(p: Coupling, sigma: f64) -> ExperimentOf<Coupled> {
    let time = Time::Uniform { start: 0.0, step: 1e-3 };
    let input: Vec<Torque> = (0..1_000).map(|k| Torque { tau: if k / 37 % 2 == 0 { 1.0 } else { -0.8 } }).collect();
    let (exact, rest) = (Rk45 { relative: 1e-11, absolute: 1e-13 }, Masses::from([0.0; 3]));
    let run = Simulator::new(&Coupled).integrator(exact).run(&p, &rest, time, &input).unwrap();
    let record = run.with_noise(First { first: sigma }, 4).experiment(&Coupled).unwrap();
    record.initial(Masses::map(rest, fixed))
}

/// An adaptive method's error is another at every point, and its slopes are not quite those of what it computes. Near the
/// minimum no step then lowers the cost as it should: that is no stall.
#[test]
fn a_cost_as_rough_as_its_tolerance_is_minimized_within_it() {
    let p = Coupling::from([1e-2, 2e-2, 1e5, 1.0, 0.05]);
    let record = coupled(p, 0.006);
    for relative in [1e-4, 1e-6] {
        let off = Coupling { j1: 1.05 * p.j1, j2: p.j2 / 1.05, c: 1.05 * p.c, ..p };
        let method = Esdirk { relative, absolute: 1e-3 * relative };
        // The plant turns by 3.9 rad in a sample; the other frequency with the same samples has 0.39 times the stiffness.
        let near = Coupling::map(off, |start| free(start).within(0.8 * start, 1.25 * start));
        let fit = Fit::new(&Coupled, &record).parameters(near).integrator(method).run().unwrap();
        println!("{relative}: {:?} {} {}", fit.parameters, fit.iterations, fit.outcome);
        assert!(fit.outcome.converged() && fit.iterations < 100, "{} {}", fit.iterations, fit.outcome);
        // The inertias together are known to 0.1 % whatever the tolerance.
        assert_relative_eq!(fit.parameters.j1 + fit.parameters.j2, p.j1 + p.j2, max_relative = 1e-3);
    }
}

signals! { pub struct Time1 { t: "s" } }
signals! { pub struct Reading { y: "" } }
signals! { pub struct Square { a: "", b: "" } }

/// `y = a^2 + a b t`, whose second derivatives are constants.
#[derive(Clone)]
struct Bilinear;

impl Model for Bilinear {
    type State = Nothing;
    type Input = Time1;
    type Output = Reading;
    type Parameters = Square;
    const KIND: Kind = Kind::Static;
    fn output<S: Scalar>(&self, _t: S, _x: &Nothing, u: &Time1<S>, p: &Square<S>) -> Reading<S> {
        Reading { y: p.a * p.a + p.a * p.b * u.t }
    }
}

/// Of the gradient of half the sum of squares with second derivatives in the place of the errors.
#[test]
fn the_second_derivative_of_a_fit_is_that_of_its_errors() {
    let times: Vec<f64> = (0..700).map(|k| 0.01 * f64::from(k)).collect();
    let readings = times.iter().map(|t| Reading { y: 1.0 + t }).collect();
    let input = times.iter().map(|&t| Time1 { t }).collect();
    let record = Experiment::new(&Bilinear, Time::Uniform { start: 0.0, step: 1.0 }, input, readings).unwrap();
    let fit = |sigma: f64| {
        Fit::new(&Bilinear, &record)
            .parameters(Square { a: free(2.0).prior(1.0, 0.5), b: free(3.0) })
            .noise(Reading { y: sigma })
            .problem()
            .unwrap()
    };
    let (v, sigma) = ([0.7, -0.2], 0.1);
    let problem = fit(sigma);
    let objective = problem.objective().unwrap();
    let second = objective.curvature(&[2.0, 3.0], &v).unwrap().unwrap();
    // The error is measured less predicted; the prior's has no second derivative.
    let expected = |slope: fn(f64) -> f64| {
        times.iter().map(|t| slope(*t) * 2.0 * (v[0] * v[0] + v[0] * v[1] * t)).sum::<f64>() / (sigma * sigma)
    };
    let gradient = second.gradient();
    // Differences of errors of 1e3 a tenth of the direction apart: 2e-13 * 200 of them.
    assert_relative_eq!(gradient[0], expected(|t| 4.0 + 3.0 * t), max_relative = 1e-9);
    assert_relative_eq!(gradient[1], expected(|t| 2.0 * t), max_relative = 1e-9);
}

/// Position is the second integral of a force that dry friction nearly balances: the search from here once ended 66 mm off
/// and said that the model reproduced the data.
#[test]
fn the_emps_record_is_fitted_in_open_loop_from_far() {
    let Some(path) = shared("emps/emps.csv") else { return };
    let model = Positioning::EMPS;
    let record = Experiment::from_file(&model, path).unwrap().initial(AxisMotion { q: free(0.0), v: fixed(0.0) });
    let start = AxisParameters {
        m: free(43.003797).log(),
        fv: free(170.22234).log(),
        fc: free(2.5872915).log(),
        offset: free(-19.631574),
    };
    let fit = Fit::new(&model, &record).parameters(start).run().unwrap();
    // The better one of two minima, 2.451 and 2.474 mm rms.
    let rms = (2.0 * fit.cost / 24_841.0).sqrt();
    assert!(
        fit.outcome.converged() && fit.iterations < 700 && (rms - 2.4511e-3).abs() < 1e-7,
        "{rms}: {} {}",
        fit.iterations,
        fit.outcome
    );
}
