//! [`Summary`]: what a fit found, and how well it is known; and [`Estimate`], the same by the model's names.

mod display;
mod format;
mod json;
mod prediction;
mod starts;
pub(crate) mod student;
mod warning;

pub(crate) use display::held;
pub use format::{Format, Version};
pub use prediction::Prediction;
pub(crate) use starts::times_the_cost;
pub use starts::{FailedStart, Minimum, Starts};
pub use warning::{Warning, WarningCode};

use crate::information::{Covariance, SquareMatrix};
use crate::layout::Layout;
use crate::model::Model;
use crate::numeral::{counted, number};
use crate::optimize::{Outcome, Severity};
use crate::parameter::{Parameter, Transform};
use crate::problem::Role;
use crate::signals::{Of, Signals};
use core::fmt;
use core::ops::Deref;
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// What is known of one quantity; in JSON with its name as `code`, in small letters. `docs/intervals.md` in the repository
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
    /// What it is in the model.
    pub role: Role,
    /// Index of the experiment that it belongs to; `None` if all share it.
    pub experiment: Option<usize>,
    /// Estimated value.
    #[serde(with = "crate::real")]
    pub value: f64,
    /// Where the search started.
    #[serde(with = "crate::real")]
    pub start: f64,
    /// What is known of it.
    pub knowledge: Knowledge,
    /// Parametric error index (%), the others refitted: the relative change that doubles the sum of squares, in linear
    /// approximation (Tenerz 2011, eq. 5.14). Low is well excited. `None` where there is no interval, or the value is 0.
    #[serde(with = "crate::real")]
    pub error_index: Option<f64>,
    /// The same with the others held.
    #[serde(with = "crate::real")]
    pub error_index_held: Option<f64>,
    /// The coordinate that the optimizer worked in.
    pub transform: Transform,
    /// Degrees of freedom of Student's t in its interval: those of the fit, or fewer where the variance of colored errors
    /// is itself an estimate from few independent stretches.
    #[serde(with = "crate::real")]
    pub degrees_of_freedom: f64,
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
    /// What is known of it.
    pub knowledge: Knowledge,
    /// What was declared of it.
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

/// A set of parameters that the data cannot tell apart.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Direction {
    /// Name and relative change (to the largest among them) of each; moving them together so changes no prediction.
    /// Absolute, where the value is zero.
    #[serde(with = "crate::real")]
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

/// What one experiment has for itself.
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

/// Where the noise levels came from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum NoiseModel {
    /// They were given.
    Given,
    /// Estimated per output.
    #[default]
    PerOutput,
    /// Estimated as a full covariance.
    Covariance,
    /// The predictor predicted the variances.
    Predicted,
}

impl fmt::Display for NoiseModel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            NoiseModel::Given => "given",
            NoiseModel::PerOutput => "estimated per output",
            NoiseModel::Covariance => "estimated as a full covariance",
            NoiseModel::Predicted => "predicted",
        })
    }
}

/// How the covariance of the unknowns was made; in JSON with its name as `code`, in small letters with underscores.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "code", rename_all = "snake_case")]
pub enum CovarianceMethod {
    /// From the curvature of the cost, for white errors.
    #[default]
    Classical,
    /// The sandwich, for errors that are independent from sample to sample.
    Sandwich,
    /// The sandwich, for errors that are white before the pre-filter.
    FilteredSandwich,
    /// Newey and West's, prewhitened, for autocorrelated errors.
    Hac {
        /// Lags over which correlation is allowed for.
        lags: u64,
    },
}

impl fmt::Display for CovarianceMethod {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            CovarianceMethod::Classical => f.write_str("classical (white errors)"),
            CovarianceMethod::Sandwich => f.write_str("sandwich (errors independent from sample to sample)"),
            CovarianceMethod::FilteredSandwich => f.write_str("sandwich (white errors before the pre-filter)"),
            CovarianceMethod::Hac { lags } => {
                let lags = counted(*lags, "lag");
                write!(f, "HAC (Newey-West over {lags}, prewhitened, for colored errors)")
            }
        }
    }
}

