//! [`Prediction`] and [`StatesOf`]: what an estimate says of a record.

use super::OutputFit;
use crate::model::Model;
use crate::problem::Simulated;
use crate::signals::Of;
use crate::sweep::States;

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

/// The states of a record by an estimate, filtered or smoothed.
#[derive(Debug)]
pub struct StatesOf<M: Model> {
    /// Time of each sample (s).
    pub t: Vec<f64>,
    /// The mean at each sample.
    pub means: Vec<Of<M::State, f64>>,
    /// The standard deviation at each sample.
    pub deviations: Vec<Of<M::State, f64>>,
    /// The same by columns, with covariances.
    pub columns: States,
}
