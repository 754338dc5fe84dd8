//! [`Settings`]: the settings of a fit besides model, records and parameters.

use super::{Noise, Optimizer};
use crate::error::Error;
use crate::layout::Layout;
use crate::loss::Loss;
use crate::numeral::exact;
use crate::optimize::{LeastSquaresState, LevenbergMarquardt};
use crate::prefilter::Butterworth;
use crate::record::Record;
use crate::sweep::Sweep;
use argmin::core::observers::{Observe, ObserverMode};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicU64};
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// All searches of a fit are in memory together.
const MOST_STARTS: usize = 100_000;

pub(crate) type Observer = Arc<Mutex<Box<dyn Observe<LeastSquaresState> + Send>>>;

/// The weight of each sample of a record.
pub(crate) trait Weights: Send + Sync {
    /// The weight of sample `k`.
    fn weight(&self, record: &Record, k: usize) -> f64;
    /// Checks the weighting against the model.
    fn check(&self) -> Result<(), Error>;
    /// Name and constants, for reports.
    fn describe(&self) -> String;
}

/// The settings of a fit besides model, records and parameters; all have defaults.
#[derive(Clone)]
pub(crate) struct Settings {
    pub(crate) noise: Noise,
    pub(crate) input_noise: Option<Vec<f64>>,
    pub(crate) loss: Option<Arc<dyn Loss>>,
    pub(crate) weights: Option<Arc<dyn Weights>>,
    pub(crate) prefilter: Option<Butterworth>,
    pub(crate) cancel: Option<Arc<AtomicBool>>,
    pub(crate) counter: Option<Arc<AtomicU64>>,
    pub(crate) time_limit: Option<Duration>,
    pub(crate) observers: Vec<(Observer, ObserverMode)>,
    pub(crate) checkpoint: Option<(PathBuf, u64)>,
    pub(crate) optimizer: Arc<dyn Optimizer>,
    pub(crate) searches: SearchPlan,
    /// What leads each start to the data before the search.
    pub(crate) lead: Lead,
}

/// Fits of an easier cost before the search of a simulation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Lead {
    /// Nothing, unless the start cannot be simulated or explains nothing.
    Declared,
    /// Predictions by a filter, less corrected in each stage, then multiple shooting.
    Stages,
    /// Multiple shooting alone.
    Shooting,
}

/// From where a fit searches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum SearchPlan {
    /// From the declared start; from others only if that explains nothing.
    Single,
    /// From so many starts, as was asked for.
    All(usize),
    /// From so many starts, of which only the best are searched to their ends.
    Best(usize),
}

impl SearchPlan {
    /// How many there are at first.
    pub fn count(self) -> usize {
        match self {
            SearchPlan::Single => 1,
            SearchPlan::All(count) | SearchPlan::Best(count) => count,
        }
    }
}

impl Settings {
    /// Those of a problem beside the fit, with this noise: without its checkpoint, its observers and its further starts.
    pub(crate) fn beside(&self, noise: Noise) -> Self {
        Settings { noise, checkpoint: None, observers: vec![], searches: SearchPlan::Single, ..self.clone() }
    }
}

impl Default for Settings {
    fn default() -> Self {
        Settings {
            noise: Noise::PerOutput,
            input_noise: None,
            loss: None,
            weights: None,
            prefilter: None,
            cancel: None,
            counter: None,
            time_limit: None,
            observers: vec![],
            checkpoint: None,
            optimizer: Arc::new(<LevenbergMarquardt>::default()),
            searches: SearchPlan::Single,
            lead: Lead::Declared,
        }
    }
}

impl Settings {
    /// These settings, with the noise set to `Predicted` where the sweep predicts variances.
    pub(super) fn of(mut self, sweep: &dyn Sweep) -> Self {
        if sweep.predicts_variance() {
            self.noise = Noise::Predicted;
        }
        self
    }

    /// Checks the settings against layout and records.
    pub(super) fn check(&self, layout: &Layout, records: &[Record]) -> Result<(), Error> {
        let given = match &self.noise {
            Noise::Given(sigma) => Some(sigma.len()),
            Noise::SomeGiven(sigma) => Some(sigma.len()),
            _ => None,
        };
        let expected = layout.outputs.len();
        if let Some(found) = given.filter(|found| *found != expected) {
            return Err(Error::Option(format!("{found} noise level(s) are given for {expected} output(s)")));
        }
        for (j, output) in layout.outputs.iter().enumerate() {
            if let Some(value) = self.noise.given(j).filter(|sigma| !(*sigma > 0.0 && sigma.is_finite())) {
                return Err(Error::NotPositive { what: format!("the noise of output `{}`", output.name), value });
            }
        }
        let count = self.searches.count();
        if !(1..=MOST_STARTS).contains(&count) {
            return Err(Error::Option(format!("a fit from {count} starts was asked for; take 1 to {MOST_STARTS}")));
        }
        self.check_input_noise(layout)?;
        self.loss.as_ref().map_or(Ok(()), |loss| loss.check())?;
        if let Some(filter) = &self.prefilter {
            records.iter().try_for_each(|record| filter.check(record))?;
        }
        self.check_weights(records)
    }

    fn check_input_noise(&self, layout: &Layout) -> Result<(), Error> {
        let Some(sigma) = &self.input_noise else { return Ok(()) };
        if sigma.len() != layout.inputs.len() {
            let (found, expected) = (sigma.len(), layout.inputs.len());
            return Err(Error::Option(format!("{found} noise level(s) are given for {expected} input(s)")));
        }
        match sigma.iter().position(|s| !(*s >= 0.0 && s.is_finite())) {
            Some(j) => Err(Error::Option(format!(
                "the noise of input `{}` is {}; it must be finite and not negative",
                layout.inputs[j].name, sigma[j]
            ))),
            None => Ok(()),
        }
    }

    /// Weights must be finite, not negative, and not zero wherever something was measured.
    fn check_weights(&self, records: &[Record]) -> Result<(), Error> {
        let Some(weights) = &self.weights else { return Ok(()) };
        weights.check()?;
        let mut counts = false;
        for record in records {
            for k in 0..record.len() {
                let weight = weights.weight(record, k);
                if !(weight >= 0.0 && weight.is_finite()) {
                    let (name, t) = (record.name(), record.moment(k));
                    return Err(Error::Option(format!(
                        "weighting: the weight of sample {k} (t = {t}) of experiment `{name}` is {}; weights must \
                         be finite and not negative",
                        exact(weight)
                    )));
                }
                counts |= weight > 0.0 && record.outputs().iter().any(|channel| !channel.values[k].is_nan());
            }
        }
        if counts {
            return Ok(());
        }
        Err(Error::Option(format!(
            "weighting: `{}` is zero at every sample with a measured output; nothing is left to fit",
            weights.describe()
        )))
    }
}
