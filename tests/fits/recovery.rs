#![cfg(feature = "std")]
//! Known parameters are found again, on random models, with and without noise.

use crate::common::*;
use greybox::optimize::LeastSquares;
use greybox::pmsm::{Currents, Drive, Surface, Winding};
use greybox::*;
use proptest::prelude::*;

signals! { pub struct Rotor { i: "A", w: "rad/s" } }
signals! { pub struct Brushed { r: "ohm", l: "H", k: "V s/rad", j: "kg m^2", b: "N m s/rad" } }
signals! { pub struct Poles { a1: "1", a2: "1", gain: "1" } }

/// A motor with brushes, current and speed measured.
struct DcMotor;

impl Model for DcMotor {
    type State = Rotor;
    type Input = Voltage;
    type Output = Rotor;
    type Parameters = Brushed;
    fn derivative<S: Scalar>(&self, _t: S, x: &Rotor<S>, u: &Voltage<S>, p: &Brushed<S>) -> Rotor<S> {
        Rotor { i: (u.u - p.r * x.i - p.k * x.w) / p.l, w: (p.k * x.i - p.b * x.w) / p.j }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Rotor<S>, _u: &Voltage<S>, _p: &Brushed<S>) -> Rotor<S> {
        *x
    }
}

/// `y[k+2] = a1 y[k+1] + a2 y[k] + gain u[k]`, as a discrete model.
struct Recursion;

impl Model for Recursion {
    type State = Pair;
    type Input = Voltage;
    type Output = Voltage;
    type Parameters = Poles;
    const KIND: Kind = Kind::Discrete;
    fn next<S: Scalar>(&self, _t: S, x: &Pair<S>, u: &Voltage<S>, p: &Poles<S>) -> Pair<S> {
        Pair { y: p.a1 * x.y + x.z, z: p.a2 * x.y + p.gain * u.u }
    }
    fn output<S: Scalar>(&self, _t: S, x: &Pair<S>, _u: &Voltage<S>, _p: &Poles<S>) -> Voltage<S> {
        Voltage { u: x.y }
    }
}

/// The outputs of a plant: to rounding, where the default step would be a part of the truth.
fn by_the_plant<M: Model>(
    model: &M,
    record: &ExperimentOf<M>,
    start: Of<M::State, f64>,
    truth: Of<M::Parameters, f64>,
) -> ExperimentOf<M> {
    let (inputs, time) = (record.inputs().collect::<Vec<_>>(), record.times().clone());
    let fine = Simulator::new(model).integrator(Rk45 { relative: 1e-11, absolute: 1e-13 });
    with_outputs(model, record, fine.run(&truth, &start, time, &inputs).unwrap().outputs)
}

/// Fits `records`' first, without noise, to 1e-6, then the second with noise, within five standard errors.
fn recovers<M: Model>(
    model: &M,
    [record, plant]: [&ExperimentOf<M>; 2],
    truth: Of<M::Parameters, f64>,
    start: Of<M::Parameters, Parameter>,
    sigma: Of<M::Output, f64>,
    seed: u64,
) -> Result<(), TestCaseError> {
    let truth = M::Parameters::into_array(truth);
    let exact = Fit::new(model, record).parameters(start).run().unwrap();
    prop_assert!(exact.outcome.converged(), "{exact}");
    for (found, truth) in M::Parameters::into_array(exact.parameters).as_ref().iter().zip(truth.as_ref()) {
        prop_assert!((found / truth - 1.0).abs() < 1e-6, "{exact}");
    }
    let estimate = Fit::new(model, &noisy(model, plant, sigma, &mut Noise(seed))).parameters(start).run().unwrap();
    prop_assert!(estimate.outcome.converged(), "{estimate}");
    for (i, truth) in truth.as_ref().iter().enumerate() {
        let unknown = estimate.unknowns.iter().find(|u| u.name == M::Parameters::NAMES[i]).unwrap();
        let error = unknown.knowledge.standard_error().unwrap();
        prop_assert!((unknown.value - truth).abs() < 5.0 * error, "{estimate}");
    }
    Ok(())
}

fn away(value: f64, by: f64) -> Parameter {
    free(value * by)
}

