//! The search: rounds of an optimizer, with the noise estimated between them.

use super::kink::at_kink;
use super::start_error::start_error;
use crate::covariance::SearchEnd;
use crate::error::Error;
use crate::optimize::{Domain, Infeasible, LeastSquares, Outcome, SearchLimit, limit_of_precision, within_tolerance};
use crate::problem::{
    CheckpointFile, Fingerprint, Memory, Objective, Optimizer, Round, RoundError, SearchPlan, Whitening, noise,
};
use std::sync::Arc;

/// Rounds end when the noise levels change by less than this, relatively: no unknown then moves by more than that
/// fraction of its standard error.
const NOISE_TOLERANCE: f64 = 1e-6;
const NOISE_ROUNDS: u32 = 100;

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
            let noise = first_whitening(plain, &place)?;
            Rounds::from(plain, optimizer, place, saved, noise)
        }
        // Written at once, so that a path that cannot be written is reported before the search.
        _ => {
            optimizer.begin(&checkpoint, &start)?;
            let noise = first_whitening(plain, &start)?;
            Rounds::from(plain, optimizer, start, None, noise)
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

/// Tolerance of a round whose noise levels are preliminary.
const ROUGH: f64 = 1e-3;
/// That of the first round where single steps follow. Steps with preliminary levels beyond it are made again with others: of 320 starts of four plants all
/// ended at the best minimum either way, with half the evaluations of [`ROUGH`].
const ROUGH_BEFORE_STEPS: f64 = 0.1;
/// Most rounds of one trial step.
const SINGLE_STEPS: u32 = 6;

/// A round of a search.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    /// To loose tolerances.
    Rough,
    /// One trial step.
    Step,
    /// To the tolerances of the search.
    Whole,
}

