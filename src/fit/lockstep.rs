//! Fits of single records in lockstep: one evaluation of all of them is one pass over lanes.

use super::further::{Further, with_work_of};
use super::refine::{Attempt, Start};
use super::search::{Rounds, at_end, ended, settled};
use super::staged::{after_stages, noted};
use super::stages::Led;
use crate::covariance::SearchEnd;
use crate::error::Error;
use crate::estimate::Summary;
use crate::judge::conclude_together;
use crate::optimize::{Domain, Infeasible, Linearization, Machine, Outcome, Request};
use crate::problem::{
    At, Bend, Control, Objective, Problem, Round, Whitening, curvatures_together, each, linearize_together, noise,
};
use std::time::Instant;

/// A search that has not ended.
pub(super) struct Search<'p> {
    rounds: Rounds<'p>,
    pub objective: Objective<'p>,
    pub machine: Box<dyn Machine + Send>,
    name: String,
    iterations: u64,
    evaluations: u64,
}

/// A round at whose end the noise is to be estimated.
pub(super) struct Measuring<'p> {
    rounds: Rounds<'p>,
    objective: Objective<'p>,
    round: Round,
}

impl<'p> Measuring<'p> {
    pub fn place(&self) -> At<'_> {
        (&self.objective, &self.round.coordinates)
    }

    /// Passes on the noise there.
    pub fn tell(self, noise: Result<Whitening, Infeasible>) -> Stage<'p> {
        let Measuring { mut rounds, objective, round } = self;
        let end = rounds.take(objective, round, Some(noise));
        Stage::after(rounds, end)
    }
}

/// The state of one record's fit.
pub(super) enum Stage<'p> {
    Searching(Box<Search<'p>>),
    Measuring(Box<Measuring<'p>>),
    Ended(Box<SearchEnd>),
    /// To be fitted by itself: its start cannot be evaluated, and the single fit gives the detailed error.
    Alone,
}

impl<'p> Stage<'p> {
    /// After a round that has ended, or the search with it.
    fn after(rounds: Rounds<'p>, end: Option<SearchEnd>) -> Self {
        match end {
            Some(end) => Stage::Ended(Box::new(end)),
            None => Stage::Searching(Box::new(Search::new(rounds))),
        }
    }
}

impl<'p> Search<'p> {
    pub fn new(rounds: Rounds<'p>) -> Self {
        let objective = rounds.objective();
        let mut machine = rounds.next.machine();
        machine.begin(rounds.coordinates.clone(), Domain::of(&objective));
        let name = rounds.next.name();
        Search { rounds, objective, machine, name, iterations: 0, evaluations: 0 }
    }

    /// The point at which it requests cost and slopes.
    pub fn requested(&self) -> Option<At<'_>> {
        match self.machine.request() {
            Request::Linearize(x) => Some((&self.objective, x)),
            _ => None,
        }
    }

    /// Where it requests the second derivatives of the errors, and along which direction; nothing where they have none.
    pub fn bends(&self) -> Option<Bend<'_>> {
        match self.machine.request() {
            Request::Curvature { x, along } => Some(Bend { objective: &self.objective, x, along }),
            _ => None,
        }
    }

    /// Trial steps so far.
    pub fn trials(&self) -> u64 {
        self.rounds.iterations() + self.iterations
    }

    /// The end of the search where its flag or time limit stopped the first evaluation of a later round.
    pub fn stopped(&self, error: &Infeasible) -> Option<SearchEnd> {
        self.rounds.stopped().filter(|_| *error == Infeasible::Cancelled)
    }

    /// Passes on the evaluation and advances the search to its next request.
    pub fn tell(mut self: Box<Self>, answer: Result<Linearization, Infeasible>) -> Stage<'p> {
        self.evaluations += 1;
        match (self.machine.linearization().is_some(), &answer) {
            (false, Err(error)) => {
                return self.stopped(error).map_or(Stage::Alone, |end| Stage::Ended(Box::new(end)));
            }
            (begun, _) => self.iterations += u64::from(begun),
        }
        self.machine.tell(answer);
        self.next()
    }

    /// Passes on the second derivatives and advances the search to its next request.
    pub fn bend(mut self: Box<Self>, answer: Option<Result<Linearization, Infeasible>>) -> Stage<'p> {
        self.evaluations += 1;
        self.machine.tell_curvature(answer);
        self.next()
    }

    fn next(self: Box<Self>) -> Stage<'p> {
        match self.machine.request() {
            Request::Ended(outcome) => self.end(outcome),
            _ => Stage::Searching(self),
        }
    }

    fn end(self: Box<Self>, outcome: Outcome) -> Stage<'p> {
        let Search { mut rounds, objective, machine, name, iterations, evaluations } = *self;
        let outcome = objective.control.named(outcome);
        let found = Round {
            coordinates: machine.place().to_vec(),
            linear: machine.linearization().cloned(),
            outcome,
            iterations,
            evaluations,
            name,
        };
        let round = ended(&objective, found);
        if rounds.asks_noise(&round) {
            return Stage::Measuring(Box::new(Measuring { rounds, objective, round }));
        }
        let end = rounds.take(objective, round, None);
        Stage::after(rounds, end)
    }
}

