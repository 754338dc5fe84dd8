//! One pass over the data without slopes: the residuals at the estimate.

use super::aliases::Point;
use super::coupling::{Coupled, Coupling};
use super::largest::Largest;
use super::noise::REPRODUCED;
use super::output_sums::OutputSums;
use super::powers::{Powers, Scale, parts_by_chance, scales};
use super::step_error::{Compared, Extremes, Sampled, step_errors};
use super::together::RECORDS;
use super::whiteness::{LAGS, Whiteness};
use crate::error::Error;
use crate::estimate::OutputFit;
use crate::optimize::Infeasible;
use crate::problem::{Accumulate, At, Objective, gather_together};
use crate::record::{Channel, Record, Time};
use crate::sweep::Window;
use crate::whiteness::Portmanteau;
use std::ops::Range;

/// Longest horizon over which errors are correlated.
const HORIZON: usize = 100;
/// To judge the step, one window in `EVERY` is simulated again with a finer step, at most `AGAIN` of a record. Records of up to `AGAIN`
/// windows are simulated again as a whole.
const EVERY: usize = 16;
const AGAIN: usize = 16;

/// Results of a pass over the residuals.
pub(crate) struct Residuals {
    pub outputs: Vec<OutputFit>,
    /// Number of measurements with a weight above zero.
    pub measured: u64,
    /// Logarithm of the determinant of the covariance of all measurements.
    pub log_determinant: f64,
    /// A bound on how far (in standard errors) a finer step could move the unknowns: the norm of the change of all
    /// standardized predictions, extrapolated from the windows that were simulated again.
    pub step_error: f64,
    /// Some points along the records, their begins first.
    pub points: Vec<Point>,
    /// The whiteness of each output's errors.
    pub whiteness: Vec<Whiteness>,
    /// Outputs whose errors are correlated at the same sample, if there are such.
    pub coupled: Option<Coupled>,
    /// Mean and standard deviation of each output's measurements.
    pub levels: Vec<(f64, f64)>,
    /// Mean fourth power of each output's errors, relative to the square of their mean square: 3 of normal ones.
    pub kurtosis: Vec<f64>,
    /// The largest error of each output, standardized where variances are predicted.
    pub largest: Vec<Largest>,
    /// The smallest standard deviation that was predicted for a measurement of each output; infinite without
    /// predictions.
    pub least_sigma: Vec<f64>,
    /// The probability that an output's errors follow as much from powers of its prediction by chance; empty where that is not examined.
    pub shape: Vec<f64>,
    /// The least probability that errors of the halves of the records, or of several records, follow from the prediction in ways
    /// that differ as much by chance.
    pub parts: f64,
}

impl Residuals {
    /// Whether the errors of an output are round-off of its measurements.
    pub fn is_rounding_of(&self, j: usize) -> bool {
        let (level, moves) = self.levels[j];
        self.outputs[j].rmse <= REPRODUCED * level.hypot(moves)
    }

    /// Whether those of all outputs are, so that the model reproduces the data.
    pub fn is_rounding(&self) -> bool {
        (0..self.outputs.len()).all(|j| self.is_rounding_of(j))
    }
}

/// Sums over one experiment.
struct Sums<'s> {
    objective: &'s Objective<'s>,
    experiment: usize,
    outputs: Vec<OutputSums>,
    measured: u64,
    /// Logarithm of the determinant of the covariance of a sample with all outputs, and of all measurements so far.
    log_determinants: (f64, f64),
    portmanteaus: Vec<Portmanteau>,
    coupling: Coupling,
    largest: Vec<Largest>,
    least_sigma: Vec<f64>,
    /// Whether autocorrelations count samples, instead of measurements.
    by_sample: bool,
    /// The windows to be simulated again, and of the others those with the most motion and with the longest intervals.
    again: Vec<Sampled>,
    moving: Extremes,
    waiting: Extremes,
    /// The first sample and its errors, to which the step from the samples before leads.
    first: Option<(usize, Vec<f64>)>,
    sigma: Vec<f64>,
    points: Vec<(usize, Vec<f64>)>,
    /// The errors of a window, output by output, then the logarithms of their variances, and those of one output that are tested for
    /// whiteness.
    errors: Vec<f64>,
    tested: Vec<f64>,
    /// Of the predictions of each output; empty where errors are not examined for following from them.
    scales: &'s [Scale],
    /// Of the first half and of the second.
    powers: Vec<[Powers; 2]>,
}