fn brushed(truth: Brushed, by: f64, seed: u64) -> Result<(), TestCaseError> {
    let inputs = levels(400, 20, seed).into_iter().map(|u| Voltage { u: 12.0 * u }).collect();
    let rest = Rotor { i: 0.0, w: 0.0 };
    let record = simulated(&DcMotor, 5e-4, inputs, rest, truth);
    let Brushed { r, l, k, j, .. } = truth;
    let start = Brushed { r: away(r, by), l: away(l, by).log(), k: away(k, by), j: away(j, by).log(), b: free(1.3e-4) };
    let plant = by_the_plant(&DcMotor, &record, rest, truth);
    recovers(&DcMotor, [&record, &plant], truth, start, Rotor { i: 0.05, w: 0.5 }, seed)
}

/// A time constant of the armature of one sample: with one step per sample the inductance would be off by 1.8 %, five
/// standard errors.
#[test]
fn a_motor_as_fast_as_its_samples() {
    let truth = Brushed { r: 1.967_499_927_292_896_6, l: 1e-3, k: 0.03, j: 7.806_833_505_070_109e-5, b: 1e-4 };
    brushed(truth, 0.8, 11_895_147_488_831_276_964).unwrap();
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    #[test]
    fn surface_motors(rs in 0.2..1.0, ls in 2e-3..8e-3, ke in 0.4..1.2, by in 0.7..1.4, seed: u64) {
        let (model, truth) = (Surface::new(4).unwrap(), Winding { rs, ls, ke });
        let (d, q, w) = (levels(300, 15, seed), levels(300, 11, seed ^ 1), levels(300, 60, seed ^ 2));
        let drive = |k: usize| Drive { ud: 10.0 * d[k], uq: 20.0 * q[k] + 0.8 * ke * 40.0 * w[k], w: 40.0 * w[k] };
        let inputs = (0..300).map(drive).collect();
        let record = simulated(&model, 5e-4, inputs, Currents { id: 1.0, iq: -1.0 }, truth)
            .initial(Currents { id: free(0.0), iq: free(0.0) });
        let start = Winding { rs: away(rs, by), ls: away(ls, 2.0 - by), ke: away(ke, by) };
        let plant = by_the_plant(&model, &record, Currents { id: 1.0, iq: -1.0 }, truth);
        recovers(&model, [&record, &plant], truth, start, Currents { id: 0.1, iq: 0.1 }, seed)?;
    }

    #[test]
    fn brushed_motors(r in 0.5..2.0, l in 1e-3..5e-3, k in 0.03..0.1, j in 2e-5..1e-4, by in 0.8..1.25, seed: u64) {
        brushed(Brushed { r, l, k, j, b: 1e-4 }, by, seed)?;
    }

    #[test]
    fn stable_recursions(radius in 0.3..0.9f64, angle in 0.3..2.5f64, gain in 0.5..2.0, seed: u64) {
        let (a1, a2) = (2.0 * radius * f64::cos(angle), -radius * radius);
        let truth = Poles { a1, a2, gain };
        let inputs = levels(300, 3, seed).into_iter().map(|u| Voltage { u }).collect();
        let record = simulated(&Recursion, 1.0, inputs, Pair { y: 0.0, z: 0.0 }, truth);
        let start = Poles { a1: free(a1 + 0.05), a2: free(a2 + 0.05), gain: free(1.0) };
        prop_assume!(a1.abs() > 0.05);
        recovers(&Recursion, [&record, &record], truth, start, Voltage { u: 0.05 }, seed)?;
    }
}

const LAG: Branch = Branch { gain: 2.0, tau: 0.05 };

fn lag(samples: usize) -> ExperimentOf<Lag> {
    let inputs = levels(samples, 12, 7).into_iter().map(|u| Voltage { u }).collect();
    simulated(&Lag, 5e-3, inputs, Current { i: 0.5 }, LAG)
}

fn lag_free() -> Branch<Parameter> {
    Branch { gain: free(1.5), tau: free(0.08).log() }
}

#[track_caller]
fn finds(fit: Fit<'_, Lag>) {
    let estimate = fit.run().unwrap();
    assert!(estimate.outcome.converged(), "{estimate}");
    assert!((estimate.parameters.gain / LAG.gain - 1.0).abs() < 1e-6, "{estimate}");
    assert!((estimate.parameters.tau / LAG.tau - 1.0).abs() < 1e-6, "{estimate}");
}

