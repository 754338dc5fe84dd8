//! [`Prediction`]: what an estimate says of a record.

use super::{Estimate, Quality};
use crate::error::Error;
use crate::experiment::ExperimentOf;
use crate::fit::Fit;
use crate::integrate::Integrator;
use crate::model::Model;
use crate::parameter::fixed;
use crate::predict::Predictor;
use crate::signals::{Of, Signals};

/// What an estimate says of a record: the outputs it predicts, beside those measured.
#[derive(Debug)]
pub struct Prediction<M: Model> {
    /// Time of each sample (s).
    pub t: Vec<f64>,
    /// Predicted outputs, one row per sample; NaN where the method has no prediction.
    pub outputs: Vec<Of<M::Output, f64>>,
    /// Measured minus predicted, one row per sample; NaN where either is missing.
    pub residuals: Vec<Of<M::Output, f64>>,
    /// State at the first sample: given, measured, or estimated with the parameters kept.
    pub initial_state: Of<M::State, f64>,
    /// How well each output is reproduced.
    pub quality: Of<M::Output, Quality>,
}

impl<M: Model, I: Integrator<M>, P: Predictor<M>> Estimate<M, I, P> {
    /// Predicts the outputs of a record, of the fit or a new one, with these parameters. What the record leaves open of its
    /// initial state is estimated from it, the parameters kept.
    ///
    /// # Errors
    /// As [`Fit::run`], and a simulation that fails.
    pub fn predict(&self, model: &M, record: &ExperimentOf<M>) -> Result<Prediction<M>, Error> {
        self.predict_with(model, record, self.parameters)
    }

    /// The same with the parameters that an experiment of the fit has for itself, and its estimated initial state; `None`
    /// if the fit had no experiment of this index.
    ///
    /// # Errors
    /// As [`predict`](Self::predict).
    pub fn predict_own(
        &self,
        model: &M,
        record: &ExperimentOf<M>,
        experiment: usize,
    ) -> Option<Result<Prediction<M>, Error>> {
        let share = self.experiments.get(experiment)?;
        let record = record.clone().initial(M::State::map(share.initial_state, fixed));
        Some(self.predict_with(model, &record, share.parameters))
    }

    fn predict_with(
        &self,
        model: &M,
        record: &ExperimentOf<M>,
        parameters: Of<M::Parameters, f64>,
    ) -> Result<Prediction<M>, Error> {
        let fit = Fit::new(model, record).parameters(M::Parameters::map(parameters, fixed));
        // An output without any error tells no noise; that of this record does then.
        let sigma = M::Output::map(self.quality, |quality| quality.sigma);
        let noisy = M::Output::into_array(sigma).as_ref().iter().all(|sigma| *sigma > 0.0);
        let fit = if noisy { fit.noise(sigma) } else { fit };
        fit.integrator(self.integrator.clone()).predictor(self.predictor.clone()).simulate()
    }
}
