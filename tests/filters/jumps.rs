//! States that change at the samples: a digital controller, doses.

use crate::common::Noise;
use argmin::core::{CostFunction, Gradient};
use greybox::online::{AdaptationLaw, Ekf, EkfStart, Moment, Rate, Watch};
use greybox::predict::GivenNoise;
use greybox::*;

signals! { pub struct Plant { x: "V", z: "V" } }
signals! { pub struct Reference { r: "V", dose: "V" } }
signals! { pub struct Measured { x: "V" } }
signals! { pub struct Loop { a: "1/s", b: "1/s", k: "1", c: "1/V", q: "V/s^0.5", s: "V" } }

/// The sampling time (s).
const TS: f64 = 0.5;

/// `dx = (-a x + b z) dt + q dw`; at the samples `x + dose` and `z + k (r - x) - c x^2`. As its own step from sample to sample, if `DISCRETE`; such
/// that it is not read as a graph, if `WHOLE`.
#[derive(Clone)]
struct Sampled<const DISCRETE: bool, const WHOLE: bool>;

impl<const DISCRETE: bool, const WHOLE: bool> Model for Sampled<DISCRETE, WHOLE> {
    type State = Plant;
    type Input = Reference;
    type Output = Measured;
    type Parameters = Loop;
    const KIND: Kind = if DISCRETE { Kind::Discrete } else { Kind::Continuous };

    fn derivative<S: Scalar>(&self, _t: S, x: &Plant<S>, _u: &Reference<S>, p: &Loop<S>) -> Plant<S> {
        Plant { x: p.b * x.z - p.a * x.x, z: S::from(0.0) }
    }

    fn jump<S: Scalar>(&self, _t: S, x: &Plant<S>, u: &Reference<S>, p: &Loop<S>) -> Plant<S> {
        if WHOLE {
            let _ = x.x.value();
        }
        Plant { x: x.x + u.dose, z: x.z + p.k * (u.r - x.x) - p.c * x.x * x.x }
    }

    fn next<S: Scalar>(&self, t: S, x: &Plant<S>, u: &Reference<S>, p: &Loop<S>) -> Plant<S> {
        let (after, kept) = (self.jump(t, x, u, p), (p.a * -TS).exp());
        Plant { x: kept * after.x + p.b * (-kept + 1.0) / p.a * after.z, z: after.z }
    }

    fn diffusion<S: Scalar>(&self, _t: S, _x: &Plant<S>, _u: &Reference<S>, p: &Loop<S>) -> Plant<S> {
        let over_a_step = ((-(p.a * (-2.0 * TS)).exp() + 1.0) / (p.a * 2.0)).sqrt();
        Plant { x: if DISCRETE { p.q * over_a_step } else { p.q }, z: S::from(0.0) }
    }

    fn noise<S: Scalar>(&self, _t: S, _x: &Plant<S>, _u: &Reference<S>, p: &Loop<S>) -> Measured<S> {
        Measured { x: p.s }
    }

    fn output<S: Scalar>(&self, _t: S, x: &Plant<S>, _u: &Reference<S>, _p: &Loop<S>) -> Measured<S> {
        Measured { x: x.x }
    }
}

const TRUTH: Loop = Loop { a: 0.6, b: 0.5, k: 0.4, c: 0.03, q: 0.1, s: 0.05 };
const AT: Loop = Loop { a: 0.8, b: 0.45, k: 0.5, c: 0.05, q: 0.2, s: 0.08 };

fn reference(k: usize) -> Reference {
    Reference { r: if (k / 25).is_multiple_of(2) { 1.0 } else { -0.5 }, dose: if k % 40 == 7 { 0.8 } else { 0.0 } }
}

