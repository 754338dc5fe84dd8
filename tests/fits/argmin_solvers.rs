#![cfg(feature = "std")]
//! The fit as a problem of argmin's own solvers, and what its executor brings: observers, checkpoints, limits.

use crate::common::*;
use argmin::core::observers::{Observe, ObserverMode};
use argmin::core::{CostFunction, Executor, KV, State};
use argmin::solver::linesearch::MoreThuenteLineSearch;
use argmin::solver::neldermead::NelderMead;
use argmin::solver::particleswarm::ParticleSwarm;
use argmin::solver::quasinewton::LBFGS;
use greybox::optimize::{GaussNewton, LeastSquares, LeastSquaresState, LevenbergMarquardt, Outcome, Stop};
use greybox::optimize::{JacobianColumns, Nominal, Unscaled};
use greybox::*;
use rand::SeedableRng;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

const SIGMA: Current = Current { i: 0.1 };

fn record(seed: u64) -> ExperimentOf<Lag> {
    let inputs = levels(200, 12, 7).into_iter().map(|u| Voltage { u }).collect();
    let record = simulated(&Lag, 5e-3, inputs, Current { i: 0.5 }, Branch { gain: 2.0, tau: 0.05 });
    noisy(&Lag, &record, SIGMA, &mut Noise(seed))
}

fn fit(record: &ExperimentOf<Lag>) -> Fit<'_, Lag> {
    Fit::new(&Lag, record).parameters(Branch { gain: free(1.0), tau: free(0.1).log() }).noise(SIGMA)
}

#[test]
fn nelder_mead_and_lbfgs_find_the_minimum() {
    let record = record(1);
    // L-BFGS begins with a step as long as the gradient: noise that makes the cost of the order of one keeps it near.
    let fit = |record| fit(record).noise(Current { i: 10.0 });
    let best = fit(&record).run().unwrap();
    let problem = fit(&record).problem().unwrap();
    let objective = problem.objective().unwrap();
    let start = objective.start();
    let moved = |i: usize| {
        let mut corner = start.clone();
        corner[i] += 0.2;
        corner
    };
    let simplex = NelderMead::new(vec![start.clone(), moved(0), moved(1)]).with_sd_tolerance(1e-14).unwrap();
    let found = Executor::new(objective.clone(), simplex).configure(|state| state.max_iters(500)).run().unwrap();
    let nelder_mead = found.state().get_best_param().unwrap().clone();
    let search = LBFGS::new(MoreThuenteLineSearch::new(), 7);
    let configure = |state: argmin::core::IterState<_, _, _, _, _, _>| state.param(start.clone()).max_iters(100);
    let found = Executor::new(objective, search).configure(configure).run().unwrap();
    let lbfgs = found.state().get_best_param().unwrap().clone();
    for place in [nelder_mead, lbfgs] {
        let estimate = problem.estimate(&place).unwrap();
        assert!(estimate.outcome.converged(), "{estimate}");
        for (found, best) in estimate.unknowns.iter().zip(&best.unknowns) {
            // A cost that is flat to 1e-14 tells the place to 1e-7 of the problem's own length, the standard error.
            let error = best.knowledge.standard_error().unwrap();
            assert!((found.value - best.value).abs() < 1e-5 * error, "{estimate}");
            assert!((found.knowledge.standard_error().unwrap() / error - 1.0).abs() < 1e-5);
        }
    }
    let far = problem.estimate(&start).unwrap();
    assert!(!far.outcome.converged(), "a start is no minimum: {far}");
    assert!(problem.estimate(&start[..1]).is_err());
}

#[test]
fn a_particle_swarm_finds_the_minimum_without_a_start() {
    let record = record(1);
    let best = fit(&record).run().unwrap();
    let problem = fit(&record).problem().unwrap();
    // Coordinates: the gain, and the logarithm of the time constant, over four decades.
    let bounds = (vec![-10.0, f64::ln(1e-3)], vec![10.0, f64::ln(10.0)]);
    let swarm = ParticleSwarm::new(bounds, 40).with_rng_generator(rand::rngs::StdRng::seed_from_u64(1));
    let executor = Executor::new(problem.objective().unwrap(), swarm);
    let found = executor.configure(|state| state.max_iters(200)).ctrlc(false).run().unwrap();
    let place = &found.state().get_best_param().unwrap().position;
    let estimate = problem.estimate(place).unwrap();
    for (found, best) in estimate.unknowns.iter().zip(&best.unknowns) {
        // The swarm halves its size every few iterations: after 200 it is far smaller than the noise lets matter.
        let error = best.knowledge.standard_error().unwrap();
        assert!((found.value - best.value).abs() < 1e-3 * error, "{estimate}");
    }
}

