//! [`Horizon`]: prediction a fixed number of samples ahead.

use super::Predictor;
use super::measured::Place;
use crate::error::Error;
use crate::functions::Functions;
use crate::integrate::Duals;
use crate::layout::Layout;
use crate::prefilter::{Butterworth, filtered};
use crate::record::Record;
use serde::{Deserialize, Serialize};

/// Prediction `steps` samples ahead: each output is simulated from the state measured that many samples earlier, so
/// that model error and disturbances act no longer than the horizon (Ljung, *System Identification*, 1999, section 3.2,
/// for a measured state). Needs outputs that determine the state, and treats them as exact: noise biases short
/// horizons.
///
/// The first samples are predicted from the initial state. Where the state was not measured, the output `steps` samples
/// later is not predicted.
///
/// ```
/// # use greybox::{Experiment, Fit, free, pmsm::{Surface, Winding}};
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// # let model = Surface::new(4)?;
/// # let record = Experiment::from_file(&model, "examples/data/pmsm.csv")?;
/// # let start = Winding { rs: free(1.0), ls: free(2e-3), ke: free(0.7) };
/// use greybox::Horizon;
/// let estimate = Fit::new(&model, &record).parameters(start).predictor(Horizon::new(20)).run()?; // 20 samples ahead
/// assert!((estimate.parameters.ls / 4e-3 - 1.0).abs() < 0.01);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Horizon {
    /// Samples from the measured state to the predicted output: one or more, and fewer than the record has.
    pub steps: usize,
    /// Source of the restarted states: the outputs as measured, or filtered forward and backward.
    pub filter: Option<Butterworth>,
}

impl Horizon {
    /// Restarts from the measured states.
    pub fn new(steps: usize) -> Self {
        Horizon { steps, filter: None }
    }

    /// Restarts from the states that the outputs give after zero-phase filtering, so that less of their noise enters;
    /// the predictions are compared with the outputs as measured.
    pub fn filtered(self, filter: Butterworth) -> Self {
        Horizon { filter: Some(filter), ..self }
    }

    /// The state that was measured at each sample, sample by sample; NaN where there is none. With the parameters `p`,
    /// on which the outputs must not depend.
    ///
    /// # Errors
    /// Steps that the record does not have, outputs that do not give the state.
    pub(crate) fn states(
        &self,
        layout: &Layout,
        functions: &dyn Functions<Duals>,
        record: &Record,
        p: &[f64],
    ) -> Result<Vec<f64>, Error> {
        let smooth = self.filter.as_ref().map(|filter| filtered(record, filter)).transpose()?;
        let record = smooth.as_ref().unwrap_or(record);
        let (steps, samples, n) = (self.steps, record.len(), layout.states.len());
        if steps == 0 || steps >= samples {
            return Err(Error::Option(format!(
                "a prediction {steps} sample(s) ahead makes no sense for experiment `{}` of {samples} samples; take at least \
                 1 and fewer than {samples}, or FreeRun to simulate it whole",
                record.name()
            )));
        }
        let constants: Vec<Duals> = p.iter().map(|p| Duals::constant(*p)).collect();
        let mut delays = vec![Duals::constant(0.0); record.inputs().len()];
        functions.delay(&constants, &mut delays);
        let delays: Vec<Option<f64>> = delays.iter().map(|delay| (delay.value != 0.0).then_some(delay.value)).collect();
        let not_measured = |reason| Error::StateNotMeasured {
            experiment: record.name().to_owned(),
            reason,
            remedy: "predictions restart from measured states: simulate the record whole (FreeRun, the default), estimate the \
                     states by a filter (Kalman), or record the missing outputs",
        };
        let mut why = None;
        let mut states = vec![f64::NAN; n * samples];
        let mut known = 0;
        for k in 0..samples {
            let (t, u, y) = (record.time(k), record.late_inputs(k, &delays), record.output(k));
            let place = Place { layout, functions, t, u: &u, p };
            match place.state(&y) {
                Ok(x) => {
                    known += 1;
                    if known == 1
                        && let Some(name) = place.depends_on_parameter(&x)
                    {
                        return Err(not_measured(format!("the outputs depend on the parameter `{name}`, too")));
                    }
                    states[k * n..(k + 1) * n].copy_from_slice(&x);
                }
                Err(reason) => why = why.or(Some(reason)),
            }
        }
        match why {
            Some(reason) if known == 0 => Err(not_measured(reason)),
            _ => Ok(states),
        }
    }
}

impl Predictor for Horizon {
    fn restarts(&self) -> Option<Horizon> {
        Some(*self)
    }

    fn describe(&self) -> String {
        let from = self.filter.as_ref().map(|filter| format!(" of states filtered by {}", filter.describe()));
        format!("prediction {} sample(s) ahead{}", self.steps, from.unwrap_or_default())
    }
}
