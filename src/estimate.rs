//! [`Summary`]: what a fit found, and how well it is known; and [`Estimate`], the same by the model's names.

mod criteria;
mod display;
mod examination;
mod format;
mod json;
mod method;
mod prediction;
pub(crate) mod quantities;
mod starts;
pub(crate) mod student;
mod typed;
mod warning;

pub(crate) use display::held;
pub(crate) use examination::described;
pub use examination::{Examination, Extent};
pub(crate) use format::{Format, Version};
pub use method::{CovarianceMethod, Method, NoiseModel};
pub use prediction::{Prediction, StatesOf};
pub use quantities::{
    Derived, Direction, ExperimentEstimate, Knowledge, OutputEstimate, OutputFit, ParameterEstimate, Unknown,
};
pub(crate) use starts::times_the_cost;
pub use starts::{FailedStart, Minimum, Starts};
pub use typed::{Estimate, Values};
pub use warning::{About, Warning, WarningCode};

use crate::error::Error;
use crate::information::{Covariance, SquareMatrix};
use crate::layout::Layout;
use crate::optimize::Outcome;
use crate::problem::Role;
use crate::record::Record;
use crate::severity::Severity;
use serde::{Deserialize, Serialize};

/// The result of a fit with its uncertainty, quantities by name. It borrows nothing.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Summary {
    /// Format of its JSON.
    pub format: Format,
    /// Which version of it.
    pub version: Version,
    /// The model's quantities.
    pub layout: Layout,
    /// The parameters, in the model's order.
    pub parameters: Vec<ParameterEstimate>,
    /// Results of each experiment alone.
    pub experiments: Vec<ExperimentEstimate>,
    /// The outputs.
    pub outputs: Vec<OutputEstimate>,
    /// All free quantities in the order of the covariance: common parameters, then experiment by experiment.
    pub unknowns: Vec<Unknown>,
    /// Covariance of the unknowns, in products of their units and in their order; zero where there is no interval. Its
    /// memory is linear in their number.
    pub covariance: Covariance,
    /// Covariance of the noise between outputs, where it was estimated in full.
    pub noise_covariance: Option<SquareMatrix>,
    /// Directions of the unknowns that the data do not determine.
    pub directions: Vec<Direction>,
    /// Quantities computed from the parameters, where any were asked for.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub derived: Vec<Derived>,
    /// How the search ended.
    pub outcome: Outcome,
    /// Results of searches from other starts; `None` if none were tried.
    pub starts: Option<Starts>,
    /// Warnings and notes.
    pub warnings: Vec<Warning>,
    /// All checks, and how far each was made.
    pub examined: Vec<Examination>,
    /// The minimized cost: the weighted sum of `rho` of the standardized errors, and half the squares of the priors.
    #[serde(with = "crate::real")]
    pub cost: f64,
    /// Measurements used (samples times outputs).
    pub measurements: u64,
    /// `-2 ln` of the Gaussian likelihood of the (filtered) errors; not defined for weighted or robust fits.
    #[serde(with = "crate::real")]
    pub deviance: Option<f64>,
    /// The logarithm of the likelihood, half the deviance with the sign changed; of a density per unit of the outputs, so that it depends on
    /// these units. Where variances are predicted and there is a loss, `rho(z)` takes the place of `z^2 / 2`, as in CTSM (Kristensen, Madsen and Jørgensen,
    /// Automatica 40 (2004) 225). Not defined for weighted fits, nor for robust fits without predicted variances.
    #[serde(with = "crate::real")]
    pub log_likelihood: Option<f64>,
    /// Trial steps of the search.
    pub iterations: u64,
    /// Evaluations of the search with slopes that took a pass over the data.
    pub evaluations: u64,
    /// Time taken (s).
    #[serde(with = "crate::real")]
    pub seconds: f64,
    /// How it was made.
    pub method: Method,
}

impl Summary {
    /// Degrees of freedom: measurements less unknowns, but for those held at a bound and one for each direction along
    /// which nothing is known. Zero where there are no more measurements than unknowns.
    pub fn degrees_of_freedom(&self) -> f64 {
        if self.measurements <= self.unknowns.len() as u64 {
            return 0.0;
        }
        let held = self.unknowns.iter().filter(|unknown| matches!(unknown.knowledge, Knowledge::Held { .. })).count();
        let estimated = self.unknowns.len() as f64 - (held + self.directions.len()) as f64;
        self.measurements as f64 - estimated
    }

    /// The unknowns as an optimizer sees them: logarithms where these were estimated.
    pub(crate) fn coordinates(&self) -> Vec<f64> {
        self.unknowns.iter().map(|unknown| unknown.transform.to_coordinate(unknown.value)).collect()
    }

    /// The parameters that each experiment has for itself, estimated or fixed at values that differ, by their places in the layout.
    pub fn own_parameters(&self) -> Vec<usize> {
        let is_estimated = |j: usize| {
            self.unknowns.iter().any(|unknown| unknown.role == Role::Parameter(j) && unknown.experiment.is_some())
        };
        let differs =
            |j: usize| self.experiments.windows(2).any(|pair| pair[0].parameters.get(j) != pair[1].parameters.get(j));
        (0..self.parameters.len()).filter(|j| is_estimated(*j) || differs(*j)).collect()
    }

