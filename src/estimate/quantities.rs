//! Results of a fit for each quantity: [`Unknown`], [`Knowledge`], parameters, outputs and experiments.

use super::student::Spread;
use super::{Warning, WarningCode};
use crate::numeral::number;
use crate::parameter::{Parameter, Transform};
use crate::problem::Role;
use crate::severity::Severity;
use core::fmt;
use serde::{Deserialize, Serialize};

/// Knowledge of one quantity; in JSON with its name as `code`, in small letters. `docs/intervals.md` in the repository
/// lists how each interval is made, what it assumes, and how often it was found to cover.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "code", rename_all = "snake_case")]
pub enum Knowledge {
    /// It was estimated; the interval covers it with 95 % probability (asymmetric, if its logarithm was estimated).
    Known {
        /// Standard error, in its own unit.
        #[serde(with = "crate::real")]
        standard_error: f64,
        /// Lower end of the 95 % interval; minus infinity stands for none.
        #[serde(with = "crate::real")]
        lower: f64,
        /// Upper end of the 95 % interval; infinity stands for none.
        #[serde(with = "crate::real")]
        upper: f64,
    },
    /// It was given.
    Fixed,
    /// The data push it against this bound; it is kept there.
    Held {
        /// The bound.
        #[serde(with = "crate::real")]
        bound: f64,
        /// Other end of its 95 % interval, which begins at the bound: the part within the bounds of the interval that it
        /// would have without them. `None` where no part is, or where there is no slope at the bound.
        #[serde(with = "crate::real")]
        end: Option<f64>,
    },
    /// The data do not determine it; its value is where the search left it.
    Unidentified,
}

impl Knowledge {
    /// Standard error in the quantity's unit, where there is one.
    pub fn standard_error(&self) -> Option<f64> {
        match self {
            Knowledge::Known { standard_error, .. } => Some(*standard_error),
            _ => None,
        }
    }
}

/// One free quantity of a fit and all that is said about it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Unknown {
    /// Name, with its experiment in brackets if it belongs to one of several; an initial state is `name(0)`.
    pub name: String,
    /// Unit.
    pub unit: String,
    /// Its role in the model.
    pub role: Role,
    /// Index of the experiment that it belongs to; `None` if all share it.
    pub experiment: Option<usize>,
    /// Estimated value.
    #[serde(with = "crate::real")]
    pub value: f64,
    /// Where the search started.
    #[serde(with = "crate::real")]
    pub start: f64,
    /// The bounds that were declared of it, infinite where there is none. No interval reaches beyond them.
    #[serde(with = "crate::real", default = "none")]
    pub bounds: (f64, f64),
    /// Knowledge of it.
    pub knowledge: Knowledge,
    /// Parametric error index (%), the others refitted: the relative change that doubles the sum of squares, in linear
    /// approximation (Tenerz 2011, eq. 5.14). Low is well excited. `None` where there is no interval, or the value is 0.
    #[serde(with = "crate::real")]
    pub error_index: Option<f64>,
    /// The standard error with the others held.
    #[serde(with = "crate::real")]
    pub error_index_held: Option<f64>,
    /// The coordinate that the optimizer worked in.
    pub transform: Transform,
    /// Degrees of freedom of Student's t in its interval: those of the fit, or fewer where the variance of colored errors
    /// is itself an estimate from few independent stretches.
    #[serde(with = "crate::real")]
    pub degrees_of_freedom: f64,
}

/// No bounds.
fn none() -> (f64, f64) {
    (f64::NEG_INFINITY, f64::INFINITY)
}

impl Unknown {
    /// How it scatters in its coordinate, where it is known.
    pub(crate) fn spread(&self) -> Option<Spread> {
        let standard_error = self.knowledge.standard_error()? / self.transform.slope(self.value);
        Some(Spread { standard_error, degrees: self.degrees_of_freedom })
    }