impl<'s> Sums<'s> {
    fn new(objective: &'s Objective<'s>, experiment: usize, scales: &'s [Scale]) -> Self {
        let outputs = objective.outputs();
        let all: Vec<usize> = (0..outputs).collect();
        Sums {
            objective,
            experiment,
            outputs: vec![OutputSums::default(); outputs],
            measured: 0,
            log_determinants: (objective.whitening.log_determinant(&all), 0.0),
            portmanteaus: vec![Portmanteau::new(LAGS.max(horizon(objective))); outputs],
            coupling: Coupling::new(outputs),
            largest: vec![Largest::default(); outputs],
            least_sigma: vec![f64::INFINITY; outputs],
            by_sample: horizon(objective) > 0,
            again: vec![],
            moving: Extremes::default(),
            waiting: Extremes::default(),
            first: None,
            sigma: objective.whitening.sigma(),
            points: vec![],
            errors: vec![],
            tested: vec![],
            scales,
            powers: vec![Default::default(); scales.len()],
        }
    }

    /// Sums of errors and predictions, on both sides of the middle of the record.
    fn add_powers(&mut self, window: &Window, lane: usize) {
        let (samples, begin) = (window.samples[lane], window.begin[lane]);
        let record = &self.objective.problem.records[self.experiment];
        let middle = (record.len() / 2).clamp(begin, begin + samples) - begin;
        for (j, (powers, scale)) in self.powers.iter_mut().zip(self.scales).enumerate() {
            let values = &record.outputs()[j].values[begin..begin + samples];
            let mut errors = &self.errors[j * samples..][..samples];
            let in_units: Vec<f64>;
            if window.has_variances() {
                in_units =
                    errors.iter().enumerate().map(|(k, error)| error * window.variance_root(k, j, lane)).collect();
                errors = &in_units;
            }
            for (half, range) in [0..middle, middle..samples].into_iter().enumerate() {
                if window.whole {
                    powers[half].add(*scale, &values[range.clone()], &errors[range]);
                    continue;
                }
                // Runs of samples that were all measured.
                let mut from = range.start;
                for k in range.start..=range.end {
                    if k == range.end || !window.is_measured(k, j, lane) {
                        powers[half].add(*scale, &values[from..k], &errors[from..k]);
                        from = k + 1;
                    }
                }
            }
        }
    }

    /// Appends the errors of an output, multiplied by the roots of their weights, to its sequence. Lags count measurements of weight
    /// above zero, however many samples lie between them; they count samples where predictions restart a number of samples
    /// before, which correlates errors over so many samples.
    fn follow(&mut self, window: &Window, j: usize, lane: usize) {
        let (weighted, samples) = (self.objective.is_weighted(), window.samples[lane]);
        let errors = &self.errors[j * samples..][..samples];
        if !weighted && (self.by_sample || window.whole) {
            return self.portmanteaus[j].add(errors);
        }
        let weight = |k: usize| self.objective.weight(self.experiment, window.begin[lane] + k);
        let counts = |k: usize| self.by_sample || window.is_measured(k, j, lane) && !(weighted && weight(k) == 0.0);
        let weigh = |(k, error): (usize, &f64)| if weighted { error * weight(k).sqrt() } else { *error };
        self.tested.clear();
        self.tested.extend(errors.iter().enumerate().filter(|(k, _)| counts(*k)).map(weigh));
        self.portmanteaus[j].add(&self.tested);
    }

    /// Completes a window that ends before the sample.
    fn close(&mut self, sample: usize, errors: &[f64]) {
        self.again.last_mut().into_iter().for_each(|window| window.follow(sample, errors));
        self.moving.follow(sample, errors);
        self.waiting.follow(sample, errors);
    }

    /// Appends the logarithms of the variances of a window, where these are predicted.
    fn add_variances(&mut self, window: &Window, lane: usize) {
        if window.has_variances() {
            for j in 0..window.outputs() {
                self.errors.extend((0..window.samples[lane]).map(|k| window.log_variance(k, j, lane)));
            }
        }
    }