/// Searches with fixed noise, one after the other, with the noise estimated between them.
///
/// The first determines three digits. Where other noise levels take no pass it determines one, and rounds of one trial step follow, each with the
/// noise estimated at its start. A step that lowers the sum of squares in units of that noise also lowers `sum N ln(sigma)`, the cost with the
/// noise minimized out, because a logarithm is concave. The last rounds go on until the noise has settled.
pub(super) struct Rounds<'r> {
    plain: &'r Objective<'r>,
    optimizer: Arc<dyn Optimizer>,
    /// The search of the next round.
    pub next: Arc<dyn Optimizer>,
    /// The start of the next round.
    pub coordinates: Vec<f64>,
    whitening: Whitening,
    memory: Memory,
    known: bool,
    round: u32,
    /// How many more rounds of one trial step may follow.
    steps_left: u32,
    /// What the present round is.
    kind: Kind,
    /// Whether the triangles of each output are known where the present round begins, so that its first evaluation takes no pass.
    begins_known: bool,
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
        let noise = first_whitening(plain, &start)?;
        Ok(Rounds::with(plain, optimizer, start, noise))
    }

    /// From a start, with the noise there and the evaluations that it was estimated from.
    pub fn with(
        plain: &'r Objective<'r>,
        optimizer: &Arc<dyn Optimizer>,
        start: Vec<f64>,
        noise: (Whitening, Memory),
    ) -> Self {
        let tolerance = if makes_steps(plain, optimizer) { ROUGH_BEFORE_STEPS } else { ROUGH };
        let first = noise::is_estimated(plain).then(|| optimizer.rough(tolerance));
        Rounds::from(plain, optimizer, start, first, noise)
    }

    /// From a point; `first` is the search of the first round, if it differs.
    fn from(
        plain: &'r Objective<'r>,
        optimizer: &Arc<dyn Optimizer>,
        coordinates: Vec<f64>,
        first: Option<Arc<dyn Optimizer>>,
        (whitening, memory): (Whitening, Memory),
    ) -> Self {
        Rounds {
            plain,
            optimizer: optimizer.clone(),
            kind: if first.is_some() { Kind::Rough } else { Kind::Whole },
            next: first.unwrap_or_else(|| optimizer.clone()),
            coordinates,
            whitening,
            memory,
            known: !noise::is_estimated(plain),
            round: 0,
            steps_left: if makes_steps(plain, optimizer) { SINGLE_STEPS } else { 0 },
            begins_known: false,
            iterations: 0,
            left: optimizer.most(),
            evaluations: 0,
            last: None,
        }
    }

    fn run(mut self, file: Option<CheckpointFile>) -> Result<SearchEnd, Error> {
        loop {
            let objective = self.objective();
            // A checkpoint of a round of one step would be resumed with the limit of one step.
            let own = file.as_ref().filter(|_| self.kind != Kind::Step);
            let result = self.next.round(&objective, self.coordinates.clone(), own);
            let result = match (result, self.stopped()) {
                (Err(RoundError::Start(Infeasible::Cancelled)), Some(end)) => {
                    let write_error = file.and_then(|file| file.write_error());
                    return Ok(SearchEnd { write_error, ..end });
                }
                (result, _) => result.map_err(|error| match error {
                    RoundError::Start(error) => start_error(self.plain, &self.coordinates, error),
                    RoundError::Optimizer(text) => Error::Optimizer(text),
                })?,
            };
            let round = ended(&objective, result);
            let noise = self.asks_noise(&round).then(|| noise::estimate(&objective, &round.coordinates));
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
        !self.known && (round.outcome.converged() || self.is_step(round))
    }

    /// Whether a round was a single trial step, and more are left of the limit.
    fn is_step(&self, round: &Round) -> bool {
        let limited = matches!(round.outcome, Outcome::IterationLimit { .. });
        self.kind == Kind::Step && limited && round.iterations < self.left
    }

    /// Records how a round with this objective [ended], and the noise there if it was asked for; returns the end of the search if
    /// no further round is needed.
    pub fn take(
        &mut self,
        objective: Objective<'r>,
        round: Round,
        noise: Option<Result<Whitening, Infeasible>>,
    ) -> Option<SearchEnd> {
        let is_step = self.is_step(&round);
        // A rejected step asks for more damping, which only a round of several steps adapts. Without triangles of each output, each
        // round would take a pass more.
        let rejected = is_step && round.coordinates == self.coordinates;
        let knows_end = objective.memory.knows_outputs_at(&round.coordinates);
        if rejected || !knows_end {
            self.steps_left = 0;
        }
        self.round += 1;
        self.iterations += round.iterations;
        self.left = self.left.saturating_sub(round.iterations);
        self.evaluations += round.evaluations.saturating_sub(u64::from(self.begins_known));
        self.begins_known = knows_end && objective.keeps_outputs();
        self.coordinates = round.coordinates;
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
            settled =
                self.round > 1 && !is_step && self.kind != Kind::Rough && changes.fold(0.0, f64::max) < NOISE_TOLERANCE;
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
        (self.kind, self.next) = match self.steps_left {
            _ if rejected => (Kind::Rough, self.optimizer.rough(ROUGH).limited(self.left)),
            0 => (Kind::Whole, self.optimizer.limited(self.left)),
            _ => (Kind::Step, self.optimizer.limited(self.left.min(1))),
        };
        self.steps_left = self.steps_left.saturating_sub(1);
        self.memory = objective.memory;
        let end = SearchEnd {
            coordinates: self.coordinates.clone(),
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

/// Whether rounds of one step are made. A search without a limit of its own cannot be told to make one.
fn makes_steps(plain: &Objective<'_>, optimizer: &Arc<dyn Optimizer>) -> bool {
    plain.keeps_outputs() && optimizer.most() < u64::MAX
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
fn first_whitening(plain: &Objective<'_>, start: &[f64]) -> Result<(Whitening, Memory), Error> {
    noise::first_whitening(plain, start).map_err(|error| start_error(plain, start, error))
}

/// A search that was ended by a limit of fewer trial steps is not examined for a kink: as many as a part of a search by a finer method has.
const CREPT: u64 = 20;

/// A round that found no further step has ended at a minimum all the same where the model reproduces the data, to the tolerance of an
/// adaptive integrator, or at a kink of the cost.
pub(super) fn ended(objective: &Objective<'_>, mut round: Round) -> Round {
    let lost = matches!(round.outcome, Outcome::Stalled { .. } | Outcome::LimitOfPrecision { .. });
    if lost && noise::reproduces(objective, &round.coordinates) {
        round.outcome = Outcome::Exact;
    }
    // Where the noise level of a filter goes to zero, rounding of the unknowns changes standardized errors by as much as these are: the search ends as at an
    // exact fit, though the errors of the outputs are not zero.
    if round.outcome == Outcome::Exact
        && objective.sweep.predicts_variance()
        && !noise::reproduces(objective, &round.coordinates)
    {
        let linear = round.linear.clone();
        let limit = linear.and_then(|linear| limit_of_precision(&round.coordinates, linear, &Domain::of(objective)));
        round.outcome = limit.unwrap_or(Outcome::Stalled { gradient: 0.0, step: 0.0, failed: 0 });
    }
    if matches!(round.outcome, Outcome::Stalled { .. } | Outcome::Creeping { .. })
        && let Some(rough) = within_finer_tolerance(objective, &round.coordinates)
    {
        round.outcome = rough;
    }
    let lost = matches!(round.outcome, Outcome::Stalled { .. } | Outcome::Creeping { .. } | Outcome::Rough { .. });
    // Steps towards a kink may become shorter without end, until a limit of trial steps.
    let crept = matches!(round.outcome, Outcome::IterationLimit { iterations } if iterations >= CREPT);
    match (lost || crept) && !round.outcome.converged() {
        true => at_kink(objective, &round).unwrap_or(round),
        false => round,
    }
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
mod tests {
    use super::{Rounds, roughness};
    use crate::optimize::{Infeasible, JacobianColumns, LevenbergMarquardt, Outcome, SearchLimit, Stop};
    use crate::problem::{Control, Memory, Round, Whitening};
    use crate::tests::{Current, Gain, Line, Voltage};
    use crate::{Experiment, ExperimentOf, Fit, Huber, Time, free};
    use std::sync::Arc;
    use std::sync::atomic::AtomicBool;

    /// A gain of two, and errors that are no line.
    fn record() -> ExperimentOf<Line> {
        let inputs: Vec<Voltage> = (0..40).map(|k| Voltage { u: f64::from(k) }).collect();
        let outputs = (0..40).map(|k| Current { i: 2.0 * f64::from(k) + f64::from(k * 37 % 21) }).collect();
        Experiment::new(&Line, Time::Uniform { start: 0.0, step: 1.0 }, inputs, outputs).unwrap()
    }

    fn noise() -> (Whitening, Memory) {
        (Whitening::none(1), Memory::default())
    }

    /// The first of several rounds with a loss determines three digits. From a start that is right to three digits, the estimate equals that from a
    /// far start to ten times the tolerance of the noise.
    #[test]
    fn the_first_round_is_not_the_last() {
        let record = record();
        let from = |start: f64| {
            let fit = Fit::new(&Line, &record).parameters(Gain { a: free(start) }).loss(Huber::default());
            fit.run().unwrap().parameters.a
        };
        let far = from(1.0);
        let near = from(far * (1.0 + 1e-4));
        assert!((near / far - 1.0).abs() < 1e-5, "{near} {far}");
    }

    /// The limit of trial steps is that of all rounds together, also where one ends just there.
    #[test]
    fn a_limit_is_that_of_all_rounds() {
        let record = record();
        let within = |iterations: u64| {
            let optimizer = LevenbergMarquardt::new(Stop { iterations, ..Stop::default() }, JacobianColumns);
            let fit = Fit::new(&Line, &record).parameters(Gain { a: free(1.0) }).loss(Huber::default());
            fit.optimizer(optimizer).run().unwrap()
        };
        let needed = within(1000).iterations;
        for limit in 1..needed {
            let found = within(limit);
            assert_eq!(found.outcome, Outcome::IterationLimit { iterations: limit });
            assert_eq!(found.iterations, limit);
        }
        assert!(needed > 3 && within(needed).outcome.converged(), "{needed}");
    }

    /// Noise that doubles from round to round never settles: the hundredth round is the last, at a limit, not at a minimum.
    #[test]
    fn rounds_of_noise_that_does_not_settle_end() {
        let record = record();
        let problem = Fit::new(&Line, &record).parameters(Gain { a: free(1.0) }).problem().unwrap();
        let plain = problem.in_units(&Control::NEVER);
        let mut rounds = Rounds::with(&plain, &problem.settings.optimizer, vec![1.0], noise());
        let mut take = || {
            let outcome = Outcome::CostUnchanged { decrease: 0.0 };
            let (coordinates, name) = (vec![1.0], String::new());
            let round = Round { coordinates, linear: None, outcome, iterations: 2, evaluations: 3, name };
            let (objective, noise) = (rounds.objective(), rounds.whitening.widened(2.0));
            rounds.take(objective, round, Some(Ok(noise))).map(|end| (end.outcome, end.iterations, end.evaluations))
        };
        assert!((1..100).all(|_| take().is_none()));
        let limit = SearchLimit::NoiseRounds;
        assert_eq!(take(), Some((Outcome::OwnLimit { iterations: 200, limit }, 200, 300)));
    }

    /// A flag that is set while noise is estimated, or before the first evaluation of the next round, leaves the end of the last round.
    #[test]
    fn a_stop_between_rounds_leaves_an_end() {
        let record = record();
        let problem = Fit::new(&Line, &record).parameters(Gain { a: free(1.0) }).problem().unwrap();
        let control = Control { cancel: Some(Arc::new(AtomicBool::new(true))), deadline: None };
        let plain = problem.in_units(&control);
        let rounds = || {
            let mut rounds = Rounds::with(&plain, &problem.settings.optimizer, vec![1.0], noise());
            rounds.known = false;
            rounds
        };
        let ended = || Round {
            coordinates: vec![1.5],
            linear: None,
            outcome: Outcome::CostUnchanged { decrease: 0.0 },
            iterations: 2,
            evaluations: 3,
            name: String::new(),
        };
        assert!(rounds().stopped().is_none() && rounds().run(None).is_err());
        let mut next = rounds();
        assert!(next.take(next.objective(), ended(), Some(Ok(Whitening::none(1).widened(2.0)))).is_none());
        let end = next.run(None).unwrap();
        assert_eq!((end.outcome, end.coordinates, end.iterations), (Outcome::Cancelled, vec![1.5], 2));
        assert_eq!(end.whitening.sigma(), [2.0]);
        let mut measuring = rounds();
        let end = measuring.take(measuring.objective(), ended(), Some(Err(Infeasible::Cancelled))).unwrap();
        assert_eq!((end.outcome, end.coordinates), (Outcome::Cancelled, vec![1.5]));
    }

    #[test]
    fn roughness_is_the_larger_change() {
        assert_eq!([roughness(-3.0, None), roughness(-3.0, Some(4.0)), roughness(3.0, Some(4.0))], [3.0, 7.0, 3.0]);
    }
}
