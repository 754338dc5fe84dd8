//! Passes over the data: the pieces of all experiments, run side by side and in parallel, and what is gathered from their
//! windows.

use super::{Objective, Values};
use crate::optimize::Infeasible;
use crate::prefilter::Butterworth;
use crate::sweep::{Piece, Reached, RunError, Seed, Visit, Window};

/// What a pass gathers from the windows of an experiment.
pub(crate) trait Accumulate: Send {
    /// Takes in one lane of a window of standardized errors.
    fn add(&mut self, window: &Window, lane: usize);
}

/// A piece of an experiment, and what its windows need.
pub(crate) struct Job<'p> {
    pub experiment: usize,
    pub seeds: Vec<Seed>,
    /// How fast the quantity of each seed moves with its coordinate.
    pub scales: Vec<f64>,
    pub piece: Piece<'p>,
}

impl Objective<'_> {
    /// Each experiment as one piece.
    fn jobs<'p>(&'p self, values: &'p [Values], coordinates: &[f64], slopes: bool) -> Vec<Job<'p>> {
        let job = |(experiment, values): (usize, &'p Values)| self.job(experiment, values, coordinates, slopes);
        values.iter().enumerate().map(job).collect()
    }

    /// An experiment as one piece.
    pub(super) fn job<'p>(&'p self, e: usize, values: &'p Values, coordinates: &[f64], slopes: bool) -> Job<'p> {
        let (problem, unknowns) = (self.problem, &self.problem.unknowns);
        let record = &problem.records[e];
        let seeds = if slopes { unknowns.seeds(e) } else { vec![] };
        let scales = if slopes { unknowns.scales(e, coordinates) } else { vec![] };
        let Reached { carry, slopes: all } = self.sweep.start(record, &values.x, &values.p);
        let (states, width) = (values.x.len(), values.x.len() + values.p.len());
        let column = |seed: &Seed| match *seed {
            Seed::Carry(i) => i,
            Seed::Parameter(j) => states + j,
        };
        let slopes = (0..carry.len()).flat_map(|row| seeds.iter().map(move |seed| (row, column(seed))));
        let slopes = slopes.map(|(row, column)| all[row * width + column]).collect();
        let (prepared, samples) = (&problem.prepared[e], 0..record.len());
        Job {
            experiment: e,
            seeds,
            scales,
            piece: Piece { record, prepared, samples, carry, slopes, parameters: &values.p },
        }
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

    /// One pass over all data: a gatherer per experiment, fed with the experiment's windows in order of time.
    pub(crate) fn gather<A: Accumulate>(
        &self,
        coordinates: &[f64],
        slopes: bool,
        make: impl Fn(usize) -> A + Sync,
    ) -> Result<Vec<A>, Infeasible> {
        let values = self.values(coordinates);
        let jobs = self.jobs(&values, coordinates, slopes);
        let one = |i: usize| {
            let mut gatherer = make(jobs[i].experiment);
            self.run(&jobs[i..=i], &mut |window| gatherer.add(window, 0)).map(|()| gatherer)
        };
        let found = each(jobs.len(), one).into_iter().enumerate();
        found.map(|(i, found)| found.map_err(|error| self.infeasible(jobs[i].experiment, coordinates, error))).collect()
    }

    /// The same of one experiment, into one gatherer.
    pub(crate) fn gather_one<A: Accumulate>(&self, x: &[f64], e: usize, mut into: A) -> Result<A, Infeasible> {
        let values = self.problem.unknowns.of_experiment(e, x);
        let job = self.job(e, &values, x, true);
        let done = self.run(std::slice::from_ref(&job), &mut |window| into.add(window, 0));
        done.map(|()| into).map_err(|error| self.infeasible(e, x, error))
    }

    /// Runs pieces side by side and shows their windows of standardized errors.
    pub(super) fn run(&self, jobs: &[Job<'_>], show: &mut dyn FnMut(&mut Window)) -> Result<(), RunError> {
        let pieces: Vec<Piece<'_>> = jobs.iter().map(|job| job.piece.clone()).collect();
        let mut standardize = Standardize::new(self, jobs);
        let mut failed = None;
        let visit = &mut |window: &mut Window| {
            if self.control.stops() {
                return false;
            }
            if let Err(sample) = standardize.apply(window) {
                failed = Some(RunError::Failed { sample });
                return false;
            }
            show(window);
            true
        };
        let reached = self.sweep.run(&pieces, &jobs[0].seeds, visit);
        match failed {
            Some(failed) => Err(failed),
            None => reached.into_iter().try_for_each(|reached| reached.map(|_| ())),
        }
    }
}

/// From errors and slopes in the units of the outputs to standardized ones, with respect to the coordinates.
struct Standardize<'s> {
    objective: &'s Objective<'s>,
    prefilter: Option<(&'s Butterworth, Vec<f64>)>,
    /// Per column, then per lane; empty where all are one.
    scales: Vec<f64>,
}

impl<'s> Standardize<'s> {
    fn new(objective: &'s Objective<'s>, jobs: &[Job<'_>]) -> Self {
        let prefilter = objective.problem.settings.prefilter.as_ref().map(|filter| (filter, vec![]));
        let plain = jobs.iter().all(|job| job.scales.iter().all(|scale| *scale == 1.0));
        let columns = if plain { 0 } else { jobs[0].scales.len() };
        let lanes = objective.sweep.lanes();
        let scale = |at: usize| jobs.get(at % lanes).map_or(1.0, |job| job.scales[at / lanes]);
        Standardize { objective, prefilter, scales: (0..columns * lanes).map(scale).collect() }
    }

    /// The sample whose error is not finite, where there is one.
    fn apply(&mut self, window: &mut Window) -> Result<(), usize> {
        let (len, outputs, lanes) = (window.len(), window.outputs(), window.lanes());
        let last = window.columns() - 1;
        for k in 0..len {
            for j in 0..outputs {
                let errors = &window.row(k, j)[last * lanes..];
                if let Some(lane) = errors.iter().position(|error| !error.is_finite()) {
                    return Err(window.begin[lane] + k);
                }
            }
        }
        if let Some((filter, states)) = &mut self.prefilter {
            let width = outputs * window.columns() * lanes;
            filter.filter_rows(window.rows_mut(), width, states);
            window.clear_unmeasured();
        }
        if window.has_variances() {
            by_variance(window)?;
        } else {
            self.objective.whitening.apply(window);
        }
        if !self.scales.is_empty() {
            for k in 0..len {
                for j in 0..outputs {
                    scale(window.row_mut(k, j), &self.scales);
                    if window.has_variances() {
                        scale(window.variance_row_mut(k, j), &self.scales);
                    }
                }
            }
        }
        Ok(())
    }
}

fn scale(row: &mut [f64], scales: &[f64]) {
    row.iter_mut().zip(scales).for_each(|(value, scale)| *value *= scale);
}

/// Standardizes errors by their predicted variances `v`: rows `dy / sqrt(v), z = e / sqrt(v)`, and in the place of the
/// variances the rows `dv / (sqrt(2) v), (z^2 - 1) / sqrt(2)`, whose least-squares gradient is that of the likelihood.
fn by_variance(window: &mut Window) -> Result<(), usize> {
    let (lanes, last) = (window.lanes(), window.columns() - 1);
    for k in 0..window.len() {
        for j in 0..window.outputs() {
            for lane in 0..lanes {
                if !window.is_measured(k, j, lane) {
                    continue;
                }
                let v = window.variance(k, j, lane);
                if !(v > 0.0 && v.is_finite()) {
                    return Err(window.begin[lane] + k);
                }
                let (root, half) = (v.sqrt(), std::f64::consts::FRAC_1_SQRT_2);
                let number = (k * window.outputs() + j) * lanes + lane;
                window.log_variances[number] = v.ln();
                let at = |column: usize| column * lanes + lane;
                let row = window.row_mut(k, j);
                (0..=last).for_each(|column| row[at(column)] /= root);
                let z = row[at(last)];
                let second = window.variance_row_mut(k, j);
                (0..last).for_each(|column| second[at(column)] *= half / v);
                second[at(last)] = (z * z - 1.0) * half;
            }
        }
    }
    Ok(())
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