    /// Keeps a window that may be simulated again, with its errors.
    fn sample(&mut self, window: &Window, lane: usize) {
        if window.carry.is_empty() {
            return;
        }
        let (samples, begin) = (window.samples[lane], window.begin[lane]);
        self.add_variances(window, lane);
        let first: Vec<f64> = self.errors.iter().step_by(samples).copied().collect();
        self.close(begin, &first);
        self.first.get_or_insert((begin, first));
        let record = &self.objective.problem.records[self.experiment];
        let carry = || window.carry.iter().skip(lane).step_by(window.lanes()).copied().collect();
        // Windows in which a multiple of the distance lies.
        let distance = (EVERY * window.capacity()).max(record.len() / AGAIN);
        let at_distance = begin.next_multiple_of(distance) < begin + samples;
        if at_distance && self.objective.sweep.restarts().is_none() {
            self.points.push((begin, carry()));
        }
        let spaced = at_distance || record.len() <= AGAIN * window.capacity();
        let sampled = || Sampled { begin, samples, spaced, errors: self.errors.clone(), after: vec![], carry: carry() };
        if spaced {
            return self.again.push(sampled());
        }
        // With the sample after it.
        let range = begin..(begin + samples + 1).min(record.len());
        self.moving.offer(motion(record, range.clone(), &self.sigma), sampled);
        if let Time::Stamps(times) = record.times() {
            let longest = times[range].windows(2).map(|pair| pair[1] - pair[0]).fold(0.0, f64::max);
            self.waiting.offer(longest, sampled);
        }
    }

    /// With all windows that are to be simulated again, each once.
    fn complete(mut self) -> Self {
        let (moving, waiting) = (std::mem::take(&mut self.moving), std::mem::take(&mut self.waiting));
        self.again.extend(moving.windows().chain(waiting.windows()));
        self.again.sort_by_key(|window| window.begin);
        self.again.dedup_by_key(|window| window.begin);
        self
    }

    /// The windows to be simulated again.
    fn compared<'c>(&'c self, coordinates: &'c [f64]) -> Compared<'c> {
        Compared { objective: self.objective, coordinates, experiment: self.experiment, windows: &self.again }
    }

    /// Counts the measurements of a window.
    fn count(&mut self, window: &Window, lane: usize) {
        let (outputs, samples) = (window.outputs(), window.samples[lane]);
        let (whole, log_determinant) = (self.log_determinants.0, &mut self.log_determinants.1);
        if window.whole && !window.has_variances() && !self.objective.is_weighted() {
            *log_determinant += samples as f64 * whole;
            self.measured += (samples * outputs) as u64;
            return;
        }
        let mut here = Vec::with_capacity(outputs);
        for k in 0..samples {
            here.clear();
            here.extend((0..outputs).filter(|&j| window.is_measured(k, j, lane)));
            *log_determinant += match here.len() == outputs {
                _ if window.has_variances() => here.iter().map(|&j| window.log_variance(k, j, lane)).sum(),
                true => whole,
                false => self.objective.whitening.log_determinant(&here),
            };
            if !self.objective.is_weighted() || self.objective.weight(self.experiment, window.begin[lane] + k) > 0.0 {
                self.measured += here.len() as u64;
            }
        }
    }
}

impl Accumulate for Sums<'_> {
    fn add(&mut self, window: &Window, lane: usize) {
        let (outputs, samples, begin) = (window.outputs(), window.samples[lane], window.begin[lane]);
        self.count(window, lane);
        let (objective, experiment) = (self.objective, self.experiment);
        let weight = |k: usize| objective.weight(experiment, begin + k);
        self.errors.clear();
        (0..outputs).for_each(|j| self.errors.extend(window.errors(j, lane)));
        match window.whole && !objective.is_weighted() {
            true => self.coupling.add_all(&self.errors, samples),
            false => self.coupling.add(window, lane, objective.is_weighted().then_some(&weight)),
        }
        self.add_powers(window, lane);
        let record = &self.objective.problem.records[self.experiment];
        for j in 0..outputs {
            let errors = &self.errors[j * samples..][..samples];
            self.largest[j].add(errors, self.experiment, begin);
            let values = &record.outputs()[j].values[begin..begin + samples];
            if window.whole && !window.has_variances() {
                self.outputs[j].add_all(values, errors);
                self.follow(window, j, lane);
                continue;
            }
            for (k, (&y, &error)) in values.iter().zip(errors).enumerate() {
                if window.is_measured(k, j, lane) {
                    let unit = window.variance_root(k, j, lane);
                    self.outputs[j].add(y, error * unit);
                    if window.has_variances() {
                        self.least_sigma[j] = self.least_sigma[j].min(unit);
                    }
                }
            }
            self.follow(window, j, lane);
        }
        self.sample(window, lane);
    }

    fn append(&mut self, later: Self) {
        self.measured += later.measured;
        self.log_determinants.1 += later.log_determinants.1;
        self.outputs.iter_mut().zip(&later.outputs).for_each(|(sums, later)| sums.append(later));
        self.portmanteaus.iter_mut().zip(&later.portmanteaus).for_each(|(sums, later)| sums.follow(later));
        self.coupling.append(&later.coupling);
        self.largest.iter_mut().zip(&later.largest).for_each(|(largest, later)| *largest = largest.or(*later));
        self.least_sigma.iter_mut().zip(&later.least_sigma).for_each(|(least, later)| *least = least.min(*later));
        if let Some((sample, errors)) = &later.first {
            self.close(*sample, errors);
        }
        self.again.extend(later.again);
        self.moving.append(later.moving);
        self.waiting.append(later.waiting);
        self.points.extend(later.points);
        for (powers, later) in self.powers.iter_mut().flatten().zip(later.powers.iter().flatten()) {
            powers.append(later);
        }
    }
}

