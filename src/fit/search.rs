//! The search: rounds of an optimizer, with the noise estimated between them.

use super::start_error::start_error;
use crate::covariance::SearchEnd;
use crate::error::Error;
use crate::optimize::{Domain, Infeasible, LeastSquares, Outcome, SearchLimit, ahead, within_tolerance};
use crate::problem::{
    CheckpointFile, Fingerprint, Memory, Objective, Optimizer, Round, RoundError, SearchPlan, Whitening, noise,
};
use std::sync::Arc;

/// Rounds end when the noise levels change by less than this, relatively: no unknown then moves by more than that
/// fraction of its standard error.
const NOISE_TOLERANCE: f64 = 1e-6;
const NOISE_ROUNDS: u32 = 100;
/// Rounds determine three digits of the unknowns, or of the cost, until the noise changes by less than this from one to the next,
/// relatively: the next change is then some 1e-4 of that, and below the tolerance.
const NEARLY_SETTLED: f64 = 1e-3;

/// Searches from a start, or from a checkpoint. `plain` leaves errors in the units of the outputs.
pub(super) fn search(
    plain: &Objective<'_>,
    optimizer: &Arc<dyn Optimizer>,
    start: Vec<f64>,
) -> Result<SearchEnd, Error> {
    let Some(mut checkpoint) = checkpoint(plain, optimizer)? else {
        return Rounds::new(plain, optimizer, start)?.run(None);
    };
    let mut rounds = match optimizer.resume(&checkpoint)? {
        Some((place, iterations, saved)) if place.len() == start.len() => {
            checkpoint.before = iterations;
            let whitening = first_whitening(plain, &place)?;
            Rounds::from(plain, optimizer, place, saved, whitening)
        }
        // Written at once, so that a path that cannot be written is reported before the search.
        _ => {
            optimizer.begin(&checkpoint, &start)?;
            let whitening = first_whitening(plain, &start)?;
            Rounds::from(plain, optimizer, start, None, whitening)
        }
    };
    rounds.iterations = checkpoint.before;
    rounds.run(Some(checkpoint))
}

/// The checkpoint of a search with this optimizer, if one is asked for.
pub(super) fn checkpoint(
    plain: &Objective<'_>,
    optimizer: &Arc<dyn Optimizer>,
) -> Result<Option<CheckpointFile>, Error> {
    let file = |(path, every): &(std::path::PathBuf, u64)| {
        Ok(CheckpointFile::new(path.clone(), *every, Fingerprint::new(plain), optimizer.settings()?))
    };
    plain.problem.settings.checkpoint.as_ref().map(file).transpose()
}

/// Searches with fixed noise, one after the other, with the noise estimated between them.
pub(super) struct Rounds<'r> {
    plain: &'r Objective<'r>,
    optimizer: Arc<dyn Optimizer>,
    /// The search of the next round.
    pub next: Arc<dyn Optimizer>,
    /// Whether that determines three digits only.
    rough: bool,
    /// The start of the next round.
    pub coordinates: Vec<f64>,
    whitening: Whitening,
    memory: Memory,
    known: bool,
    round: u32,
    iterations: u64,
    /// Trial steps that are left of the limit.
    left: u64,
    evaluations: u64,
    /// The end of the last round, if there has been one.
    last: Option<SearchEnd>,
}

impl<'r> Rounds<'r> {
    /// From a start. With noise estimated there, the first round need not find an exact minimum.
    pub fn new(plain: &'r Objective<'r>, optimizer: &Arc<dyn Optimizer>, start: Vec<f64>) -> Result<Self, Error> {
        let whitening = first_whitening(plain, &start)?;
        Ok(Rounds::with(plain, optimizer, start, whitening))
    }

    /// From a start, with the noise there.
    pub fn with(
        plain: &'r Objective<'r>,
        optimizer: &Arc<dyn Optimizer>,
        start: Vec<f64>,
        whitening: Whitening,
    ) -> Self {
        let rough = noise::is_estimated(plain);
        let first = rough.then(|| optimizer.rough());
        Rounds { rough, ..Rounds::from(plain, optimizer, start, first, whitening) }
    }

    /// From a point; `first` is the search of the first round, if it differs.
    fn from(
        plain: &'r Objective<'r>,
        optimizer: &Arc<dyn Optimizer>,
        coordinates: Vec<f64>,
        first: Option<Arc<dyn Optimizer>>,
        whitening: Whitening,
    ) -> Self {
        Rounds {
            plain,
            optimizer: optimizer.clone(),
            next: first.unwrap_or_else(|| optimizer.clone()),
            rough: false,
            coordinates,
            whitening,
            memory: plain.memory.clone(),
            known: !noise::is_estimated(plain),
            round: 0,
            iterations: 0,
            left: optimizer.most(),
            evaluations: 0,
            last: None,
        }
    }

