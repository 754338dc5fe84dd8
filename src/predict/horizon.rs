//! [`Horizon`]: prediction a fixed number of samples ahead.

use super::{Predictor, Walk, measured};
use crate::error::Error;
use crate::experiment::ExperimentOf;
use crate::integrate::{Integrator, Stuck};
use crate::model::Model;
use crate::prefilter::{Butterworth, zero_phase};
use crate::scalar::Scalar;
use crate::signals::{Of, Signals};
use serde::{Deserialize, Serialize};

/// Prediction `steps` samples ahead: each output is simulated from the state measured that many samples earlier, so that
/// model error and disturbances are forgotten after the horizon (Ljung, *System Identification*, 1999, section 3.2, for a
/// measured state). Needs outputs that give the state, and takes them as exact: noise biases short horizons.
///
/// The first samples are predicted from the initial state. Where the state was not measured, the output `steps` samples
/// later is not predicted.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Horizon {
    /// Samples from the measured state to the predicted output: one or more, and fewer than the record has.
    pub steps: usize,
    /// What the states are restarted from: the outputs as measured, or filtered forward and backward.
    pub filter: Option<Butterworth>,
}

impl Horizon {
    /// Restarts from the measured states.
    pub fn new(steps: usize) -> Self {
        Horizon { steps, filter: None }
    }

    /// Restarts from the states that the outputs give after zero-phase filtering, so that less of their noise enters; the
    /// predictions are compared with the outputs as measured.
    pub fn filtered(self, filter: Butterworth) -> Self {
        Horizon { filter: Some(filter), ..self }
    }
}

impl<M: Model> Predictor<M> for Horizon {
    const CARRIES: bool = false;
    /// The measured state at each sample; NaN where there is none.
    type Prepared = Vec<Of<M::State, f64>>;

    fn prepare(
        &self,
        model: &M,
        experiment: &ExperimentOf<M>,
        p: &Of<M::Parameters, f64>,
    ) -> Result<Self::Prepared, Error> {
        let filtered = self.filter.as_ref().map(|filter| zero_phase(experiment, filter)).transpose()?;
        let outputs = filtered.as_ref().map_or(experiment.outputs(), |filtered| filtered.outputs());
        let (steps, samples) = (self.steps, experiment.len());
        if steps == 0 || steps >= samples {
            return Err(Error::Option(format!(
                "a prediction {steps} sample(s) ahead makes no sense for experiment `{}` of {samples} samples; take at least \
                 1 and fewer than {samples}, or FreeRun to simulate it whole",
                experiment.name()
            )));
        }
        let mut why = None;
        let mut states = Vec::with_capacity(experiment.len());
        let mut known = 0;
        for (k, (u, y)) in experiment.inputs().iter().zip(outputs).enumerate() {
            let t = experiment.time(k);
            states.push(match measured::state(model, t, u, y, p) {
                Ok(x) => {
                    known += 1;
                    if known == 1
                        && let Some(name) = measured::depends_on_parameter(model, t, &x, u, p)
                    {
                        let reason = format!("the outputs depend on the parameter `{name}`, too");
                        return Err(Error::StateNotMeasured { experiment: experiment.name().to_owned(), reason });
                    }
                    x
                }
                Err(reason) => {
                    why = why.or(Some(reason));
                    M::State::splat(f64::NAN)
                }
            });
        }
        match why {
            Some(reason) if known == 0 => {
                Err(Error::StateNotMeasured { experiment: experiment.name().to_owned(), reason })
            }
            _ => Ok(states),
        }
    }

    #[inline(always)]
    fn state<S: Scalar, I: Integrator>(
        &self,
        walk: &Walk<'_, M, I>,
        prepared: &Self::Prepared,
        k: usize,
        start: Of<M::State, S>,
        p: &Of<M::Parameters, S>,
        memory: &mut I::Memory,
    ) -> Result<Option<Of<M::State, S>>, Stuck> {
        let steps = self.steps;
        let (mut x, first) = if k < steps {
            (start, 0)
        } else {
            let x = prepared[k - steps];
            if M::State::into_array(x).as_ref().iter().any(|x| x.is_nan()) {
                return Ok(None);
            }
            (M::State::map(x, S::from), k - steps)
        };
        for j in first..k {
            x = walk.advance(j, x, p, memory)?;
        }
        Ok(Some(x))
    }

    fn describe(&self) -> String {
        let from = self.filter.as_ref().map(|filter| format!(" of states filtered by {}", filter.describe()));
        format!("prediction {} sample(s) ahead{}", self.steps, from.unwrap_or_default())
    }
}
