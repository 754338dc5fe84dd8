//! Passes over the data: the segments of all records, run side by side and in parallel, and what is gathered from their
//! windows.

use super::segments::{Border, Borders};
use super::standardize::Standardize;
use super::{Objective, Values};
use crate::optimize::Infeasible;
use crate::record::Time;
use crate::sweep::{Piece, Reached, RunError, Seed, Visit, Window};
use std::sync::Arc;

/// What a pass gathers from the windows of a segment of an experiment.
pub(crate) trait Accumulate: Send + Sized {
    /// Takes in one lane of a window of standardized errors.
    fn add(&mut self, window: &Window, lane: usize);

    /// Takes in what was gathered from the segment that follows.
    fn append(&mut self, later: Self);
}

/// A segment of an experiment, and what its windows need.
pub(crate) struct Job<'p> {
    pub experiment: usize,
    pub seeds: Vec<Seed>,
    /// How fast the quantity of each seed moves with its coordinate; zero where its slopes are left out.
    pub scales: Vec<f64>,
    pub piece: Piece<'p>,
}

/// Which of the pieces that ran side by side was not run to its end, and why.
pub(super) struct Broken {
    pub lane: usize,
    pub error: RunError,
}

/// Samples times columns that are worth another thread.
const WORTH_A_THREAD: usize = 50_000;