/// Iterations and ends of searches.
#[derive(Clone, Default)]
struct Count(Arc<AtomicU64>, Arc<AtomicU64>);

impl Observe<LeastSquaresState> for Count {
    fn observe_iter(&mut self, state: &LeastSquaresState, _kv: &KV) -> Result<(), argmin::core::Error> {
        assert!(state.get_cost().is_finite());
        self.0.fetch_add(1, Ordering::Relaxed);
        Ok(())
    }

    fn observe_final(&mut self, _state: &LeastSquaresState) -> Result<(), argmin::core::Error> {
        self.1.fetch_add(1, Ordering::Relaxed);
        Ok(())
    }
}

/// The course of a search: the start, and each iteration down to the last cost.
#[test]
fn the_course_of_a_search_is_kept() {
    let (record, course) = (record(1), diagnose::Convergence::default());
    let estimate = fit(&record).observe(course.clone(), ObserverMode::Always).run().unwrap();
    let kept = course.iterations();
    let numbers: Vec<u64> = kept.iter().map(|iteration| iteration.0).collect();
    assert_eq!(numbers, (0..=estimate.iterations).collect::<Vec<u64>>());
    assert_eq!(kept[kept.len() - 1].1, estimate.cost);
    assert!(kept[0].1 > 10.0 * estimate.cost, "{} {}", kept[0].1, estimate.cost);
}

#[test]
fn observers_see_every_iteration() {
    let (record, count) = (record(1), Count::default());
    let estimate = fit(&record).observe(count.clone(), ObserverMode::Always).run().unwrap();
    assert!(estimate.iterations > 2);
    assert_eq!((count.0.load(Ordering::Relaxed), count.1.load(Ordering::Relaxed)), (estimate.iterations, 1));
}

/// The costs that an observer was shown.
struct Costs(Arc<Mutex<Vec<f64>>>);

impl Observe<LeastSquaresState> for Costs {
    fn observe_iter(&mut self, state: &LeastSquaresState, _: &KV) -> Result<(), argmin::core::Error> {
        self.0.lock().unwrap().push(state.get_cost());
        Ok(())
    }
}

/// Of searches from several starts, an observer of new best points sees the lowest cost fall to that of the estimate.
#[test]
fn observers_see_each_new_best() {
    let (record, costs) = (record(1), Arc::new(Mutex::new(vec![])));
    let estimate = fit(&record).starts(6).observe(Costs(costs.clone()), ObserverMode::NewBest).run().unwrap();
    let costs = costs.lock().unwrap();
    assert!(costs.len() > 2 && costs.windows(2).all(|pair| pair[1] < pair[0]), "{costs:?}");
    assert!((costs[costs.len() - 1] / estimate.cost - 1.0).abs() < 1e-9, "{costs:?} {}", estimate.cost);
}

/// The cost alone and that with slopes, of a record in segments with a loss; and second derivatives with the slopes of the errors and
/// of a prior.
#[test]
fn costs_and_slopes_are_of_one_problem() {
    let inputs = levels(2_000, 12, 7).into_iter().map(|u| Voltage { u }).collect();
    let exact = simulated(&Lag, 5e-3, inputs, Current { i: 0.5 }, Branch { gain: 2.0, tau: 0.05 });
    let record = noisy(&Lag, &exact, SIGMA, &mut Noise(3));
    let tau = free(0.1).within(0.01, 1.0);
    let fit = Fit::new(&Lag, &record).parameters(Branch { gain: free(1.0).prior(3.0, 1e-3), tau });
    let problem = fit.noise(SIGMA).loss(Huber::default()).problem().unwrap();
    let objective = problem.objective().unwrap();
    let start = objective.start();
    let linear = objective.linearize(&start).unwrap();
    assert!((objective.cost(&start).unwrap() / linear.cost - 1.0).abs() < 1e-12);
    let costs = [0.009, 0.01, 1.0, 1.1].map(|tau| objective.cost(&vec![1.0, tau]).unwrap());
    assert_eq!(costs.map(f64::is_finite), [false, true, true, false], "in the bounds: {costs:?}");
    let second = objective.curvature(&start, &[0.1, 0.0]).unwrap().unwrap();
    for (second, first) in second.column_norms().iter().zip(linear.column_norms()) {
        assert!((second / first - 1.0).abs() < 1e-12, "{second} {first}");
    }
}