#[test]
fn records_of_every_kind() {
    let record = lag(200);
    // The initial state: given, wrong and free, not said, and from the first sample.
    finds(Fit::new(&Lag, &record).parameters(lag_free()));
    finds(Fit::new(&Lag, &record.clone().initial(Current { i: free(-1.0) })).parameters(lag_free()));
    finds(Fit::new(&Lag, &record.clone().initial_from_first_sample()).parameters(lag_free()));
    let unsaid = Experiment::new(&Lag, record.times().clone(), record.inputs().collect(), record.outputs().collect());
    finds(Fit::new(&Lag, &unsaid.unwrap()).parameters(lag_free()));
    // Every third measurement missing.
    let thin = |(k, y): (usize, Current)| if k % 3 == 0 { Current { i: f64::NAN } } else { y };
    let outputs = record.outputs().enumerate().map(thin).collect();
    finds(Fit::new(&Lag, &with_outputs(&Lag, &record, outputs)).parameters(lag_free()));
    // Inputs that run in straight lines, and time that does not.
    finds(Fit::new(&Lag, &with_truth(&Lag, &record.clone().hold(Hold::First), LAG)).parameters(lag_free()));
    let mut noise = Noise(3);
    let stamps = (0..200).map(|k| 5e-3 * (k as f64 + 0.8 * noise.uniform())).collect();
    let uneven = Experiment::new(&Lag, Time::Stamps(stamps), record.inputs().collect(), record.outputs().collect());
    let uneven = with_truth(&Lag, &uneven.unwrap().initial(Current { i: fixed(0.5) }), LAG);
    finds(Fit::new(&Lag, &uneven).parameters(lag_free()));
    // A pre-filter, and a noise covariance.
    let filter = Butterworth::low_pass(4, 20.0, 5e-3).unwrap();
    finds(Fit::new(&Lag, &record).parameters(lag_free()).prefilter(filter));
    finds(Fit::new(&Lag, &record).parameters(lag_free()).noise_covariance());
}

#[test]
fn predictions_a_few_steps_ahead() {
    let record = lag(200);
    for steps in [1, 5] {
        let fit = Fit::new(&Lag, &record).parameters(lag_free()).predictor(Horizon { steps, filter: None });
        let estimate = fit.run().unwrap();
        assert!((estimate.parameters.tau / LAG.tau - 1.0).abs() < 1e-6, "{estimate}");
    }
}

#[test]
fn experiments_with_something_of_their_own() {
    let gains = [1.5, 2.0, 3.0];
    let one = |e: usize| {
        let inputs = levels(150, 12, e as u64).into_iter().map(|u| Voltage { u }).collect();
        simulated(&Lag, 5e-3, inputs, Current { i: e as f64 }, Branch { gain: gains[e], ..LAG })
            .named(format!("run {e}"))
            .initial(Current { i: free(0.0) })
    };
    let records: Vec<_> = (0..3).map(one).collect();
    let parameters = Branch { gain: free(1.0).per_experiment(), tau: free(0.08) };
    let estimate = Fit::new(&Lag, &records).parameters(parameters).run().unwrap();
    assert!((estimate.parameters.tau / LAG.tau - 1.0).abs() < 1e-6, "{estimate}");
    for (e, own) in estimate.experiments.iter().enumerate() {
        assert!((own.parameters.gain / gains[e] - 1.0).abs() < 1e-6, "{estimate}");
        assert!((own.initial_state.i - e as f64).abs() < 1e-6, "{estimate}");
    }
}

#[test]
fn what_is_fixed_stays_and_bounds_hold() {
    let record = noisy(&Lag, &lag(200), Current { i: 0.05 }, &mut Noise(1));
    let held = Branch { gain: fixed(2.0), tau: free(0.08) };
    let estimate = Fit::new(&Lag, &record).parameters(held).run().unwrap();
    assert_eq!(estimate.parameters.gain, 2.0);
    assert_eq!(estimate.knowledge.gain, Knowledge::Fixed);
    assert_eq!(estimate.unknowns.len(), 1);
    let bounded = Branch { gain: free(1.5).within(0.0, 1.8), tau: free(0.08) };
    let estimate = Fit::new(&Lag, &record).parameters(bounded).run().unwrap();
    assert_eq!(estimate.parameters.gain, 1.8);
    assert_eq!(estimate.knowledge.gain, Knowledge::Held { bound: 1.8, end: None });
    // The cost falls outward at a lower bound, too.
    let bounded = Branch { gain: free(2.5).within(2.2, 9.0), tau: free(0.08) };
    let above = Fit::new(&Lag, &record).parameters(bounded).run().unwrap();
    assert_eq!((above.parameters.gain, above.knowledge.gain), (2.2, Knowledge::Held { bound: 2.2, end: None }));
    // And inward from a bound that the start is on: nothing is held.
    let bounded = Branch { gain: free(1.8).within(1.8, 9.0), tau: free(0.08) };
    let inside = Fit::new(&Lag, &record).parameters(bounded).run().unwrap();
    assert!(
        (inside.parameters.gain / 2.0 - 1.0).abs() < 0.05 && inside.knowledge.gain.standard_error().is_some(),
        "{inside}"
    );
    // The rest is what a fit finds where the bound is a fixed value.
    let reference = Fit::new(&Lag, &record).parameters(Branch { gain: fixed(1.8), tau: free(0.08) }).run().unwrap();
    assert!((estimate.parameters.tau / reference.parameters.tau - 1.0).abs() < 1e-9);
    assert_eq!(estimate.degrees_of_freedom(), reference.degrees_of_freedom());
    let (a, b) = (estimate.knowledge.tau.standard_error(), reference.knowledge.tau.standard_error());
    assert!((a.unwrap() / b.unwrap() - 1.0).abs() < 1e-6);
}

