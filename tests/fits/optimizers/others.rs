//! Argmin's own solvers on the same problems: simplex, quasi-Newton, particle swarm.

use super::problems::{PROBLEMS, Problem};
use argmin::core::{CostFunction, Error, Executor, Gradient};
use argmin::solver::linesearch::MoreThuenteLineSearch;
use argmin::solver::neldermead::NelderMead;
use argmin::solver::particleswarm::ParticleSwarm;
use argmin::solver::quasinewton::LBFGS;
use greybox::optimize::LeastSquares;
use rand::SeedableRng;

struct Other<'a>(&'a Problem);

impl CostFunction for Other<'_> {
    type Param = Vec<f64>;
    type Output = f64;

    fn cost(&self, x: &Vec<f64>) -> Result<f64, Error> {
        Ok(self.0.linearize(x).map_or(f64::INFINITY, |linear| linear.cost))
    }
}

impl Gradient for Other<'_> {
    type Param = Vec<f64>;
    type Gradient = Vec<f64>;

    fn gradient(&self, x: &Vec<f64>) -> Result<Vec<f64>, Error> {
        Ok(self.0.linearize(x)?.gradient())
    }
}

fn of(number: &str) -> &'static Problem {
    PROBLEMS.iter().find(|problem| problem.name.split(' ').next() == Some(number)).expect("a problem of the list")
}

/// The sum of squares is that of the global minimum to this part of the one at the start.
fn reached(problem: &Problem, cost: f64, part: f64) {
    let start = 2.0 * problem.linearize(problem.start).expect("the start").cost;
    println!("{}: {:e}", problem.name, 2.0 * cost);
    assert!((2.0 * cost - problem.minima[0]).abs() <= part * start, "{}: {:e}", problem.name, 2.0 * cost);
}

#[test]
fn nelder_mead() {
    for number in ["1", "5", "7", "8", "9", "13", "16"] {
        let problem = of(number);
        let corner = |i: usize| {
            let mut x = problem.start.to_vec();
            x[i] += 0.1 * x[i].abs().max(1.0);
            x
        };
        let simplex = (0..problem.start.len()).map(corner).chain([problem.start.to_vec()]).collect();
        let solver = NelderMead::new(simplex).with_sd_tolerance(1e-14).expect("a tolerance");
        let executor = Executor::new(Other(problem), solver).configure(|state| state.max_iters(5000)).ctrlc(false);
        reached(problem, executor.run().expect("a search").state().get_best_cost(), 1e-8);
    }
}

#[test]
fn l_bfgs() {
    for number in ["1", "5", "7", "8", "9", "13", "14", "16"] {
        let problem = of(number);
        let solver = LBFGS::new(MoreThuenteLineSearch::new(), 7);
        let configure =
            |state: argmin::core::IterState<_, _, _, _, _, _>| state.param(problem.start.to_vec()).max_iters(2000);
        let result = Executor::new(Other(problem), solver).configure(configure).ctrlc(false).run().expect("a search");
        reached(problem, result.state().get_best_cost(), 1e-8);
    }
}

#[test]
fn particle_swarm_finds_the_better_of_two_minima() {
    // From the usual start the methods with slopes end in the other minimum of Freudenstein and Roth.
    let problem = of("2");
    let bounds = (vec![-10.0, -10.0], vec![20.0, 10.0]);
    let solver = ParticleSwarm::new(bounds, 40).with_rng_generator(rand::rngs::StdRng::seed_from_u64(1));
    let executor = Executor::new(Other(problem), solver).configure(|state| state.max_iters(500)).ctrlc(false);
    reached(problem, executor.run().expect("a search").state().get_best_cost(), 1e-8);
}
