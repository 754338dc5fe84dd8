//! Ends that are one minimum, and the best of them.

use super::*;
use crate::tests::{Current, Gain, Line, Voltage};
use crate::{Experiment, Fit, Kind, Model, Nothing, Parameter, Scalar, Time, free};

const MINIMUM: Outcome = Outcome::Converged { step: 0.0, gradient: 0.0 };
const LIMIT: Outcome = Outcome::IterationLimit { iterations: 9 };

/// The results of searches that ended at these gains, of eight measurements whose sum of squares is `8 + 800 (a - 2)^2`, in units of
/// the noise.
fn ended(ends: &[Option<(f64, Outcome)>]) -> (usize, Starts) {
    ended_by(&Line, free(1.0), ends)
}

/// Those of another model with the same outputs at a gain of two.
fn ended_by(
    model: &(impl Model<State = Nothing, Input = Voltage, Output = Current, Parameters = Gain> + Clone),
    declared: Parameter,
    ends: &[Option<(f64, Outcome)>],
) -> (usize, Starts) {
    let inputs: Vec<Voltage> = (0..8).map(|k| Voltage { u: f64::from(1 - 2 * (k % 2)) }).collect();
    let error = |k: usize| if (k / 2).is_multiple_of(2) { 0.1 } else { -0.1 };
    let outputs = inputs.iter().enumerate().map(|(k, u)| Current { i: 2.0 * u.u + error(k) }).collect();
    let record = Experiment::new(model, Time::Uniform { start: 0.0, step: 1.0 }, inputs, outputs).unwrap();
    let fit = Fit::new(model, &record).parameters(Gain { a: declared }).noise(Current { i: 0.1 });
    let problem = fit.problem().unwrap();
    let plain = problem.objective().unwrap();
    let end = |(a, outcome): &(f64, Outcome)| SearchEnd {
        coordinates: vec![*a],
        whitening: plain.whitening.clone(),
        linear: None,
        outcome: *outcome,
        iterations: 3,
        evaluations: 5,
        name: String::new(),
        write_error: None,
        memory: Default::default(),
        starts: None,
    };
    let none = || NoEnd::new(false, "no simulation");
    let ends: Vec<Result<SearchEnd, NoEnd>> = ends.iter().map(|one| one.as_ref().map(end).ok_or_else(none)).collect();
    let starts: Vec<Vec<f64>> = (0..ends.len()).map(|i| vec![i as f64]).collect();
    found(&plain, &starts, &ends).unwrap()
}

/// A search that found no minimum is the best if its cost is lower by more than a millionth: 4 and `4 + 400 (a - 2)^2`.
#[test]
fn the_best_of_ends() {
    let off = |part: f64| 2.0 + (4.0 * part / 400.0).sqrt();
    for (part, best) in [(9.0, 0), (1.5e-6, 0), (0.5e-6, 1)] {
        let (found, starts) = ended(&[Some((2.0, LIMIT)), Some((off(part), MINIMUM))]);
        assert_eq!((found, starts.agreed), (best, best as u64), "{part}");
        assert_eq!((starts.tried, starts.evaluations, starts.declared, starts.minima.len()), (2, 10, None, 1));
        let ratio = if best == 0 { 1.0 + part } else { 1.0 };
        assert!((starts.minima[0].cost_ratio - ratio).abs() < 1e-9, "{starts:?}");
        assert_eq!((starts.failed.len(), starts.failed[0].evaluated), (1, true));
    }
    let (best, starts) = ended(&[None, Some((2.3, MINIMUM)), Some((2.0, MINIMUM))]);
    assert_eq!((best, starts.agreed, starts.declared, starts.evaluations), (2, 1, None, 10));
    assert!((starts.minima[1].cost_ratio - 10.0).abs() < 1e-9 && !starts.failed[0].evaluated, "{starts:?}");
    assert_eq!(starts.failed[0].reason, "no simulation");
    assert_eq!(starts.minima[1].unknowns, [("a".to_owned(), 2.3)]);
}

