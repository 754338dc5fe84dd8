//! [`Search`]: the optimizers that a fit accepts, and one round of a search.

use super::checkpoint::CheckpointFile;
use super::{Objective, Observer};
use crate::error::Error;
use crate::optimize::{
    GaussNewton, Infeasible, LeastSquaresState, LevenbergMarquardt, Linearization, Machine, Outcome,
};
use crate::scaling::Scaling;
use argmin::core::observers::Observe;
use argmin::core::{Executor, KV, Solver, State, TerminationReason, TerminationStatus};
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::sync::Arc;

/// A search that a fit can run.
pub trait Search:
    Machine
    + Clone
    + Send
    + Sync
    + Serialize
    + DeserializeOwned
    + for<'p> Solver<&'p Objective<'p>, LeastSquaresState>
    + 'static
{
    /// This search with tolerances of this size at least, for a cost that changes in the next round.
    fn rough(&self, tolerance: f64) -> Self;

    /// This search with at most so many trial steps, or the search itself if it has no such limit.
    fn limited(&self, iterations: u64) -> Self {
        let _ = iterations;
        self.clone()
    }

    /// The most trial steps; the largest number of a search that has no such limit.
    fn most(&self) -> u64 {
        u64::MAX
    }

    /// Checks the settings.
    ///
    /// # Errors
    /// The setting and its value.
    fn check(&self) -> Result<(), Error> {
        Ok(())
    }
}

impl<S: Scaling + Serialize + DeserializeOwned + 'static> Search for LevenbergMarquardt<S> {
    fn rough(&self, tolerance: f64) -> Self {
        LevenbergMarquardt::new(self.stop.rough(tolerance), self.scaling.clone())
    }

    fn limited(&self, iterations: u64) -> Self {
        LevenbergMarquardt::new(self.stop.limited(iterations), self.scaling.clone())
    }

    fn most(&self) -> u64 {
        self.stop.iterations
    }

    fn check(&self) -> Result<(), Error> {
        self.stop.check()
    }
}

impl Search for GaussNewton {
    fn rough(&self, tolerance: f64) -> Self {
        GaussNewton::new(self.stop.rough(tolerance))
    }

    fn limited(&self, iterations: u64) -> Self {
        GaussNewton::new(self.stop.limited(iterations))
    }

    fn most(&self) -> u64 {
        self.stop.iterations
    }

    fn check(&self) -> Result<(), Error> {
        self.stop.check()
    }
}

/// How one round of a search ended.
#[derive(Clone)]
pub(crate) struct Round {
    pub coordinates: Vec<f64>,
    pub linear: Option<Linearization>,
    pub outcome: Outcome,
    pub iterations: u64,
    pub evaluations: u64,
    pub name: String,
}

/// Why a round did not begin.
pub(crate) enum RoundError {
    /// There is no cost at the start, or the search was stopped there.
    Start(Infeasible),
    /// The optimizer returned an error.
    Optimizer(String),
}

/// A [`Search`] as an object.
pub(crate) trait Optimizer: Send + Sync {
    fn check(&self) -> Result<(), Error>;

    fn rough(&self, tolerance: f64) -> Arc<dyn Optimizer>;

    fn limited(&self, iterations: u64) -> Arc<dyn Optimizer>;

    fn most(&self) -> u64;

    /// Its settings, as text.
    fn settings(&self) -> Result<String, Error>;

    /// A copy, used as a [`Machine`].
    fn machine(&self) -> Box<dyn Machine + Send>;

    /// Its name.
    fn name(&self) -> String;

    /// One search of an objective with fixed noise.
    fn round(
        &self,
        objective: &Objective<'_>,
        start: Vec<f64>,
        file: Option<&CheckpointFile>,
    ) -> Result<Round, RoundError>;

    /// The point and the iterations of a checkpoint, and the search itself if it can be resumed.
    fn resume(&self, file: &CheckpointFile) -> Result<Option<Resumed>, Error>;

    /// Writes a checkpoint of a search that has not begun.
    fn begin(&self, file: &CheckpointFile, coordinates: &[f64]) -> Result<(), Error>;
}