#[test]
fn priors_are_measurements() {
    // Without influence on the outputs the prior comes back, whether or not the noise is known.
    let quiet: Vec<Voltage> = vec![Voltage { u: 0.0 }; 50];
    let truth = Affine { slope: 0.0, offset: 0.3 };
    signals! { pub struct Unseen { offset: "V", unseen: "1" } }
    struct WithoutEffect;
    impl Model for WithoutEffect {
        type State = Nothing;
        type Input = Voltage;
        type Output = Voltage;
        type Parameters = Unseen;
        const KIND: Kind = Kind::Static;
        fn output<S: Scalar>(&self, _t: S, _x: &Nothing, _u: &Voltage<S>, p: &Unseen<S>) -> Voltage<S> {
            Voltage { u: p.offset }
        }
    }
    let record = simulated(&WithoutEffect, 1.0, quiet, Nothing, Unseen { offset: truth.offset, unseen: 0.0 });
    let record = noisy(&WithoutEffect, &record, Voltage { u: 0.1 }, &mut Noise(5));
    let fit = || {
        Fit::new(&WithoutEffect, &record).parameters(Unseen { offset: free(0.0), unseen: free(1.0).prior(4.0, 0.25) })
    };
    for estimate in [fit().noise(Voltage { u: 0.1 }).run().unwrap(), fit().run().unwrap()] {
        assert!((estimate.parameters.unseen - 4.0).abs() < 1e-9, "{estimate}");
        assert!((estimate.knowledge.unseen.standard_error().unwrap() - 0.25).abs() < 1e-9, "{estimate}");
    }
    // A mean of 50 at 0.1 each, and a prior: weighted by their precision.
    let mean = record.outputs().map(|y| y.u).sum::<f64>() / 50.0;
    let (data, prior) = (50.0 / 0.01, 1.0 / 0.02f64.powi(2));
    let parameters = Unseen { offset: free(0.0).prior(0.5, 0.02), unseen: fixed(0.0) };
    let estimate = Fit::new(&WithoutEffect, &record).parameters(parameters).noise(Voltage { u: 0.1 }).run().unwrap();
    let expected = (data * mean + prior * 0.5) / (data + prior);
    assert!((estimate.parameters.offset - expected).abs() < 1e-12);
    let error = estimate.knowledge.offset.standard_error().unwrap();
    assert!((error / (data + prior).sqrt().recip() - 1.0).abs() < 1e-12);
}

/// Records with inputs that are held and with inputs between straight lines are simulated each in its own way, in one fit: its cost is
/// the sum of theirs.
#[test]
fn each_record_keeps_its_hold() {
    let inputs = levels(200, 12, 7).into_iter().map(|u| Voltage { u }).collect();
    let held = simulated(&Lag, 5e-3, inputs, Current { i: 0.5 }, LAG).named("held");
    let lines = held.clone().hold(Hold::First).named("lines");
    let cost = |records: &[ExperimentOf<Lag>]| {
        let problem = Fit::new(&Lag, records).parameters(lag_free()).noise(Current { i: 0.1 }).problem().unwrap();
        let objective = problem.objective().unwrap();
        objective.linearize(&objective.start()).unwrap().cost
    };
    let (one, other) = (cost(std::slice::from_ref(&held)), cost(std::slice::from_ref(&lines)));
    assert!((one / other - 1.0).abs() > 1e-3, "the holds differ: {one} {other}");
    assert!((cost(&[held, lines]) / (one + other) - 1.0).abs() < 1e-12);
}
