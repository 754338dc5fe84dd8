//! The search: rounds of an optimizer, with the noise estimated between them.

use super::checkpoint::CheckpointFile;
use super::noise::{Noise, Whitening};
use super::objective::Objective;
use super::source::Halt;
use super::{Observer, Search, Terms};
use crate::error::Error;
use crate::optimize::{Infeasible, LeastSquaresState, Linearization, Outcome};
use argmin::core::observers::Observe;
use argmin::core::{Executor, KV, Solver, State, TerminationReason, TerminationStatus};
use std::hash::{DefaultHasher, Hash, Hasher};
use std::sync::Arc;

/// Where a search ended.
pub(super) struct Found {
    pub coordinates: Vec<f64>,
    pub whitening: Whitening,
    /// The slopes there, if they are still those of this whitening.
    pub linear: Option<Linearization>,
    pub outcome: Outcome,
    pub iterations: u64,
    pub evaluations: u64,
    pub name: String,
    pub trouble: Option<String>,
}

/// The noise is known well enough when a round changes it by less than this part: no unknown then moves by more than that
/// part of its standard error.
const NOISE_TOLERANCE: f64 = 1e-6;
const NOISE_ROUNDS: u32 = 100;

impl Objective<'_> {
    /// Searches from the start, or from where a checkpoint says. `self` leaves errors in the units of the outputs.
    pub(super) fn search<O: Search>(&self, terms: &Terms<'_>, optimizer: &O) -> Result<Found, Error> {
        let mut coordinates = self.unknowns.start();
        let mut solver = optimizer.clone();
        let mut file = None;
        let mut before = 0;
        if let Some((path, every)) = &terms.checkpoint {
            let (path, every, fingerprint) = (path.clone(), *every, self.fingerprint(terms));
            let settings = serde_json::to_string(&solver).map_err(|error| Error::Optimizer(error.to_string()))?;
            let mut checkpoint = CheckpointFile { path, every, fingerprint, settings, before, trouble: Arc::default() };
            match checkpoint.load::<O>()? {
                Some((place, iterations, saved)) if place.len() == coordinates.len() => {
                    (coordinates, before) = (place, iterations);
                    // The settings are those of this run; only a search with the same that has not ended goes on as it was.
                    solver = saved.filter(|saved| saved.outcome().is_none()).unwrap_or(solver);
                }
                // Written at once: a place that cannot be written to is better known now.
                _ => checkpoint.write(&coordinates, 0, &solver)?,
            }
            checkpoint.before = before;
            file = Some(checkpoint);
        }
        let mut whitening = self.first_whitening(terms, &coordinates)?;
        let known = matches!(terms.noise, Noise::Given(_)) || self.noise_is_no_matter(&terms.noise);
        let (mut iterations, mut evaluations) = (before, 0);
        let mut name = String::new();
        // Noise as the errors at the start show it is not worth an exact minimum.
        if !known && file.is_none() {
            solver = optimizer.rough();
        }
        let mut round = 0;
        loop {
            round += 1;
            let objective = self.with(whitening.clone());
            let result = objective.round(terms, coordinates, solver, &file)?;
            name.clone_from(&result.name);
            iterations += result.iterations;
            evaluations += result.evaluations;
            coordinates = result.coordinates;
            let (mut outcome, mut linear) = (result.outcome, result.linear);
            let lost = matches!(outcome, Outcome::Stalled { .. } | Outcome::LimitOfPrecision { .. });
            if lost && objective.reproduces(&coordinates) {
                outcome = Outcome::Exact;
            }
            let mut settled = known || !outcome.converged();
            if !settled {
                let next = objective.estimate_noise(&coordinates, &terms.noise).unwrap_or_else(|_| whitening.clone());
                let changes = next.sigma().into_iter().zip(whitening.sigma()).map(|(a, b)| (a / b).ln().abs());
                settled = round > 1 && changes.fold(0.0, f64::max) < NOISE_TOLERANCE;
                if !settled {
                    (whitening, linear) = (next, None);
                }
                // Rounding is another at every point.
                settled |= outcome == Outcome::Exact;
                if !settled && round == NOISE_ROUNDS {
                    outcome = Outcome::IterationLimit { iterations };
                    settled = true;
                }
            }
            if settled {
                let trouble = file.and_then(|file| file.trouble.lock().ok().and_then(|trouble| trouble.clone()));
                return Ok(Found { coordinates, whitening, linear, outcome, iterations, evaluations, name, trouble });
            }
            solver = optimizer.clone();
        }
    }

    /// One search with the noise as it stands.
    fn round<O: Search>(
        &self,
        terms: &Terms<'_>,
        start: Vec<f64>,
        solver: O,
        file: &Option<CheckpointFile>,
    ) -> Result<Round, Error> {
        let counting = |state: LeastSquaresState| state.param(start.clone()).counting(true);
        let mut executor = Executor::new(self, solver).configure(counting).ctrlc(false);
        for (observer, mode) in &terms.observers {
            executor = executor.add_observer(Shared(observer.clone()), *mode);
        }
        if let Some(file) = file {
            executor = executor.checkpointing(file.clone());
        }
        let result = executor.run().map_err(|error| match error.downcast::<Infeasible>() {
            Ok(Infeasible::Failed(_)) => self.start_failure(terms, &start),
            Ok(Infeasible::Cancelled) => self.stopped(terms),
            Err(other) => Error::Optimizer(other.to_string()),
        })?;
        let state = result.state();
        let outcome = result.solver().outcome().unwrap_or(match state.get_termination_status() {
            TerminationStatus::Terminated(TerminationReason::MaxItersReached) => {
                Outcome::IterationLimit { iterations: state.get_iter() }
            }
            _ => Outcome::Cancelled,
        });
        let outcome = match outcome {
            Outcome::Cancelled if self.control.expired() => Outcome::TimeLimit,
            outcome => outcome,
        };
        let evaluations = state.get_func_counts().get("linearization_count").copied().unwrap_or(0);
        if let Some(file) = file
            && let Some(place) = state.get_param()
            && let Err(error) = file.write(place, state.get_iter(), result.solver())
            && let Ok(mut trouble) = file.trouble.lock()
        {
            *trouble = Some(error.to_string());
        }
        Ok(Round {
            coordinates: state.get_param().cloned().unwrap_or(start),
            linear: result.solver().linearization().cloned(),
            outcome,
            iterations: state.get_iter(),
            evaluations,
            name: Solver::<&Objective<'_>, LeastSquaresState>::name(result.solver()).to_owned(),
        })
    }

    /// The noise as given, or as the errors at the start show it.
    pub(super) fn first_whitening(&self, terms: &Terms<'_>, coordinates: &[f64]) -> Result<Whitening, Error> {
        match &terms.noise {
            Noise::Given(sigma) => Ok(Whitening::Diagonal(sigma.clone())),
            noise if self.noise_is_no_matter(noise) => Ok(self.whitening.clone()),
            noise => self.estimate_noise(coordinates, noise).map_err(|_| self.start_failure(terms, coordinates)),
        }
    }

    /// With one output, squared loss and no prior the noise scales the cost and nothing else.
    pub(super) fn noise_is_no_matter(&self, noise: &Noise) -> bool {
        let priors = self.unknowns.row.iter().any(|unknown| unknown.parameter.prior.is_some());
        !matches!(noise, Noise::Given(_)) && self.outputs() == 1 && self.loss.is_none() && !priors
    }

    pub(super) fn start_failure(&self, terms: &Terms<'_>, coordinates: &[f64]) -> Error {
        for e in 0..self.experiments() {
            match self.experiment(e, coordinates) {
                Err(Halt::Failed { sample }) => return Error::Start(self.locate(e, coordinates, sample)),
                Err(Halt::Cancelled) => return self.stopped(terms),
                Ok(_) => {}
            }
        }
        Error::Start(self.locate(0, coordinates, 0))
    }

    fn stopped(&self, terms: &Terms<'_>) -> Error {
        Error::Option(match terms.time_limit {
            Some(limit) if self.control.expired() => format!(
                "the time limit of {} s was over before the start had been evaluated; allow more time",
                limit.as_secs_f64()
            ),
            _ => "the fit was cancelled before its start had been evaluated; lower the flag to run it".to_owned(),
        })
    }

    /// What a checkpoint belongs to: the data, and everything that shapes the cost.
    fn fingerprint(&self, terms: &Terms<'_>) -> String {
        let mut hash = DefaultHasher::new();
        env!("CARGO_PKG_VERSION").hash(&mut hash);
        self.source.fingerprint(&mut hash);
        format!("{:?}{:?}", self.unknowns.parameters, self.unknowns.row).hash(&mut hash);
        self.loss.map(|loss| loss.describe()).hash(&mut hash);
        format!("{:?}{:?}", self.prefilter, terms.noise).hash(&mut hash);
        format!("{:016x}", hash.finish())
    }
}

struct Round {
    coordinates: Vec<f64>,
    linear: Option<Linearization>,
    outcome: Outcome,
    iterations: u64,
    evaluations: u64,
    name: String,
}

/// An observer that several rounds of one fit share.
struct Shared(Observer);

impl Observe<LeastSquaresState> for Shared {
    fn observe_init(&mut self, name: &str, state: &LeastSquaresState, kv: &KV) -> Result<(), argmin::core::Error> {
        self.0.lock().map_or(Ok(()), |mut observer| observer.observe_init(name, state, kv))
    }

    fn observe_iter(&mut self, state: &LeastSquaresState, kv: &KV) -> Result<(), argmin::core::Error> {
        self.0.lock().map_or(Ok(()), |mut observer| observer.observe_iter(state, kv))
    }

    fn observe_final(&mut self, state: &LeastSquaresState) -> Result<(), argmin::core::Error> {
        self.0.lock().map_or(Ok(()), |mut observer| observer.observe_final(state))
    }
}