    fn run(mut self, file: Option<CheckpointFile>) -> Result<SearchEnd, Error> {
        loop {
            let objective = self.objective();
            let result = self.next.round(&objective, self.coordinates.clone(), file.as_ref());
            let result = match (result, self.stopped()) {
                (Err(RoundError::Start(Infeasible::Cancelled)), Some(end)) => {
                    let write_error = file.and_then(|file| file.write_error());
                    return Ok(SearchEnd { write_error, ..end });
                }
                (Err(RoundError::Start(Infeasible::Failed(_))), _) if self.steps_back() => continue,
                (result, _) => result.map_err(|error| match error {
                    RoundError::Start(error) => start_error(self.plain, &self.coordinates, error),
                    RoundError::Optimizer(text) => Error::Optimizer(text),
                })?,
            };
            let round = self.with_step(&objective, ended(&objective, result));
            let noise = self.asks_noise(&round).then(|| {
                let there = Objective { extrapolates: round.ahead.is_some(), ..objective.clone() };
                noise::estimate(&there, round.place())
            });
            if let Some(mut end) = self.take(objective, round, noise) {
                end.write_error = file.and_then(|file| file.write_error());
                return Ok(end);
            }
        }
    }

    /// Trial steps of the rounds that have ended.
    pub fn iterations(&self) -> u64 {
        self.iterations
    }

    /// The objective of the next round.
    pub fn objective(&self) -> Objective<'r> {
        Objective { memory: self.memory.clone(), ..self.plain.with(self.whitening.clone()) }
    }

    /// The end of a search that was stopped before the first evaluation of a later round: that of the round before.
    pub fn stopped(&self) -> Option<SearchEnd> {
        let outcome = self.plain.control.named(Outcome::Cancelled);
        self.last.clone().map(|last| SearchEnd { outcome, ..last })
    }

    /// A round with the step on to where the next one begins. That is not evaluated before: the noise is to be estimated there, and with
    /// that the cost is another one.
    pub fn with_step(&self, objective: &Objective<'_>, mut round: Round) -> Round {
        if self.rough && matches!(round.outcome, Outcome::Converged { .. } | Outcome::CostUnchanged { .. }) {
            let linear = round.linear.take();
            round.ahead = linear.and_then(|linear| ahead(&round.coordinates, linear, &Domain::of(objective)));
        }
        round
    }

    /// Goes back to where the last round ended, if the next one was to begin a step ahead of that.
    fn steps_back(&mut self) -> bool {
        let Some(last) = self.last.as_ref().filter(|last| last.coordinates != self.coordinates) else { return false };
        (self.coordinates, self.next, self.rough) =
            (last.coordinates.clone(), self.optimizer.limited(self.left), false);
        true
    }

    /// What the limit of this search is of, where it is not that of the user.
    fn own_limit(&self) -> Option<SearchLimit> {
        let (problem, most) = (self.plain.problem, self.optimizer.most());
        match problem.settings.searches {
            SearchPlan::Best(_) => Some(SearchLimit::FurtherStart),
            _ if problem.limits_search_to(most) => Some(SearchLimit::FinerMethod),
            _ => None,
        }
    }

    /// Whether the noise is to be estimated where a round has ended.
    pub fn asks_noise(&self, round: &Round) -> bool {
        !self.known && round.outcome.converged()
    }

    /// Records how a round with this objective [ended], and the noise there if it was asked for; returns the end of the search if
    /// no further round is needed.
    pub fn take(
        &mut self,
        objective: Objective<'r>,
        round: Round,
        noise: Option<Result<Whitening, Infeasible>>,
    ) -> Option<SearchEnd> {
        self.round += 1;
        self.iterations += round.iterations;
        self.left = self.left.saturating_sub(round.iterations);
        self.evaluations += round.evaluations;
        self.coordinates = match (&noise, round.ahead) {
            (Some(Ok(_)), Some(ahead)) => ahead,
            _ => round.coordinates.clone(),
        };
        let (mut outcome, mut linear) = (round.outcome, round.linear);
        let noise = match noise {
            Some(Err(Infeasible::Cancelled)) => {
                outcome = objective.control.named(Outcome::Cancelled);
                None
            }
            noise => noise,
        };
        let mut settled = noise.is_none();
        if let Some(found) = noise {
            let found = found.unwrap_or_else(|_| self.whitening.clone());
            let changes = found.sigma().into_iter().zip(self.whitening.sigma()).map(|(a, b)| (a / b).ln().abs());
            let change = changes.fold(0.0, f64::max);
            settled = self.round > 1 && !self.rough && change < NOISE_TOLERANCE;
            self.rough = change > NEARLY_SETTLED;
            if !settled {
                (self.whitening, linear) = (found, None);
            }
            // Rounding errors differ from point to point: the noise would never settle.
            settled |= outcome == Outcome::Exact;
            if !settled && self.round == NOISE_ROUNDS {
                outcome = Outcome::OwnLimit { iterations: self.iterations, limit: SearchLimit::NoiseRounds };
                settled = true;
            }
        }
        // A round's limit is what earlier rounds left.
        outcome = match (outcome, self.own_limit()) {
            (Outcome::IterationLimit { .. }, None) => Outcome::IterationLimit { iterations: self.iterations },
            (Outcome::IterationLimit { .. }, Some(limit)) | (Outcome::OwnLimit { limit, .. }, _) => {
                Outcome::OwnLimit { iterations: self.iterations, limit }
            }
            (outcome, _) => outcome,
        };
        let next = if self.rough { self.optimizer.rough() } else { self.optimizer.clone() };
        self.next = next.limited(self.left);
        self.memory = objective.memory;
        if !settled {
            self.memory.forget_costs();
        }
        let end = SearchEnd {
            coordinates: round.coordinates,
            whitening: self.whitening.clone(),
            linear,
            outcome,
            iterations: self.iterations,
            evaluations: self.evaluations,
            name: round.name,
            write_error: None,
            memory: self.memory.clone(),
            starts: None,
        };
        if settled {
            return Some(end);
        }
        self.last = Some(end);
        None
    }
}

