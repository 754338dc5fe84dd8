//! [`FreeRun`]: simulation.

use super::Predictor;
use serde::{Deserialize, Serialize};

/// Simulation from the initial state to the end of the record: the prediction error is the simulation error (the output
/// error of Ljung, *System Identification*, 1999, section 4.3). Right where the noise is in the measurement.
///
/// ```
/// # use greybox::{Experiment, Fit, free, pmsm::{Surface, Winding}};
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// # let model = Surface::new(4)?;
/// # let record = Experiment::from_file(&model, "examples/data/pmsm.csv")?;
/// # let start = Winding { rs: free(1.0), ls: free(2e-3), ke: free(0.7) };
/// let estimate = Fit::new(&model, &record).parameters(start).predictor(greybox::FreeRun).run()?; // the default
/// assert_eq!(estimate.method.predictor, "simulation error");
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct FreeRun;

impl Predictor for FreeRun {
    fn describe(&self) -> String {
        "simulation error".to_owned()
    }
}
