//! Passes over the data: the segments of all records, run in lanes and on threads, and the accumulators of their
//! windows.

use super::batches::{Broken, in_batches, run};
use super::job::Job;
use super::{Objective, Values};
use crate::optimize::Infeasible;
use crate::sweep::{RunError, Visit, Window};

/// An accumulator of the windows of a segment of an experiment.
pub(crate) trait Accumulate: Send + Sized {
    /// Adds one lane of a window of standardized errors.
    fn add(&mut self, window: &Window, lane: usize);

    /// Adds the accumulator of the segment that follows.
    fn append(&mut self, later: Self);
}

/// Two accumulators in one pass.
impl<A: Accumulate, B: Accumulate> Accumulate for (A, B) {
    fn add(&mut self, window: &Window, lane: usize) {
        self.0.add(window, lane);
        self.1.add(window, lane);
    }

    fn append(&mut self, later: Self) {
        self.0.append(later.0);
        self.1.append(later.1);
    }
}

/// An accumulator that a pass may leave out, in all segments alike.
impl<A: Accumulate> Accumulate for Option<A> {
    fn add(&mut self, window: &Window, lane: usize) {
        self.iter_mut().for_each(|one| one.add(window, lane));
    }

    fn append(&mut self, later: Self) {
        self.iter_mut().zip(later).for_each(|(one, later)| one.append(later));
    }
}

/// As many accumulators in all segments.
impl<A: Accumulate> Accumulate for Vec<A> {
    fn add(&mut self, window: &Window, lane: usize) {
        self.iter_mut().for_each(|one| one.add(window, lane));
    }

    fn append(&mut self, later: Self) {
        self.iter_mut().zip(later).for_each(|(one, later)| one.append(later));
    }
}

/// An accumulator of the windows of segments that run in parallel lanes. It takes all lanes of a window at once, in vector registers.
pub(crate) trait AccumulateLanes {
    /// What one lane has summed up to.
    type Lane: Send;

    /// Adds a window of standardized errors. `begin` of a lane that has no samples may lie behind the end of its record.
    fn add(&mut self, window: &Window);

    fn lane(&self, lane: usize) -> Self::Lane;

    /// Adds the sum of the segment that follows.
    fn append(lane: &mut Self::Lane, later: Self::Lane);
}

/// Accumulates nothing.
impl AccumulateLanes for () {
    type Lane = ();

    fn add(&mut self, _window: &Window) {}

    fn lane(&self, _lane: usize) {}

    fn append(_lane: &mut (), _later: ()) {}
}

/// An accumulator that a pass may leave out, in all segments alike.
impl<L: AccumulateLanes> AccumulateLanes for Option<L> {
    type Lane = Option<L::Lane>;

    fn add(&mut self, window: &Window) {
        self.iter_mut().for_each(|one| one.add(window));
    }

    fn lane(&self, lane: usize) -> Self::Lane {
        self.as_ref().map(|one| one.lane(lane))
    }

    fn append(lane: &mut Self::Lane, later: Self::Lane) {
        lane.iter_mut().zip(later).for_each(|(lane, later)| L::append(lane, later));
    }
}