    /// This estimate for one experiment of the fit, by its place: where experiments have a parameter for themselves, with its value there and how well
    /// that is known. What is returned has this experiment alone, at place 0. `None` if the fit had no experiment of this place.
    pub fn of_experiment(&self, experiment: usize) -> Option<Summary> {
        let own = self.experiments.get(experiment)?.clone();
        let mut found = self.clone();
        if self.experiments.len() > 1 {
            for j in self.own_parameters() {
                found.parameters[j].value = own.parameters.get(j).copied()?;
            }
            for unknown in &mut found.unknowns {
                unknown.experiment = match unknown.experiment {
                    Some(e) if e == experiment => Some(0),
                    Some(0) => Some(experiment),
                    other => other,
                };
                if let (Role::Parameter(j), Some(0)) = (unknown.role, unknown.experiment) {
                    found.parameters[j].knowledge = unknown.knowledge;
                }
            }
        }
        found.experiments = vec![own];
        Some(found)
    }

    /// This estimate for a record. Of parameters that each experiment of the fit has for itself, those of the experiment of its name.
    ///
    /// # Errors
    /// A record of another name, where experiments have parameters for themselves.
    pub fn of_record(&self, record: &Record) -> Result<Summary, Error> {
        let at = self.experiments.iter().position(|experiment| experiment.name == record.name());
        if let Some(own) = at.and_then(|at| self.of_experiment(at)) {
            return Ok(own);
        }
        match self.own_parameters().first().filter(|_| self.experiments.len() > 1) {
            None => Ok(self.clone()),
            Some(own) => Err(Error::Option(format!(
                "experiment `{}`: parameter `{}` has a value for each record of the fit, and this is none of them ({}; records of equal names are \
                 numbered); give it the name of the one whose values it has",
                record.name(),
                self.parameters[*own].name,
                self.experiments.iter().map(|experiment| experiment.name.as_str()).collect::<Vec<_>>().join(", ")
            ))),
        }
    }

    /// The worst that is said of this estimate.
    pub fn severity(&self) -> Severity {
        let outcome = if self.outcome.converged() { Severity::Usable } else { Severity::NotUsable };
        self.warnings.iter().map(|warning| warning.severity).fold(outcome, Severity::max)
    }

    /// Whether other starts were tried, and how many agree.
    pub(crate) fn searches(&self) -> String {
        self.starts.as_ref().map_or("no other start was tried".to_owned(), Starts::to_string)
    }

    /// Interval of one unknown with the given probability (0 to 1), by Student's t; `None` if it has none, or if there is
    /// no such unknown or probability.
    pub fn interval(&self, name: &str, probability: f64) -> Option<(f64, f64)> {
        let unknown = self.unknowns.iter().find(|unknown| unknown.name == name)?;
        if !(probability > 0.0 && probability < 1.0) {
            return None;
        }
        let (center, spread) =
            (unknown.transform.to_coordinate(unknown.value) + self.shift(unknown), unknown.spread()?);
        Some(quantities::within(unknown.bounds, spread.interval(center, unknown.transform, probability)))
    }

    /// From the coordinate of an unknown to the center of its interval: next to an unknown that is held it is not centered at the
    /// estimate. It is told by an end that is no bound.
    fn shift(&self, unknown: &Unknown) -> f64 {
        let Knowledge::Known { lower, upper, .. } = unknown.knowledge else { return 0.0 };
        let Some(spread) = unknown.spread().filter(|_| self.releases()) else { return 0.0 };
        let (value, reach) = (unknown.transform.to_coordinate(unknown.value), spread.reach(0.95));
        let (least, greatest) = unknown.bounds;
        let shift = match (lower > least, upper < greatest) {
            (true, _) => unknown.transform.to_coordinate(lower) + reach - value,
            (false, true) => unknown.transform.to_coordinate(upper) - reach - value,
            (false, false) => 0.0,
        };
        if shift.is_finite() { shift } else { 0.0 }
    }

    /// Whether an unknown at a bound has an interval, for which those of all others allow.
    fn releases(&self) -> bool {
        self.unknowns.iter().any(|unknown| matches!(unknown.knowledge, Knowledge::Held { end: Some(_), .. }))
    }

    /// Correlation of some unknowns, by their numbers; zero where there is no interval, one on the diagonal.
    pub fn correlation(&self, unknowns: &[usize]) -> SquareMatrix {
        let c = self.covariance.dense(unknowns);
        SquareMatrix::from_fn(c.size(), |i, j| {
            let scale = (c[(i, i)] * c[(j, j)]).sqrt();
            if i == j {
                1.0
            } else if scale > 0.0 {
                c[(i, j)] / scale
            } else {
                0.0
            }
        })
    }

    /// Standard deviation of the noise of each output.
    pub(crate) fn sigma(&self) -> Vec<f64> {
        self.outputs.iter().map(|output| output.fit.sigma).collect()
    }
}
