//! Bounds: active at the solution, at the start, in a corner, and hit on the way.

use super::problems::{D, PROBLEMS, Problem};
use super::{gauss_newton, levenberg_marquardt};
use argmin::core::{Executor, State};
use greybox::optimize::LevenbergMarquardt;
use greybox::optimize::OwnSize;

const FREE: (f64, f64) = (f64::NEG_INFINITY, f64::INFINITY);

/// Both solvers end converged at this point, inside the bounds.
fn both_reach(problem: &Problem, expected: &[f64], tolerance: f64) {
    let ends = [levenberg_marquardt(problem, problem.start, OwnSize), gauss_newton(problem, problem.start)];
    for ended in ends {
        let outcome = ended.outcome.expect("an outcome");
        println!("{}: {:?} after {} evaluations, {outcome}", problem.name, ended.x, ended.evaluations);
        assert!(outcome.converged(), "{}: {outcome}", problem.name);
        for (i, (found, expected)) in ended.x.iter().zip(expected).enumerate() {
            assert!((found - expected).abs() <= tolerance, "{}: x[{i}] = {found}, not {expected}", problem.name);
            let (lower, upper) = problem.bounds[i];
            assert!((lower..=upper).contains(found), "{}: x[{i}] = {found} is out of bounds", problem.name);
        }
    }
}

const ROSENBROCK: fn(&[D]) -> Vec<D> = |x| vec![(x[1] - x[0] * x[0]) * 10.0, -x[0] + 1.0];
/// `(x0 - 3)^2 + (x1 + 2)^2 + (x0 + x1)^2`: without bounds the minimum is at (7/3, -4/3).
const COUPLED: fn(&[D]) -> Vec<D> = |x| vec![x[0] - 3.0, x[1] + 2.0, x[0] + x[1]];

const fn bounded(
    name: &'static str,
    start: &'static [f64],
    residuals: fn(&[D]) -> Vec<D>,
    bounds: &'static [(f64, f64)],
) -> Problem {
    Problem { name, start, residuals, minima: &[], minimizer: None, bounds }
}

#[test]
fn a_bound_is_active_at_the_solution() {
    // With x0 = 1/2 the rest is solved by x1 = 1/4.
    let bounds = &[(f64::NEG_INFINITY, 0.5), FREE];
    both_reach(&bounded("Rosenbrock, x0 <= 1/2", &[-1.2, 1.0], ROSENBROCK, bounds), &[0.5, 0.25], 1e-9);
}

#[test]
fn a_bound_is_left_again() {
    // It starts on the bound that the solution is away from.
    let bounds = &[(-1.2, f64::INFINITY), (f64::NEG_INFINITY, 1.0)];
    both_reach(&bounded("Rosenbrock from its corner", &[-1.2, 1.0], ROSENBROCK, bounds), &[1.0, 1.0], 1e-9);
}

#[test]
fn the_solution_is_in_a_corner() {
    // Both slopes point outwards at (1, 0): 2 (1 - 3) + 2 (1 + 0) < 0 and 2 (0 + 2) + 2 (1 + 0) > 0.
    let bounds = &[(-1.0, 1.0), (0.0, 5.0)];
    both_reach(&bounded("coupled, corner", &[-1.0, 5.0], COUPLED, bounds), &[1.0, 0.0], 0.0);
    both_reach(&bounded("coupled, from the corner", &[1.0, 0.0], COUPLED, bounds), &[1.0, 0.0], 0.0);
}

#[test]
fn the_others_are_minimized_again_where_one_is_put_on_its_bound() {
    // x1 >= -1 is active; on it, x0 = (3 + 1) / 2. A step merely cut would go to x0 = 7/3 first.
    let problem = bounded("coupled, edge", &[0.0, 5.0], COUPLED, &[FREE, (-1.0, f64::INFINITY)]);
    both_reach(&problem, &[2.0, -1.0], 1e-9);
    // Linear: one full step does it, and one more look sees that it did.
    assert!(gauss_newton(&problem, problem.start).evaluations <= 3);
}

#[test]
fn problems_of_the_list_stay_in_their_bounds_all_the_way() {
    for problem in PROBLEMS {
        let Some(minimizer) = problem.minimizer else { continue };
        let bounds: Vec<(f64, f64)> =
            problem.start.iter().zip(minimizer).map(|(a, b): (&f64, &f64)| (a.min(*b), a.max(*b))).collect();
        let boxed = Problem { bounds: bounds.leak(), ..*problem };
        let mut solver = LevenbergMarquardt::default();
        let mut x = boxed.start.to_vec();
        for _ in 0..300 {
            solver.stop.iterations = 1;
            let configure = |state: greybox::optimize::LeastSquaresState| state.param(x.clone());
            let result =
                Executor::new(&boxed, solver.clone()).configure(configure).ctrlc(false).run().expect("a start");
            x = result.state().get_param().expect("a point").clone();
            solver = result.solver().clone();
            for (x, (lower, upper)) in x.iter().zip(boxed.bounds) {
                assert!((*lower..=*upper).contains(x), "{}: {x} is not in {lower}..={upper}", problem.name);
            }
        }
    }
}