/// The least of the probabilities that the halves of the records, or some records, differ as much by chance.
fn parts(all: &[Sums<'_>]) -> f64 {
    let outputs = all[0].powers.len();
    let half = |j: usize, half: usize| {
        let mut sum = Powers::default();
        all.iter().for_each(|one| sum.append(&one.powers[j][half]));
        sum
    };
    let record = |one: &Sums<'_>, j: usize| {
        let mut sum = one.powers[j][0];
        sum.append(&one.powers[j][1]);
        sum
    };
    let of = |j: usize| {
        let halves = parts_by_chance(&[half(j, 0), half(j, 1)]);
        let several = (2..=RECORDS).contains(&all.len());
        let records = || all.iter().map(|one| record(one, j)).collect::<Vec<_>>();
        if several { halves.min(parts_by_chance(&records())) } else { halves }
    };
    (0..outputs).map(of).fold(1.0, f64::min)
}

/// The residuals at a point, in the units of the outputs.
pub(crate) fn residual_pass(objective: &Objective<'_>, coordinates: &[f64]) -> Result<Residuals, Error> {
    // Without a pre-filter: the errors as they are.
    let mut plain = objective.in_units();
    let unfiltered;
    if objective.problem.settings.prefilter.is_some() {
        let mut problem = objective.problem.clone();
        problem.settings.prefilter = None;
        unfiltered = problem;
        plain = Objective { problem: &unfiltered, ..plain };
    }
    let scales = scales(objective);
    let make = |experiment: usize| Sums::new(objective, experiment, &scales);
    let all = plain.gather(coordinates, false, make).map_err(|_| failed(objective, coordinates))?;
    let all: Vec<Sums<'_>> = all.into_iter().map(Sums::complete).collect();
    let windows: Vec<Compared<'_>> = all.iter().map(|one| one.compared(coordinates)).collect();
    let step_error = step_errors(&windows).into_iter().sum::<f64>();
    Ok(residuals(objective, coordinates, &all, step_error))
}