/// Of the plant from 0.3 V; every seventh output is missing.
fn record<M: Model<State = Plant, Input = Reference, Output = Measured, Parameters = Loop>>(
    model: &M,
    samples: usize,
) -> ExperimentOf<M> {
    let time = Time::Uniform { start: 0.0, step: TS };
    let inputs: Vec<Reference> = (0..samples).map(reference).collect();
    let exact = Sampled::<true, false>;
    let run = Simulator::new(&exact).run(&TRUTH, &Plant { x: 0.3, z: 0.0 }, time.clone(), &inputs).unwrap();
    let mut random = Noise(17);
    let measured = |(k, y): (usize, &Measured)| {
        let y = y.x + 0.05 * random.gauss();
        Measured { x: if k % 7 == 5 { f64::NAN } else { y } }
    };
    let outputs = run.outputs.iter().enumerate().map(measured).collect();
    let record = Experiment::new(model, time, inputs, outputs).unwrap();
    record.initial(Plant { x: free(0.3), z: fixed(0.0) })
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Way {
    Simulation,
    GivenNoise,
    Kalman,
    Stationary,
    SecondOrder,
}

/// Cost and gradient at `AT`; the jump is affine in the state unless it is `curved`.
fn costs<M: Clone + Model<State = Plant, Input = Reference, Output = Measured, Parameters = Loop>>(
    model: &M,
    way: Way,
    curved: bool,
) -> Vec<f64> {
    let record = record(model, 300);
    let start = Loop { c: if curved { free(AT.c) } else { fixed(0.0) }, ..Loop::map(AT, free) };
    let without_levels = Loop { q: fixed(AT.q), s: fixed(AT.s), ..start };
    let fit = |start| {
        let fit = Fit::new(model, &record).parameters(start);
        if M::KIND == Kind::Continuous { fit.integrator(Rk4 { substeps: 40 }) } else { fit }
    };
    let levels = GivenNoise { states: vec![0.1, 0.03], outputs: vec![0.05] };
    let problem = match way {
        Way::Simulation => fit(without_levels).noise(Measured { x: 0.05 }).problem(),
        Way::GivenNoise => fit(without_levels).predictor(levels).problem(),
        Way::Kalman => fit(start).predictor(Kalman).problem(),
        Way::Stationary => fit(start).predictor(Kalman::starting(InitialCovariance::Stationary)).problem(),
        Way::SecondOrder => fit(start).predictor(SecondOrder).problem(),
    };
    let problem = problem.unwrap();
    let objective = problem.objective().unwrap();
    let at = objective.start();
    [vec![objective.cost(&at).unwrap()], objective.gradient(&at).unwrap()].concat()
}

/// Where the plant between the samples is linear, its step from sample to sample is known: cost and gradient of simulations and filters are those
/// of that step as a discrete model, in programs and in dual numbers, to what 40 steps of Runge-Kutta's method leave.
#[test]
fn a_sampled_part_is_a_part_of_the_step() {
    let ways = [Way::Simulation, Way::GivenNoise, Way::Kalman, Way::Stationary, Way::SecondOrder];
    let cases = ways.into_iter().flat_map(|way| [(way, false), (way, true)]);
    for (way, curved) in cases {
        let exact = costs(&Sampled::<true, false>, way, curved);
        let programs = costs(&Sampled::<false, false>, way, curved);
        // Filters in dual numbers have affine models.
        let in_duals = way == Way::Simulation || !curved;
        let duals = if in_duals { costs(&Sampled::<false, true>, way, curved) } else { programs.clone() };
        let size = exact.iter().fold(0.0, |size: f64, one| size.max(one.abs()));
        for (exact, found) in exact.iter().zip(&programs).chain(exact.iter().zip(&duals)) {
            assert!((exact - found).abs() < 1e-9 * size, "{way:?} {curved}: {exact} {found}");
        }
        assert!(exact.len() == programs.len() && exact.len() == duals.len());
    }
    let [extended, second] = [Way::Kalman, Way::SecondOrder].map(|way| costs(&Sampled::<false, false>, way, true)[0]);
    assert!((extended - second).abs() > 1e-6, "the curvature of the jump shows: {extended} {second}");
}

/// The same without curvature: an integral controller.
#[derive(Clone)]
struct Integral;

impl Model for Integral {
    type State = Plant;
    type Input = Reference;
    type Output = Measured;
    type Parameters = Loop;

    fn derivative<S: Scalar>(&self, t: S, x: &Plant<S>, u: &Reference<S>, p: &Loop<S>) -> Plant<S> {
        Sampled::<false, false>.derivative(t, x, u, p)
    }
    fn jump<S: Scalar>(&self, _t: S, x: &Plant<S>, u: &Reference<S>, p: &Loop<S>) -> Plant<S> {
        Plant { x: x.x + u.dose, z: x.z + p.k * (u.r - x.x) }
    }
    fn diffusion<S: Scalar>(&self, t: S, x: &Plant<S>, u: &Reference<S>, p: &Loop<S>) -> Plant<S> {
        Sampled::<false, false>.diffusion(t, x, u, p)
    }
    fn noise<S: Scalar>(&self, t: S, x: &Plant<S>, u: &Reference<S>, p: &Loop<S>) -> Measured<S> {
        Sampled::<false, false>.noise(t, x, u, p)
    }
    fn output<S: Scalar>(&self, t: S, x: &Plant<S>, u: &Reference<S>, p: &Loop<S>) -> Measured<S> {
        Sampled::<false, false>.output(t, x, u, p)
    }
}

/// Filters of a plant that is linear between the samples cross the intervals exactly, the sampled part included: cost and gradient are those of the step as
/// a discrete model to rounding, and on uneven samples those of 60 steps of Runge-Kutta's method, which leave some 1e-10 of the largest; the states too.
#[test]
fn intervals_after_a_jump_are_crossed_exactly() {
    let start = Loop { c: fixed(0.0), ..Loop::map(AT, free) };
    let costs = |problem: greybox::problem::Problem<'_>| {
        let objective = problem.objective().unwrap();
        let at = objective.start();
        [vec![objective.cost(&at).unwrap()], objective.gradient(&at).unwrap()].concat()
    };
    let agree = |found: Vec<f64>, expected: Vec<f64>, close: f64| {
        let size = expected.iter().fold(0.0, |size: f64, one| size.max(one.abs()));
        for (found, expected) in found.iter().zip(&expected) {
            assert!((found - expected).abs() < close * size, "{found} {expected}");
        }
    };
    let (even, discrete) = (record(&Integral, 300), record(&Sampled::<true, false>, 300));
    for initial in [InitialCovariance::Declared, InitialCovariance::Stationary] {
        let filter = Kalman::starting(initial);
        let found = Fit::new(&Integral, &even).parameters(start).predictor(filter).problem().unwrap();
        let expected =
            Fit::new(&Sampled::<true, false>, &discrete).parameters(start).predictor(filter).problem().unwrap();
        agree(costs(found), costs(expected), 1e-11);
    }
    let stamps: Vec<f64> =
        (0..300).map(|k| TS * (k as f64 + 0.3 * (k as f64 * 0.7).sin() + 4.0 * (k / 50) as f64)).collect();
    let uneven = Experiment::new(&Integral, Time::Stamps(stamps), even.inputs().collect(), even.outputs().collect());
    let uneven = uneven.unwrap().initial(Plant { x: fixed(0.3), z: fixed(0.0) });
    let fit = |start| Fit::new(&Integral, &uneven).parameters(start).predictor(Kalman);
    let stepped = |start| fit(start).integrator(Rk4 { substeps: 60 });
    agree(costs(fit(start).problem().unwrap()), costs(stepped(start).problem().unwrap()), 1e-9);
    let second = Fit::new(&Integral, &uneven).parameters(start).predictor(SecondOrder);
    agree(costs(second.problem().unwrap()), costs(fit(start).problem().unwrap()), 1e-12);
    let known = Loop { a: free(AT.a), c: fixed(0.0), ..Loop::map(AT, fixed) };
    let estimate = fit(known).run().unwrap();
    assert!(estimate.method.integrator.contains("exact transition"), "{estimate}");
    let [exact, steps] = [fit(known), stepped(known)].map(|fit| fit.smoothed(&estimate, &uneven).unwrap());
    for (exact, steps) in exact.means.iter().zip(&steps.means) {
        assert!((exact.x - steps.x).abs() < 1e-8 && (exact.z - steps.z).abs() < 1e-8, "{exact:?} {steps:?}");
    }
}

