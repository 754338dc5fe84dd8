//! [`CheckpointFile`]: a search that survives its process.
//!
//! argmin resumes from whatever it finds, and a checkpoint of a finished or of another run then ends the new one after 0
//! iterations without a word. So the file names its problem by a fingerprint of data and settings, and only the place
//! and the solver's memory are taken over: the search goes on, however the old one ended.

use crate::error::Error;
use crate::optimize::LeastSquaresState;
use argmin::core::State;
use argmin::core::checkpointing::{Checkpoint, CheckpointingFrequency};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

/// Where a search is saved, how often, and for which problem.
#[derive(Clone, Debug)]
pub(crate) struct CheckpointFile {
    pub path: PathBuf,
    pub every: u64,
    pub fingerprint: String,
    /// The solver as it is set in this run, as text.
    pub settings: String,
    /// Iterations of earlier runs.
    pub before: u64,
    /// What went wrong while saving; the search goes on all the same.
    trouble: Arc<Mutex<Option<String>>>,
}

#[derive(Serialize, Deserialize)]
struct Saved<S> {
    /// What the file is.
    format: String,
    problem: String,
    iterations: u64,
    coordinates: Vec<f64>,
    /// The solver as it was set, as text.
    settings: String,
    solver: S,
}

const FORMAT: &str = "greybox checkpoint 1";

/// Place, iterations so far, and the solver if it may go on.
type Resumed<S> = (Vec<f64>, u64, Option<S>);

impl CheckpointFile {
    /// A file for the search of one problem.
    pub fn new(path: PathBuf, every: u64, fingerprint: String, settings: String) -> Self {
        CheckpointFile { path, every, fingerprint, settings, before: 0, trouble: Arc::default() }
    }

    /// What went wrong while saving.
    pub fn trouble(&self) -> Option<String> {
        self.trouble.lock().ok().and_then(|trouble| trouble.clone())
    }

    /// Remembers what went wrong.
    pub fn note(&self, written: Result<(), Error>) {
        if let Err(error) = written
            && let Ok(mut trouble) = self.trouble.lock()
        {
            *trouble = Some(error.to_string());
        }
    }

    /// The place, the iterations so far and, if it was set as it is now, the solver of an earlier run; `None` if there is
    /// no file yet.
    pub fn load<S: DeserializeOwned>(&self) -> Result<Option<Resumed<S>>, Error> {
        // A device may have no end, and must not be replaced by a file.
        if std::fs::metadata(&self.path).is_ok_and(|meta| !meta.is_file()) {
            let problem = "it is no regular file; name one that can be written".to_owned();
            return Err(Error::Checkpoint { path: self.path.clone(), problem });
        }
        let text = match std::fs::read_to_string(&self.path) {
            Ok(text) => text,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(Error::File { path: self.path.clone(), source: Box::new(error) }),
        };
        let wrong = |problem: String| Error::Checkpoint { path: self.path.clone(), problem };
        let saved: Saved<S> = serde_json::from_str(&text)
            .map_err(|error| wrong(format!("it cannot be read ({error}); delete it to start afresh")))?;
        if saved.format != FORMAT {
            return Err(wrong(format!("its format is `{}`, not `{FORMAT}`; delete it to start afresh", saved.format)));
        }
        if saved.problem != self.fingerprint {
            return Err(wrong(
                "it belongs to another problem (other data, model, parameters or settings); delete it or name another file"
                    .to_owned(),
            ));
        }
        let solver = (saved.settings == self.settings).then_some(saved.solver);
        Ok(Some((saved.coordinates, saved.iterations, solver)))
    }

    /// Writes the file beside its place, then moves it there.
    pub fn write<S: Serialize>(&self, coordinates: &[f64], iterations: u64, solver: &S) -> Result<(), Error> {
        let saved = Saved {
            format: FORMAT.to_owned(),
            problem: self.fingerprint.clone(),
            iterations: self.before + iterations,
            coordinates: coordinates.to_vec(),
            settings: self.settings.clone(),
            solver,
        };
        let file = |source: Box<dyn std::error::Error + Send + Sync>| Error::File { path: self.path.clone(), source };
        let text = serde_json::to_string(&saved).map_err(|error| file(Box::new(error)))?;
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

/// Writes a file beside its place and renames it: whoever reads finds the old or the new one whole.
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
