//! Rounds of a search, and the noise between them.

use super::{Rounds, roughness};
use crate::optimize::{Infeasible, JacobianColumns, LevenbergMarquardt, Outcome, SearchLimit, Stop};
use crate::pmsm::{Currents, Drive, SQRT_2_3, Surface, Winding};
use crate::problem::{Control, Objective, Round, Whitening, noise};
use crate::random::Random;
use crate::tests::{Current, Gain, Line, Voltage};
use crate::{Experiment, ExperimentOf, Fit, Huber, Parameter, Time, free, simulate};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// A gain of two, and errors that are no line.
fn record() -> ExperimentOf<Line> {
    let inputs: Vec<Voltage> = (0..40).map(|k| Voltage { u: f64::from(k) }).collect();
    let outputs = (0..40).map(|k| Current { i: 2.0 * f64::from(k) + f64::from(k * 37 % 21) }).collect();
    Experiment::new(&Line, Time::Uniform { start: 0.0, step: 1.0 }, inputs, outputs).unwrap()
}

/// The first of several rounds determines three digits. From a start that is right to three digits, the estimate equals that from a
/// far start to ten times the tolerance of the noise.
#[test]
fn the_first_round_is_not_the_last() {
    let record = record();
    let from = |start: f64| {
        let fit = Fit::new(&Line, &record).parameters(Gain { a: free(start) }).loss(Huber::default());
        fit.run().unwrap().parameters.a
    };
    let far = from(1.0);
    let near = from(far * (1.0 + 1e-4));
    assert!((near / far - 1.0).abs() < 1e-5, "{near} {far}");
}

/// The limit of trial steps is that of all rounds together, also where one ends just there.
#[test]
fn a_limit_is_that_of_all_rounds() {
    let record = record();
    let within = |iterations: u64| {
        let optimizer = LevenbergMarquardt::new(Stop { iterations, ..Stop::default() }, JacobianColumns);
        let fit = Fit::new(&Line, &record).parameters(Gain { a: free(1.0) }).loss(Huber::default());
        fit.optimizer(optimizer).run().unwrap()
    };
    let needed = within(1000).iterations;
    for limit in 1..needed {
        let found = within(limit);
        assert_eq!(found.outcome, Outcome::IterationLimit { iterations: limit });
        assert_eq!(found.iterations, limit);
    }
    assert!(needed > 3 && within(needed).outcome.converged(), "{needed}");
}

/// Noise that doubles from round to round never settles: the hundredth round is the last, at a limit, not at a minimum.
#[test]
fn rounds_of_noise_that_does_not_settle_end() {
    let record = record();
    let problem = Fit::new(&Line, &record).parameters(Gain { a: free(1.0) }).problem().unwrap();
    let plain = problem.in_units(&Control::NEVER);
    let mut rounds = Rounds::with(&plain, &problem.settings.optimizer, vec![1.0], Whitening::none(1));
    let mut take = || {
        let outcome = Outcome::CostUnchanged { decrease: 0.0 };
        let (coordinates, ahead, name) = (vec![1.0], None, String::new());
        let round = Round { coordinates, ahead, linear: None, outcome, iterations: 2, evaluations: 3, name };
        let (objective, noise) = (rounds.objective(), rounds.whitening.widened(2.0));
        rounds.take(objective, round, Some(Ok(noise))).map(|end| (end.outcome, end.iterations, end.evaluations))
    };
    assert!((1..100).all(|_| take().is_none()));
    let limit = SearchLimit::NoiseRounds;
    assert_eq!(take(), Some((Outcome::OwnLimit { iterations: 200, limit }, 200, 300)));
}

/// A flag that is set while noise is estimated, or before the first evaluation of the next round, leaves the end of the last round.
#[test]
fn a_stop_between_rounds_leaves_an_end() {
    let record = record();
    let problem = Fit::new(&Line, &record).parameters(Gain { a: free(1.0) }).problem().unwrap();
    let control = Control { cancel: Some(Arc::new(AtomicBool::new(true))), deadline: None };
    let plain = problem.in_units(&control);
    let rounds = || {
        let mut rounds = Rounds::with(&plain, &problem.settings.optimizer, vec![1.0], Whitening::none(1));
        rounds.known = false;
        rounds
    };
    let ended = || Round {
        coordinates: vec![1.5],
        ahead: None,
        linear: None,
        outcome: Outcome::CostUnchanged { decrease: 0.0 },
        iterations: 2,
        evaluations: 3,
        name: String::new(),
    };
    assert!(rounds().stopped().is_none() && rounds().run(None).is_err());
    let mut next = rounds();
    assert!(next.take(next.objective(), ended(), Some(Ok(Whitening::none(1).widened(2.0)))).is_none());
    let end = next.run(None).unwrap();
    assert_eq!((end.outcome, end.coordinates, end.iterations), (Outcome::Cancelled, vec![1.5], 2));
    assert_eq!(end.whitening.sigma(), [2.0]);
    let mut measuring = rounds();
    let end = measuring.take(measuring.objective(), ended(), Some(Err(Infeasible::Cancelled))).unwrap();
    assert_eq!((end.outcome, end.coordinates), (Outcome::Cancelled, vec![1.5]));
}

