//! Accelerated steps, and the end of a search that is canceled.

use super::*;
use crate::optimize::point::tests::{at, linear};

/// A search at one with a trial: a residual of 6, of which the whole unknown step of 3 takes away all.
fn on_trial() -> (LevenbergMarquardt, Trial) {
    let mut search = LevenbergMarquardt::new(Stop::default(), OwnSize);
    search.begin(vec![1.0], Domain::default());
    while !matches!(search.stage, Stage::Step(_)) {
        search.tell(Ok(linear(&[(2.0, 6.0)])));
    }
    let Stage::Step(trial) = search.stage.clone() else { unreachable!() };
    (search, trial)
}

/// The acceleration is the step that the same damped slopes take for the second derivative in the place of the residual, here `r / 6`
/// of the step itself; half of it is added where it is no longer than three quarters of the step.
#[test]
fn half_the_acceleration_is_added() {
    let (search, trial) = on_trial();
    let step = trial.step[0];
    assert!(step > 0.0 && trial.x == [1.0 + step], "{trial:?}");
    for (r, part) in [(0.0, 0.0), (1.5, 0.125), (-3.0, -0.25), (4.4, 2.2 / 6.0), (4.6, 0.0), (-4.6, 0.0)] {
        let mut search = LevenbergMarquardt { stage: Stage::Accelerate(trial.clone()), ..search.clone() };
        search.tell_curvature(Some(Ok(linear(&[(2.0, r)]))));
        let Request::Linearize(x) = search.request() else { panic!("{r}") };
        assert!((x[0] - 1.0 - (1.0 + part) * step).abs() < 1e-14, "{r}: {x:?} {step}");
    }
    // Without second derivatives the step is taken as it is.
    for answer in [None, Some(Err(Infeasible::Failed(String::new())))] {
        let mut search = LevenbergMarquardt { stage: Stage::Accelerate(trial.clone()), ..search.clone() };
        let none = answer.is_none();
        search.tell_curvature(answer);
        assert!(matches!(search.request(), Request::Linearize(x) if x == trial.x));
        assert_eq!(search.curved, !none);
    }
}

/// A search that is canceled ends at the better of where it stands, with a cost of 18, and the end of its first try.
#[test]
fn the_best_point_of_a_canceled_search() {
    let (search, trial) = on_trial();
    for (cost, place) in [(17.0, 5.0), (19.0, 1.0)] {
        let first = || {
            let outcome = Outcome::IterationLimit { iterations: 7 };
            Some(Try { x: vec![5.0], cost, outcome, trials: 7, point: Some(at(5.0, linear(&[(1.0, 5.0)]))) })
        };
        let mut stepping = LevenbergMarquardt { first: first(), ..search.clone() };
        stepping.tell(Err(Infeasible::Cancelled));
        let stage = Stage::Accelerate(trial.clone());
        let mut bending = LevenbergMarquardt { first: first(), stage, ..search.clone() };
        bending.tell_curvature(Some(Err(Infeasible::Cancelled)));
        for search in [stepping, bending] {
            assert_eq!((search.outcome(), search.place()), (Some(Outcome::Cancelled), &[place][..]));
            assert!(matches!(search.request(), Request::Ended(Outcome::Cancelled)));
        }
    }
}

/// A search that creeps names the part of its cost that the next full step would take away: 18, of 18 and of 50.
#[test]
fn what_a_creeping_search_is_promised() {
    let (search, _) = on_trial();
    for (rows, part) in [(&[(2.0, 6.0)][..], 1.0), (&[(2.0, 6.0), (0.0, 8.0)], 0.36)] {
        let (mut search, point) = (search.clone(), at(1.0, linear(rows)));
        search.descent.trials = 301;
        let found = search.given_up(&point);
        let Some(Outcome::Creeping { trials, promised }) = found else { panic!("{found:?}") };
        assert!(trials == 301 && (promised - part).abs() < 1e-9, "{trials} {promised}");
    }
}

/// A search that goes on elsewhere stays within the bounds given there, from the slopes where it stands.
#[test]
fn a_resumed_search_knows_its_bounds() {
    let (mut search, trial) = on_trial();
    let bound = 1.0 + 0.5 * trial.step[0];
    search.resume(Domain { bounds: vec![(0.0, bound)], ..Domain::default() });
    assert!(search.linearization().is_none());
    assert!(matches!(search.request(), Request::Linearize([1.0])));
    search.tell(Ok(linear(&[(2.0, 6.0)])));
    let Request::Linearize(x) = search.request() else { panic!() };
    assert_eq!(x, [bound]);
}
