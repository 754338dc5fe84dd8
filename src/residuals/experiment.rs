//! Sums over the errors of one experiment, window by window.

use crate::problem::{Accumulate, Objective};
use crate::record::{Channel, Record, Time};
use crate::residuals::coupling::Coupling;
use crate::residuals::first_errors::FirstErrors;
use crate::residuals::largest::Largest;
use crate::residuals::output_sums::OutputSums;
use crate::residuals::powers::{Powers, Scale};
use crate::residuals::step_error::{Compared, Extremes, Sampled};
use crate::residuals::whiteness::LAGS;
use crate::sweep::Window;
use crate::whiteness::Portmanteau;
use std::ops::Range;

/// To judge the step, one window in `EVERY` is simulated again with a finer step, at most `AGAIN` of a record. Records of up to `AGAIN`
/// windows are simulated again as a whole.
const EVERY: usize = 16;
const AGAIN: usize = 16;

/// Sums over one experiment.
pub(crate) struct Sums<'s> {
    objective: &'s Objective<'s>,
    experiment: usize,
    pub outputs: Vec<OutputSums>,
    pub measured: u64,
    /// Logarithm of the determinant of the covariance of a sample with all outputs, and of all measurements so far.
    pub log_determinants: (f64, f64),
    pub portmanteaus: Vec<Portmanteau>,
    pub coupling: Coupling,
    pub largest: Vec<Largest>,
    pub least_sigma: Vec<f64>,
    /// The windows to be simulated again, and of the others those with the most motion and with the longest intervals.
    again: Vec<Sampled>,
    moving: Extremes,
    waiting: Extremes,
    /// The first sample and its errors, to which the step from the samples before leads.
    first: Option<(usize, Vec<f64>)>,
    sigma: Vec<f64>,
    pub points: Vec<(usize, Vec<f64>)>,
    pub first_errors: FirstErrors,
    /// The errors of a window, output by output, then the logarithms of their variances, and those of one output that are tested for
    /// whiteness.
    errors: Vec<f64>,
    tested: Vec<f64>,
    /// Of the predictions of each output; empty where errors are not examined for following from them.
    scales: &'s [Scale],
    /// Of the first half and of the second.
    pub powers: Vec<[Powers; 2]>,
}

impl<'s> Sums<'s> {
    pub fn new(objective: &'s Objective<'s>, experiment: usize, scales: &'s [Scale]) -> Self {
        let outputs = objective.outputs();
        let all: Vec<usize> = (0..outputs).collect();
        Sums {
            objective,
            experiment,
            outputs: vec![OutputSums::default(); outputs],
            measured: 0,
            log_determinants: (objective.whitening.log_determinant(&all), 0.0),
            portmanteaus: vec![Portmanteau::new(LAGS); outputs],
            coupling: Coupling::new(outputs),
            largest: vec![Largest::default(); outputs],
            least_sigma: vec![f64::INFINITY; outputs],
            again: vec![],
            moving: Extremes::default(),
            waiting: Extremes::default(),
            first: None,
            sigma: objective.whitening.sigma(),
            points: vec![],
            first_errors: FirstErrors::new(experiment, outputs, objective.problem.records[experiment].len()),
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
        if !weighted && window.whole {
            return self.portmanteaus[j].add(errors);
        }
        let weight = |k: usize| self.objective.weight(self.experiment, window.begin[lane] + k);
        let counts = |k: usize| window.is_measured(k, j, lane) && !(weighted && weight(k) == 0.0);
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
    pub fn complete(mut self) -> Self {
        let (moving, waiting) = (std::mem::take(&mut self.moving), std::mem::take(&mut self.waiting));
        self.again.extend(moving.windows().chain(waiting.windows()));
        self.again.sort_by_key(|window| window.begin);
        self.again.dedup_by_key(|window| window.begin);
        self
    }

    /// The windows to be simulated again.
    pub fn compared<'c>(&'c self, coordinates: &'c [f64]) -> Compared<'c> {
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
        self.first_errors.add(window, lane, &self.errors);
        let record = &self.objective.problem.records[self.experiment];
        for j in 0..outputs {
            let errors = &self.errors[j * samples..][..samples];
            self.largest[j].add(errors, self.experiment, begin);
            let values = &record.outputs()[j].values[begin..begin + samples];
            if window.whole && !window.has_variances() {
                self.outputs[j].add(values, errors);
            } else {
                let measured = || (0..samples).filter(|k| window.is_measured(*k, j, lane));
                let unit = |k: usize| window.variance_root(k, j, lane);
                let (values, in_units): (Vec<f64>, Vec<f64>) =
                    measured().map(|k| (values[k], errors[k] * unit(k))).unzip();
                self.outputs[j].add(&values, &in_units);
                if window.has_variances() {
                    self.least_sigma[j] = measured().map(unit).fold(self.least_sigma[j], f64::min);
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
        self.first_errors.append(later.first_errors);
        for (powers, later) in self.powers.iter_mut().flatten().zip(later.powers.iter().flatten()) {
            powers.append(later);
        }
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
