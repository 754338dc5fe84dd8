//! The list of More, Garbow and Hillstrom from its usual starts, and from ten and a hundred times as far.

use super::problems::{PROBLEMS, Problem};
use greybox::optimize::{Domain, LeastSquares, LevenbergMarquardt, Machine, Outcome, Request};

/// Sum of squares, how the search ended, and its evaluations, a second derivative counted as one more.
fn search(problem: &Problem, start: Vec<f64>) -> (f64, Outcome, u64) {
    let mut search: LevenbergMarquardt = LevenbergMarquardt::default();
    let mut evaluations = 0;
    search.begin(start, Domain::of(problem));
    loop {
        match search.request() {
            Request::Linearize(x) => search.tell(problem.linearize(x)),
            Request::Curvature { x, along } => search.tell_curvature(problem.curvature(x, along)),
            Request::Ended(outcome) => {
                let squares = search.linearization().map_or(f64::INFINITY, |linear| 2.0 * linear.cost);
                return (squares, outcome, evaluations);
            }
        }
        evaluations += 1;
    }
}

/// 42 of 51, and a fifth of the evaluations that the first edition took for 35: 53,000.
#[test]
fn most_far_starts_end_in_the_global_minimum() {
    let (mut right, mut evaluations) = (0, 0);
    for problem in PROBLEMS {
        for factor in [1.0, 10.0, 100.0] {
            let start = problem.start.iter().map(|x| factor * x).collect();
            let (squares, outcome, count) = search(problem, start);
            let best = squares <= problem.minima[0] * (1.0 + 1e-4) + 1e-12;
            right += u32::from(best);
            evaluations += count;
            println!("{:<24} x{factor:<4} {best:5} {squares:12.5e} {count:5} {outcome}", problem.name);
        }
    }
    println!("{right} right, {evaluations} evaluations");
    assert!(right >= 42, "{right} of 51 right");
    assert!(evaluations <= 10_600, "{evaluations} evaluations");
}