impl Objective<'_> {
    /// An experiment as one piece.
    pub(super) fn job<'p>(&'p self, e: usize, values: &'p Values, coordinates: &[f64], slopes: bool) -> Job<'p> {
        let (problem, unknowns) = (self.problem, &self.problem.unknowns);
        let record = &problem.records[e];
        let seeds = if slopes { unknowns.seeds(e) } else { vec![] };
        let mut scales = if slopes { unknowns.scales(e, coordinates) } else { vec![] };
        for (scale, i) in scales.iter_mut().zip(unknowns.columns(e)) {
            if self.left_out.get(i) == Some(&true) {
                *scale = 0.0;
            }
        }
        let Reached { carry, slopes: all } = self.sweep.start(record, &values.x, &values.p);
        let (states, width) = (values.x.len(), values.x.len() + values.p.len());
        let column = |seed: &Seed| match *seed {
            Seed::Carry(i) => i,
            Seed::Parameter(j) => states + j,
        };
        let known = seeds.iter().zip(&scales);
        let slopes = (0..carry.len()).flat_map(|row| known.clone().map(move |(seed, scale)| (row, column(seed), *scale)));
        let slope = |(row, column, scale): (usize, usize, f64)| if scale == 0.0 { 0.0 } else { all[row * width + column] };
        let slopes = slopes.map(slope).collect();
        let (prepared, samples) = (&problem.prepared[e], 0..record.len());
        Job {
            experiment: e,
            seeds,
            scales,
            piece: Piece { record, prepared, samples, carry, slopes, parameters: &values.p },
        }
    }

    /// The segments of an experiment, the begins of which are known.
    pub(super) fn segments<'p>(
        &'p self,
        e: usize,
        values: &'p Values,
        coordinates: &[f64],
        slopes: bool,
        borders: Option<&Borders>,
    ) -> Vec<Job<'p>> {
        let whole = self.job(e, values, coordinates, slopes);
        let segments = self.problem.cuts.segments[e].iter().enumerate();
        let job = |(s, samples): (usize, &std::ops::Range<usize>)| {
            let border = borders.filter(|_| s > 0).and_then(|borders| borders.of[e].get(s - 1));
            let from = |own: &Vec<f64>, border: Option<&Vec<f64>>| border.unwrap_or(own).clone();
            let carry = from(&whole.piece.carry, border.map(|border| &border.carry));
            let slopes = from(&whole.piece.slopes, border.map(|border| &border.slopes).filter(|_| slopes));
            let (seeds, scales) = (whole.seeds.clone(), whole.scales.clone());
            Job {
                experiment: e,
                seeds,
                scales,
                piece: Piece { samples: samples.clone(), carry, slopes, ..whole.piece.clone() },
            }
        };
        segments.map(job).collect()
    }

    /// Initial state and parameters of each experiment.
    pub(super) fn values(&self, coordinates: &[f64]) -> Vec<Values> {
        (0..self.experiments()).map(|e| self.problem.unknowns.of_experiment(e, coordinates)).collect()
    }

    /// Runs one experiment alone and shows its windows as they come, in the units of the outputs.
    pub(crate) fn run_alone(
        &self,
        e: usize,
        coordinates: &[f64],
        slopes: bool,
        visit: Visit<'_>,
    ) -> Result<(), RunError> {
        let values = self.problem.unknowns.of_experiment(e, coordinates);
        let job = self.job(e, &values, coordinates, slopes);
        let visit = &mut |window: &mut Window| !self.control.stops() && visit(window);
        let reached = self.sweep.run(std::slice::from_ref(&job.piece), &job.seeds, visit);
        reached.into_iter().next().map_or(Ok(()), |reached| reached.map(|_| ()))
    }

    /// The borders of the segments at a point, with their slopes if they are asked for; `None` where nothing is chained.
    fn borders(
        &self,
        coordinates: &[f64],
        values: &[Values],
        slopes: bool,
    ) -> Result<Option<Arc<Borders>>, Infeasible> {
        let cuts = &self.problem.cuts;
        if !(0..self.experiments()).any(|e| cuts.is_chained(e)) {
            return Ok(None);
        }
        let known = |found: &Arc<Borders>| !slopes || found.has_slopes();
        if let Some(found) = self.memory.at(coordinates).filter(known) {
            return Ok(Some(found));
        }
        if slopes {
            self.evaluate(coordinates)?;
            if let Some(found) = self.memory.at(coordinates) {
                return Ok(Some(found));
            }
        }
        let found = Arc::new(self.simulated_borders(coordinates, values)?);
        self.memory.keep(found.clone());
        Ok(Some(found))
    }

    /// The borders of the segments at a point, simulated in values.
    pub(super) fn simulated_borders(&self, coordinates: &[f64], values: &[Values]) -> Result<Borders, Infeasible> {
        let one = |e: usize| {
            let segments = &self.problem.cuts.segments[e];
            if !self.problem.cuts.is_chained(e) {
                return Ok(vec![]);
            }
            let job = self.job(e, &values[e], coordinates, false);
            let at: Vec<usize> = segments[1..].iter().map(|samples| samples.start).collect();
            self.sweep.follow(&job.piece, &at).map_err(|error| self.infeasible(e, error))
        };
        let borders =
            |carries: Vec<Vec<f64>>| carries.into_iter().map(|carry| Border { carry, slopes: vec![] }).collect();
        let of: Result<Vec<_>, Infeasible> =
            each(self.experiments(), one).into_iter().map(|e| e.map(borders)).collect();
        Ok(Borders { point: coordinates.to_vec(), cost: f64::INFINITY, values: values.to_vec(), of: of? })
    }

    /// One pass over all data: a gatherer per experiment, fed with the experiment's windows in order of time.
    pub(crate) fn gather<A: Accumulate>(
        &self,
        coordinates: &[f64],
        slopes: bool,
        make: impl Fn(usize) -> A + Sync,
    ) -> Result<Vec<A>, Infeasible> {
        let found = self.gather_all(coordinates, slopes, &make);
        match (&found, self.inside_bounds(coordinates)) {
            (Err(Infeasible::Failed(_)), Some(inside)) if slopes => inside.gather_all(coordinates, slopes, &make).or(found),
            _ => found,
        }
    }

    fn gather_all<A: Accumulate>(
        &self,
        coordinates: &[f64],
        slopes: bool,
        make: &(impl Fn(usize) -> A + Sync),
    ) -> Result<Vec<A>, Infeasible> {
        let values = self.values(coordinates);
        let borders = self.borders(coordinates, &values, slopes)?;
        let jobs = (0..self.experiments())
            .flat_map(|e| self.segments(e, &values[e], coordinates, slopes, borders.as_deref()))
            .collect();
        let found = self.run_jobs(jobs, make)?;
        let mut all: Vec<A> = Vec::with_capacity(self.experiments());
        let mut found = found.into_iter();
        for segments in &self.problem.cuts.segments {
            let mut parts = found.by_ref().take(segments.len());
            let Some(mut whole) = parts.next() else { break };
            parts.for_each(|part| whole.append(part));
            all.push(whole);
        }
        Ok(all)
    }

    /// The same of one experiment.
    pub(crate) fn gather_one<A: Accumulate>(
        &self,
        coordinates: &[f64],
        e: usize,
        slopes: bool,
        make: impl Fn() -> A + Sync,
    ) -> Result<A, Infeasible> {
        let values = self.values(coordinates);
        let borders = self.borders(coordinates, &values, slopes)?;
        let jobs = self.segments(e, &values[e], coordinates, slopes, borders.as_deref());
        let mut found = self.run_jobs(jobs, &|_| make())?.into_iter();
        let mut whole = found.next().unwrap_or_else(make);
        found.for_each(|part| whole.append(part));
        Ok(whole)
    }

    /// Runs jobs side by side and gathers from each.
    fn run_jobs<A: Accumulate>(
        &self,
        jobs: Vec<Job<'_>>,
        make: &(impl Fn(usize) -> A + Sync),
    ) -> Result<Vec<A>, Infeasible> {
        let batch = |jobs: &[&Job<'_>]| {
            let mut gatherers: Vec<A> = jobs.iter().map(|job| make(job.experiment)).collect();
            self.run(jobs, &mut |window| {
                for (lane, gatherer) in gatherers.iter_mut().enumerate().filter(|(lane, _)| window.samples[*lane] > 0) {
                    gatherer.add(window, lane);
                }
            })
            .map(|_| gatherers)
        };
        self.in_batches(&jobs, batch)
    }

    /// Runs jobs in batches of those that can go side by side; the results in the order of the jobs.
    pub(super) fn in_batches<T: Send>(
        &self,
        jobs: &[Job<'_>],
        batch: impl Fn(&[&Job<'_>]) -> Result<Vec<T>, Broken> + Sync,
    ) -> Result<Vec<T>, Infeasible> {
        let batches = self.batches(jobs);
        let one = |b: usize| {
            let members: Vec<&Job<'_>> = batches[b].iter().map(|&i| &jobs[i]).collect();
            batch(&members)
        };
        let work = jobs.iter().map(|job| job.piece.samples.len() * (job.seeds.len() + 1)).sum::<usize>();
        let results = match work / batches.len().max(1) > WORTH_A_THREAD || work > 8 * WORTH_A_THREAD {
            true => each(batches.len(), one),
            false => (0..batches.len()).map(one).collect(),
        };
        let mut found: Vec<Option<T>> = (0..jobs.len()).map(|_| None).collect();
        for (members, result) in batches.iter().zip(results) {
            let result = result.map_err(|Broken { lane, error }| {
                self.infeasible(jobs[members[lane]].experiment, error)
            })?;
            members.iter().zip(result).for_each(|(&i, value)| found[i] = Some(value));
        }
        Ok(found.into_iter().flatten().collect())
    }

    /// The numbers of the jobs that go side by side: of records alike, the long ones first.
    fn batches(&self, jobs: &[Job<'_>]) -> Vec<Vec<usize>> {
        let alike = |a: &Job<'_>, b: &Job<'_>| {
            let (one, other) = (a.piece.record, b.piece.record);
            let uniform = |time: &Time| matches!(time, Time::Uniform { .. });
            one.input_hold() == other.input_hold()
                && uniform(one.times()) == uniform(other.times())
                && a.seeds == b.seeds
        };
        let mut kinds: Vec<Vec<usize>> = vec![];
        for (i, job) in jobs.iter().enumerate() {
            match kinds.iter_mut().find(|kind| alike(&jobs[kind[0]], job)) {
                Some(kind) => kind.push(i),
                None => kinds.push(vec![i]),
            }
        }
        let mut batches = vec![];
        for mut kind in kinds {
            let first = &jobs[kind[0]];
            let lanes = self.sweep.lanes(first.piece.record, &first.seeds).max(1);
            if lanes > 1 {
                kind.sort_by_key(|&i| std::cmp::Reverse(jobs[i].piece.samples.len()));
            }
            batches.extend(kind.chunks(lanes).map(<[usize]>::to_vec));
        }
        batches
    }

    /// Runs pieces side by side and shows their windows of standardized errors.
    pub(super) fn run(&self, jobs: &[&Job<'_>], show: &mut dyn FnMut(&mut Window)) -> Result<Vec<Reached>, Broken> {
        let pieces: Vec<Piece<'_>> = jobs.iter().map(|job| job.piece.clone()).collect();
        let mut standardize: Option<Standardize<'_>> = None;
        let mut failed = None;
        let visit = &mut |window: &mut Window| {
            if self.control.stops() {
                return false;
            }
            let standardize = standardize.get_or_insert_with(|| Standardize::new(self, jobs, window.lanes()));
            if let Err((lane, sample)) = standardize.apply(window) {
                failed = Some(Broken { lane, error: RunError::Failed { sample } });
                return false;
            }
            show(window);
            true
        };
        let reached = self.sweep.run(&pieces, &jobs[0].seeds, visit);
        match failed {
            Some(failed) => Err(failed),
            None => {
                let lanes = reached.into_iter().enumerate();
                lanes.map(|(lane, reached)| reached.map_err(|error| Broken { lane, error })).collect()
            }
        }
    }
}

/// `f(0), f(1), ...`, in parallel where the feature `parallel` is on; in order.
pub(crate) fn each<T: Send>(n: usize, f: impl Fn(usize) -> T + Send + Sync) -> Vec<T> {
    #[cfg(feature = "parallel")]
    if n > 1 {
        use rayon::prelude::*;
        return (0..n).into_par_iter().map(f).collect();
    }
    (0..n).map(f).collect()
}
