//! [`FreeRun`]: simulation.

use super::{Predictor, Walk};
use crate::error::Error;
use crate::experiment::ExperimentOf;
use crate::integrate::{Integrator, Stuck};
use crate::model::Model;
use crate::scalar::Scalar;
use crate::signals::Of;
use serde::{Deserialize, Serialize};

/// Simulation from the initial state to the end of the record: the prediction error is the simulation error (the output
/// error of Ljung, *System Identification*, 1999, section 4.3). Right where the noise is in the measurement.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct FreeRun;

impl<M: Model> Predictor<M> for FreeRun {
    const CARRIES: bool = true;
    type Prepared = ();

    fn prepare(&self, _: &M, _: &ExperimentOf<M>, _: &Of<M::Parameters, f64>) -> Result<(), Error> {
        Ok(())
    }

    #[inline(always)]
    fn state<S: Scalar, I: Integrator>(
        &self,
        walk: &Walk<'_, M, I>,
        _prepared: &(),
        k: usize,
        x: Of<M::State, S>,
        p: &Of<M::Parameters, S>,
        memory: &mut I::Memory,
    ) -> Result<Option<Of<M::State, S>>, Stuck> {
        if k == 0 { Ok(Some(x)) } else { walk.advance(k - 1, x, p, memory).map(Some) }
    }

    fn describe(&self) -> String {
        "simulation error".to_owned()
    }
}