#[test]
fn roughness_is_the_larger_change() {
    assert_eq!([roughness(-3.0, None), roughness(-3.0, Some(4.0)), roughness(3.0, Some(4.0))], [3.0, 7.0, 3.0]);
}

/// A motor's currents over 2,000 samples with noise of 0.05 and 0.1 A.
fn motor(model: &Surface) -> ExperimentOf<Surface> {
    let mut random = Random::stream(36, 1);
    let time = Time::Uniform { start: 0.0, step: 0.25e-3 };
    let input = |k: usize| {
        let (w, step) = (150.0 * (3e-3 * k as f64).sin(), if k / 100 % 2 == 0 { 8.0 } else { -8.0 });
        Drive { ud: -0.4 * step, uq: 0.63 * step + 0.95 * SQRT_2_3 * w, w }
    };
    let inputs: Vec<Drive> = (0..2000).map(input).collect();
    let truth = Winding { rs: 0.63, ls: 4e-3, ke: 0.95 };
    let clean = simulate(model, &truth, &Currents { id: 0.0, iq: 0.0 }, time.clone(), &inputs).unwrap().outputs;
    let mut noisy = |y: &Currents| Currents { id: y.id + 0.05 * random.normal(), iq: y.iq + 0.1 * random.normal() };
    let outputs = clean.iter().map(&mut noisy).collect();
    Experiment::new(model, time, inputs, outputs).unwrap()
}

/// From a start that is far off.
fn far() -> Winding<Parameter> {
    Winding { rs: free(1.2), ls: free(1.75e-3), ke: free(0.63) }
}

/// The estimate with the noise estimated is that with this noise given, to the tolerance of the noise in standard errors; and takes two
/// evaluations more at most: one for the noise where the first round ended, and one as its weights have moved the minimum.
#[test]
fn noise_is_estimated_in_two_evaluations() {
    let model = Surface::new(4).unwrap();
    let record = motor(&model);
    let fit = || Fit::new(&model, &record).parameters(far());
    let estimated = fit().run().unwrap();
    let [id, iq] = [0, 1].map(|j| estimated.outputs[j].fit.rmse);
    let given = fit().noise(Currents { id, iq }).run().unwrap();
    assert!(estimated.evaluations <= given.evaluations + 2, "{} {}", estimated.evaluations, given.evaluations);
    for (one, other) in estimated.unknowns.iter().zip(&given.unknowns) {
        let error = other.knowledge.standard_error().unwrap();
        assert!((one.value - other.value).abs() < 1e-6 * error, "{}: {} {}", one.name, one.value, other.value);
    }
}

/// Noise next to a point with slopes is that of segments which begin where these lead to: off by the square of the distance, a part of
/// 1e-4 of each parameter, times what the currents are of their noise, 200 at most.
#[test]
fn noise_next_to_the_best_point_needs_no_simulation_of_its_own() {
    let model = Surface::new(4).unwrap();
    let record = motor(&model);
    let problem = Fit::new(&model, &record).parameters(far()).problem().unwrap();
    let objective = problem.objective().unwrap();
    let best = [0.63, 4e-3, 0.95, 0.0, 0.0];
    objective.evaluate(&best).unwrap();
    let next = best.map(|x| x * (1.0 + 1e-4));
    let near = Objective { extrapolates: true, ..objective.clone() };
    let [near, exact] = [&near, &objective].map(|objective| noise::estimate(objective, &next).unwrap().sigma());
    for (near, exact) in near.iter().zip(&exact) {
        let part = (near / exact - 1.0).abs();
        assert!(part < 2e-6 && part > 0.0, "{part:e}");
    }
}

/// A round that cannot begin a step ahead of the end of the last one begins at that end, and determines all digits.
#[test]
fn a_step_ahead_is_taken_back() {
    let record = record();
    let problem = Fit::new(&Line, &record).parameters(Gain { a: free(1.0) }).problem().unwrap();
    let plain = problem.in_units(&Control::NEVER);
    let mut rounds = Rounds::with(&plain, &problem.settings.optimizer, vec![1.0], Whitening::none(1));
    let round = |ahead: Option<Vec<f64>>| Round {
        coordinates: vec![1.5],
        ahead,
        linear: None,
        outcome: Outcome::CostUnchanged { decrease: 0.0 },
        iterations: 2,
        evaluations: 3,
        name: String::new(),
    };
    let noise = || Ok(Whitening::none(1).widened(2.0));
    assert!(rounds.take(rounds.objective(), round(Some(vec![1.7])), Some(noise())).is_none());
    assert_eq!((&rounds.coordinates[..], rounds.rough), (&[1.7][..], true));
    assert!(rounds.steps_back() && !rounds.steps_back());
    assert_eq!((&rounds.coordinates[..], rounds.rough), (&[1.5][..], false));
    // Nor where the noise cannot be estimated there.
    let failed = Infeasible::Failed(String::new());
    assert!(rounds.take(rounds.objective(), round(Some(vec![1.7])), Some(Err(failed))).is_some());
    assert_eq!(rounds.coordinates, [1.5]);
}