/// The estimate of each problem, all of the same sweep and of one record each. Default methods give way to finer ones as in a
/// fit of each alone.
pub(super) fn fit_together(problems: &[Problem<'_>]) -> Vec<Result<Summary, Error>> {
    let Some(control) = problems.first().map(|first| control(first, problems.len())) else { return vec![] };
    let (starts, notes): (Vec<_>, Vec<_>) =
        each(problems.len(), |i| problems[i].first_start(&control)).into_iter().unzip();
    let leds: Vec<Option<Led>> = starts.iter().map(|start: &Start| start.stages.clone()).collect();
    let all: Vec<From<'_>> = problems.iter().zip(starts).collect();
    let found = by_one_method(&all, &control);
    let shot = each(found.len(), |i| problems[i].shot_further(found[i].as_ref().ok()?, leds[i].as_ref(), &control));
    let found = found.into_iter().zip(shot).map(|(found, shot)| shot.map_or(found, Ok)).zip(notes);
    let found: Vec<_> = found.map(|(found, note)| found.map(|found| noted(found, note))).collect();
    let further = each(found.len(), |i| problems[i].search_further(found[i].as_ref().ok()?, &control));
    let found = found.into_iter().zip(&further);
    let found: Vec<_> =
        found.map(|(found, further)| found.map(|found| with_work_of(found, further.as_ref()))).collect();
    let usable = |(further, found): (&Option<Further>, &Result<Summary, Error>)| {
        further.as_ref().zip(found.as_ref().ok()).and_then(|(further, found)| further.usable(found))
    };
    let usable: Vec<Option<Summary>> = further.iter().zip(&found).map(usable).collect();
    let mut attempts: Vec<Attempt> = found.into_iter().map(Attempt::new).collect();
    for number in 0.. {
        let coarse: Vec<bool> =
            attempts.iter().zip(&usable).map(|(attempt, usable)| usable.is_none() && attempt.is_coarse()).collect();
        let finer =
            coarse.iter().zip(problems).map(|(coarse, problem)| if *coarse { problem.finer(number) } else { None });
        let finer: Vec<Option<&Problem<'_>>> = finer.collect();
        if finer.iter().all(Option::is_none) || control.stops() {
            break;
        }
        let most = |problem: &Problem<'_>| problem.settings.optimizer.most();
        let from = attempts
            .iter()
            .zip(problems)
            .zip(finer)
            .map(|((attempt, problem), finer)| Some((finer?, attempt.start(finer?, most(problem), &control)?)));
        let finer: Vec<Option<From<'_>>> = from.collect();
        let coarse: Vec<bool> = finer.iter().map(Option::is_some).collect();
        let finer: Vec<From<'_>> = finer.into_iter().flatten().collect();
        let begin = Instant::now();
        let found = by_one_method(&finer, &control).into_iter().zip(&finer);
        let mut found = found.map(|(found, (finer, start))| finer.run_on(found, start.trials, begin, &control));
        let next = |((attempt, coarse), problem): ((Attempt, bool), &Problem<'_>)| match (
            if coarse { found.next() } else { None },
            problem.finer(number),
        ) {
            (Some(again), Some(finer)) => {
                let again = attempt.again_from_start(finer, (again, most(problem)), begin, &control);
                attempt.or(again, finer.sweep.is_adaptive())
            }
            _ => attempt,
        };
        attempts = attempts.into_iter().zip(coarse).zip(problems).map(next).collect();
    }
    let answer = |(attempt, usable): (Attempt, Option<Summary>)| usable.map_or_else(|| attempt.answer(), Ok);
    let found: Vec<Result<Summary, Error>> = attempts.into_iter().zip(usable).map(answer).collect();
    let failed = each(found.len(), |i| problems[i].in_stages(found[i].as_ref().err()?, &control));
    let found: Vec<_> = found.into_iter().zip(failed).map(|(found, staged)| staged.map_or(found, Ok)).collect();
    let searched =
        each(found.len(), |i| problems[i].searched_elsewhere(found[i].as_ref().ok()?, further[i].as_ref(), &control));
    let found: Vec<_> = found.into_iter().zip(searched).map(|(found, searched)| searched.map_or(found, Ok)).collect();
    let by_pieces = |((found, led), problem): ((Result<Summary, Error>, Option<Led>), &Problem<'_>)| {
        found.map(|found| problem.or_by_pieces(found, led.as_ref(), &control))
    };
    found.into_iter().zip(leds).zip(problems).map(by_pieces).collect()
}

/// The stop conditions of fits together: the sum of their time limits is left to all.
fn control(problem: &Problem<'_>, together: usize) -> Control {
    let begin = Instant::now();
    let limit = problem.settings.time_limit.and_then(|limit| limit.checked_mul(u32::try_from(together).ok()?));
    Control { deadline: limit.and_then(|limit| begin.checked_add(limit)), ..problem.control(begin) }
}

/// A problem and the start of its search.
type From<'p> = (&'p Problem<'p>, Start);

/// The estimate of each problem, by its own method.
fn by_one_method(problems: &[From<'_>], control: &Control) -> Vec<Result<Summary, Error>> {
    let begin = Instant::now();
    let plain: Vec<Objective<'_>> = problems.iter().map(|(problem, _)| problem.in_units(control)).collect();
    let starts: Vec<At<'_>> =
        plain.iter().zip(problems).map(|(plain, (_, start))| (plain, &start.coordinates[..])).collect();
    let first = |((plain, (problem, start)), noise): ((_, &From<'_>), Result<_, Infeasible>)| match noise {
        Ok(noise) => {
            let optimizer = problem.settings.optimizer.limited(start.trials);
            let rounds = Rounds::with(plain, &optimizer, start.coordinates.clone(), noise);
            Stage::Searching(Box::new(Search::new(rounds)))
        }
        Err(_) => Stage::Alone,
    };
    let mut stages: Vec<Stage<'_>> =
        plain.iter().zip(problems).zip(noise::first_together(&starts)).map(first).collect();
    loop {
        measure(&mut stages);
        let requesting = stages.iter().enumerate().filter_map(|(i, stage)| match stage {
            Stage::Searching(search) => Some((i, search.requested()?)),
            _ => None,
        });
        let (requesting, points): (Vec<usize>, Vec<At<'_>>) = requesting.unzip();
        if requesting.is_empty() {
            break;
        }
        for (i, answer) in requesting.into_iter().zip(linearize_together(&points)) {
            if let Stage::Searching(search) = std::mem::replace(&mut stages[i], Stage::Alone) {
                stages[i] = search.tell(answer);
            }
        }
        bend(&mut stages);
    }
    let starts: Vec<&Start> = problems.iter().map(|(_, start)| start).collect();
    summaries(&plain, stages, &starts, control, begin)
}

/// Passes on the second derivatives that searches request, of all in one pass.
fn bend(stages: &mut [Stage<'_>]) {
    let bending = stages.iter().enumerate().filter_map(|(i, stage)| match stage {
        Stage::Searching(search) => Some((i, search.bends()?)),
        _ => None,
    });
    let (bending, bends): (Vec<usize>, Vec<Bend<'_>>) = bending.unzip();
    for (i, answer) in bending.into_iter().zip(curvatures_together(&bends)) {
        if let Stage::Searching(search) = std::mem::replace(&mut stages[i], Stage::Alone) {
            stages[i] = search.bend(answer);
        }
    }
}

/// Estimates the noise where rounds have ended, in one pass.
fn measure(stages: &mut [Stage<'_>]) {
    let measuring = stages.iter().enumerate().filter_map(|(i, stage)| match stage {
        Stage::Measuring(one) => Some((i, one.place())),
        _ => None,
    });
    let (measuring, points): (Vec<usize>, Vec<At<'_>>) = measuring.unzip();
    for (i, noise) in measuring.into_iter().zip(noise::estimate_together(&points)) {
        if let Stage::Measuring(one) = std::mem::replace(&mut stages[i], Stage::Alone) {
            stages[i] = one.tell(noise);
        }
    }
}

fn summaries(
    plain: &[Objective<'_>],
    stages: Vec<Stage<'_>>,
    starts: &[&Start],
    control: &Control,
    begin: Instant,
) -> Vec<Result<Summary, Error>> {
    let settle = |(stage, plain)| match stage {
        Stage::Ended(end) => Stage::Ended(Box::new(settled(plain, *end))),
        other => other,
    };
    let stages: Vec<Stage<'_>> = stages.into_iter().zip(plain).map(settle).collect();
    let ended = |(stage, plain): (&Stage<'_>, _)| match stage {
        Stage::Ended(end) => Some(at_end(plain, end)),
        _ => None,
    };
    let objectives: Vec<Option<Objective<'_>>> = stages.iter().zip(plain).map(ended).collect();
    let ends = stages.iter().zip(&objectives).filter_map(|(stage, objective)| match (stage, objective) {
        (Stage::Ended(end), Some(objective)) => Some((objective, &**end)),
        _ => None,
    });
    let seconds = begin.elapsed().as_secs_f64() / plain.len() as f64;
    let mut found = conclude_together(&ends.collect::<Vec<_>>(), seconds).into_iter();
    let finish = |i: usize| match objectives[i].as_ref().and_then(|_| found.next()) {
        Some(found) => found.map(|found| after_stages(found, starts[i].stages.as_ref())),
        None => plain[i].problem.run_within(Instant::now(), control, starts[i].clone()),
    };
    (0..plain.len()).map(finish).collect()
}