/// Plant and controller come back, and the simulation with them is that of the simulator.
#[test]
fn a_loop_with_a_digital_controller_is_fitted() {
    let model = Sampled::<false, false>;
    let record = record(&model, 2_000);
    let start = Loop { a: free(1.0), b: free(1.0), k: fixed(TRUTH.k), c: free(0.0), q: fixed(0.0), s: fixed(0.05) };
    let found = Fit::new(&model, &record).parameters(start).run().unwrap();
    assert!(found.severity() == Severity::Usable, "{found}");
    let truth = [TRUTH.a, TRUTH.b, TRUTH.c];
    for (one, truth) in found.unknowns.iter().zip(truth) {
        let error = one.knowledge.standard_error().unwrap();
        assert!((one.value - truth).abs() < 3.0 * error && error < 0.1, "{found}");
    }
    let from = found.experiments[0].initial_state;
    let inputs: Vec<Reference> = record.inputs().collect();
    let time = Time::Uniform { start: 0.0, step: TS };
    let method = Rk4 { substeps: 40 };
    let run = Simulator::new(&model).integrator(method).run(&found.parameters, &from, time, &inputs).unwrap();
    let predicted = Fit::new(&model, &record).parameters(Loop::map(found.parameters, fixed)).integrator(method);
    let begun = record.clone().initial(Plant::map(from, fixed));
    let predicted = predicted.predict(&found, &begun).unwrap();
    for (one, other) in run.outputs.iter().zip(&predicted.outputs) {
        assert!((one.x - other.x).abs() < 1e-12, "{} {}", one.x, other.x);
    }
}