    /// The 95 % interval that it would have without its bounds, by its own value.
    pub(crate) fn unbounded(&self) -> Option<(f64, f64)> {
        Some(self.spread()?.interval(self.transform.to_coordinate(self.value), self.transform, 0.95))
    }
}

/// The part of an interval within bounds; an interval beyond them is the bound next to it.
pub(crate) fn within((least, greatest): (f64, f64), (lower, upper): (f64, f64)) -> (f64, f64) {
    (lower.max(least).min(greatest), upper.max(least).min(greatest))
}

/// A parameter of the model: what was declared of it, and what was found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ParameterEstimate {
    /// Name.
    pub name: String,
    /// Unit.
    pub unit: String,
    /// Value; of a parameter that each experiment has for itself, the first experiment's.
    #[serde(with = "crate::real")]
    pub value: f64,
    /// Knowledge of it.
    pub knowledge: Knowledge,
    /// Its declaration.
    pub declared: Parameter,
}

/// How well an output is reproduced.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OutputFit {
    /// Samples measured.
    pub samples: u64,
    /// Root of the mean squared prediction error, in the output's unit, before any pre-filter.
    #[serde(with = "crate::real")]
    pub rmse: f64,
    /// Fit (%): `100 (1 - |y - y_hat| / |y - mean y|)`; `None` if the measurement is constant.
    #[serde(with = "crate::real")]
    pub fit_percent: Option<f64>,
    /// Standard deviation of the noise: given, or estimated from the (filtered) errors with `N - p` in the denominator.
    #[serde(with = "crate::real")]
    pub sigma: f64,
}

/// An output of the model, and how well it is reproduced over all experiments.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OutputEstimate {
    /// Name.
    pub name: String,
    /// Unit.
    pub unit: String,
    /// The numbers.
    pub fit: OutputFit,
}

/// A quantity computed from the parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Derived {
    /// Its name.
    pub name: String,
    /// Its value.
    #[serde(with = "crate::real")]
    pub value: f64,
    /// Its standard error, to first order (Rao, *Linear Statistical Inference and Its Applications*, 1973, section 6a.2);
    /// `None` if it depends on a parameter that has none because it is held or not determined, changes within the interval of one in which it has no slope, or is
    /// not a number.
    #[serde(with = "crate::real")]
    pub standard_error: Option<f64>,
    /// The 95 % interval by Student's t.
    #[serde(with = "crate::real")]
    pub interval: Option<(f64, f64)>,
}

/// A set of parameters that the data cannot tell apart.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Direction {
    /// Name and relative change (to the largest among them) of each; moving them together so changes no prediction.
    /// Absolute, where the value is zero.
    #[serde(with = "crate::real")]
    pub moves: Vec<(String, f64)>,
}

impl Direction {
    /// The warning about a direction, of which `what` says what it is.
    pub(crate) fn warning(what: String) -> Warning {
        let text = what + "; fix one, add a prior, or excite the system differently";
        Warning::new(WarningCode::Unidentified, Severity::UsableWithCare, text)
    }
}

impl fmt::Display for Direction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let [(name, _)] = self.moves.as_slice() {
            return write!(f, "`{name}` has no influence on the outputs");
        }
        let names: Vec<String> = self.moves.iter().map(|(name, _)| format!("`{name}`")).collect();
        let sign = |by: f64| if by < 0.0 { '-' } else { '+' };
        let step = |(name, by): &(String, f64)| format!("{name} {}{} %", sign(*by), number(by.abs(), 3));
        let moves: Vec<String> = self.moves.iter().map(step).collect();
        write!(f, "{} are known only together: {} changes nothing", names.join(", "), moves.join(" with "))
    }
}

/// Results of one experiment alone.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExperimentEstimate {
    /// Name of the experiment.
    pub name: String,
    /// Number of samples.
    pub samples: u64,
    /// Parameters of this experiment in the model's order: the common ones and its own.
    #[serde(with = "crate::real")]
    pub parameters: Vec<f64>,
    /// State at the first sample.
    #[serde(with = "crate::real")]
    pub initial_state: Vec<f64>,
}
