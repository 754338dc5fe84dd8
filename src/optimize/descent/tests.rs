//! Damping, lengths and ends of a descent, by hand.

use super::*;
use crate::optimize::machine::{Machine, Request};
use crate::optimize::point::tests::{at, linear};
use crate::optimize::{Domain, LevenbergMarquardt, Outcome};

fn descent() -> Descent {
    Descent { lambda: 1.0, ..Descent::new(Reach { first: 1.0, later: 10.0 }) }
}

/// Residuals 3 and 4: the cost 12.5 would fall by 4.5 with a step of 3.
fn here() -> Point {
    at(0.0, linear(&[(1.0, 3.0), (0.0, 4.0)]))
}

fn trial(resolved: bool) -> Trial {
    Trial { x: vec![3.0], step: vec![3.0], damping: vec![0.0], length: 3.0, predicted: 4.5, resolved }
}

/// A point of another cost with this first residual, of slope one.
fn there(cost: f64, residual: f64) -> Point {
    at(3.0, linear(&[(1.0, residual), (0.0, (2.0 * cost - residual * residual).sqrt())]))
}

/// The damping falls to a part after a good first step, to a tenth of that part after the next, and otherwise by Nielsen's
/// `1 - (2 g - 1)^3` for the part `g` of the predicted decrease, which is at most two.
#[test]
fn the_damping_follows_the_gain() {
    let damped = |gains: &[f64]| {
        let mut descent = descent();
        for gain in gains {
            assert!(descent.judge(&here(), &trial(true), Some(&there(12.5 - 4.5 * gain, 0.1))));
        }
        descent.lambda()
    };
    let cases: [(&[f64], f64); 8] = [
        (&[1.0], FIRST_FALL),
        (&[0.91], FIRST_FALL),
        (&[0.89], 1.0 - 0.78f64.powi(3)),
        (&[1.0, 1.0], FIRST_FALL * 0.1 * FIRST_FALL),
        (&[0.5], 1.0),
        (&[0.5, 1.0], 0.1),
        (&[0.75], 0.875),
        (&[2e-4], 1.0 + (1.0f64 - 4e-4).powi(3)),
    ];
    for (gains, expected) in cases {
        assert!((damped(gains) / expected - 1.0).abs() < 1e-10, "{gains:?} {}", damped(gains));
    }
}

/// A rejected step is followed by one of a quarter of its length; how far it was off the prediction is the noise of the cost,
/// which decays by an eighth. Eight that come no nearer to the prediction than the longer ones before show that slopes are
/// not those of the cost; a trial without a cost shows nothing.
#[test]
fn rejected_steps() {
    let mut descent = descent();
    let mut reject = |gain: Option<f64>| {
        let next = gain.map(|gain| there(12.5 - 4.5 * gain, 0.1));
        assert!(!descent.judge(&here(), &trial(true), next.as_ref()));
        assert_eq!((descent.longest, descent.fall, descent.lambda), (Longest::Length(0.75), 0.1, 1.0));
        (descent.failed, descent.noise, descent.is_rough())
    };
    assert_eq!(reject(None), (1, 0.0, false));
    assert_eq!(reject(None), (2, 0.0, false));
    let (failed, noise, _) = reject(Some(-1.0));
    assert!(failed == 0 && (noise - 2.0 * 0.36).abs() < 1e-10, "{noise}");
    // Seven tenths of the error before: a smooth cost.
    let (_, noise, _) = reject(Some(-0.39));
    assert!((noise - 1.39 * 0.36).abs() < 1e-10, "{noise}");
    for count in 1..=8 {
        assert_eq!(reject(Some(0.0)).2, count == 8, "{count}");
    }
    assert!(descent.judge(&here(), &trial(true), Some(&there(8.0, 0.1))) && !descent.is_rough());
    assert_eq!((descent.noise, descent.longest), (0.0, Longest::Later));
}

/// Where the change of cost is rounding, slopes decide: nine at the start, the square of the residual after the step.
#[test]
fn slopes_decide_where_the_cost_does_not() {
    let gain = |cost: f64, residual: f64| descent().gain_by_slope(&here(), &trial(false), &there(cost, residual));
    assert_eq!([gain(12.5, 1.49), gain(12.5, 1.51), gain(12.5, 2.99), gain(12.5, 3.01)], [1.0, GOOD, GOOD, 0.0]);
    assert_eq!([gain(12.5 * (1.0 + 5e-11), 1.0), gain(12.5 * (1.0 + 2e-10), 1.0)], [1.0, 0.0]);
    // Nine tenths are not yet a good step: the damping falls by Nielsen's rule.
    let mut descent = descent();
    assert!(descent.judge(&here(), &trial(false), Some(&there(12.5, 2.0))));
    assert!((descent.lambda() - (1.0 - 0.8f64.powi(3))).abs() < 1e-12, "{}", descent.lambda());
}