impl Objective<'_> {
    /// Initial state and parameters of each experiment.
    pub(super) fn values(&self, coordinates: &[f64]) -> Vec<Values> {
        (0..self.experiments()).map(|e| self.problem.unknowns.of_experiment(e, coordinates)).collect()
    }

    /// Initial state and parameters of one experiment, also of states that follow from the parameters: not numbers where there are none.
    pub(crate) fn values_of(&self, e: usize, coordinates: &[f64]) -> Values {
        let values = self.problem.unknowns.of_experiment(e, coordinates);
        if !self.problem.unknowns.follows(e) {
            return values;
        }
        let states = values.x.len();
        let started = self.sweep.start(&self.problem.records[e], &values.x, &values.p);
        let x = started.map_or(vec![f64::NAN; states], |started| started.carry[..states].to_vec());
        Values { x, ..values }
    }

    /// Runs one experiment alone and calls `visit` with its windows, in the units of the outputs.
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

    /// One pass over all data: an accumulator per experiment, with the experiment's windows added in order of time.
    pub(crate) fn gather<A: Accumulate>(
        &self,
        coordinates: &[f64],
        slopes: bool,
        make: impl Fn(usize) -> A + Sync,
    ) -> Result<Vec<A>, Infeasible> {
        let found = self.gather_beside(coordinates, slopes, make, |_| ())?;
        Ok(found.into_iter().map(|(one, ())| one).collect())
    }

    /// [`gather`](Self::gather) with a second accumulator, which `beside` makes for the experiments in the lanes of a batch.
    pub(crate) fn gather_beside<A: Accumulate, L: AccumulateLanes>(
        &self,
        coordinates: &[f64],
        slopes: bool,
        make: impl Fn(usize) -> A + Sync,
        beside: impl Fn(&[usize]) -> L + Sync,
    ) -> Result<Vec<(A, L::Lane)>, Infeasible> {
        let found = self.gather_all(coordinates, slopes, &make, &beside);
        match (&found, self.inside_bounds(coordinates)) {
            (Err(Infeasible::Failed(_)), Some(inside)) if slopes => {
                inside.gather_all(coordinates, slopes, &make, &beside).or(found)
            }
            _ => found,
        }
    }

    fn gather_all<A: Accumulate, L: AccumulateLanes>(
        &self,
        coordinates: &[f64],
        slopes: bool,
        make: &(impl Fn(usize) -> A + Sync),
        beside: &(impl Fn(&[usize]) -> L + Sync),
    ) -> Result<Vec<(A, L::Lane)>, Infeasible> {
        let values = self.values(coordinates);
        let borders = self.borders(coordinates, &values, slopes)?;
        let jobs = (0..self.experiments())
            .flat_map(|e| self.segments(e, &values[e], coordinates, slopes, borders.as_deref()))
            .collect();
        let found = self.run_jobs(jobs, make, beside)?;
        let mut all: Vec<(A, L::Lane)> = Vec::with_capacity(self.experiments());
        let mut found = found.into_iter();
        for segments in &self.problem.cuts.segments {
            let mut parts = found.by_ref().take(segments.len());
            let Some(mut whole) = parts.next() else { break };
            for (part, lane) in parts {
                whole.0.append(part);
                L::append(&mut whole.1, lane);
            }
            all.push(whole);
        }
        Ok(all)
    }

    /// One pass over the data of one experiment, with its accumulator.
    pub(crate) fn gather_one<A: Accumulate>(
        &self,
        coordinates: &[f64],
        e: usize,
        slopes: bool,
        make: impl Fn() -> A + Sync,
    ) -> Result<A, Infeasible> {
        // Not the values of all experiments, if they are not asked for: this is called for each of them.
        let borders = match self.problem.cuts.is_chained(e) {
            true => self.borders(coordinates, &self.values(coordinates), slopes)?,
            false => None,
        };
        let values = self.problem.unknowns.of_experiment(e, coordinates);
        let jobs = self.segments(e, &values, coordinates, slopes, borders.as_deref());
        let mut found = self.run_jobs(jobs, &|_| make(), &|_| ())?.into_iter().map(|(one, ())| one);
        let mut whole = found.next().unwrap_or_else(make);
        found.for_each(|part| whole.append(part));
        Ok(whole)
    }

    /// Runs jobs and accumulates the windows of each.
    fn run_jobs<A: Accumulate, L: AccumulateLanes>(
        &self,
        jobs: Vec<Job<'_>>,
        make: &(impl Fn(usize) -> A + Sync),
        beside: &(impl Fn(&[usize]) -> L + Sync),
    ) -> Result<Vec<(A, L::Lane)>, Infeasible> {
        let batch = |_: &[usize], jobs: &[&Job<'_>]| {
            let experiments: Vec<usize> = jobs.iter().map(|job| job.experiment).collect();
            gather(jobs, experiments.iter().map(|e| make(*e)).collect(), beside(&experiments))
        };
        in_batches(&jobs, batch).map_err(|(job, error)| self.infeasible(jobs[job].experiment, error))
    }
}

/// Runs jobs and accumulates the windows of each.
pub(super) fn gather<A: Accumulate, L: AccumulateLanes>(
    jobs: &[&Job<'_>],
    mut gatherers: Vec<A>,
    mut beside: L,
) -> Result<Vec<(A, L::Lane)>, Broken> {
    run(jobs, &mut |window| {
        beside.add(window);
        for (lane, gatherer) in gatherers.iter_mut().enumerate().filter(|(lane, _)| window.samples[*lane] > 0) {
            gatherer.add(window, lane);
        }
    })?;
    Ok(gatherers.into_iter().enumerate().map(|(lane, one)| (one, beside.lane(lane))).collect())
}
