//! [`Prediction`]: what an estimate says of a record.

use super::OutputFit;
use crate::model::Model;
use crate::problem::Simulated;
use crate::signals::Of;

/// Prediction of a record by an estimate, beside the measured outputs.
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
    pub quality: Of<M::Output, OutputFit>,
    /// The predictions by columns.
    pub columns: Simulated,
}

impl<M: Model> AsRef<Simulated> for Prediction<M> {
    fn as_ref(&self) -> &Simulated {
        &self.columns
    }
}
