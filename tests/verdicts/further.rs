//! Fits whose first search ends where the model explains nothing: predators and prey that do not swing.

use crate::plants::*;
use crate::processes::*;
use argmin::core::observers::{Observe, ObserverMode};
use argmin::core::{Error, KV};
use greybox::estimate::WarningCode::{self, Unexplained};
use greybox::optimize::{LeastSquaresState, LevenbergMarquardt, OwnSize, Stop};
use greybox::{Estimate, Experiment, Fit, Fleet, Nothing, Parameter, Severity, free};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

type Counted = Experiment<Animals, Nothing, Animals>;

/// A record, and starts within a factor of 1.5 of the truth from which a single search ends in a false minimum.
fn counted(seed: u64) -> Counted {
    let plant = predator_prey();
    plant.experiment(&plant.record(seed, 400).noisy(0.02, 0.0, seed))
}

fn rates() -> Rates<Parameter> {
    Rates { a: free(1.283), b: free(0.5602), c: free(0.08687), d: free(0.2876) }
}

fn severity(fit: &Estimate<PredatorPrey>, code: WarningCode) -> Option<Severity> {
    fit.warnings.iter().find(|warning| warning.code == code).map(|warning| warning.severity)
}

/// Five standard errors for four parameters.
fn is_right(fit: &Estimate<PredatorPrey>) -> bool {
    let near = |(found, truth): (&greybox::estimate::ParameterEstimate, f64)| {
        found.knowledge.standard_error().is_some_and(|error| (found.value - truth).abs() < 5.0 * error)
    };
    fit.summary().parameters.iter().zip(predator_prey().truth).all(near)
}

/// One search explains nothing, and says so. Without a number of starts the fit goes on in stages to the minimum that 32 starts find, and says so.
#[test]
fn a_fit_that_explains_nothing_searches_further() {
    let record = counted(53_002);
    let fit = || Fit::new(&PredatorPrey, &record).parameters(rates());
    let one = fit().starts(1).run().unwrap();
    assert!(severity(&one, Unexplained) == Some(Severity::NotUsable) && one.starts.is_none(), "{one}");
    let (found, asked) = (fit().run().unwrap(), fit().starts(32).run().unwrap());
    assert!(found.severity() < Severity::NotUsable && is_right(&found), "{found}");
    assert!(
        severity(&found, Unexplained) == Some(Severity::Usable) && found.to_string().contains("by itself"),
        "{found}"
    );
    let staged = found.warnings.iter().any(|warning| warning.text.contains("by itself from the end of"));
    assert!(found.starts.is_none() && staged, "{found}");
    // Ends of one minimum differ by less than that.
    assert!((found.parameters.a / asked.parameters.a - 1.0).abs() < 1e-6, "{found}\n{asked}");
    // The work of the first search is counted, too.
    assert!(found.evaluations > one.evaluations && found.iterations > one.iterations);
}

/// Any number of threads gives the same bits, and a fleet gives what a single fit gives.
#[test]
fn further_searches_are_the_same_on_threads_and_in_fleets() {
    let record = counted(53_002);
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| Fit::new(&PredatorPrey, &record).parameters(rates()).run().unwrap())
    };
    let (alone, threads) = (on(1), on(3));
    assert_eq!((&alone.starts, alone.parameters), (&threads.starts, threads.parameters));
    let fleet = Fleet::new(&PredatorPrey).parameters(rates()).fleet().unwrap();
    let together = fleet.run([record.clone()]).next().unwrap().unwrap();
    assert_eq!(severity(&together, Unexplained), Some(Severity::Usable), "{together}");
    let tried = |fit: &Estimate<PredatorPrey>| fit.starts.as_ref().map(|starts| (starts.tried, starts.agreed));
    assert_eq!(tried(&together), tried(&alone));
    // Lanes add in another order.
    assert!((together.parameters.a / alone.parameters.a - 1.0).abs() < 1e-6, "{together}\n{alone}");
}

/// Raises a flag after the first evaluations of searches from several starts.
struct Stops {
    began: bool,
    flag: Arc<AtomicBool>,
}

impl Observe<LeastSquaresState> for Stops {
    fn observe_init(&mut self, name: &str, _: &LeastSquaresState, _: &KV) -> Result<(), Error> {
        self.began |= name.contains("several starts");
        Ok(())
    }

    fn observe_iter(&mut self, _: &LeastSquaresState, _: &KV) -> Result<(), Error> {
        self.flag.fetch_or(self.began, Ordering::Relaxed);
        Ok(())
    }
}

/// A flag that is raised when the searches from further starts have begun, of a record in another order, which nothing explains, ends them, and the
/// estimate says so; a limit of trial steps that the first search
/// used up allows no further ones.
#[test]
fn limits_hold_for_further_searches() {
    let record = counted(53_002);
    let fit = || Fit::new(&PredatorPrey, &record).parameters(rates());
    let one = fit().starts(1).run().unwrap();
    let flag = Arc::new(AtomicBool::new(false));
    let stops = Stops { began: false, flag: flag.clone() };
    let all: Vec<_> = record.outputs().collect();
    let outputs = (0..all.len()).map(|k| all[k * 181 % all.len()]).collect();
    let inputs = vec![Nothing; all.len()];
    let shuffled = Experiment::new(&PredatorPrey, record.times().clone(), inputs, outputs).unwrap();
    let stopped = Fit::new(&PredatorPrey, &shuffled).parameters(rates());
    let stopped = stopped.observe(stops, ObserverMode::Always).cancel(flag.clone()).run().unwrap();
    assert!(flag.load(Ordering::Relaxed) && stopped.severity() == Severity::NotUsable, "{stopped}");
    assert!(
        stopped.warnings.iter().any(|warning| warning.text.contains("limits of the fit stopped searches")),
        "{stopped}"
    );
    let limited = |iterations: u64| {
        let optimizer = LevenbergMarquardt::new(Stop { iterations, ..Stop::default() }, OwnSize);
        fit().optimizer(optimizer).run().unwrap()
    };
    let searched = |fit: &Estimate<PredatorPrey>| fit.warnings.iter().any(|warning| warning.text.contains("by itself"));
    assert!(!searched(&limited(one.iterations)) && searched(&limited(one.iterations + 1)));
}
