//! [`Estimate`]: what a fit found, and how well it is known.

mod display;
mod prediction;
pub(crate) mod student;

pub use prediction::Prediction;

use crate::by_name;
use crate::information::SquareMatrix;
use crate::integrate::Automatic;
use crate::model::Model;
use crate::numeral::{number, or_nan, pairs_or_nan};
use crate::optimize::{Outcome, Severity};
use crate::parameter::{Parameter, Transform, unbounded_above, unbounded_below};
use crate::predict::FreeRun;
use crate::signals::{Of, Signals};
use core::fmt;
use serde::{Deserialize, Serialize};

/// What is known of one quantity.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Knowledge {
    /// It was estimated; the interval covers it with 95 % probability (asymmetric, if its logarithm was estimated).
    Known {
        /// Standard error, in its own unit.
        #[serde(deserialize_with = "or_nan")]
        standard_error: f64,
        /// Lower end of the 95 % interval; `null` in JSON stands for none.
        #[serde(with = "unbounded_below")]
        lower: f64,
        /// Upper end of the 95 % interval; `null` in JSON stands for none.
        #[serde(with = "unbounded_above")]
        upper: f64,
    },
    /// It was given.
    Fixed,
    /// The data push it against this bound; it is kept there, and has no interval.
    Held {
        /// The bound.
        bound: f64,
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
    /// Name, with its experiment in brackets if it belongs to one; an initial state is `name(0)`.
    pub name: String,
    /// Unit.
    pub unit: String,
    /// Estimated value.
    #[serde(deserialize_with = "or_nan")]
    pub value: f64,
    /// Where the search started.
    #[serde(deserialize_with = "or_nan")]
    pub start: f64,
    /// What is known of it.
    pub knowledge: Knowledge,
    /// Parametric error index (%), the others refitted: the relative change that doubles the sum of squares, in linear
    /// approximation (Tenerz 2011, eq. 5.14). Low is well excited. `None` where there is no interval, or the value is 0.
    pub error_index: Option<f64>,
    /// The same with the others held.
    pub error_index_held: Option<f64>,
    /// The coordinate that the optimizer worked in.
    pub transform: Transform,
}

/// How well one output is reproduced.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Quality {
    /// Samples measured.
    pub samples: u64,
    /// Root of the mean squared prediction error, in the output's unit, before any pre-filter.
    #[serde(deserialize_with = "or_nan")]
    pub rmse: f64,
    /// Fit (%): `100 (1 - |y - y_hat| / |y - mean y|)`; `None` if the measurement is constant.
    pub fit_percent: Option<f64>,
    /// Standard deviation of the noise: given, or estimated from the (filtered) errors with `N - p` in the denominator.
    #[serde(deserialize_with = "or_nan")]
    pub sigma: f64,
}

/// A set of parameters that the data cannot tell apart.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Direction {
    /// Name and relative change (to the largest among them) of each; moving them together so changes no prediction.
    /// Absolute, where the value is zero.
    #[serde(deserialize_with = "pairs_or_nan")]
    pub moves: Vec<(String, f64)>,
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

/// Something the reader of an estimate must know.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Warning {
    /// How bad it is.
    pub severity: Severity,
    /// What it is, with the numbers and the remedy.
    pub text: String,
}

/// What one experiment has for itself.
#[derive(Debug, Serialize, Deserialize)]
#[serde(bound = "", deny_unknown_fields)]
pub struct Share<M: Model> {
    /// Name of the experiment.
    pub name: String,
    /// Number of samples.
    pub samples: usize,
    /// Parameters of this experiment: the common ones and its own.
    #[serde(
        serialize_with = "by_name::serialize::<M::Parameters, _, _>",
        deserialize_with = "by_name::deserialize::<M::Parameters, _, _>"
    )]
    pub parameters: Of<M::Parameters, f64>,
    /// State at the first sample.
    #[serde(
        serialize_with = "by_name::serialize::<M::State, _, _>",
        deserialize_with = "by_name::deserialize::<M::State, _, _>"
    )]
    pub initial_state: Of<M::State, f64>,
}