/// Point, iterations so far, and the search if it can be resumed.
pub(crate) type Resumed = (Vec<f64>, u64, Option<Arc<dyn Optimizer>>);

impl<S: Search> Optimizer for S {
    fn check(&self) -> Result<(), Error> {
        Search::check(self)
    }

    fn rough(&self, tolerance: f64) -> Arc<dyn Optimizer> {
        Arc::new(Search::rough(self, tolerance))
    }

    fn limited(&self, iterations: u64) -> Arc<dyn Optimizer> {
        Arc::new(Search::limited(self, iterations))
    }

    fn most(&self) -> u64 {
        Search::most(self)
    }

    fn settings(&self) -> Result<String, Error> {
        serde_json::to_string(self).map_err(|error| Error::Optimizer(error.to_string()))
    }

    fn machine(&self) -> Box<dyn Machine + Send> {
        Box::new(self.clone())
    }

    fn name(&self) -> String {
        Solver::<&Objective<'_>, LeastSquaresState>::name(self).to_owned()
    }

    fn round(
        &self,
        objective: &Objective<'_>,
        start: Vec<f64>,
        file: Option<&CheckpointFile>,
    ) -> Result<Round, RoundError> {
        let counting = |state: LeastSquaresState| state.param(start.clone()).counting(true);
        let mut executor = Executor::new(objective, self.clone()).configure(counting).ctrlc(false);
        for (observer, mode) in &objective.problem.settings.observers {
            executor = executor.add_observer(Shared(observer.clone()), *mode);
        }
        if let Some(file) = file {
            executor = executor.checkpointing(file.clone());
        }
        let result = executor.run().map_err(|error| match error.downcast::<Infeasible>() {
            Ok(infeasible) => RoundError::Start(infeasible),
            Err(other) => RoundError::Optimizer(other.to_string()),
        })?;
        let state = result.state();
        let outcome = result.solver().outcome().unwrap_or(match state.get_termination_status() {
            TerminationStatus::Terminated(TerminationReason::MaxItersReached) => {
                Outcome::IterationLimit { iterations: state.get_iter() }
            }
            _ => Outcome::Cancelled,
        });
        let outcome = objective.control.named(outcome);
        if let Some(file) = file
            && let Some(place) = state.get_param()
        {
            file.note(file.write(place, state.get_iter(), result.solver()));
        }
        Ok(Round {
            coordinates: state.get_param().cloned().unwrap_or(start),
            linear: result.solver().linearization().cloned(),
            outcome,
            iterations: state.get_iter(),
            evaluations: state.get_func_counts().get("linearization_count").copied().unwrap_or(0),
            name: Optimizer::name(self),
        })
    }

    fn resume(&self, file: &CheckpointFile) -> Result<Option<Resumed>, Error> {
        let Some((place, iterations, saved)) = file.load::<S>()? else { return Ok(None) };
        // Only a search that has not ended, with the settings of this run, is resumed with its internal state.
        let saved = saved.filter(|saved| saved.outcome().is_none());
        Ok(Some((place, iterations, saved.map(|saved| Arc::new(saved) as Arc<dyn Optimizer>))))
    }

    fn begin(&self, file: &CheckpointFile, coordinates: &[f64]) -> Result<(), Error> {
        file.write(coordinates, 0, self)
    }
}

/// An observer that several rounds of one fit share.
struct Shared(Observer);

impl Observe<LeastSquaresState> for Shared {
    fn observe_init(&mut self, name: &str, state: &LeastSquaresState, kv: &KV) -> Result<(), argmin::core::Error> {
        self.0.lock().map_or(Ok(()), |mut observer| observer.observe_init(name, state, kv))
    }

    fn observe_iter(&mut self, state: &LeastSquaresState, kv: &KV) -> Result<(), argmin::core::Error> {
        self.0.lock().map_or(Ok(()), |mut observer| observer.observe_iter(state, kv))
    }

    fn observe_final(&mut self, state: &LeastSquaresState) -> Result<(), argmin::core::Error> {
        self.0.lock().map_or(Ok(()), |mut observer| observer.observe_final(state))
    }
}
