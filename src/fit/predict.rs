//! Prediction of a record by an estimate, and its states: a fit of the initial state alone.

use super::Fit;
use super::fittable::{Made, crosses, finer};
use super::search::search;
use crate::error::Error;
use crate::estimate::{Estimate, Prediction, StatesOf, Summary};
use crate::experiment::ExperimentOf;
use crate::integrate::exact;
use crate::model::Model;
use crate::parameter::fixed;
use crate::problem::{Control, Noise, Objective, Problem, Settings, Simulated};
use crate::record::Record;
use crate::residuals::output_fit;
use crate::signals::Signals;
use crate::sweep::Sweep;
use std::sync::Arc;

/// What is asked of a record with the parameters of an estimate, at the initial state that fits it best.
pub(super) fn asked<'a, T>(
    sweep: Arc<dyn Sweep + 'a>,
    record: &Record,
    estimate: &Summary,
    ask: impl FnOnce(&Objective<'_>, &[f64]) -> Result<T, Error>,
) -> Result<T, Error> {
    let own = estimate.of_record(record)?;
    let parameters: Vec<_> = own.parameters.iter().map(|parameter| fixed(parameter.value)).collect();
    // An output without any error gives no noise level; it is then estimated from this record.
    let sigma = estimate.sigma();
    let noisy = sigma.iter().all(|sigma| *sigma > 0.0);
    let settings =
        if noisy { Settings { noise: Noise::Given(sigma), ..Settings::default() } } else { Settings::default() };
    let problem = Problem::unchecked(sweep, vec![record.clone()], &parameters, settings)?;
    let objective = problem.in_units(&Control::NEVER);
    let coordinates = match problem.unknowns.row.is_empty() {
        true => vec![],
        false => {
            problem.check_measured()?;
            search(&objective, &problem.settings.optimizer, problem.unknowns.start())?.coordinates
        }
    };
    ask(&objective, &coordinates)
}

impl<M: Model> Fit<'_, M> {
    /// Predicts a record by an estimate, with the integrator and the predictor of this fit; the fit's own records,
    /// parameters and other settings are not used. Free initial states are estimated from the record. Parameters that each experiment of the fit had for
    /// itself are those of the experiment of the record's name.
    ///
    /// # Errors
    /// As [`run`](Fit::run), and a simulation that fails; a record that is none of the fit, where each had parameters for itself.
    pub fn predict(&self, estimate: &Estimate<M>, record: &ExperimentOf<M>) -> Result<Prediction<M>, Error> {
        let sweep = self.sweep_of(estimate)?;
        let found = asked(sweep, record.record(), estimate, |objective, at| objective.predict(0, at))?;
        Ok(typed(found, record))
    }

    /// The state after each sample's measurements, by the filter of this fit with the parameters of an estimate, on a record of the fit or a new
    /// one; as [`predict`](Fit::predict) otherwise.
    ///
    /// # Errors
    /// As [`predict`](Fit::predict); a predictor other than [`Kalman`](crate::Kalman) and [`SecondOrder`](crate::SecondOrder).
    pub fn filtered(&self, estimate: &Estimate<M>, record: &ExperimentOf<M>) -> Result<StatesOf<M>, Error> {
        self.states(estimate, record, false)
    }

    /// The state at each sample by all measurements of the record, before it and after it: the mean and covariance of what is known of it in the
    /// end (fixed-interval smoother of Rauch, Tung and Striebel, AIAA Journal 3 (1965) 1445-1450, by the model's slopes where it is not affine, to the second order by
    /// their means).
    /// The parameters and an initial state that is estimated count as known.
    ///
    /// # Errors
    /// As [`filtered`](Fit::filtered).
    pub fn smoothed(&self, estimate: &Estimate<M>, record: &ExperimentOf<M>) -> Result<StatesOf<M>, Error> {
        self.states(estimate, record, true)
    }

    fn states(&self, estimate: &Estimate<M>, record: &ExperimentOf<M>, smoothed: bool) -> Result<StatesOf<M>, Error> {
        let sweep = self.sweep_of(estimate)?;
        let columns = asked(sweep, record.record(), estimate, |objective, at| objective.states(0, at, smoothed))?;
        let row = |of: &[Vec<f64>], k: usize| M::State::from_fn(|i| of[i][k]);
        Ok(StatesOf {
            t: (0..record.len()).map(|k| record.time(k)).collect(),
            means: (0..record.len()).map(|k| row(&columns.means, k)).collect(),
            deviations: (0..record.len()).map(|k| row(&columns.deviations, k)).collect(),
            columns,
        })
    }

    /// The sweep of this fit, by the method of the estimate, where the fit would have come to it by itself.
    fn sweep_of(&self, estimate: &Estimate<M>) -> Result<Arc<dyn Sweep + '_>, Error> {
        let predictor = self.predictor.as_ref();
        // A simulation after a filter that crossed intervals exactly does so, too.
        let is_exact = crosses(predictor) && estimate.method.integrator == exact().describe(M::KIND);
        let stepping = self.stepping.clone().or_else(|| is_exact.then(|| self.model.exact()).flatten());
        let sweep = M::sweep(self.model.lent(), stepping.as_ref(), predictor)?;
        let finer = finer(self.model.lent(), stepping.as_ref(), predictor);
        Ok(finer.by_number(estimate.method.refinement).unwrap_or(sweep))
    }
}

impl<M: Model> Estimate<M> {
    /// Simulates the outputs of a record, of the fit or a new one, with these parameters and the default step. Free
    /// initial states are estimated from the record; the parameters stay fixed.
    ///
    /// # Errors
    /// As [`Fit::run`](crate::Fit::run), and a simulation that fails.
    pub fn predict(&self, model: &M, record: &ExperimentOf<M>) -> Result<Prediction<M>, Error> {
        let parameters = M::Parameters::map(self.parameters, fixed);
        Fit::new(model, record).parameters(parameters).predict(self, record)
    }

    /// [`predict`](Self::predict) with the local parameters of an experiment of the fit and its estimated initial state; `None` if the
    /// fit had no experiment of this index.
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
        let summary = self.summary().of_experiment(experiment)?;
        Some(Estimate::of(summary).and_then(|own| own.predict(model, &record)))
    }
}

/// A prediction with the model's types.
fn typed<M: Model>(found: Simulated, record: &ExperimentOf<M>) -> Prediction<M> {
    let Simulated { outputs, residuals, initial_state, .. } = &found;
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
