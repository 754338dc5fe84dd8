//! [`Kalman`] of models that are not affine in their state, the extended filter: against one that is written out for its plant, against
//! differences, and against simulations.

use crate::common::Noise;
use crate::hardening::{Deflection, Gauges, Hardening, Pull, Spring, disturbed, runge_kutta, start};
use argmin::core::{CostFunction, Gradient};
use core::f64::consts::TAU;
use greybox::*;

/// Numbers with slopes with respect to all unknowns: a, b, c, ln q, ln r and the initial state.
type D = Dual<6>;

/// `-ln` of the likelihood of a record by the extended filter of [`Hardening`], its slopes by hand: `A = -a - 3 b x^2`, and those of the
/// gauges `1` and `1 + x`. Mean and covariance by Runge-Kutta's method with so many steps per sample.
fn written_out(record: &ExperimentOf<Hardening>, at: [D; 6], steps: u32) -> D {
    let [a, b, c, q, r, mut x] = at;
    let (q, r) = ((q * 2.0).exp(), (r * 2.0).exp());
    let (mut p, mut sum) = (D::from(0.0), D::from(0.0));
    for (k, (u, gauges)) in record.inputs().zip(record.outputs()).enumerate() {
        for (second, y) in [(false, gauges.y), (true, gauges.z)] {
            if y.is_nan() {
                continue;
            }
            let (mean, slope, noise) = match second {
                false => (x, D::from(1.0), r),
                true => (x + x * x * 0.5, x + 1.0, r * 4.0),
            };
            let (error, variance) = (D::from(y) - mean, slope * slope * p + noise);
            sum += (error * error / variance + (variance * TAU).ln()) * 0.5;
            (x, p) = (x + p * slope * error / variance, p * noise / variance);
        }
        if k + 1 == record.len() {
            break;
        }
        let h = (record.time(k + 1) - record.time(k)) / f64::from(steps);
        let rate = |[x, p]: [D; 2]| [c * u.u - a * x - b * x * x * x, (-a - b * x * x * 3.0) * p * 2.0 + q];
        [x, p] = runge_kutta([x, p], h, steps, rate);
    }
    sum
}

fn uneven(samples: usize) -> Time {
    Time::Stamps((0..samples).map(|k| 0.1 * k as f64 + if k % 2 == 0 { 0.0 } else { 0.04 }).collect())
}

/// A record whose first gauge fails at every seventh sample.
fn patchy(time: Time, samples: usize, seed: u64) -> ExperimentOf<Hardening> {
    let record = disturbed(time.clone(), samples, 3, &mut Noise(seed));
    let missing = |(k, gauges): (usize, Gauges)| if k % 7 == 5 { Gauges { y: f64::NAN, ..gauges } } else { gauges };
    let outputs = record.outputs().enumerate().map(missing).collect();
    Experiment::new(&Hardening, time, record.inputs().collect(), outputs).unwrap()
}

/// Of two records, uneven and even, with missing outputs and an initial state each: likelihood and gradient at the start and elsewhere,
/// to the roundings of some hundred terms.
#[test]
fn likelihood_and_gradient_are_those_of_a_filter_written_out() {
    let even = Time::Uniform { start: 0.0, step: 0.1 };
    let records = [patchy(uneven(60), 60, 5), patchy(even, 45, 6)];
    let records = records.map(|record| record.initial(Deflection { x: free(0.2) }));
    let fit = Fit::new(&Hardening, &records).parameters(start()).predictor(Kalman);
    let problem = fit.integrator(Rk4 { substeps: 3 }).problem().unwrap();
    let objective = problem.objective().unwrap();
    let measured: usize = records
        .iter()
        .flat_map(|record| record.outputs())
        .map(|y| [y.y, y.z].iter().filter(|y| !y.is_nan()).count())
        .sum();
    let constant = 0.5 * measured as f64 * TAU.ln();
    let begin = objective.start();
    let moved: Vec<f64> = begin.iter().enumerate().map(|(i, x)| x + 0.1 * (1.0 + i as f64).sin()).collect();
    for at in [begin, moved] {
        // The unknowns: parameters, then the initial state of each record.
        let of = |record: usize| {
            let at: [f64; 6] = core::array::from_fn(|i| if i < 5 { at[i] } else { at[5 + record] });
            written_out(&records[record], core::array::from_fn(|i| Dual::variable(at[i], i)), 3)
        };
        let found = objective.cost(&at).unwrap() + constant;
        let exact = of(0).value + of(1).value;
        assert!((found / exact - 1.0).abs() < 1e-12, "{found} {exact}");
        let found = objective.gradient(&at).unwrap();
        let [first, second] = [of(0).slopes, of(1).slopes];
        let exact: Vec<f64> = (0..5).map(|i| first[i] + second[i]).chain([first[5], second[5]]).collect();
        let size = exact.iter().fold(1.0, |size: f64, g| size.max(g.abs()));
        for (found, exact) in found.iter().zip(&exact) {
            assert!((found - exact).abs() < 1e-11 * size, "{found} {exact}");
        }
    }
}