/// How an estimate was made; enough to make it again.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Method {
    /// The search.
    pub optimizer: String,
    /// How the model was stepped.
    pub integrator: String,
    /// Which prediction error.
    pub predictor: String,
    /// How the equations were evaluated.
    pub engine: String,
    /// The loss.
    pub loss: String,
    /// The weighting.
    pub weighting: String,
    /// The pre-filter.
    pub prefilter: String,
    /// Where the noise levels came from.
    pub noise: NoiseModel,
    /// How the covariance was made.
    pub covariance: CovarianceMethod,
    /// Version of this library.
    pub version: String,
}

/// What a fit found, and how well it is known, quantities by name. It borrows nothing.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Summary {
    /// What kind of file its JSON is.
    pub format: Format,
    /// Which version of it.
    pub version: Version,
    /// The model's quantities.
    pub layout: Layout,
    /// The parameters, in the model's order.
    pub parameters: Vec<ParameterEstimate>,
    /// What each experiment has for itself.
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
    /// What the data cannot tell apart.
    pub directions: Vec<Direction>,
    /// How the search ended.
    pub outcome: Outcome,
    /// What searches from other starts found; `None` if none were tried.
    pub starts: Option<Starts>,
    /// What the reader must know.
    pub warnings: Vec<Warning>,
    /// The minimized cost: the weighted sum of `rho` of the standardized errors, and half the squares of the priors.
    #[serde(with = "crate::real")]
    pub cost: f64,
    /// Measurements used (samples times outputs).
    pub measurements: u64,
    /// `-2 ln` of the Gaussian likelihood of the (filtered) errors; not defined for weighted or robust fits.
    #[serde(with = "crate::real")]
    pub deviance: Option<f64>,
    /// Trial steps of the search.
    pub iterations: u64,
    /// Passes over the data with slopes.
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
        let error = unknown.knowledge.standard_error()?;
        if !(probability > 0.0 && probability < 1.0) {
            return None;
        }
        let Knowledge::Known { lower, upper, .. } = unknown.knowledge else { return None };
        let (to_coordinate, slope) =
            (|value| unknown.transform.to_coordinate(value), unknown.transform.slope(unknown.value));
        // Next to an unknown that is held, an interval is not centered at the estimate.
        let moved = 0.5 * (to_coordinate(lower) + to_coordinate(upper)) - to_coordinate(unknown.value);
        let shift = if self.releases() && moved.is_finite() { moved } else { 0.0 };
        let spread = student::Spread { standard_error: error / slope, degrees: unknown.degrees_of_freedom };
        Some(spread.interval(to_coordinate(unknown.value) + shift, unknown.transform, probability))
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
        let samples = self.outputs.iter().map(|output| output.fit.samples).max().unwrap_or(0) as f64;
        let d = self.unknowns.len() as f64;
        let determinant: f64 = self.outputs.iter().map(|output| output.fit.rmse * output.fit.rmse).product();
        (samples > d).then(|| determinant * (1.0 + d / samples) / (1.0 - d / samples))
    }

    /// Parameters of the likelihood: unknowns, and estimated standard deviations of the noise.
    pub(crate) fn likelihood_parameters(&self) -> f64 {
        let outputs = self.outputs.len();
        let noise = match self.method.noise {
            NoiseModel::Covariance if self.noise_covariance.is_some() => outputs * (outputs + 1) / 2,
            NoiseModel::PerOutput | NoiseModel::Covariance => outputs,
            NoiseModel::Given | NoiseModel::Predicted => 0,
        };
        (self.unknowns.len() + noise) as f64
    }

    /// Standard deviation of the noise of each output.
    pub(crate) fn sigma(&self) -> Vec<f64> {
        self.outputs.iter().map(|output| output.fit.sigma).collect()
    }
}