fn place(name: &str) -> PathBuf {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_file(&path);
    path
}

#[test]
fn a_checkpoint_goes_on() {
    let (record, other, path) = (record(1), record(2), place("goes_on.json"));
    let whole = fit(&record).run().unwrap();
    let short = Stop { iterations: 3, ..Stop::default() };
    let cut = fit(&record).optimizer(LevenbergMarquardt::new(short, JacobianColumns)).checkpoint(&path, 1);
    let cut = cut.run().unwrap();
    assert_eq!(cut.outcome, Outcome::IterationLimit { iterations: 3 });
    assert!(!cut.outcome.converged());
    let resumed = fit(&record).checkpoint(&path, 1).run().unwrap();
    assert!(resumed.outcome.converged(), "{resumed}");
    assert!(resumed.iterations > 3, "those before count: {}", resumed.iterations);
    // Three trial steps need not be taken again.
    assert!(resumed.evaluations < whole.evaluations, "{} {}", resumed.evaluations, whole.evaluations);
    let error = whole.unknowns[0].knowledge.standard_error().unwrap();
    assert!((resumed.parameters.gain - whole.parameters.gain).abs() < 1e-6 * error);
    // A finished search looks again before it says so.
    let again = fit(&record).checkpoint(&path, 1).run().unwrap();
    assert!(again.outcome.converged() && again.evaluations > 0 && again.iterations >= resumed.iterations, "{again}");
    assert!((again.parameters.gain - whole.parameters.gain).abs() < 1e-6 * error);
    // Another search begins at the point that was reached.
    let other_search = fit(&record).optimizer(GaussNewton::default()).checkpoint(&path, 1).run().unwrap();
    assert!(other_search.outcome.converged() && other_search.iterations >= again.iterations, "{other_search}");
    assert!(other_search.evaluations <= 2, "it begins at the minimum: {}", other_search.evaluations);
    let refused = fit(&other).checkpoint(&path, 1).run().unwrap_err().to_string();
    assert!(refused.contains("another problem"), "{refused}");
    std::fs::write(&path, "{}").unwrap();
    let refused = fit(&record).checkpoint(&path, 1).run().unwrap_err().to_string();
    assert!(refused.contains("delete it"), "{refused}");
}

/// Takes a file away, and counts how often it was there.
struct Take(PathBuf, Arc<AtomicU64>);

impl Observe<LeastSquaresState> for Take {
    fn observe_iter(&mut self, _: &LeastSquaresState, _: &KV) -> Result<(), argmin::core::Error> {
        self.1.fetch_add(u64::from(std::fs::remove_file(&self.0).is_ok()), Ordering::Relaxed);
        Ok(())
    }
}

/// A checkpoint is there while the search goes on; it belongs to all records, also those beyond the eight that are simulated to tell
/// problems apart.
#[test]
fn a_checkpoint_is_written_on_the_way() {
    let (path, seen) = (place("on_the_way.json"), Arc::new(AtomicU64::new(0)));
    let records: Vec<ExperimentOf<Lag>> = (0..9).map(|k| record(k).named(format!("{k}"))).collect();
    let others: Vec<ExperimentOf<Lag>> = records.iter().take(8).cloned().chain([record(100).named("8")]).collect();
    let fit =
        |records| Fit::new(&Lag, records).parameters(Branch { gain: free(1.0), tau: free(0.1).log() }).noise(SIGMA);
    let take = Take(path.clone(), seen.clone());
    let estimate = fit(&records).checkpoint(&path, 1).observe(take, ObserverMode::Always).run().unwrap();
    assert!(seen.load(Ordering::Relaxed) + 1 >= estimate.iterations && estimate.iterations > 2, "{seen:?} {estimate}");
    let refused = fit(&others).checkpoint(&path, 1).run().unwrap_err().to_string();
    assert!(refused.contains("another problem"), "{refused}");
    // Every thousandth iteration: the first one, and at the end.
    let (path, seen) = (place("at_the_end.json"), Arc::new(AtomicU64::new(0)));
    let take = Take(path.clone(), seen.clone());
    let estimate = fit(&others).checkpoint(&path, 1000).observe(take, ObserverMode::Always).run().unwrap();
    assert!(path.exists() && seen.load(Ordering::Relaxed) <= 1 && estimate.iterations > 2, "{seen:?} {estimate}");
    assert_eq!(estimate.method.optimizer, "Levenberg-Marquardt");
}

