//! From an estimate to what it says of a record: a fit of nothing but the initial state.

use super::Fit;
use crate::error::Error;
use crate::estimate::{Estimate, Prediction};
use crate::experiment::ExperimentOf;
use crate::integrate::Integrator;
use crate::model::Model;
use crate::parameter::fixed;
use crate::predict::Predictor;
use crate::signals::{Of, Signals};

impl<M: Model, I: Integrator, P: Predictor<M>> Estimate<M, I, P> {
    /// Predicts the outputs of a record, of the fit or a new one, with these parameters. What the record leaves open of its
    /// initial state is estimated from it, the parameters kept.
    ///
    /// # Errors
    /// As [`Fit::run`](crate::Fit::run), and a simulation that fails.
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
