//! Observers and the checkpoint of searches from several starts.

use super::{NoEnd, Run, Searches};
use crate::error::Error;
use crate::optimize::LeastSquaresState;
use crate::problem::{CheckpointFile, Observer};
use argmin::core::observers::{Observe, ObserverMode};
use argmin::core::{KV, State};
use serde::{Deserialize, Serialize};
use std::sync::PoisonError;

/// State of the searches in a checkpoint.
#[derive(Serialize, Deserialize)]
pub(super) struct Places {
    pub starts: Vec<Vec<f64>>,
    /// The point of each search, or the cause why there is none.
    pub places: Vec<Result<Vec<f64>, NoEnd>>,
}

/// Writes the checkpoint.
pub(super) fn write(searches: &Searches<'_>, file: &CheckpointFile) -> Result<(), Error> {
    let place = |run: &Run<'_>| match run {
        Run::Searching(search) => Ok(search.machine.place().to_vec()),
        Run::Ended { end, .. } => Ok(end.coordinates.clone()),
        Run::Failed(none) => Err(none.clone()),
    };
    let places = Places { starts: searches.starts.clone(), places: searches.runs.iter().map(place).collect() };
    let best = best(searches).map_or(vec![], |(place, _)| place.to_vec());
    file.write(&best, searches.cycle, &places)
}

/// The best point so far, and its comparable cost.
fn best<'s>(searches: &'s Searches<'_>) -> Option<(&'s [f64], f64)> {
    let places = searches.runs.iter().filter_map(|run| run.place(&searches.comparison));
    places.min_by(|a, b| a.1.total_cmp(&b.1))
}

/// Shows observers the best point so far, after each evaluation of all searches.
pub(super) struct Progress {
    state: LeastSquaresState,
}

impl Progress {
    pub fn begin(searches: &Searches<'_>) -> Self {
        let mut progress = Progress { state: LeastSquaresState::new() };
        progress.update(searches);
        observed(searches, |observer, _| {
            // An observer that fails does not stop a fit.
            let _ = observer.observe_init("searches from several starts", &progress.state, &KV::new());
        });
        progress
    }

    pub fn show(&mut self, searches: &Searches<'_>) {
        let before = self.state.best_cost;
        self.update(searches);
        let is_best = self.state.best_cost < before;
        let running = searches.runs.iter().filter(|run| matches!(run, Run::Searching(_))).count();
        let kv = argmin::kv!("running" => running as u64;);
        observed(searches, |observer, mode| {
            let wanted = match mode {
                ObserverMode::Always => true,
                ObserverMode::Every(n) => self.state.iter.is_multiple_of(n),
                ObserverMode::NewBest => is_best,
                ObserverMode::Never => false,
            };
            if wanted {
                let _ = observer.observe_iter(&self.state, &kv);
            }
        });
    }

    pub fn end(&self, searches: &Searches<'_>) {
        observed(searches, |observer, _| {
            let _ = observer.observe_final(&self.state);
        });
    }

    fn update(&mut self, searches: &Searches<'_>) {
        // argmin counts an iteration after it was observed.
        self.state.iter = searches.cycle.saturating_sub(1);
        if let Some((place, level)) = best(searches) {
            (self.state.param, self.state.cost) = (Some(place.to_vec()), level);
            if level < self.state.best_cost {
                (self.state.best_param, self.state.best_cost) = (Some(place.to_vec()), level);
            }
        }
    }
}

fn observed(searches: &Searches<'_>, mut show: impl FnMut(&mut dyn Observe<LeastSquaresState>, ObserverMode)) {
    for (observer, mode) in &searches.plain.problem.settings.observers {
        let observer: &Observer = observer;
        show(&mut **observer.lock().unwrap_or_else(PoisonError::into_inner), *mode);
    }
}
