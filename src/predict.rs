//! [`Predictor`]: what the model expects of each output, and the slopes of that.
//!
//! A record is walked in windows of [`WINDOW`] samples. In each window the states are carried forward as [`Dual`]s, eight
//! slopes at a time, and the prediction errors and slopes are laid down in columns, ready for filters, weights and the
//! triangle. Memory is one window, whatever the record's length.
//!
//! Slopes with respect to the initial state die away like `exp(-t / T)`. After some ten thousand samples they are
//! denormal numbers, on which processors are up to 60 times slower; so slopes below 1e-150 are set to zero between windows.

mod free_run;
mod horizon;
pub(crate) mod measured;

mod window;

pub use free_run::FreeRun;
pub use horizon::Horizon;

pub(crate) use window::{Seed, Target, Trajectory, WINDOW, Window};

use crate::error::Error;
use crate::experiment::ExperimentOf;
use crate::integrate::{Integrator, ModelSystem, Stuck};
use crate::interval::Hold;
use crate::model::Model;
use crate::scalar::Scalar;
use crate::signals::Of;
use core::fmt::Debug;

/// Where the state behind each predicted output comes from.
pub trait Predictor<M: Model>: Clone + Debug + Send + Sync {
    /// What is made of a record once, before the search (restart states).
    type Prepared: Send + Sync;

    /// Looks at a record once, with the parameters at their start.
    ///
    /// # Errors
    /// A record that the method cannot serve.
    fn prepare(
        &self,
        model: &M,
        experiment: &ExperimentOf<M>,
        p: &Of<M::Parameters, f64>,
    ) -> Result<Self::Prepared, Error>;

    /// The state that the output of sample `k` is predicted from. `x` is the one before (the initial one, for
    /// `k = 0`) if the method carries it on, else always the initial one.
    /// `None` where there is no prediction for lack of a measurement to start from.
    ///
    /// # Errors
    /// Where the integrator is [`Stuck`].
    fn state<S: Scalar, I: Integrator>(
        &self,
        walk: &Walk<'_, M, I>,
        prepared: &Self::Prepared,
        k: usize,
        x: Of<M::State, S>,
        p: &Of<M::Parameters, S>,
        memory: &mut I::Memory,
    ) -> Result<Option<Of<M::State, S>>, Stuck>;

    /// Which state to hand to the next sample: the one just reached (a simulation), or the initial one.
    const CARRIES: bool;

    /// Name and settings in a few words, for reports.
    fn describe(&self) -> String;
}

/// A model on its way through a record.
#[derive(Debug)]
pub struct Walk<'a, M: Model, I> {
    /// The equations.
    pub model: &'a M,
    /// The method that steps them.
    pub integrator: &'a I,
    /// The record.
    pub experiment: &'a ExperimentOf<M>,
    /// How its input behaves between samples; apart, so that a loop may be compiled for one hold.
    pub(crate) hold: Hold,
}

impl<M: Model, I> Clone for Walk<'_, M, I> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<M: Model, I> Copy for Walk<'_, M, I> {}

impl<'a, M: Model, I: Integrator> Walk<'a, M, I> {
    /// A model before its first step.
    pub fn new(model: &'a M, integrator: &'a I, experiment: &'a ExperimentOf<M>) -> Self {
        Walk { model, integrator, experiment, hold: experiment.input_hold() }
    }

    /// From sample `k` to sample `k + 1`.
    ///
    /// # Errors
    /// Where the integrator is [`Stuck`].
    #[inline(always)]
    pub fn advance<S: Scalar>(
        &self,
        k: usize,
        x: Of<M::State, S>,
        p: &Of<M::Parameters, S>,
        memory: &mut I::Memory,
    ) -> Result<Of<M::State, S>, Stuck> {
        let interval = self.experiment.interval(k, self.hold);
        ModelSystem { model: self.model, interval: &interval, p }.step(self.integrator, x, memory)
    }
}
