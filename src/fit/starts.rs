//! Searches from several starts, side by side: [`Fit::starts`](super::Fit::starts).

mod again;
mod draw;
mod minima;
mod progress;
mod screen;

use super::lockstep::{Search, Stage};
use super::search::{Rounds, checkpoint};
use super::start_error::start_error;
use crate::covariance::SearchEnd;
use crate::error::{Error, Failure};
use crate::estimate::Starts;
use crate::numeral::number;
use crate::optimize::{Infeasible, LeastSquares, Linearization};
use crate::problem::{
    At, Bend, CheckpointFile, Lead, Objective, Optimizer, SearchPlan, curvatures_together, each, linearize_together,
    noise,
};
use minima::{Comparison, End};
use progress::{Places, Progress};
use serde::{Deserialize, Serialize};
use std::sync::{Arc, Mutex, PoisonError};

/// From this number on, searches of a single record are run in lanes; fewer have more of the lanes with each record cut into segments.
const TOGETHER: usize = 4;
/// A search that is above the best minimum is stopped after so many times the trial steps of the median search that found a
/// minimum, if a quarter of the searches have found one, and after so many at the least.
const PATIENCE: u64 = 10;
const LEAST_TRIALS: u64 = 100;
const QUARTER: usize = 4;
/// Where only the best are searched to their ends: so many, after so many evaluations of each. Some searches cross a plateau at first:
/// of 138 right minima 137 are found without this rule, 136 with 75 evaluations, 122 with 40, 70 with 25. A crane in which one search of 32
/// ends at the right minimum is found with 150, not with 75.
const BEST: usize = 4;
const EVALUATIONS_OF_ALL: u64 = 150;

type Answer = Result<Linearization, Infeasible>;

/// A search from one of the starts.
enum Run<'p> {
    Searching(Box<Search<'p>>),
    Ended { end: Box<SearchEnd>, level: f64 },
    Failed(NoEnd),
}

/// Why a search came to no end.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct NoEnd {
    /// False where the model failed where the search began.
    evaluated: bool,
    reason: String,
}

impl NoEnd {
    fn new(evaluated: bool, reason: impl Into<String>) -> Self {
        NoEnd { evaluated, reason: reason.into() }
    }

    /// From the error at the start, without its hint, which would be repeated for each start, and in the words of a report.
    fn at_start(error: Error) -> Self {
        match error {
            Error::Start(Failure { experiment, sample, time, signal, value, .. }) => NoEnd::new(
                false,
                format!(
                    "the start cannot be evaluated: experiment `{experiment}`, sample {sample} (t = {time}): {signal} is {}",
                    number(value, 3)
                ),
            ),
            // A time limit, or a flag.
            other => NoEnd::new(true, other.to_string()),
        }
    }
}

/// Searches from the declared start and others, or from where earlier ones ended by a coarser method; the best end, with what
/// all of them found.
pub(super) fn search_from_many(
    plain: &Objective<'_>,
    optimizer: &Arc<dyn Optimizer>,
    count: usize,
    earlier: Option<&Starts>,
) -> Result<SearchEnd, Error> {
    if let Some(earlier) = earlier {
        return again::search_again(plain, optimizer, earlier);
    }
    let wide = is_wide(plain);
    let file = checkpoint(plain, optimizer)?;
    let resumed = file.as_ref().map(CheckpointFile::load::<Places>).transpose()?.flatten();
    let (cycle, Places { starts, places }, led) = match resumed {
        Some((_, cycle, Some(resumed))) if resumed.places.len() == count => (cycle, resumed, 0),
        _ => {
            let (starts, screened) = starts(plain, count, wide);
            let (led, evaluations) = in_stages(plain, &starts);
            (0, Places { starts, places: led.into_iter().map(Ok).collect() }, evaluations + screened)
        }
    };
    // The declared start is evaluated whatever the limits, so that there is an answer.
    let begin = |i: usize| match i > 0 && plain.control.stops() {
        true => Run::Failed(NoEnd::new(true, "a limit was reached before this start was evaluated")),
        false => begin(plain, optimizer, &places[i]),
    };
    let runs = each(count, begin);
    let comparison = Comparison::new(plain);
    let mut searches = Searches { plain, comparison, starts, runs, cycle, wide };
    if let Some(file) = &file {
        // Written at once, so that a path that cannot be written is reported before the searches.
        progress::write(&searches, file)?;
    }
    searches.run(file.as_ref());
    let starts = searches.starts;
    let ends: Vec<Result<SearchEnd, NoEnd>> = searches.runs.into_iter().map(Run::end).collect();
    let Some((best, found)) = minima::found(plain, &starts, &ends) else {
        return Err(declared_error(plain, &starts[0]));
    };
    let end = ends.into_iter().nth(best).and_then(Result::ok).ok_or_else(|| declared_error(plain, &starts[0]))?;
    let found = Starts { evaluations: found.evaluations + led, ..found };
    Ok(SearchEnd { starts: Some(found), write_error: file.and_then(|file| file.write_error()), ..end })
}