/// Puts a folder where a file is to be written.
struct Obstruct(PathBuf);

impl Observe<LeastSquaresState> for Obstruct {
    fn observe_iter(&mut self, _: &LeastSquaresState, _: &KV) -> Result<(), argmin::core::Error> {
        let _ = std::fs::remove_file(&self.0);
        let _ = std::fs::create_dir_all(self.0.join("folder"));
        Ok(())
    }
}

/// A search goes on without its checkpoint, and says so; from one start and from several.
#[test]
fn a_checkpoint_that_cannot_be_written_later_is_a_warning() {
    for starts in [1, 4] {
        let path = place(&format!("obstructed_{starts}.json"));
        let _ = std::fs::remove_dir_all(&path);
        let record = record(1);
        let fit =
            fit(&record).starts(starts).checkpoint(&path, 1).observe(Obstruct(path.clone()), ObserverMode::Always);
        let estimate = fit.run().unwrap();
        std::fs::remove_dir_all(&path).unwrap();
        let warned = estimate.warnings.iter().any(|one| one.code == WarningCode::CheckpointNotWritten);
        assert!(warned && estimate.outcome.converged(), "{starts}: {estimate}");
    }
}

#[test]
fn a_place_that_cannot_be_written_is_an_error_at_once() {
    let path = place("absent_folder").join("checkpoint.json");
    assert!(matches!(fit(&record(1)).checkpoint(path, 1).run(), Err(Error::File { .. })));
}

/// Raises the flag after the second iteration.
struct Raise(Arc<AtomicBool>);

impl Observe<LeastSquaresState> for Raise {
    fn observe_iter(&mut self, state: &LeastSquaresState, _kv: &KV) -> Result<(), argmin::core::Error> {
        self.0.store(state.get_iter() >= 1, Ordering::Relaxed);
        Ok(())
    }
}

#[test]
fn a_flag_stops_the_search() {
    let (record, flag) = (record(1), Arc::new(AtomicBool::new(false)));
    let observer = Raise(flag.clone());
    let estimate = fit(&record).cancel(flag).observe(observer, ObserverMode::Always).run().unwrap();
    assert_eq!(estimate.outcome, Outcome::Cancelled);
    assert_eq!(estimate.severity(), Severity::NotUsable);
    let raised = Arc::new(AtomicBool::new(true));
    assert!(fit(&record).cancel(raised).run().is_err());
}

#[test]
fn a_time_limit_stops_the_search() {
    // Over before the first evaluation: nothing to hand back.
    assert!(fit(&record(1)).time_limit(Duration::ZERO).run().is_err());
    assert!(fit(&record(1)).time_limit(Duration::from_secs(3600)).run().unwrap().outcome.converged());
}

#[test]
fn settings_of_optimizers_come_back_from_json() {
    fn same<T: serde::Serialize + serde::de::DeserializeOwned>(value: T) {
        let text = serde_json::to_string(&value).unwrap();
        let back: T = serde_json::from_str(&text).unwrap();
        assert_eq!(serde_json::to_string(&back).unwrap(), text);
    }
    let stop = Stop { step: 1e-7, gradient: 1e-5, cost: 1e-9, iterations: 7 };
    same(stop);
    same(LevenbergMarquardt::new(stop, JacobianColumns));
    same(LevenbergMarquardt::new(stop, Unscaled));
    same(LevenbergMarquardt::new(stop, Nominal(vec![1.0, 0.1])));
    same(GaussNewton::default());
    same(Outcome::Stalled { gradient: 0.1, step: 0.2, failed: 3 });
}
