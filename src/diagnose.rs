//! Diagnoses of an estimate: residuals, identifiability, intervals, other models, other data.
//!
//! All results are plain data that serialize, for reports and for programs.

mod bands;
mod bootstrap;
mod compare;
mod convergence;
mod derived;
mod drift;
mod identifiability;
mod leverages;
mod process_noise;
mod profile;
pub mod residuals;
mod side_by_side;

pub use bands::{Bands, bands};
pub(crate) use bands::{Widths, widths};
pub use bootstrap::{Bootstrap, Resampling, bootstrap};
pub use compare::{Candidate, Validation, cross_validate, f_test, likelihood_ratio, validate};
pub use convergence::Convergence;
pub use derived::{derived, derived_by};
pub use drift::{Drift, drift};
pub use identifiability::{Collinear, Excitation, Identifiability, Segment, identifiability};
pub(crate) use identifiability::{identifiability_beside_warnings, reworded};
pub(crate) use process_noise::cheap_process_noise;
pub use process_noise::{ProcessNoise, process_noise};
pub use profile::{End, Profile, ProfilePoint, profile};
pub use side_by_side::Compared;

pub use crate::estimate::Derived;

use crate::error::Error;
use crate::numeral::p_value;
use crate::optimize::{Infeasible, LeastSquares, LeastSquaresState, LevenbergMarquardt, Linearization, Machine, Stop};
use crate::problem::{Control, Objective, Problem};
use crate::section::{Cell, Section, Table};
use crate::severity::Severity;
use argmin::core::{Executor, State};
use serde::{Deserialize, Serialize};

/// The probability of error below which a hypothesis is rejected.
pub(crate) const LEVEL: f64 = 0.01;

/// A hypothesis and whether the data are against it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Test {
    /// Name of the test.
    pub name: String,
    /// Its statistic.
    #[serde(with = "crate::real")]
    pub statistic: f64,
    /// Probability of such a statistic, or one further out, if the hypothesis is true.
    #[serde(with = "crate::real")]
    pub p_value: f64,
    /// Whether the hypothesis may stand: `p_value` is at least 0.01.
    pub passed: bool,
    /// Meaning of the result; of a failed test with the usual cause.
    pub meaning: String,
}

impl Test {
    /// The p-value in words: `p = 0.032`, or that it is below what can be computed.
    pub fn probability(&self) -> String {
        p_value(self.p_value)
    }

    /// Passed if `p_value` is at least `LEVEL`; the meaning is the first if passed, else the second.
    pub(crate) fn new(name: impl Into<String>, statistic: f64, p_value: f64, passed: &str, failed: &str) -> Self {
        let holds = p_value >= LEVEL;
        let meaning = if holds { passed } else { failed }.to_owned();
        Test { name: name.into(), statistic, p_value, passed: holds, meaning }
    }
}

/// Tests of something (nested models, drift) as a section of a report; where one fails, the estimate is to be used with
/// care.
///
/// ```
/// # use greybox::{Experiment, Fit, free, pmsm::{Surface, Winding}};
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// # let model = Surface::new(4)?;
/// # let record = Experiment::from_file(&model, "examples/data/pmsm.csv")?;
/// # let start = Winding { rs: free(1.0), ls: free(2e-3), ke: free(0.7) };
/// # let problem = Fit::new(&model, &record).parameters(start).problem()?;
/// # let estimate = problem.run()?;
/// use greybox::{Report, diagnose};
/// let fixed = Winding { ls: greybox::fixed(4.1e-3), ..start };
/// let restricted = Fit::new(&model, &record).parameters(fixed).run()?;
/// let [a, b] = [&*restricted, &estimate].map(|one| diagnose::Candidate::new("model", one));
/// let test = diagnose::likelihood_ratio(&a, &b)?;
/// let report = Report::new(&problem, &estimate)?.with(diagnose::tested("nested models", [&test]));
/// assert!(report.to_string().contains("likelihood ratio"));
/// # Ok(())
/// # }
/// ```
pub fn tested<'a>(about: &str, tests: impl IntoIterator<Item = &'a Test>) -> Section {
    let tests: Vec<&Test> = tests.into_iter().collect();
    let part = Section::new(format!("tests-{about}"), about).table(results(about, tests.iter().copied()));
    let failed = tests.iter().filter(|test| !test.passed);
    let about = about.replace('`', "'");
    let part = failed.fold(part, |part, test| {
        part.because(Severity::UsableWithCare, format!("`{about}`, {}: {}", test.name, test.meaning))
    });
    Section::new("tests", "Further tests").part(part)
}

