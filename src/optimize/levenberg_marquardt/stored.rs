//! [`Stored`]: a search as it is written to a file.

use super::{Domain, LevenbergMarquardt, Stage, Try};
use crate::optimize::descent::Descent;
use crate::optimize::{Outcome, Stop};
use crate::scaling::Seen;
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// The settings of a search, and where it stands: without the slopes there.
///
/// Where it stands is a value of JSON already, so that its writing and reading are compiled with the library, not again
/// with each program that names a search.
#[derive(Serialize, Deserialize)]
pub(super) struct Stored<S> {
    stop: Stop,
    scaling: S,
    progress: Value,
}

#[derive(Serialize, Deserialize)]
struct Progress {
    #[serde(with = "crate::real")]
    x: Vec<f64>,
    seen: Seen,
    descent: Descent,
    unseen: usize,
    steps: u64,
    leaps: u64,
    first: Option<Try>,
    outcome: Option<Outcome>,
    curved: bool,
}

impl Progress {
    fn write(self) -> Value {
        // Fails for maps only, of which there is none.
        serde_json::to_value(self).unwrap_or_default()
    }

    fn read(value: Value) -> Result<Self, serde_json::Error> {
        serde_json::from_value(value)
    }
}

impl<S> From<LevenbergMarquardt<S>> for Stored<S> {
    fn from(search: LevenbergMarquardt<S>) -> Self {
        let LevenbergMarquardt { x, seen, descent, unseen, steps, leaps, first, outcome, curved, .. } = search;
        let progress = Progress { x, seen, descent, unseen, steps, leaps, first, outcome, curved };
        Stored { stop: search.stop, scaling: search.scaling, progress: progress.write() }
    }
}

impl<S> TryFrom<Stored<S>> for LevenbergMarquardt<S> {
    type Error = serde_json::Error;

    fn try_from(stored: Stored<S>) -> Result<Self, serde_json::Error> {
        let Stored { stop, scaling, progress } = stored;
        let Progress { x, seen, descent, unseen, steps, leaps, first, outcome, curved } = Progress::read(progress)?;
        let (domain, stage, point) = (Domain::default(), Stage::default(), None);
        Ok(LevenbergMarquardt {
            stop,
            scaling,
            x,
            seen,
            descent,
            unseen,
            steps,
            leaps,
            first,
            outcome,
            curved,
            domain,
            stage,
            point,
        })
    }
}
