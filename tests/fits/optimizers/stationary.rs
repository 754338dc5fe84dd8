//! Where a search ends, it says so: converged at minima, and nowhere else.

use super::problems::{D, PROBLEMS, Problem};
use super::{Ended, levenberg_marquardt, run};
use greybox::optimize::{Infeasible, LeastSquares, LevenbergMarquardt, Linearization, Machine, Outcome};
use greybox::{Scalar, optimize::OwnSize};

type Residuals = fn(&[D]) -> Vec<D>;
type Start = &'static [f64];

/// A problem whose data have this norm.
struct Said<'p> {
    problem: &'p Problem,
    norm: f64,
}

impl LeastSquares for Said<'_> {
    fn linearize(&self, x: &[f64]) -> Result<Linearization, Infeasible> {
        Ok(self.problem.linearize(x)?.with_data_norm(self.norm))
    }
}

fn search(problem: &Problem, norm: f64) -> Outcome {
    run(&Said { problem, norm }, problem.start, LevenbergMarquardt::default(), LevenbergMarquardt::outcome)
        .outcome
        .expect("an outcome")
}

const fn problem(start: Start, residuals: Residuals) -> Problem {
    Problem { name: "", start, residuals, minima: &[], minimizer: None, bounds: &[] }
}

/// An error of 2 that rises with `steepness`, and jumps by one as often as it has risen by one.
fn saw(x: D, steepness: f64) -> Vec<D> {
    let part = ((x.value() - 1.0) * steepness).rem_euclid(1.0);
    vec![(x - x.value()) * steepness + (2.0 + part)]
}

/// At the foot of a tooth each step leads up. The full step is 2e-13 of the unknown, and the slope is not zero.
#[test]
fn a_small_step_alone_is_no_minimum() {
    let outcome = search(&problem(&[1.0], |x| saw(x[0], 1e13)), 2.0);
    // The next step would be as long as the error: one standard error of the unknown.
    let Outcome::Rough { errors, .. } = outcome else { panic!("{outcome}") };
    assert!((errors - 1.0).abs() < 1e-12 && !outcome.converged(), "{outcome}");
}

/// The unknown's rounding moves the prediction by 22 where the error is 2, as large as the data.
#[test]
fn an_error_as_large_as_the_data_is_not_exact() {
    let outcome = search(&problem(&[1.0], |x| saw(x[0], 1e17)), 2.0);
    assert!(matches!(outcome, Outcome::Stalled { .. }), "{outcome}");
}

#[test]
fn a_stop_by_the_cost_that_was_not_asked_for_never_comes() {
    for problem in PROBLEMS {
        let ended = levenberg_marquardt(problem, problem.start, OwnSize);
        let outcome = ended.outcome.expect("an outcome");
        assert!(!matches!(outcome, Outcome::CostUnchanged { .. }), "{}: {outcome}", problem.name);
    }
}

/// BoxBOD of NIST's Statistical Reference Datasets: a large second parameter loses its influence.
fn oxygen(x: &[D]) -> Vec<D> {
    let data = [(1.0, 109.0), (2.0, 149.0), (3.0, 149.0), (5.0, 191.0), (7.0, 213.0), (10.0, 224.0)];
    data.iter().map(|(t, y)| x[0] * (-(-x[1] * *t).exp() + 1.0) - *y).collect()
}

/// Rat43 of the same: a sigmoid, whose third and fourth parameter lose their influence far out.
fn onions(x: &[D]) -> Vec<D> {
    let weights = [
        16.08, 33.83, 65.8, 97.2, 191.55, 326.2, 386.87, 520.53, 590.03, 651.92, 724.93, 699.56, 689.96, 637.56, 717.41,
    ];
    let at = |t: usize| x[0] / ((x[1] - x[2] * (t + 1) as f64).exp() + 1.0).pow(x[3].recip());
    weights.iter().enumerate().map(|(t, y)| at(t) - *y).collect()
}

/// From these starts the first edition converged on plateaus, with a standard deviation of 130 for 26.
#[test]
fn a_plateau_is_left_or_not_called_a_minimum() {
    let (oxygen, onions) = (oxygen as Residuals, onions as Residuals);
    // The certified sums of squares.
    let (least, smallest) = (1_168.008_876_555_5, 8_786.404_907_963_1);
    let starts: [(Residuals, f64, Start); 7] = [
        (oxygen, least, &[1.0, 10.0]),
        (oxygen, least, &[1e4, 5.0]),
        (oxygen, least, &[50.0, 20.0]),
        (onions, smallest, &[913.0, 49.23, 2.45, 0.4425]),
        (onions, smallest, &[337.7, 77.87, 0.5791, 3.106]),
        (onions, smallest, &[500.5, 40.8, 0.6541, 1.687]),
        (onions, smallest, &[130.0, 65.9, 0.2293, 3.643]),
    ];
    let mut right = 0;
    for (residuals, minimum, start) in starts {
        let Ended { sum_of_squares, outcome, .. } = levenberg_marquardt(&problem(start, residuals), start, OwnSize);
        let outcome = outcome.expect("an outcome");
        // Eleven digits are certified, and the cost is twice as exact as the unknowns.
        let best = (sum_of_squares / minimum - 1.0).abs() < 1e-9;
        println!("{start:?}: {sum_of_squares} {outcome}");
        right += u32::from(best);
        assert!(best || !outcome.converged(), "{start:?}: {sum_of_squares}, {outcome}");
    }
    assert!(right >= 5, "{right} of 7 right");
}

/// J. E. Dennis, R. B. Schnabel, *Numerical Methods for Unconstrained Optimization* (1983), example 10.2.4: full steps lead
/// away from the minimum at zero where the factor is below minus one.
#[test]
fn a_minimum_that_full_steps_lead_away_from_is_found_in_tens_of_trials() {
    let starts: [(Start, Residuals); 3] = [
        (&[1.0], |x| vec![x[0] + 1.0, x[0] * x[0] * -5.0 + x[0] - 1.0]),
        (&[1.0], |x| vec![x[0] + 1.0, x[0] * x[0] * -30.0 + x[0] - 1.0]),
        (&[0.3], |x| vec![x[0] + 1.0, x[0] * x[0] * -300.0 + x[0] - 1.0]),
    ];
    for (start, residuals) in starts {
        let problem = problem(start, residuals);
        let ended = levenberg_marquardt(&problem, start, OwnSize);
        let outcome = ended.outcome.expect("an outcome");
        assert!(outcome.converged() && ended.evaluations < 60, "{outcome} after {}", ended.evaluations);
    }
}