signals! { pub struct Amount { m: "mg" } }
signals! { pub struct Dose { d: "mg" } }
signals! { pub struct Elimination { ke: "1/h", f: "1", lag: "h" } }

/// A drug in one compartment, of whose doses a part is taken up; doses are late, if `LATE`.
#[derive(Clone)]
struct Compartment<const LATE: bool>;

impl<const LATE: bool> Model for Compartment<LATE> {
    type State = Amount;
    type Input = Dose;
    type Output = Amount;
    type Parameters = Elimination;

    fn derivative<S: Scalar>(&self, _t: S, x: &Amount<S>, _u: &Dose<S>, p: &Elimination<S>) -> Amount<S> {
        Amount { m: -p.ke * x.m }
    }

    fn jump<S: Scalar>(&self, _t: S, x: &Amount<S>, u: &Dose<S>, p: &Elimination<S>) -> Amount<S> {
        Amount { m: x.m + p.f * u.d }
    }

    fn delay<S: Scalar>(&self, p: &Elimination<S>) -> Dose<S> {
        Dose { d: if LATE { p.lag } else { S::from(0.0) } }
    }

    fn output<S: Scalar>(&self, _t: S, x: &Amount<S>, _u: &Dose<S>, _p: &Elimination<S>) -> Amount<S> {
        *x
    }
}

/// Three doses at uneven times, one of them at an instant of three rows: amounts are sums of exponentials, in programs and in dual numbers.
#[test]
fn doses_add_exponentials() {
    let times = vec![0.0, 0.5, 1.0, 2.0, 2.0, 2.0, 3.5, 5.0, 6.0, 7.0, 7.5, 9.0, 12.0];
    let doses = [(0.0, 100.0), (2.0, 60.0), (6.0, 80.0)];
    let at = |t: f64| Dose { d: doses.iter().find(|dose| dose.0 == t).map_or(0.0, |dose| dose.1) };
    let truth = Elimination { ke: 0.31, f: 0.7, lag: 0.0 };
    let amount = |t: f64| {
        let before = doses.iter().filter(|dose| dose.0 < t);
        Amount { m: before.map(|(of, dose)| truth.f * dose * (-truth.ke * (t - of)).exp()).sum() }
    };
    let (inputs, outputs) = (times.iter().copied().map(at).collect(), times.iter().copied().map(amount).collect());
    let model = Compartment::<false>;
    let record = Experiment::new(&model, Time::Stamps(times.clone()), inputs, outputs).unwrap();
    let record = record.initial(Amount { m: fixed(0.0) });
    let start = Elimination { ke: free(0.1), f: free(1.0), lag: fixed(0.0) };
    let fit = || Fit::new(&model, &record).parameters(start);
    // Steps of 0.015 h at 0.31 per hour leave 1e-13, the adaptive ones their tolerance.
    let adaptive = Rk45 { relative: 1e-12, absolute: 1e-12 };
    for found in [fit().integrator(Rk4 { substeps: 200 }).run(), fit().integrator(adaptive).run()] {
        let p = found.unwrap().parameters;
        assert!((p.ke / truth.ke - 1.0).abs() < 1e-9 && (p.f / truth.f - 1.0).abs() < 1e-9, "{p:?}");
    }
}