/// Mean and covariance are of fourth order in the integrator's steps: half the step, a sixteenth of the error of the likelihood, as far as
/// the next order lets it.
#[test]
fn moments_are_of_fourth_order() {
    let record = disturbed(Time::Uniform { start: 0.0, step: 0.3 }, 60, 3, &mut Noise(7));
    let cost = |substeps: u32| {
        let fit = Fit::new(&Hardening, &record).parameters(start()).predictor(Kalman);
        let problem = fit.integrator(Rk4 { substeps }).problem().unwrap();
        let objective = problem.objective().unwrap();
        objective.cost(&objective.start()).unwrap()
    };
    let fine = cost(64);
    let errors = [2, 4, 8].map(|substeps| (cost(substeps) - fine).abs());
    println!("{errors:?}");
    for pair in errors.windows(2) {
        assert!((12.0..24.0).contains(&(pair[0] / pair[1])), "{errors:?}");
    }
}

/// Without process noise and with a known initial state the filter predicts what a simulation does, and the estimates are the same.
#[test]
fn without_diffusion_the_estimates_are_those_of_a_simulation() {
    let record = disturbed(Time::Uniform { start: 0.0, step: 0.1 }, 400, 2, &mut Noise(8));
    let parameters = Spring { q: fixed(0.0), r: fixed(0.1), ..start() };
    let fit = || Fit::new(&Hardening, &record).parameters(parameters).integrator(Rk4 { substeps: 2 });
    let filtered = fit().predictor(Kalman).run().unwrap();
    let simulated = fit().noise(Gauges { y: 0.1, z: 0.2 }).run().unwrap();
    assert!(filtered.outcome.converged() && simulated.outcome.converged(), "{filtered}{simulated}");
    for (a, b) in filtered.unknowns.iter().zip(&simulated.unknowns) {
        assert!((a.value / b.value - 1.0).abs() < 1e-8, "{}: {} {}", a.name, a.value, b.value);
    }
    assert_eq!(
        filtered.method.predictor,
        "one-step prediction by a Kalman filter, extended: by the model's slopes at the state (first order)"
    );
}

signals! { pub struct Swing { phi: "rad", w: "rad/s" } }
signals! { pub struct Angle { phi: "rad" } }
signals! { pub struct Hanging { g: "1/s^2", d: "1/s", q: "rad/s^1.5", r: "rad" } }

/// A pendulum. Its code may ask for a value, so that it is not read as a graph.
#[derive(Clone)]
struct Pendulum {
    opaque: bool,
}

impl Model for Pendulum {
    type State = Swing;
    type Input = Pull;
    type Output = Angle;
    type Parameters = Hanging;
    fn derivative<S: Scalar>(&self, _t: S, x: &Swing<S>, u: &Pull<S>, p: &Hanging<S>) -> Swing<S> {
        let phi = if self.opaque && x.phi.value() > 1e9 { x.phi * 2.0 } else { x.phi };
        Swing { phi: x.w, w: u.u - p.g * phi.sin() - p.d * x.w }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Swing<S>, _u: &Pull<S>, _p: &Hanging<S>) -> Angle<S> {
        Angle { phi: x.phi }
    }
    fn diffusion<S: Scalar>(&self, _t: S, _x: &Swing<S>, _u: &Pull<S>, p: &Hanging<S>) -> Swing<S> {
        Swing { phi: S::from(0.0), w: p.q }
    }
    fn noise<S: Scalar>(&self, _t: S, _x: &Swing<S>, _u: &Pull<S>, p: &Hanging<S>) -> Angle<S> {
        Angle { phi: p.r }
    }
}

