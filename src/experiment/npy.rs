//! Experiments from NumPy files.

use super::Experiment;
use crate::error::Error;
use crate::layout::Layout;
use crate::model::Model;
use crate::record::Record;
use crate::signals::Signals;
use std::path::Path;

impl<X: Signals, U: Signals, Y: Signals> Experiment<X, U, Y> {
    /// A record in a folder of NumPy files, mapped into memory; see [`Record::from_npy`].
    ///
    /// # Errors
    /// The errors of [`Record::from_npy`].
    pub fn from_npy<M: Model<State = X, Input = U, Output = Y>>(
        _model: &M,
        folder: impl AsRef<Path>,
        step: Option<f64>,
    ) -> Result<Self, Error> {
        Record::from_npy(&Layout::of::<M>(), folder, step).map(Experiment::of)
    }
}