/// With a dead time a sample has the dose of as much earlier, in simulations and in fits.
#[test]
fn doses_that_are_late() {
    let model = Compartment::<true>;
    let time = Time::Uniform { start: 0.0, step: 1.0 };
    let inputs: Vec<Dose> = (0..30).map(|k| Dose { d: if k % 10 == 3 { 50.0 } else { 0.0 } }).collect();
    let truth = Elimination { ke: 0.4, f: 0.8, lag: 2.0 };
    let run = simulate(&model, &truth, &Amount { m: 0.0 }, time, &inputs).unwrap();
    assert!(run.outputs[5].m == 0.0 && run.outputs[6].m > 20.0, "{:?}", run.outputs);
    let record = run.experiment(&model).unwrap().initial(Amount { m: fixed(0.0) });
    let start = Elimination { ke: free(0.2), f: free(0.5), lag: fixed(2.0) };
    let found = Fit::new(&model, &record).parameters(start).integrator(Rk4::default()).run().unwrap();
    assert!((found.parameters.ke / truth.ke - 1.0).abs() < 1e-8 && (found.parameters.f / truth.f - 1.0).abs() < 1e-8);
}

/// A loop rests where plant and controller do, and does not rest under a dose.
#[test]
fn rest_of_a_loop() {
    let model = Sampled::<false, false>;
    let time = || Time::Uniform { start: 0.0, step: TS };
    let record = |dose: f64| {
        let inputs = (0..50).map(|k| Reference { r: 1.0, dose: if k == 0 { dose } else { 0.0 } }).collect();
        let outputs = (0..50).map(|_| Measured { x: 0.9 }).collect();
        Experiment::new(&model, time(), inputs, outputs).unwrap().initially_at_rest()
    };
    let fit = |record: &ExperimentOf<Sampled<false, false>>| {
        let start = Loop { k: free(0.4), ..Loop::map(TRUTH, fixed) };
        Fit::new(&model, record).parameters(start).noise(Measured { x: 0.05 }).run()
    };
    let found = fit(&record(0.0)).unwrap();
    let state = found.experiments[0].initial_state;
    let k = found.parameters.k;
    // k (1 - x) = c x^2 and b z = a x, which Newton's method solves to rounding.
    let x = ((k * k + 4.0 * k * TRUTH.c).sqrt() - k) / (2.0 * TRUTH.c);
    assert!((state.x - x).abs() < 1e-9 && (state.z - TRUTH.a / TRUTH.b * x).abs() < 1e-9, "{state:?} {x}");
    let error = fit(&record(0.8)).unwrap_err().to_string();
    assert!(
        error.contains("rest") && error.contains("`x`") && error.contains("the first sample changes it by 0.8 V"),
        "{error}"
    );
}