/// How an estimate was made, in words; enough to make it again.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Method {
    /// The search.
    pub optimizer: String,
    /// How the model was stepped.
    pub integrator: String,
    /// Which prediction error.
    pub predictor: String,
    /// The loss.
    pub loss: String,
    /// The weighting.
    pub weighting: String,
    /// The pre-filter.
    pub prefilter: String,
    /// What was said of the noise.
    pub noise: String,
    /// How the covariance was made.
    pub covariance: String,
    /// Version of this library.
    pub version: String,
}

/// What a fit found, and how well it is known. It borrows nothing.
#[derive(Serialize, Deserialize)]
#[serde(
    bound(serialize = "I: Serialize, P: Serialize", deserialize = "I: Deserialize<'de>, P: Deserialize<'de>"),
    deny_unknown_fields
)]
pub struct Estimate<M: Model, I = Automatic, P = FreeRun> {
    /// The parameters; of those that each experiment has for itself, the first experiment's.
    #[serde(
        serialize_with = "by_name::serialize::<M::Parameters, _, _>",
        deserialize_with = "by_name::deserialize::<M::Parameters, _, _>"
    )]
    pub parameters: Of<M::Parameters, f64>,
    /// What is known of each parameter.
    #[serde(
        serialize_with = "by_name::serialize::<M::Parameters, _, _>",
        deserialize_with = "by_name::deserialize::<M::Parameters, _, _>"
    )]
    pub knowledge: Of<M::Parameters, Knowledge>,
    /// What was declared of each parameter.
    #[serde(
        serialize_with = "by_name::serialize::<M::Parameters, _, _>",
        deserialize_with = "by_name::deserialize::<M::Parameters, _, _>"
    )]
    pub declared: Of<M::Parameters, Parameter>,
    /// What each experiment has for itself.
    pub experiments: Vec<Share<M>>,
    /// How well each output is reproduced, over all experiments.
    #[serde(
        serialize_with = "by_name::serialize::<M::Output, _, _>",
        deserialize_with = "by_name::deserialize::<M::Output, _, _>"
    )]
    pub quality: Of<M::Output, Quality>,
    /// All free quantities in the order of the covariance: common parameters, then experiment by experiment.
    pub unknowns: Vec<Unknown>,
    /// Covariance of the unknowns, in products of their units; zero where there is no interval.
    pub covariance: SquareMatrix,
    /// Covariance of the noise between outputs, where it was estimated in full.
    pub noise_covariance: Option<SquareMatrix>,
    /// What the data cannot tell apart.
    pub directions: Vec<Direction>,
    /// How the search ended.
    pub outcome: Outcome,
    /// What the reader must know.
    pub warnings: Vec<Warning>,
    /// The minimized cost: the weighted sum of `rho` of the standardized errors, and half the squares of the priors.
    pub cost: f64,
    /// Measurements used (samples times outputs).
    pub measurements: u64,
    /// `-2 ln` of the Gaussian likelihood of the (filtered) errors; not defined for weighted or robust fits.
    pub deviance: Option<f64>,
    /// Trial steps of the search.
    pub iterations: u64,
    /// Passes over the data with slopes.
    pub evaluations: u64,
    /// Time taken (s).
    pub seconds: f64,
    /// How it was made.
    pub method: Method,
    /// The method that stepped the model.
    pub integrator: I,
    /// The prediction error that was minimized.
    pub predictor: P,
}

impl<M: Model, I, P> Estimate<M, I, P> {
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

    /// The worst that is said of this estimate.
    pub fn severity(&self) -> Severity {
        let outcome = if self.outcome.converged() { Severity::Usable } else { Severity::NotUsable };
        self.warnings.iter().map(|warning| warning.severity).fold(outcome, Severity::max)
    }

