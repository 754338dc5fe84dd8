//! [`CheckpointFile`]: the state of a search in a file, from which another process can resume.
//!
//! argmin resumes from any file that it finds, and a checkpoint of a finished run or of another problem then ends the
//! new run after 0 iterations, unreported. So the file holds a fingerprint of data and settings, and only the point and
//! the solver's internal state are taken over: the search continues, however the old one ended.

use super::Fingerprint;
use crate::error::Error;
use crate::optimize::LeastSquaresState;
use argmin::core::State;
use argmin::core::checkpointing::{Checkpoint, CheckpointingFrequency};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::value::RawValue;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

/// Path of a checkpoint, interval between writes, and the fingerprint of its problem.
#[derive(Clone, Debug)]
pub(crate) struct CheckpointFile {
    pub path: PathBuf,
    pub every: u64,
    pub fingerprint: Fingerprint,
    /// The solver as it is set in this run, as text.
    pub settings: String,
    /// Iterations of earlier runs.
    pub before: u64,
    /// The last error in writing; it does not stop the search.
    write_error: Arc<Mutex<Option<String>>>,
}

/// What the file holds. The solver is kept as text, so that all else is compiled once, not for each kind of solver.
#[derive(Serialize, Deserialize)]
struct Saved {
    /// Format of the file.
    format: Format,
    version: Version,
    problem: Fingerprint,
    iterations: u64,
    #[serde(with = "crate::real")]
    coordinates: Vec<f64>,
    /// The solver as it was set, as text.
    settings: String,
    solver: Box<RawValue>,
}

crate::format::format!("greybox checkpoint", 4);

const OTHER: &str = "it belongs to another problem (other data, equations, constants, weighting, parameters or settings); \
                     delete it or name another file";

/// Point, iterations so far, and the solver if it can be resumed.
type Resumed<S> = (Vec<f64>, u64, Option<S>);

impl CheckpointFile {
    /// A file for the search of one problem.
    pub fn new(path: PathBuf, every: u64, fingerprint: Fingerprint, settings: String) -> Self {
        CheckpointFile { path, every, fingerprint, settings, before: 0, write_error: Arc::default() }
    }

    /// The last error in writing.
    pub fn write_error(&self) -> Option<String> {
        self.write_error.lock().ok().and_then(|write_error| write_error.clone())
    }

    /// Keeps the last error in writing.
    pub fn note(&self, written: Result<(), Error>) {
        if let Err(error) = written
            && let Ok(mut write_error) = self.write_error.lock()
        {
            *write_error = Some(error.to_string());
        }
    }

    /// The point, the iterations so far and, if its settings are those of this run, the solver of an earlier run;
    /// `None` if there is no file yet.
    pub fn load<S: DeserializeOwned>(&self) -> Result<Option<Resumed<S>>, Error> {
        let Some(saved) = self.read()? else { return Ok(None) };
        let solver = (saved.settings == self.settings).then(|| serde_json::from_str(saved.solver.get()));
        let solver = solver.transpose().map_err(|error| self.unreadable(&error))?;
        Ok(Some((saved.coordinates, saved.iterations, solver)))
    }

    fn read(&self) -> Result<Option<Saved>, Error> {
        // Reading a device may never end, and a device must not be replaced by a file.
        if std::fs::metadata(&self.path).is_ok_and(|meta| !meta.is_file()) {
            let problem = "it is no regular file; name one that can be written".to_owned();
            return Err(Error::Checkpoint { path: self.path.clone(), problem });
        }
        let text = match std::fs::read_to_string(&self.path) {
            Ok(text) => text,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(Error::File { path: self.path.clone(), source: Box::new(error) }),
        };
        let saved: Saved = crate::format::read::<Format, Version, _>(&text).map_err(|error| self.unreadable(&error))?;
        match saved.problem.is_same(&self.fingerprint) {
            true => Ok(Some(saved)),
            false => Err(Error::Checkpoint { path: self.path.clone(), problem: OTHER.to_owned() }),
        }
    }

    fn unreadable(&self, error: &serde_json::Error) -> Error {
        let problem = format!("it cannot be read ({error}); delete it to start afresh");
        Error::Checkpoint { path: self.path.clone(), problem }
    }

    /// Writes a temporary file in the same folder and renames it.
    pub fn write<S: Serialize>(&self, coordinates: &[f64], iterations: u64, solver: &S) -> Result<(), Error> {
        self.write_text(coordinates, iterations, serde_json::to_string(solver))
    }

    fn write_text(
        &self,
        coordinates: &[f64],
        iterations: u64,
        solver: Result<String, serde_json::Error>,
    ) -> Result<(), Error> {
        let saved = |solver| Saved {
            format: Format,
            version: Version,
            problem: self.fingerprint.clone(),
            iterations: self.before + iterations,
            coordinates: coordinates.to_vec(),
            settings: self.settings.clone(),
            solver,
        };
        let file = |source: Box<dyn std::error::Error + Send + Sync>| Error::File { path: self.path.clone(), source };
        let text = solver.and_then(RawValue::from_string).and_then(|solver| serde_json::to_string(&saved(solver)));
        let text = text.map_err(|error| file(Box::new(error)))?;
        write_whole(&self.path, text.as_bytes()).map_err(|error| file(Box::new(error)))
    }
}

impl<S: Serialize> Checkpoint<S, LeastSquaresState> for CheckpointFile {
    fn save(&self, solver: &S, state: &LeastSquaresState) -> Result<(), argmin::core::Error> {
        let place = state.get_param().map(Vec::as_slice).unwrap_or_default();
        self.note(self.write(place, state.get_iter(), solver));
        Ok(())
    }

    /// Loading is done before argmin starts, where a wrong file can be refused.
    fn load(&self) -> Result<Option<(S, LeastSquaresState)>, argmin::core::Error> {
        Ok(None)
    }

    fn frequency(&self) -> CheckpointingFrequency {
        CheckpointingFrequency::Every(self.every.max(1))
    }
}

/// Writes a temporary file in the same folder and renames it: a reader finds either the old or the new file, complete.
fn write_whole(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    let mut beside = path.as_os_str().to_owned();
    beside.push(format!(".{}.part", std::process::id()));
    let beside = PathBuf::from(beside);
    let result = std::fs::write(&beside, bytes).and_then(|()| std::fs::rename(&beside, path));
    if result.is_err() {
        // Best effort: the first error is the one to report.
        let _ = std::fs::remove_file(&beside);
    }
    result
}