/// The declared start and others, of which half are the best of many by their costs, and the evaluations that these took. Stages begin where
/// no simulation follows the measurements, so that its cost says nothing.
fn starts(plain: &Objective<'_>, count: usize, wide: bool) -> (Vec<Vec<f64>>, u64) {
    let half = (count - 1) / 2;
    if half == 0 || plain.problem.settings.lead != Lead::Declared {
        return (draw::starts(plain, count, draw::REACH, draw::SEED), 0);
    }
    let (best, evaluations) = screen::best(plain, half, wide);
    let mut starts = draw::starts(plain, count - best.len(), draw::REACH, draw::SEED);
    starts.extend(best);
    (starts, evaluations)
}

/// Where stages lead these starts, if they were asked for, and their evaluations.
fn in_stages(plain: &Objective<'_>, starts: &[Vec<f64>]) -> (Vec<Vec<f64>>, u64) {
    let Some(stages) = (plain.problem.settings.lead != Lead::Declared).then(|| plain.problem.stages().ok()).flatten()
    else {
        return (starts.to_vec(), 0);
    };
    let led = each(starts.len(), |i| stages.lead(&starts[i], plain.control));
    let evaluations = led.iter().flatten().map(|(_, led)| led.evaluations).sum();
    let places = led.into_iter().zip(starts).map(|(led, start)| led.map_or_else(|_| start.clone(), |(led, _)| led));
    (places.collect(), evaluations)
}

/// Why nothing came of any start: the error of the declared one.
fn declared_error(plain: &Objective<'_>, declared: &[f64]) -> Error {
    let error = plain.linearize(declared).err();
    start_error(plain, declared, error.unwrap_or(Infeasible::Failed(String::new())))
}

fn begin<'p>(plain: &'p Objective<'p>, optimizer: &Arc<dyn Optimizer>, place: &Result<Vec<f64>, NoEnd>) -> Run<'p> {
    let place = match place {
        Ok(place) => place.clone(),
        Err(none) => return Run::Failed(none.clone()),
    };
    match Rounds::new(plain, optimizer, place) {
        Ok(rounds) => Run::Searching(Box::new(Search::new(rounds))),
        Err(error) => Run::Failed(NoEnd::at_start(error)),
    }
}

