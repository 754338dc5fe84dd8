//! [`FreeRun`]: simulation.

use super::Predictor;
use serde::{Deserialize, Serialize};

/// Simulation from the initial state to the end of the record: the prediction error is the simulation error (the output
/// error of Ljung, *System Identification*, 1999, section 4.3). Right where the noise is in the measurement.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct FreeRun;

impl Predictor for FreeRun {
    fn describe(&self) -> String {
        "simulation error".to_owned()
    }
}