/// Where the cost resolves nothing, five rejected steps are enough, and sixty of any kind.
#[test]
fn trials_that_resolve_nothing_end() {
    let seen = Seen::new(&[6.0], &[None]);
    let near = || at(6.0, linear(&[(1.0, 1e-7), (0.0, 4.0)]));
    let goes_on = |descent: &Descent| descent.clone().propose(&near(), &[1.0], &seen).is_some();
    let mut rejected = descent();
    for count in 1..=5 {
        assert!(!rejected.judge(&here(), &trial(false), Some(&there(13.0, 1.0))));
        assert_eq!(goes_on(&rejected), count < 5);
    }
    let mut accepted = descent();
    for count in 1..=60 {
        assert!(accepted.judge(&here(), &trial(false), Some(&there(12.5, 1.0))));
        assert_eq!(goes_on(&accepted), count < 60);
    }
    assert!(accepted.judge(&here(), &trial(true), Some(&there(8.0, 1.0))) && goes_on(&accepted));
}

/// Steps in a row that each lower the cost by less than a tenth.
#[test]
fn twenty_short_steps_are_slow() {
    let mut descent = descent();
    let short = |descent: &mut Descent| descent.judge(&here(), &trial(true), Some(&there(12.5 - 1.2, 0.1)));
    for count in 1..=20 {
        assert!(short(&mut descent));
        assert_eq!(descent.is_slow(&trial(true)), count == 20);
    }
    assert!(!descent.is_slow(&trial(false)));
    assert!(descent.judge(&here(), &trial(true), Some(&there(12.5 - 1.3, 0.1))) && !descent.is_slow(&trial(true)));
}

/// A search creeps after more than 300 trials that neither lower the cost by a hundredth nor the promised decrease to a tenth.
#[test]
fn many_trials_without_progress_creep() {
    let mut descent = descent();
    assert!(!descent.creeps(&here()));
    descent.trials = 300;
    assert!(!descent.creeps(&there(12.5 * 0.991, 3.0)));
    descent.trials = 301;
    let mut lower = descent.clone();
    assert!(descent.creeps(&there(12.5 * 0.991, 3.0)) && !lower.creeps(&there(12.5 * 0.989, 3.0)));
    // Residuals of 3 and of 0.9 promise 4.5 and 0.405.
    assert!(descent.creeps(&there(12.5, 1.0)) && !descent.creeps(&there(12.5, 0.9)));
}

/// Damped by `l`, the step of a residual of 3 is `3 / (1 + l)`: it is as long as allowed, to a tenth.
#[test]
fn steps_of_limited_length() {
    for longest in [1e-3, 0.1, 1.0, 2.7] {
        let (lambda, step) = limited(&here(), &[1.0], 0.0, longest).unwrap();
        assert!((step[0].abs() / longest - 1.0).abs() <= 0.1, "{step:?}");
        assert!((step[0].abs() * (1.0 + lambda) - 3.0).abs() < 1e-12, "{lambda} {step:?}");
    }
    // Within a tenth of the length, and more damped than that already.
    let of = |lambda: f64, longest: f64| limited(&here(), &[1.0], lambda, longest).unwrap().0;
    assert_eq!([of(0.0, 2.8), of(0.5, 2.0), of(2.0, 1.0)], [0.0, 0.5, 2.0]);
}

/// Each trial finds a thousandth less of a slope whose decrease the cost does not resolve: a search goes on with it for sixty trials, and
/// for five where the rounding of data of norm 1e9 has slopes as large.
#[test]
fn slopes_of_rounding_end_a_search() {
    let trials = |norm: f64| {
        let mut search = LevenbergMarquardt::default();
        search.begin(vec![6.0], Domain::default());
        let (mut residual, mut evaluations) = (1e-6, 0);
        while let Request::Linearize(_) = search.request() {
            search.tell(Ok(linear(&[(1.0, residual), (0.0, 4.0)]).with_data_norm(norm)));
            (residual, evaluations) = (0.999 * residual, evaluations + 1);
        }
        assert!(matches!(search.outcome(), Some(Outcome::LimitOfPrecision { .. })), "{:?}", search.outcome());
        evaluations - 1
    };
    assert_eq!([trials(1e8), trials(1e9)], [60, 5]);
}