/// Ends of one cost are one minimum within a tenth of a standard deviation, 0.0035 here; costs may differ by the noise of a
/// rough one.
#[test]
fn ends_that_are_one_minimum() {
    let rough = |noise: f64| Outcome::Rough { noise, errors: 0.1 };
    let agreed = |ends: [(f64, Outcome); 2]| {
        let (_, starts) = ended(&ends.map(Some));
        (starts.agreed, starts.minima.len(), starts.declared)
    };
    assert_eq!(agreed([(2.0, MINIMUM), (2.0, MINIMUM)]), (2, 1, Some(0)));
    assert_eq!(agreed([(1.9, MINIMUM), (2.1, MINIMUM)]).0, 1);
    // 400 * 0.003^2 are 0.0009 of the cost.
    assert_eq!(agreed([(2.003, MINIMUM), (2.0, MINIMUM)]), (1, 2, Some(1)));
    assert_eq!(agreed([(2.003, rough(8e-4)), (2.0, MINIMUM)]), (1, 2, Some(1)));
    assert_eq!(agreed([(2.003, rough(1e-3)), (2.0, MINIMUM)]), (2, 1, Some(0)));
    assert_eq!(agreed([(2.0, rough(1e-3)), (2.003, MINIMUM)]), (2, 1, Some(0)));
    assert_eq!(agreed([(2.004, rough(1e-2)), (2.0, MINIMUM)]), (1, 2, Some(1)));
}

/// Of a minimum and its mirror image, which cost the same, that of the declared sign is the best, and without one that to which the declared start leads; a
/// lower cost of the other one decides.
#[test]
fn a_mirror_image_of_the_wrong_sign() {
    #[derive(Clone)]
    struct Square;
    impl Model for Square {
        type State = Nothing;
        type Input = Voltage;
        type Output = Current;
        type Parameters = Gain;
        const KIND: Kind = Kind::Static;
        fn output<S: Scalar>(&self, _t: S, _x: &Nothing, u: &Voltage<S>, p: &Gain<S>) -> Current<S> {
            Current { i: p.a * p.a * u.u * 0.5 }
        }
    }
    let ends = [-2.0, 2.0, -2.0, 2.1].map(|a| Some((a, MINIMUM)));
    let (best, starts) = ended_by(&Square, free(1.0).positive(), &ends);
    assert_eq!((best, starts.agreed, starts.declared), (1, 1, Some(1)));
    let gains: Vec<f64> = starts.minima.iter().map(|minimum| minimum.unknowns[0].1).collect();
    assert_eq!(gains, [2.0, -2.0, 2.1]);
    assert_eq!((starts.minima[0].cost_ratio, starts.minima[1].cost_ratio), (1.0, 1.0));
    assert_eq!(ended_by(&Square, free(1.0), &ends).0, 0);
    // A part of 3e-13 of the cost.
    let lower = [-2.0 - 1e-8, 2.0, 2.0].map(|a| Some((a, MINIMUM)));
    let (best, starts) = ended_by(&Square, free(1.0), &lower);
    assert_eq!((best, starts.agreed, starts.declared, starts.minima.len()), (0, 1, Some(0), 2));
    assert_eq!(ended_by(&Square, free(1.0).positive(), &lower).0, 1);
    assert_eq!(ended_by(&Square, free(1.0).positive(), &ends[2..]).0, 0);
}

/// A tenth of a standard deviation, and a millionth of the unknowns' effect.
#[test]
fn a_place_found_twice() {
    assert!(is_small(0.19, 2.0, 0.0) && !is_small(0.21, 2.0, 0.0));
    assert!(is_small(2.9e-6, 0.0, 3.0) && !is_small(3.1e-6, 0.0, 3.0));
    assert!(is_small(0.0, 0.0, 0.0));
}

#[test]
fn values_differ_by_more_than_their_last_digits() {
    let differ = |values: [f64; 3]| differ(values.into_iter());
    assert!(!differ([2.0, 2.0, 2.0]) && !differ([0.0; 3]) && !differ([2.0, 2.0 * (1.0 + 0.9e-6), 2.0]));
    assert!(differ([2.0, 2.0 * (1.0 + 1.1e-6), 2.0]) && differ([-1.0, 1.0, 1.0]) && differ([0.0, 0.0, 1e-300]));
}
