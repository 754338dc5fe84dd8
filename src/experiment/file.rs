//! Experiments from files, and to CSV files.

use super::{Experiment, ExperimentOf};
use crate::error::Error;
use crate::layout::Layout;
use crate::model::Model;
use crate::record::DataFile;
use crate::signals::Signals;
use std::path::{Path, PathBuf};

impl DataFile {
    /// Reads the record of a model; it is named after the file.
    ///
    /// # Errors
    /// A file that cannot be read; a missing or ambiguous column (the message lists those there); a cell that is no
    /// number, a missing input, time that runs backwards, dates that can be read in two ways, a unit that is not the signal's, a row of another length (each with its line); a factor that
    /// is not positive; a signal that the model does not have; whatever [`Experiment::new`] refuses.
    pub fn read<M: Model>(&self, _model: &M) -> Result<ExperimentOf<M>, Error> {
        self.read_record(&Layout::of::<M>()).map(Experiment::of)
    }
}

impl<X: Signals, U: Signals, Y: Signals> Experiment<X, U, Y> {
    /// Reads a record from a file whose columns are named as the signals of the model, in their units, and one of time; see
    /// [`DataFile`] for what is found by itself, and for files that are otherwise.
    ///
    /// # Errors
    /// The errors of [`DataFile::read`].
    pub fn from_file<M: Model<State = X, Input = U, Output = Y>>(
        model: &M,
        path: impl Into<PathBuf>,
    ) -> Result<Self, Error> {
        DataFile::new(path).read(model)
    }

    /// Writes `t`, inputs and outputs as columns under their names, a missing output as an empty cell. Reading the file
    /// gives the signals back to the last bit, and an even time to its rounding; hold, initial state and name are not in
    /// it (JSON keeps them).
    ///
    /// # Errors
    /// A file that cannot be written (it is left as it was); an input and an output of one name.
    pub fn to_csv(&self, path: impl AsRef<Path>) -> Result<(), Error> {
        self.record().to_csv(path)
    }
}
