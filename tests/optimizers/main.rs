//! Every optimizer on every problem of a list: it reaches a known minimum, or says that it did not converge.

mod bounds;
mod others;
mod problems;

use argmin::core::{Executor, Solver, State};
use greybox::optimize::{GaussNewton, LeastSquaresState, LevenbergMarquardt, Outcome, Stop};
use greybox::{JacobianColumns, Nominal, Scaling, Unscaled};
use problems::{PROBLEMS, Problem};

/// Where a search ended: point, sum of squares, outcome, evaluations.
struct Ended {
    x: Vec<f64>,
    sum_of_squares: f64,
    outcome: Option<Outcome>,
    evaluations: u64,
}

fn run<O>(problem: &Problem, start: &[f64], solver: O, outcome: fn(&O) -> Option<Outcome>) -> Ended
where
    O: for<'p> Solver<&'p Problem, LeastSquaresState>,
{
    let configure = |state: LeastSquaresState| state.param(start.to_vec()).counting(true);
    let result =
        Executor::new(problem, solver).configure(configure).ctrlc(false).run().expect("a start that evaluates");
    let state = result.state();
    Ended {
        x: state.get_param().expect("a point").clone(),
        sum_of_squares: 2.0 * state.get_cost(),
        outcome: outcome(result.solver()),
        evaluations: state.get_func_counts()["linearization_count"],
    }
}

fn levenberg_marquardt(problem: &Problem, start: &[f64], scaling: impl Scaling) -> Ended {
    run(problem, start, LevenbergMarquardt::new(Stop::default(), scaling), LevenbergMarquardt::outcome)
}

fn gauss_newton(problem: &Problem, start: &[f64]) -> Ended {
    run(problem, start, GaussNewton::default(), GaussNewton::outcome)
}

/// That a search that says it converged is at one of the minima; whether it is at the global one.
fn check(optimizer: &str, problem: &Problem, ended: &Ended) -> bool {
    let Ended { x, sum_of_squares, outcome, evaluations } = ended;
    let name = problem.name;
    // The minima are printed with six digits or more; those at zero are reached to rounding.
    let at = |minimum: f64| (sum_of_squares - minimum).abs() <= 1e-5 * minimum + 1e-18;
    let minimum = problem.minima.iter().position(|&minimum| at(minimum));
    let said = outcome.map_or("no outcome".to_owned(), |outcome| outcome.to_string());
    println!("{optimizer:<22} {name:<24} {sum_of_squares:<12.6e} {evaluations:>5} {minimum:?} {said}");
    let converged = outcome.is_some_and(|outcome| outcome.converged());
    if !converged {
        return false;
    }
    assert!(minimum.is_some(), "{optimizer} on {name}: {sum_of_squares:e} at {x:?} is called {said}");
    if let (Some(minimizer), Some(0)) = (problem.minimizer, minimum) {
        for (i, (found, known)) in x.iter().zip(minimizer).enumerate() {
            let swapped = name.contains("Osborne 1") || name.contains("Jennrich");
            assert!(
                (found - known).abs() <= 2e-5 * known.abs() + 1e-6 || swapped && sum_of_squares.is_finite(),
                "{optimizer} on {name}: x[{i}] = {found}, known is {known}"
            );
        }
    }
    minimum == Some(0)
}

#[test]
fn the_default_solves_every_problem() {
    for problem in PROBLEMS {
        let solved =
            check("LM, Jacobian columns", problem, &levenberg_marquardt(problem, problem.start, JacobianColumns));
        println!("   {solved}");
    }
}

#[test]
fn every_scaling_is_honest() {
    for problem in PROBLEMS {
        check("LM, unscaled", problem, &levenberg_marquardt(problem, problem.start, Unscaled));
        check("LM, nominal", problem, &levenberg_marquardt(problem, problem.start, Nominal::default()));
    }
}

#[test]
fn gauss_newton_is_honest() {
    for problem in PROBLEMS {
        check("Gauss-Newton", problem, &gauss_newton(problem, problem.start));
    }
}
