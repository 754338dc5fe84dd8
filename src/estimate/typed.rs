//! [`Estimate`]: a summary by the names of its model.

use super::{ExperimentEstimate, Knowledge, OutputFit, Summary};
use crate::error::Error;
use crate::layout::Layout;
use crate::model::Model;
use crate::signals::{Of, Signals};
use core::fmt;
use core::ops::Deref;
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// The result of a fit with its uncertainty, by the names of its model; everything of the [`Summary`] can be read from
/// it, too.
///
/// ```
/// # use greybox::{Experiment, Fit, free, pmsm::{Surface, Winding}};
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// # let model = Surface::new(4)?;
/// # let record = Experiment::from_file(&model, "examples/data/pmsm.csv")?;
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
    /// Knowledge of each parameter.
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
    pub fn of(summary: Summary) -> Result<Self, Error> {
        summary.check_layout::<M>()?;
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

    /// The estimate without the model's names.
    pub fn into_summary(self) -> Summary {
        self.summary
    }
}

impl Summary {
    /// Refuses a model of other quantities.
    fn check_layout<M: Model>(&self) -> Result<(), Error> {
        if self.layout.is_of::<M>() {
            return Ok(());
        }
        let layout = Layout::of::<M>();
        Err(Error::Option(format!(
            "the estimate is of another model: it has the quantities {:?}, the model has {layout:?}",
            self.layout
        )))
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