fn swinging(samples: usize) -> ExperimentOf<Pendulum> {
    let mut noise = Noise(3);
    let (mut x, mut outputs) = ((1.2, 0.0), vec![]);
    for _ in 0..samples {
        outputs.push(Angle { phi: x.0 + 0.02 * noise.gauss() });
        for _ in 0..50 {
            let h = 0.05 / 50.0;
            let w = x.1 + h * (0.2 - 9.0 * f64::sin(x.0) - 0.4 * x.1) + 0.5 * h.sqrt() * noise.gauss();
            x = (x.0 + h * w, w);
        }
    }
    let time = Time::Uniform { start: 0.0, step: 0.05 };
    let model = Pendulum { opaque: false };
    let record = Experiment::new(&model, time, vec![Pull { u: 0.2 }; samples], outputs).unwrap();
    record.initial(Swing { phi: free(1.2), w: free(0.0) })
}

fn hanging() -> Hanging<Parameter> {
    Hanging { g: free(7.0), d: free(0.2), q: free(1.0).log(), r: free(0.05).log() }
}

/// Two states, one of them hidden: the gradient is that of central differences, in programs and by methods that choose their steps, and
/// the fit finds the plant within four standard errors.
#[test]
fn a_pendulum_whose_speed_is_hidden() {
    let (model, record) = (Pendulum { opaque: false }, swinging(600));
    let fit = || Fit::new(&model, &record).parameters(hanging()).predictor(Kalman);
    let (relative, absolute) = (1e-11, 1e-13);
    let fixed_steps = fit().integrator(Rk4 { substeps: 1 }).problem().unwrap();
    let chosen_steps = fit().integrator(Rk45 { relative, absolute }).problem().unwrap();
    for problem in [fixed_steps, chosen_steps] {
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
            // Of fourth order: the error is some 1e-12 by the step and 1e-11 by rounding, of costs of some 1e3.
            let h = 1e-3;
            let difference = (8.0 * (cost(h) - cost(-h)) - cost(2.0 * h) + cost(-2.0 * h)) / (12.0 * h);
            assert!((found - difference).abs() < 1e-7 * size, "{i}: {found} {difference}");
        }
    }
    let estimate = fit().run().unwrap();
    println!("{estimate}");
    for (unknown, truth) in estimate.unknowns.iter().zip([9.0, 0.4, 0.5, 0.02, 1.2, 0.0]) {
        let error = unknown.knowledge.standard_error().unwrap();
        assert!((unknown.value - truth).abs() < 4.0 * error, "{}: {estimate}", unknown.name);
    }
}

/// What cannot be differentiated is refused by the name of the equation; functions that are affine are filtered.
#[test]
fn functions_that_are_neither_read_nor_affine_are_refused() {
    fn fitted<M>(model: &M) -> Result<Estimate<M>, Error>
    where
        M: Model<State = Swing, Input = Pull, Output = Angle, Parameters = Hanging>,
    {
        let outputs = swinging(40).outputs().collect();
        let time = Time::Uniform { start: 0.0, step: 0.05 };
        let record = Experiment::new(model, time, vec![Pull { u: 0.2 }; 40], outputs)?;
        Fit::new(model, &record).parameters(hanging()).predictor(Kalman).run()
    }
    let refused = |found: Result<(), Error>| {
        let error = found.unwrap_err();
        assert!(matches!(&error, Error::NotAffine { what, .. } if what == "the derivative of state `w`"), "{error}");
        assert!(error.to_string().contains("write it as a Model"), "{error}");
    };
    refused(fitted(&Pendulum { opaque: true }).map(|_| ()));
    let numeric = |power: i32| {
        let derivative = move |_: f64, x: &Swing, u: &Pull, p: &Hanging| Swing {
            phi: x.w,
            w: u.u - p.g * x.phi.powi(power) - p.d * x.w,
        };
        Numeric::continuous(derivative, |_, x: &Swing, _: &Pull, _: &Hanging| Angle { phi: x.phi })
    };
    refused(fitted(&numeric(3)).map(|_| ()));
    // It says nothing of its noise, which is the next thing to be missed.
    let error = fitted(&numeric(1)).unwrap_err().to_string();
    assert!(error.contains("write Model::noise"), "{error}");
}
