//! From an estimate to what it says of a record: a fit of nothing but the initial state.

use super::Fit;
use super::search::search;
use crate::error::Error;
use crate::estimate::{Estimate, Prediction, Summary};
use crate::experiment::ExperimentOf;
use crate::judge::output_fit;
use crate::model::Model;
use crate::parameter::fixed;
use crate::problem::{Control, Problem, Settings, Simulated};
use crate::record::Record;
use crate::signals::Signals;
use crate::sweep::Sweep;
use std::sync::Arc;

/// Predicts the outputs of a record with the parameters of an estimate.
pub(super) fn predict<'a>(sweep: Arc<dyn Sweep + 'a>, record: &Record, estimate: &Summary) -> Result<Simulated, Error> {
    let parameters: Vec<_> = estimate.parameters.iter().map(|parameter| fixed(parameter.value)).collect();
    // An output without any error tells no noise; that of this record does then.
    let sigma = estimate.sigma();
    let noisy = sigma.iter().all(|sigma| *sigma > 0.0);
    let settings = if noisy { Settings::default().noise(sigma) } else { Settings::default() };
    let problem = Problem::unchecked(sweep, vec![record.clone()], &parameters, settings)?;
    let objective = problem.in_units(&Control::NEVER);
    let coordinates = match problem.unknowns.row.is_empty() {
        true => vec![],
        false => {
            problem.check_measured()?;
            search(&objective, &problem.settings.optimizer)?.coordinates
        }
    };
    objective.predict(0, &coordinates)
}

impl<M: Model> Fit<'_, M> {
    /// What an estimate says of a record, predicted by the method and the predictor of this fit; its own records,
    /// parameters and settings do not matter. What the record leaves open of its initial state is estimated from it.
    ///
    /// # Errors
    /// As [`run`](Fit::run), and a simulation that fails.
    pub fn predict(&self, estimate: &Estimate<M>, record: &ExperimentOf<M>) -> Result<Prediction<M>, Error> {
        let model = crate::functions::Handle::Borrowed(self.model);
        let sweep = super::sweep(model, &self.stepping, &self.predictor)?;
        predict(sweep, record.record(), estimate).map(|found| typed(found, record))
    }
}

impl<M: Model> Estimate<M> {
    /// Simulates the outputs of a record, of the fit or a new one, with these parameters and the default step. What the
    /// record leaves open of its initial state is estimated from it, the parameters kept.
    ///
    /// # Errors
    /// As [`Fit::run`](crate::Fit::run), and a simulation that fails.
    pub fn predict(&self, model: &M, record: &ExperimentOf<M>) -> Result<Prediction<M>, Error> {
        let parameters = M::Parameters::map(self.parameters, fixed);
        Fit::new(model, record).parameters(parameters).predict(self, record)
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
        let own = self.experiments.get(experiment)?;
        let record = record.clone().initial(M::State::map(own.initial_state, fixed));
        let mut summary = self.summary().clone();
        let values = M::Parameters::into_array(own.parameters);
        summary.parameters.iter_mut().zip(values).for_each(|(parameter, value)| parameter.value = value);
        Some(Estimate::of(summary).and_then(|own| own.predict(model, &record)))
    }
}

/// A prediction by the model's names.
fn typed<M: Model>(found: Simulated, record: &ExperimentOf<M>) -> Prediction<M> {
    let Simulated { outputs, residuals, initial_state } = &found;
    let channels = record.record().outputs();
    Prediction {
        t: (0..record.len()).map(|k| record.time(k)).collect(),
        quality: M::Output::from_fn(|j| output_fit(&channels[j].values, &residuals[j])),
        outputs: (0..record.len()).map(|k| M::Output::from_fn(|j| outputs[j][k])).collect(),
        residuals: (0..record.len()).map(|k| M::Output::from_fn(|j| residuals[j][k])).collect(),
        initial_state: M::State::from_fn(|i| initial_state[i]),
        columns: found,
    }
}