/// What a fit found, and how well it is known, by the names of its model; everything of the [`Summary`] can be read from
/// it, too.
///
/// ```
/// # use greybox::{Experiment, Fit, free, pmsm::{Surface, Winding}};
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// # let model = Surface::new(4)?;
/// # let record = Experiment::from_csv(&model, "examples/data/pmsm.csv")?;
/// # let start = Winding { rs: free(1.0), ls: free(2e-3), ke: free(0.7) };
/// use greybox::Knowledge;
/// let estimate = Fit::new(&model, &record).parameters(start).run()?;
/// let rs: f64 = estimate.parameters.rs; // by the model's names
/// if let Knowledge::Known { standard_error, lower, upper } = estimate.knowledge.rs {
///     println!("{rs:.4} ± {standard_error:.4} ohm, {lower:.4} to {upper:.4}");
///     assert!(lower < 0.63 && 0.63 < upper); // the truth
/// }
/// assert!(estimate.outcome.converged()); // from its `Summary`
/// assert!(estimate.quality.id.fit_percent.unwrap() > 98.0);
/// # Ok(())
/// # }
/// ```
pub struct Estimate<M: Model> {
    /// The parameters; of those that each experiment has for itself, the first experiment's.
    pub parameters: Of<M::Parameters, f64>,
    /// What is known of each parameter.
    pub knowledge: Of<M::Parameters, Knowledge>,
    /// How well each output is reproduced, over all experiments.
    pub quality: Of<M::Output, OutputFit>,
    /// Parameters and initial state of each experiment.
    pub experiments: Vec<Values<M>>,
    summary: Summary,
}

/// Parameters and initial state of one experiment.
pub struct Values<M: Model> {
    /// Parameters: the common ones and its own.
    pub parameters: Of<M::Parameters, f64>,
    /// State at the first sample.
    pub initial_state: Of<M::State, f64>,
}

impl<M: Model> Estimate<M> {
    /// An estimate of a model from its summary.
    ///
    /// # Errors
    /// A summary of other quantities than the model has.
    pub fn of(summary: Summary) -> Result<Self, crate::error::Error> {
        let layout = Layout::of::<M>();
        if summary.layout != layout {
            return Err(crate::error::Error::Option(format!(
                "the estimate is of another model: it has the quantities {:?}, the model has {layout:?}",
                summary.layout
            )));
        }
        let values = |one: &ExperimentEstimate| Values {
            parameters: M::Parameters::from_fn(|j| one.parameters[j]),
            initial_state: M::State::from_fn(|i| one.initial_state[i]),
        };
        summary.check()?;
        Ok(Estimate {
            parameters: M::Parameters::from_fn(|j| summary.parameters[j].value),
            knowledge: M::Parameters::from_fn(|j| summary.parameters[j].knowledge),
            quality: M::Output::from_fn(|j| summary.outputs[j].fit),
            experiments: summary.experiments.iter().map(values).collect(),
            summary,
        })
    }

    /// All that was found, quantities by name.
    pub fn summary(&self) -> &Summary {
        &self.summary
    }

    /// The same, without the model's names.
    pub fn into_summary(self) -> Summary {
        self.summary
    }
}

impl<M: Model> Deref for Estimate<M> {
    type Target = Summary;

    fn deref(&self) -> &Summary {
        &self.summary
    }
}

impl<M: Model> Serialize for Estimate<M> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.summary.serialize(serializer)
    }
}

impl<'de, M: Model> Deserialize<'de> for Estimate<M> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Estimate::of(Summary::deserialize(deserializer)?).map_err(D::Error::custom)
    }
}

// `derive` would ask for the same of `M`.
impl<M: Model> Clone for Values<M> {
    fn clone(&self) -> Self {
        Values { ..*self }
    }
}

impl<M: Model> fmt::Debug for Values<M> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Values { parameters, initial_state } = self;
        f.debug_struct("Values").field("parameters", parameters).field("initial_state", initial_state).finish()
    }
}

impl<M: Model> Clone for Estimate<M> {
    fn clone(&self) -> Self {
        Estimate { experiments: self.experiments.clone(), summary: self.summary.clone(), ..*self }
    }
}

impl<M: Model> fmt::Debug for Estimate<M> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.summary.fmt(f)
    }
}

impl<M: Model> fmt::Display for Estimate<M> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(&self.summary, f)
    }
}