/// The same of several objectives of one record each, at points of their own; `None` for one that fails.
pub(crate) fn residuals_together(points: &[At<'_>]) -> Vec<Option<Residuals>> {
    let plain: Vec<Objective<'_>> = points.iter().map(|(objective, _)| objective.in_units()).collect();
    let in_units: Vec<At<'_>> = plain.iter().zip(points).map(|(plain, (_, x))| (plain, *x)).collect();
    let scales: Vec<Vec<Scale>> = points.iter().map(|(objective, _)| scales(objective)).collect();
    let all = gather_together(&in_units, |i| Sums::new(points[i].0, 0, &scales[i]));
    let all: Vec<Option<Sums<'_>>> = all.into_iter().map(|sums| sums.map(Sums::complete)).collect();
    let present = all.iter().zip(points).filter_map(|(sums, (_, x))| Some(sums.as_ref()?.compared(x)));
    let windows: Vec<Compared<'_>> = present.collect();
    let mut step_errors = step_errors(&windows).into_iter();
    let finish = |(sums, (objective, x)): (&Option<Sums<'_>>, &At<'_>)| {
        let sums = std::slice::from_ref(sums.as_ref()?);
        Some(residuals(objective, x, sums, step_errors.next()?))
    };
    all.iter().zip(points).map(finish).collect()
}

/// Results from the sums of all experiments, and the sum of the squared changes with a finer step.
fn residuals(objective: &Objective<'_>, coordinates: &[f64], all: &[Sums<'_>], step_error: f64) -> Residuals {
    let outputs = objective.outputs();
    let mut sums = vec![OutputSums::default(); outputs];
    let (mut measured, mut log_determinant) = (0, 0.0);
    for one in all {
        measured += one.measured;
        log_determinant += one.log_determinants.1;
        sums.iter_mut().zip(&one.outputs).for_each(|(sum, one)| sum.append(one));
    }
    let mut coupling = all[0].coupling.clone();
    all[1..].iter().for_each(|one| coupling.append(&one.coupling));
    let whiteness = |j: usize| {
        let mut total = all[0].portmanteaus[j].clone();
        all[1..].iter().for_each(|one| total.append(&one.portmanteaus[j]));
        // Errors of a short record are correlated by its own unknowns, at each lag by no more than their number in errors.
        let unknowns = &objective.problem.unknowns;
        let own = if all.len() > 1 { unknowns.row.len() - unknowns.shared() } else { 0 };
        let count = sums[j].count;
        Whiteness::of(&total.without(own as f64 / count.max(1) as f64), count, horizon(objective))
    };
    let whiteness: Vec<Whiteness> = (0..outputs).map(whiteness).collect();
    let shape = |j: usize| {
        let mut sum = Powers::default();
        all.iter().flat_map(|one| one.powers[j]).for_each(|half| sum.append(&half));
        sum.shape_by_chance()
    };
    Residuals {
        shape: (0..all[0].powers.len()).map(shape).collect(),
        parts: parts(all),
        outputs: sums.iter().map(OutputSums::fit).collect(),
        levels: sums.iter().map(OutputSums::level).collect(),
        kurtosis: sums.iter().map(OutputSums::kurtosis).collect(),
        measured,
        log_determinant,
        step_error: step_error.sqrt(),
        points: points(objective, coordinates, all),
        coupled: coupling.strongest(&whiteness),
        whiteness,
        largest: (0..outputs)
            .map(|j| all.iter().map(|one| one.largest[j]).fold(Largest::default(), Largest::or))
            .collect(),
        least_sigma: (0..outputs)
            .map(|j| all.iter().map(|one| one.least_sigma[j]).fold(f64::INFINITY, f64::min))
            .collect(),
    }
}

/// How much measurements change from sample to sample, by the noise: the sum of squares over all outputs.
fn motion(record: &Record, samples: Range<usize>, sigma: &[f64]) -> f64 {
    let of = |(channel, sigma): (&Channel, &f64)| {
        let steps = channel.values[samples.clone()].windows(2).map(|pair| ((pair[1] - pair[0]) / sigma).powi(2));
        steps.filter(|step| step.is_finite()).sum::<f64>()
    };
    record.outputs().iter().zip(sigma).map(of).sum()
}

/// The begins of the records, then some points along them.
fn points(objective: &Objective<'_>, coordinates: &[f64], all: &[Sums<'_>]) -> Vec<Point> {
    let begin = |e: usize| (e, 0, objective.problem.unknowns.of_experiment(e, coordinates).x);
    let states = objective.problem.layout().states.len();
    let later = |(e, one): (usize, &Sums<'_>)| -> Vec<Point> {
        one.points.iter().map(|(begin, carry)| (e, *begin, carry[..states].to_vec())).collect()
    };
    (0..all.len()).map(begin).chain(all.iter().enumerate().flat_map(later)).collect()
}

/// The horizon of predictions that restart; zero where they do not, or from too far.
fn horizon(objective: &Objective<'_>) -> usize {
    objective.sweep.restarts().filter(|steps| *steps <= HORIZON).unwrap_or(0)
}

fn failed(objective: &Objective<'_>, coordinates: &[f64]) -> Error {
    for e in 0..objective.experiments() {
        let probe = objective.run_alone(e, coordinates, false, &mut |window| {
            (0..window.samples[0]).all(|k| (0..window.outputs()).all(|j| window.error(k, j, 0).is_finite()))
        });
        if let Err(error) = probe {
            let sample = if let crate::sweep::RunError::Failed { sample } = error { sample } else { 0 };
            return Error::Simulation(objective.locate(e, coordinates, sample));
        }
    }
    Error::Simulation(objective.locate(0, coordinates, 0))
}

/// The error of an infeasible point.
pub(crate) fn reason(error: Infeasible) -> Error {
    Error::Optimizer(error.to_string())
}

#[cfg(test)]
mod tests;