/// Slopes and cost at each point.
fn linearized(points: &[At<'_>], wide: bool) -> Vec<Answer> {
    match wide && points.len() >= TOGETHER {
        true => linearize_together(points),
        false => each(points.len(), |i| points[i].0.linearize(points[i].1)),
    }
}

/// Whether single records run in more than one lane.
fn is_wide(plain: &Objective<'_>) -> bool {
    let problem = plain.problem;
    let single = problem.records.len() == 1 && problem.settings.prefilter.is_none();
    single && problem.runs_in_lanes()
}

impl<'p> Run<'p> {
    /// Passes on an evaluation. One that fails at the start is told why.
    fn told(self, answer: Answer, plain: &Objective<'_>, comparison: &Comparison) -> Run<'p> {
        let Run::Searching(search) = self else { return self };
        if let (None, Err(error)) = (search.machine.linearization(), &answer)
            && search.stopped(error).is_none()
        {
            return Run::Failed(NoEnd::at_start(start_error(plain, search.machine.place(), error.clone())));
        }
        Run::at(search.tell(answer), plain, comparison)
    }

    /// Passes on the second derivatives that it requested.
    fn bent(self, answer: Option<Answer>, plain: &Objective<'_>, comparison: &Comparison) -> Run<'p> {
        match self {
            Run::Searching(search) => Run::at(search.bend(answer), plain, comparison),
            other => other,
        }
    }

    fn at(stage: Stage<'p>, plain: &Objective<'_>, comparison: &Comparison) -> Run<'p> {
        match stage {
            Stage::Searching(search) => Run::Searching(search),
            Stage::Measuring(round) => {
                let (objective, place) = round.place();
                let noise = noise::estimate(objective, place);
                Run::at(round.tell(noise), plain, comparison)
            }
            Stage::Ended(end) => match End::new(plain, comparison, &end) {
                Some(End { level, .. }) => Run::Ended { level, end },
                None => Run::Failed(NoEnd::new(true, "its end cannot be evaluated")),
            },
            Stage::Alone => Run::Failed(NoEnd::new(false, "its start cannot be evaluated")),
        }
    }

    /// Where it stands, and its comparable cost there; `None` where it has none.
    fn place(&self, comparison: &Comparison) -> Option<(&[f64], f64)> {
        match self {
            Run::Searching(search) => {
                let cost = search.machine.linearization()?.cost;
                Some((search.machine.place(), comparison.level(&search.objective, cost)))
            }
            Run::Ended { end, level } => Some((&end.coordinates, *level)),
            Run::Failed(_) => None,
        }
    }

    fn end(self) -> Result<SearchEnd, NoEnd> {
        match self {
            Run::Ended { end, .. } => Ok(*end),
            Run::Failed(none) => Err(none),
            Run::Searching(_) => Err(NoEnd::new(true, "it was not run to its end")),
        }
    }
}

/// All searches of a fit.
struct Searches<'p> {
    plain: &'p Objective<'p>,
    comparison: Comparison,
    starts: Vec<Vec<f64>>,
    runs: Vec<Run<'p>>,
    /// Evaluations that each search was given so far.
    cycle: u64,
    wide: bool,
}

impl<'p> Searches<'p> {
    fn run(&mut self, file: Option<&CheckpointFile>) {
        let mut progress = Progress::begin(self);
        while self.advance() {
            self.cycle += 1;
            self.give_up_hopeless();
            let only_best = matches!(self.plain.problem.settings.searches, SearchPlan::Best(_));
            if only_best && self.cycle == EVALUATIONS_OF_ALL {
                self.give_up_all_but(BEST);
            }
            progress.show(self);
            if let Some(file) = file.filter(|file| self.cycle.is_multiple_of(file.every.max(1))) {
                file.note(progress::write(self, file));
            }
        }
        if let Some(file) = file {
            file.note(progress::write(self, file));
        }
        progress.end(self);
    }

    /// Gives each search the evaluation that it requests; false if there was none to give.
    fn advance(&mut self) -> bool {
        let requesting = self.runs.iter().enumerate().filter_map(|(i, run)| match run {
            Run::Searching(search) => Some((i, search.requested()?)),
            _ => None,
        });
        let (requesting, points): (Vec<usize>, Vec<At<'_>>) = requesting.unzip();
        let answers = linearized(&points, self.wide);
        let lost = || Run::Failed(NoEnd::new(true, ""));
        let taken = requesting.iter().zip(answers).map(|(&i, answer)| {
            let run = std::mem::replace(&mut self.runs[i], lost());
            Mutex::new(Some((run, answer)))
        });
        let taken: Vec<_> = taken.collect();
        let (plain, comparison) = (self.plain, &self.comparison);
        let told = each(taken.len(), |i| {
            let (run, answer) = taken[i].lock().unwrap_or_else(PoisonError::into_inner).take()?;
            Some(run.told(answer, plain, comparison))
        });
        for (&i, run) in requesting.iter().zip(told) {
            self.runs[i] = run.unwrap_or_else(lost);
        }
        self.bend();
        !requesting.is_empty()
    }

    /// Gives second derivatives to the searches that request them.
    fn bend(&mut self) {
        let bending = self.runs.iter().enumerate().filter_map(|(i, run)| match run {
            Run::Searching(search) => Some((i, search.bends()?)),
            _ => None,
        });
        let (bending, bends): (Vec<usize>, Vec<Bend<'_>>) = bending.unzip();
        let answers = match self.wide && bends.len() >= TOGETHER {
            true => curvatures_together(&bends),
            false => each(bends.len(), |i| bends[i].objective.curvature(bends[i].x, bends[i].along)),
        };
        for (i, answer) in bending.into_iter().zip(answers) {
            let run = std::mem::replace(&mut self.runs[i], Run::Failed(NoEnd::new(true, "")));
            self.runs[i] = run.bent(answer, self.plain, &self.comparison);
        }
    }

    /// Gives up the searches whose cost is not among so many of the lowest.
    fn give_up_all_but(&mut self, count: usize) {
        let levels: Vec<Option<f64>> = self.runs.iter().map(|run| Some(run.place(&self.comparison)?.1)).collect();
        let mut sorted: Vec<f64> = levels.iter().flatten().copied().collect();
        sorted.sort_by(f64::total_cmp);
        let Some(&most) = sorted.get(count - 1) else { return };
        for (run, level) in self.runs.iter_mut().zip(levels) {
            let Some(level) = level.filter(|&level| level > most && matches!(run, Run::Searching(_))) else { continue };
            let ratio = number(self.comparison.ratio(level, sorted[0]), 3);
            let reason = format!("given up after {} evaluations at {ratio} times the best cost", self.cycle);
            *run = Run::Failed(NoEnd::new(true, reason));
        }
    }

    /// Gives up the searches that take far longer than others, except that from the declared start, of which the end is reported.
    fn give_up_hopeless(&mut self) {
        let minima = self.runs.iter().filter_map(|run| match run {
            Run::Ended { end, level } if end.outcome.converged() => Some((*level, end.iterations)),
            _ => None,
        });
        let (levels, trials): (Vec<f64>, Vec<u64>) = minima.unzip();
        let Some(typical) = typical(trials, self.runs.len()) else { return };
        let best = levels.into_iter().fold(f64::INFINITY, f64::min);
        for run in self.runs.iter_mut().skip(1) {
            let Run::Searching(search) = run else { continue };
            let Some(linear) = search.machine.linearization() else { continue };
            let level = self.comparison.level(&search.objective, linear.cost);
            if search.trials() > most(typical) && level > best {
                let ratio = number(self.comparison.ratio(level, best), 3);
                let reason = format!(
                    "given up after {} steps at {ratio} times the best cost: the median search that found a minimum took {typical}",
                    search.trials()
                );
                *run = Run::Failed(NoEnd::new(true, reason));
            }
        }
    }
}

/// The trial steps of the median search that found a minimum, out of those of all that did; `None` where less than a quarter of the
/// searches did.
fn typical(mut trials: Vec<u64>, searches: usize) -> Option<u64> {
    trials.sort_unstable();
    trials.get(trials.len() / 2).copied().filter(|_| trials.len() * QUARTER >= searches)
}

/// The most trial steps of a search above the best minimum, by those of a typical one.
fn most(typical: u64) -> u64 {
    LEAST_TRIALS.max(PATIENCE * typical)
}

#[cfg(test)]
mod tests {
    use super::{most, typical};

    /// The median needs a quarter of the searches: two of eight, three of nine.
    #[test]
    fn patience_with_a_search() {
        assert_eq!([typical(vec![9, 3, 5], 9), typical(vec![9, 3], 8)], [Some(5), Some(9)]);
        assert_eq!([typical(vec![9, 3], 9), typical(vec![], 1)], [None, None]);
        assert_eq!([most(9), most(10), most(11)], [100, 100, 110]);
    }
}