    /// Interval of one unknown with the given probability (0 to 1), by Student's t; `None` if it has none, or if there is
    /// no such unknown or probability.
    pub fn interval(&self, name: &str, probability: f64) -> Option<(f64, f64)> {
        let unknown = self.unknowns.iter().find(|unknown| unknown.name == name)?;
        let error = unknown.knowledge.standard_error()?;
        if !(probability > 0.0 && probability < 1.0) {
            return None;
        }
        Some(student::interval(unknown.value, error, unknown.transform, probability, self.degrees_of_freedom()))
    }

    /// Correlation of the unknowns; zero where there is no interval, one on the diagonal.
    pub fn correlation(&self) -> SquareMatrix {
        let c = &self.covariance;
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

    /// Akaike's information criterion; smaller is better. `None` for weighted or robust fits. The standard deviations of
    /// the noise count as parameters where they were estimated.
    pub fn aic(&self) -> Option<f64> {
        self.deviance.map(|deviance| deviance + 2.0 * self.likelihood_parameters())
    }

    /// Akaike's criterion corrected for short records (Hurvich and Tsai 1989); `None` too where it is not defined.
    pub fn aicc(&self) -> Option<f64> {
        let (n, k) = (self.measurements as f64, self.likelihood_parameters());
        self.aic().filter(|_| n - k > 1.0).map(|aic| aic + 2.0 * k * (k + 1.0) / (n - k - 1.0))
    }

    /// Bayes' information criterion (Schwarz 1978).
    pub fn bic(&self) -> Option<f64> {
        let n = self.measurements as f64;
        self.deviance.map(|deviance| deviance + self.likelihood_parameters() * n.ln())
    }

    /// Akaike's final prediction error (Ljung 1999, eq. 16.56): the expected product over the outputs of the error
    /// variances on new data. `None` if there are not more samples than unknowns.
    pub fn fpe(&self) -> Option<f64> {
        let outputs = M::Output::into_array(self.quality);
        let samples = outputs.as_ref().iter().map(|q| q.samples).max().unwrap_or(0) as f64;
        let d = self.unknowns.len() as f64;
        let determinant: f64 = outputs.as_ref().iter().map(|q| q.rmse * q.rmse).product();
        (samples > d).then(|| determinant * (1.0 + d / samples) / (1.0 - d / samples))
    }

    fn likelihood_parameters(&self) -> f64 {
        let outputs = M::Output::LEN;
        let noise = match (self.method.noise.as_str(), &self.noise_covariance) {
            (_, Some(_)) => outputs * (outputs + 1) / 2,
            ("given", None) => 0,
            _ => outputs,
        };
        (self.unknowns.len() + noise) as f64
    }
}

impl<M: Model, I: Clone, P: Clone> Clone for Estimate<M, I, P> {
    fn clone(&self) -> Self {
        Estimate {
            experiments: self.experiments.clone(),
            unknowns: self.unknowns.clone(),
            covariance: self.covariance.clone(),
            noise_covariance: self.noise_covariance.clone(),
            directions: self.directions.clone(),
            warnings: self.warnings.clone(),
            method: self.method.clone(),
            integrator: self.integrator.clone(),
            predictor: self.predictor.clone(),
            ..*self
        }
    }
}

// `derive` would ask for `M: Clone`.
impl<M: Model> Clone for Share<M> {
    fn clone(&self) -> Self {
        Share { name: self.name.clone(), ..*self }
    }
}

impl<M: Model, I: fmt::Debug, P: fmt::Debug> fmt::Debug for Estimate<M, I, P> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Estimate")
            .field("unknowns", &self.unknowns)
            .field("outcome", &self.outcome)
            .field("warnings", &self.warnings)
            .field("cost", &self.cost)
            .field("method", &self.method)
            .finish_non_exhaustive()
    }
}