/// An end with the noise of the errors there: that of a search that did not converge is the noise where its last round began.
pub(super) fn settled(plain: &Objective<'_>, end: SearchEnd) -> SearchEnd {
    if end.outcome.converged() || !noise::is_estimated(plain) {
        return end;
    }
    let there = Objective { memory: end.memory.clone(), ..plain.unlimited() };
    match noise::estimate(&there, &end.coordinates) {
        Ok(whitening) => SearchEnd { whitening, linear: None, ..end },
        Err(_) => end,
    }
}

/// The objective that a search ended with.
pub(super) fn at_end<'p>(plain: &Objective<'p>, end: &SearchEnd) -> Objective<'p> {
    Objective { memory: end.memory.clone(), ..plain.with(end.whitening.clone()) }
}

/// The noise of a search's first round.
fn first_whitening(plain: &Objective<'_>, start: &[f64]) -> Result<Whitening, Error> {
    noise::first_whitening(plain, start).map_err(|error| start_error(plain, start, error))
}

/// A round that found no further step has ended at a minimum all the same where the model reproduces the data, or to the tolerance of an
/// adaptive integrator.
pub(super) fn ended(objective: &Objective<'_>, mut round: Round) -> Round {
    let lost = matches!(round.outcome, Outcome::Stalled { .. } | Outcome::LimitOfPrecision { .. });
    if lost && noise::reproduces(objective, &round.coordinates) {
        round.outcome = Outcome::Exact;
    }
    if matches!(round.outcome, Outcome::Stalled { .. } | Outcome::Creeping { .. })
        && let Some(rough) = within_finer_tolerance(objective, &round.coordinates)
    {
        round.outcome = rough;
    }
    round
}

/// How a search ended that found no step to lower the cost of an adaptive integrator, whose number of steps changes from point
/// to point; `None` if the slopes predict a decrease larger than the difference of the costs by this tolerance and a finer one.
fn within_finer_tolerance(objective: &Objective<'_>, coordinates: &[f64]) -> Option<Outcome> {
    let finer = if objective.sweep.is_adaptive() {
        objective.sweep.refined(objective.problem.samples())?
    } else {
        return None;
    };
    let finer = objective.of(objective.problem, &*finer);
    let (linear, again) = (objective.linearize(coordinates).ok()?, finer.linearize(coordinates).ok()?);
    let here = again.cost - linear.cost;
    let noise = |x: &[f64]| {
        let there = finer.cost_at(x).ok().zip(objective.cost_at(x).ok());
        roughness(here, there.map(|(finer, this)| finer - this))
    };
    let domain = Domain::of(objective);
    // A minimum of this tolerance, though that of a finer one lies elsewhere, which a warning names.
    within_tolerance(coordinates, linear, &domain, noise)
        .or_else(|| within_tolerance(coordinates, again, &domain, noise))
}

/// How far the cost may be off what the slopes at a point say of another: from how much a finer tolerance changes it at both, the
/// second unknown where it cannot be evaluated.
fn roughness(here: f64, there: Option<f64>) -> f64 {
    there.map_or(0.0, |there| (there - here).abs()).max(here.abs())
}

#[cfg(test)]
mod tests;