/// Tests and their results, with the meaning of those that failed.
pub(crate) fn results<'a>(caption: &str, tests: impl IntoIterator<Item = &'a Test>) -> Table {
    let row = |test: &Test| {
        let result = if test.passed { "✓ passes" } else { "! fails" };
        let meaning = if test.passed { "" } else { &test.meaning };
        let probability = Cell::Number { value: test.p_value, text: test.probability() };
        [test.name.replace('`', "").into(), probability, result.into(), meaning.replace('`', "").into()]
    };
    Table::new(caption, ["test", "probability", "result", "meaning"]).rows(tests.into_iter().map(row))
}

/// A problem with other bounds; equal bounds pin an unknown.
struct Pinned<'a, L> {
    problem: &'a L,
    bounds: Vec<(f64, f64)>,
}

impl<L: LeastSquares> LeastSquares for Pinned<'_, L> {
    fn linearize(&self, x: &[f64]) -> Result<Linearization, Infeasible> {
        self.problem.linearize(x)
    }

    fn curvature(&self, x: &[f64], along: &[f64]) -> Option<Result<Linearization, Infeasible>> {
        self.problem.curvature(x, along)
    }

    fn bounds(&self) -> Vec<(f64, f64)> {
        self.bounds.clone()
    }

    fn sizes(&self) -> Vec<Option<f64>> {
        self.problem.sizes()
    }

    fn logarithms(&self) -> Vec<bool> {
        self.problem.logarithms()
    }
}

/// Refuses a result that was not computed to its end.
fn check_complete(problem: &Problem<'_>, control: &Control, what: &str) -> Result<(), Error> {
    if !control.stops() {
        return Ok(());
    }
    Err(Error::Option(match problem.settings.time_limit {
        Some(limit) if control.expired() => format!(
            "the time limit of {} s, which holds for each diagnosis anew, was over before {what} was complete; allow more time",
            limit.as_secs_f64()
        ),
        _ => format!("{what} was cancelled; lower the flag to run it"),
    }))
}

/// Cost and slopes at an estimate.
fn linearize(objective: &Objective<'_>, best: &[f64], what: &str) -> Result<Linearization, Error> {
    objective.linearize(best).map_err(|error| {
        let stopped = check_complete(objective.problem, objective.control, what).err();
        stopped.unwrap_or(Error::Optimizer(error.to_string()))
    })
}

/// Place and cost of the minimum that a search from `start` ends in; `None` where it cannot begin or does not end.
fn minimize(problem: impl LeastSquares, start: Vec<f64>) -> Option<(Vec<f64>, f64)> {
    minimize_within(problem, start, Stop::default().iterations)
}

/// The same in so many trial steps at most.
fn minimize_within(problem: impl LeastSquares, start: Vec<f64>, trials: u64) -> Option<(Vec<f64>, f64)> {
    let mut solver: LevenbergMarquardt = LevenbergMarquardt::default();
    solver.stop = solver.stop.limited(trials);
    let configure = |state: LeastSquaresState| state.param(start);
    let result = Executor::new(problem, solver).configure(configure).ctrlc(false).run().ok()?;
    let ended = result.solver().outcome().is_some_and(|outcome| outcome.converged());
    let place = result.state().get_param()?.clone();
    ended.then(|| (place, result.state().get_cost()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A hypothesis stands from its level on.
    #[test]
    fn a_test_says_its_probability() {
        let of = |p_value: f64| Test::new("test", 2.0, p_value, "it may stand", "it falls");
        let (stands, falls) = (of(LEVEL), of(0.0099));
        assert_eq!(
            (stands.passed, &stands.meaning[..], falls.passed, &falls.meaning[..]),
            (true, "it may stand", false, "it falls")
        );
        assert_eq!(falls.probability(), "p = 0.0099");
    }
}