/// Of a parameter that stands in the jump alone the gradient law has the slope per second: `dp/dt = gain (r - x) / ts e`.
#[test]
fn the_gradient_law_adapts_parameters_of_the_jump() {
    let model = Sampled::<false, false>;
    let (x, e, u, p) = (Plant { x: 0.3, z: 0.1 }, Plant { x: 0.0, z: 0.2 }, reference(0), TRUTH);
    let now = Moment { model: &model, ts: TS, t: 0.0, x: &x, e: &e, u: &u, p: &p };
    let gain = Loop { k: 2.0, ..Loop::map(TRUTH, |_| 0.0) };
    let rates = greybox::online::Gradient::<_, 6> { gain }.rates(&now);
    let Rate::Adapt(rate) = rates.k else { panic!() };
    assert!((rate - 2.0 * (u.r - x.x) / TS * e.z).abs() < 1e-14, "{rate}");
}

/// A helper of the name of the jump is no jump of a discrete model, whose own step calls it: the equations may be affine all the same.
#[derive(Clone)]
struct Helped;

impl Model for Helped {
    type State = Measured;
    type Input = Reference;
    type Output = Measured;
    type Parameters = Loop;
    const KIND: Kind = Kind::Discrete;

    fn jump<S: Scalar>(&self, _t: S, x: &Measured<S>, _u: &Reference<S>, _p: &Loop<S>) -> Measured<S> {
        Measured { x: x.x * x.x }
    }
    fn next<S: Scalar>(&self, _t: S, x: &Measured<S>, u: &Reference<S>, p: &Loop<S>) -> Measured<S> {
        // Not read as a graph.
        let _ = x.x.value();
        Measured { x: p.a * x.x + p.b * u.r }
    }
    fn diffusion<S: Scalar>(&self, _t: S, _x: &Measured<S>, _u: &Reference<S>, p: &Loop<S>) -> Measured<S> {
        Measured { x: p.q }
    }
    fn noise<S: Scalar>(&self, _t: S, _x: &Measured<S>, _u: &Reference<S>, p: &Loop<S>) -> Measured<S> {
        Measured { x: p.s }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Measured<S>, _u: &Reference<S>, _p: &Loop<S>) -> Measured<S> {
        *x
    }
}

#[test]
fn a_discrete_model_has_no_jump() {
    let mut random = Noise(3);
    let (mut x, mut outputs) = (0.0, vec![]);
    let inputs: Vec<Reference> = (0..200).map(reference).collect();
    for u in &inputs {
        outputs.push(Measured { x: x + 0.05 * random.gauss() });
        x = 0.6 * x + 0.5 * u.r + 0.1 * random.gauss();
    }
    let record = Experiment::new(&Helped, Time::Uniform { start: 0.0, step: TS }, inputs, outputs).unwrap();
    let start = Loop { a: free(0.5), b: free(0.4), ..Loop::map(TRUTH, fixed) };
    let found = Fit::new(&Helped, &record).parameters(start).predictor(Kalman).run().unwrap();
    assert!((found.parameters.a - 0.6).abs() < 0.1 && (found.parameters.b - 0.5).abs() < 0.1, "{found}");
}

/// An observer of the loop follows it: without noise its state is the simulated one.
#[test]
fn an_observer_has_the_sampled_part() {
    let model = Sampled::<false, false>;
    let inputs: Vec<Reference> = (0..200).map(reference).collect();
    let from = Plant { x: 0.3, z: 0.0 };
    let run = simulate(&model, &TRUTH, &from, Time::Uniform { start: 0.0, step: TS }, &inputs).unwrap();
    let start = EkfStart {
        state: Plant { x: free(from.x).prior(from.x, 0.1), z: free(from.z).prior(from.z, 0.1) },
        parameters: Loop::map(TRUTH, fixed),
        state_drift: Plant { x: 0.01, z: 0.01 },
        parameter_drift: Loop::splat(0.0),
        noise: Measured { x: 0.05 },
        hold: Hold::Zero,
        watch: Watch { limit: Measured { x: 6.0 }, patience: 20 },
    };
    let mut observer = Ekf::<_, 2>::new(model, TS, start).unwrap();
    for (k, (u, y)) in inputs.iter().zip(&run.outputs).enumerate() {
        let update = observer.update(TS * k as f64, u, y);
        // The same steps: two hundred of them add their roundings.
        assert!(update.innovation.x.abs() < 1e-12, "{k}: {update:?}");
    }
}
