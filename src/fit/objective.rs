//! [`Objective`]: the fit as a function of its unknowns.
//!
//! The way of a sample: the predictor lays down errors and slopes window by window; each window is filtered, standardized
//! and weighted in place; the triangle absorbs it. Nothing is kept of the samples.

use super::noise::Whitening;
use super::unknowns::Unknowns;
use crate::dispatch::{PORTABLE, Unit, WIDE, has_wide};
use crate::error::Failure;
use crate::experiment::{ExperimentOf, Sample};
use crate::information::{Block, Information};
use crate::integrate::Integrator;
use crate::interval::Hold;
use crate::loss::Loss;
use crate::model::Model;
use crate::optimize::{Infeasible, LeastSquares, Linearization};
use crate::predict::{Predictor, Seed, Trajectory, WINDOW, Walk, Window};
use crate::prefilter::{Butterworth, FilterState};
use crate::signals::{Of, Signals};
use crate::weighting::Weighting;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// What a fit minimizes, as a problem for its own and for argmin's solvers.
///
/// The unknowns are coordinates in a row: shared parameters, then each experiment's free initial states and own
/// parameters; parameters declared with `.log()` by their logarithm. [`names`](Self::names) tells the order. The cost is
/// the sum over samples and outputs of `weight * rho(error / sigma)`, plus half the squares of the priors.
pub struct Objective<'a, M: Model, I: Integrator<M>, P: Predictor<M>> {
    pub(crate) model: &'a M,
    pub(crate) experiments: &'a [ExperimentOf<M>],
    pub(crate) unknowns: &'a Unknowns<M>,
    pub(crate) integrator: &'a I,
    pub(crate) predictor: &'a P,
    pub(crate) prepared: &'a [P::Prepared],
    pub(crate) weighting: Option<&'a dyn Weighting<M>>,
    pub(crate) loss: Option<&'a dyn Loss>,
    pub(crate) prefilter: Option<&'a Butterworth>,
    pub(crate) whitening: Whitening,
    pub(crate) control: &'a Control,
}

/// Who may stop an evaluation.
#[derive(Debug, Default)]
pub(crate) struct Control {
    pub cancel: Option<Arc<AtomicBool>>,
    pub deadline: Option<Instant>,
}

impl Control {
    fn stops(&self) -> bool {
        self.cancel.as_ref().is_some_and(|cancel| cancel.load(Ordering::Relaxed)) || self.expired()
    }

    pub fn expired(&self) -> bool {
        self.deadline.is_some_and(|deadline| Instant::now() >= deadline)
    }
}

/// A window of standardized errors and slopes.
pub(crate) struct Rows<'w> {
    pub begin: usize,
    pub samples: usize,
    /// Column by column: slopes of the prediction, then the errors; row `j * WINDOW + k` is output `j`, sample `k`.
    pub window: &'w mut Window,
}

/// Why an experiment could not be walked.
pub(crate) enum Halt {
    Failed { sample: usize },
    Cancelled,
}

impl<M: Model, I: Integrator<M>, P: Predictor<M>> Objective<'_, M, I, P> {
    /// The names of the unknowns, in order.
    pub fn names(&self) -> Vec<String> {
        self.unknowns.row.iter().map(|unknown| unknown.name.clone()).collect()
    }

    /// The coordinates at which the fit starts.
    pub fn start(&self) -> Vec<f64> {
        self.unknowns.start()
    }

    /// Leaves errors and slopes in the units of the outputs from here on.
    pub(crate) fn leave_units(&mut self) {
        self.whitening = Whitening::Diagonal(vec![1.0; M::Output::LEN]);
    }

    pub(crate) fn step<'s>(&'s self, experiment: usize) -> Walk<'s, M, I> {
        Walk::new(self.model, self.integrator, &self.experiments[experiment])
    }

    /// Walks one experiment, with slopes or without, and shows each window of standardized errors.
    pub(crate) fn walk(
        &self,
        experiment: usize,
        coordinates: &[f64],
        slopes: bool,
        visit: &mut dyn FnMut(Rows<'_>),
    ) -> Result<(), Halt> {
        let seeds = if slopes { self.unknowns.seeds(experiment, coordinates) } else { vec![] };
        if cfg!(debug_assertions) {
            // A build that is not made for speed is soon compiled: same numbers, more passes.
            return if slopes {
                self.walk_in::<4, PORTABLE>(experiment, coordinates, &seeds, visit)
            } else {
                self.walk_in::<0, PORTABLE>(experiment, coordinates, &seeds, visit)
            };
        }
        // The wide loop is made for the hold that nearly all records have.
        let wide = has_wide() && self.experiments[experiment].input_hold() == Hold::Zero;
        match (seeds.len(), wide) {
            (0, _) => self.walk_in::<0, PORTABLE>(experiment, coordinates, &seeds, visit),
            (1..=4, false) => self.walk_in::<4, PORTABLE>(experiment, coordinates, &seeds, visit),
            (5 | 6, false) => self.walk_in::<6, PORTABLE>(experiment, coordinates, &seeds, visit),
            (_, false) => self.walk_in::<8, PORTABLE>(experiment, coordinates, &seeds, visit),
            (1..=4, true) => self.walk_in::<4, WIDE>(experiment, coordinates, &seeds, visit),
            (5 | 6, true) => self.walk_in::<6, WIDE>(experiment, coordinates, &seeds, visit),
            (_, true) => self.walk_in::<8, WIDE>(experiment, coordinates, &seeds, visit),
        }
    }

    fn walk_in<const N: usize, const UNIT: Unit>(
        &self,
        experiment: usize,
        coordinates: &[f64],
        seeds: &[Seed],
        visit: &mut dyn FnMut(Rows<'_>),
    ) -> Result<(), Halt> {
        let (x, p) = self.unknowns.place(experiment, coordinates);
        let prepared = &self.prepared[experiment];
        let mut trajectory =
            Trajectory::<M, I, P, N, UNIT>::new(self.step(experiment), self.predictor, prepared, x, p, seeds);
        let mut window = Window::new(seeds.len(), M::Output::LEN);
        let filtered = if self.prefilter.is_some() { (seeds.len() + 1) * M::Output::LEN } else { 0 };
        let mut states = vec![FilterState::default(); filtered];
        loop {
            if self.control.stops() {
                return Err(Halt::Cancelled);
            }
            match trajectory.fill(&mut window) {
                Err(sample) => return Err(Halt::Failed { sample }),
                Ok(false) => return Ok(()),
                Ok(true) => {}
            }
            if let Some(row) = window.errors().iter().position(|error| !error.is_finite()) {
                return Err(Halt::Failed { sample: window.begin + row % WINDOW });
            }
            if let Some(filter) = self.prefilter {
                let samples = window.samples;
                filter.filter(window.data_mut(), WINDOW, samples, &mut states);
                window.clear_unmeasured();
            }
            self.whitening.apply(&mut window);
            visit(Rows { begin: window.begin, samples: window.samples, window: &mut window });
        }
    }

    /// The weight of one sample of an experiment.
    pub(crate) fn sample_weight(&self, experiment: usize, k: usize) -> f64 {
        self.weighting.map_or(1.0, |weighting| {
            let record = &self.experiments[experiment];
            let sample = Sample { t: record.time(k), u: record.inputs()[k], y: record.outputs()[k] };
            weighting.weight(&sample)
        })
    }

    /// Cost and triangle of one experiment, priors left out.
    pub(crate) fn experiment(&self, experiment: usize, coordinates: &[f64]) -> Result<(f64, Information), Halt> {
        let columns = self.unknowns.columns(experiment).count();
        let rows = M::Output::LEN * WINDOW;
        let mut information = Information::new(columns);
        let mut block = Block::new(columns, rows);
        let mut roots = vec![0.0; if self.weighting.is_some() || self.loss.is_some() { rows } else { 0 }];
        let (mut cost, mut measured) = (0.0, 0u64);
        self.walk(experiment, coordinates, true, &mut |Rows { begin, samples, window }| {
            measured += window.measured.iter().filter(|&&here| here).count() as u64;
            if roots.is_empty() {
                cost += 0.5 * sum_of_squares(window.errors());
                for (c, column) in window.columns_mut().enumerate() {
                    block.column_mut(c).copy_from_slice(column);
                }
            } else {
                roots.fill(1.0);
                if self.weighting.is_some() {
                    for k in 0..samples {
                        let root = self.sample_weight(experiment, begin + k);
                        (0..M::Output::LEN).for_each(|j| roots[j * WINDOW + k] = root);
                    }
                }
                for (root, &z) in roots.iter_mut().zip(window.errors()) {
                    let weight = *root;
                    cost += weight * self.loss.map_or(0.5 * z * z, |loss| loss.rho(z));
                    *root = (weight * self.loss.map_or(1.0, |loss| loss.weight(z))).sqrt();
                }
                for (c, column) in window.columns_mut().enumerate() {
                    for ((to, from), root) in block.column_mut(c).iter_mut().zip(column).zip(&roots) {
                        *to = *from * root;
                    }
                }
            }
            block.set_len(rows);
            information.absorb(&mut block);
        })?;
        if !cost.is_finite() || information.column_norms().iter().any(|norm| !norm.is_finite()) {
            return Err(Halt::Failed { sample: 0 });
        }
        Ok((cost, information))
    }

    /// Cost and triangles of all experiments and the priors.
    pub(crate) fn evaluate(&self, coordinates: &[f64]) -> Result<Linearization, Infeasible> {
        let one = |e: usize| self.experiment(e, coordinates).map_err(|halt| self.infeasible(e, coordinates, halt));
        let results = each(self.experiments.len(), one);
        let (mut cost, mut blocks) = (0.0, Vec::with_capacity(results.len()));
        for result in results {
            let (share, information) = result?;
            cost += share;
            blocks.push(information);
        }
        for (i, slope, error) in self.unknowns.priors(coordinates) {
            let e = self.unknowns.row[i].experiment.unwrap_or(0);
            let row: Vec<f64> = self.unknowns.columns(e).map(|c| if c == i { slope } else { 0.0 }).collect();
            blocks[e].absorb_row(&row, error);
            cost += 0.5 * error * error;
        }
        Ok(Linearization::new(cost, self.unknowns.shared(), blocks))
    }

    /// The cost alone.
    pub(crate) fn cost_at(&self, coordinates: &[f64]) -> Result<f64, Infeasible> {
        let mut total = 0.0;
        for e in 0..self.experiments.len() {
            let visit = &mut |Rows { begin, samples, window }: Rows<'_>| {
                for (row, &z) in window.errors().iter().enumerate() {
                    let k = row % WINDOW;
                    if k < samples {
                        let rho = self.loss.map_or(0.5 * z * z, |loss| loss.rho(z));
                        total += self.sample_weight(e, begin + k) * rho;
                    }
                }
            };
            self.walk(e, coordinates, false, visit).map_err(|halt| self.infeasible(e, coordinates, halt))?;
        }
        Ok(total + self.unknowns.priors(coordinates).map(|(_, _, error)| 0.5 * error * error).sum::<f64>())
    }

    fn infeasible(&self, experiment: usize, coordinates: &[f64], halt: Halt) -> Infeasible {
        match halt {
            Halt::Cancelled => Infeasible::Cancelled,
            Halt::Failed { sample } => Infeasible::Failed(self.locate(experiment, coordinates, sample).to_string()),
        }
    }

    /// What exactly fails in an experiment that cannot be evaluated; `sample` is where it was noticed.
    pub(crate) fn locate(&self, experiment: usize, coordinates: &[f64], sample: usize) -> Failure {
        let walk = self.step(experiment);
        let record = walk.experiment;
        let (start, p) = self.unknowns.place(experiment, coordinates);
        let failure = |k: usize, signal: String, value: f64, hint: &'static str| Failure {
            experiment: self.unknowns.labels[experiment].clone(),
            sample: k,
            time: record.time(k),
            signal,
            value,
            hint,
        };
        let unsound = |values: &[f64]| {
            let i = values.iter().position(|v| !v.is_finite())?;
            Some((i, values[i], if values[i].is_nan() { UNDEFINED } else { OVERFLOW }))
        };
        let runaway = |x: Of<M::State, f64>| {
            let x = M::State::into_array(x);
            x.as_ref().iter().copied().enumerate().find(|(_, x)| x.abs() >= RUNAWAY)
        };
        let (mut x, mut memory) = (start, I::Memory::default());
        // The error that costs most, in standard deviations.
        let (sigma, mut largest) = (self.whitening.sigma(), (sample, 0, 0.0f64));
        for k in 0..record.len() {
            let state = match self.predictor.state(&walk, &self.prepared[experiment], k, x, &p, &mut memory) {
                Ok(Some(state)) => state,
                Ok(None) => continue,
                Err(_) => {
                    let before = k.saturating_sub(1);
                    if let Some((i, value)) = runaway(x) {
                        return failure(before, format!("state `{}`", M::State::NAMES[i]), value, OVERFLOW);
                    }
                    let slope = self.model.derivative(record.time(before), &x, &record.inputs()[before], &p);
                    return match unsound(M::State::into_array(slope).as_ref()) {
                        Some((i, value, hint)) => {
                            failure(before, format!("the derivative of state `{}`", M::State::NAMES[i]), value, hint)
                        }
                        None => failure(before, "the progress of the integrator".to_owned(), 0.0, STUCK),
                    };
                }
            };
            if let Some((i, value, hint)) = unsound(M::State::into_array(state).as_ref()) {
                let hint = if runaway(x).is_some() { OVERFLOW } else { hint };
                return failure(k, format!("state `{}`", M::State::NAMES[i]), value, hint);
            }
            if P::CARRIES {
                x = state;
            }
            let y = M::Output::into_array(self.model.output(record.time(k), &state, &record.inputs()[k], &p));
            let found = M::Output::into_array(record.outputs()[k]);
            for (j, (&y, &found)) in y.as_ref().iter().zip(found.as_ref()).enumerate() {
                // What was not measured need not be predicted in a fit; where a prediction was asked for, it stopped here.
                if !y.is_finite() && (!found.is_nan() || k == sample) {
                    let hint = if y.is_nan() { UNDEFINED } else { OVERFLOW };
                    return failure(k, format!("output `{}`", M::Output::NAMES[j]), y, hint);
                }
                if ((found - y) / sigma[j]).abs() > (largest.2 / sigma[largest.1]).abs() {
                    largest = (k, j, found - y);
                }
            }
        }
        if let Some((k, output, unknown, value)) = self.unsound_slope(experiment, coordinates) {
            let signal = format!("the slope of output `{}` with respect to `{unknown}`", M::Output::NAMES[output]);
            return failure(k, signal, value, if value.is_nan() { STEEP } else { OVERFLOW });
        }
        let (k, j, error) = largest;
        failure(k, format!("the error of output `{}`", M::Output::NAMES[j]), error, HUGE)
    }

    /// The first slope that is not finite: sample, output, name of the unknown, value.
    fn unsound_slope(&self, e: usize, coordinates: &[f64]) -> Option<(usize, usize, &str, f64)> {
        let mut first: Option<(usize, usize, usize, f64)> = None;
        let unknowns: Vec<usize> = self.unknowns.columns(e).collect();
        let plain = Objective { whitening: Whitening::Diagonal(vec![1.0; M::Output::LEN]), prefilter: None, ..*self };
        let visit = &mut |Rows { begin, window, .. }: Rows<'_>| {
            for (column, &unknown) in window.columns_mut().zip(&unknowns) {
                if let Some(row) = column.iter().position(|slope| !slope.is_finite()) {
                    let found = (begin + row % WINDOW, row / WINDOW, unknown, column[row]);
                    first = first.filter(|&(k, ..)| k <= found.0).or(Some(found));
                }
            }
        };
        // It fails, where it fails, after what is looked for.
        let _ = plain.walk(e, coordinates, true, visit);
        first.map(|(k, output, unknown, value)| (k, output, self.unknowns.row[unknown].name.as_str(), value))
    }
}

/// A state as large as this is about to overflow; a method then gets stuck, or computes infinity less infinity.
const RUNAWAY: f64 = 1e100;

const STUCK: &str = "; no step is short enough, or 100,000 of them do not reach the next sample: the model is too stiff for \
                     the method, jumps, or leaves its domain (take Esdirk, or smooth the model)";
const UNDEFINED: &str = "; the equations are undefined there (a division by zero, a root or logarithm out of its domain, \
                         or the `derivative` or `next` that Model::KIND asks for was not written): bound the parameters \
                         or start elsewhere";
const STEEP: &str = "; the value is finite but has no slope there (a root or a power at zero): start elsewhere, or write \
                     the model so that it is smooth there";
const OVERFLOW: &str = "; the simulation overflows (an unstable model, or a step too long for its dynamics): bound the \
                        parameters, take a shorter step or a stiff method, or predict over a shorter horizon";
const HUGE: &str = ", whose square overflows: check the units of the record, the noise levels and the start";

impl<M: Model, I: Integrator<M>, P: Predictor<M>> LeastSquares for Objective<'_, M, I, P> {
    fn linearize(&self, x: &[f64]) -> Result<Linearization, Infeasible> {
        self.evaluate(x)
    }

    fn bounds(&self) -> Vec<(f64, f64)> {
        self.unknowns.bounds()
    }
}

/// `f(0), f(1), ...`, side by side where the feature `parallel` is on; in order.
pub(crate) fn each<T: Send>(n: usize, f: impl Fn(usize) -> T + Send + Sync) -> Vec<T> {
    #[cfg(feature = "parallel")]
    if n > 1 {
        use rayon::prelude::*;
        return (0..n).into_par_iter().map(f).collect();
    }
    (0..n).map(f).collect()
}

/// With several accumulators, which the compiler may keep in vector lanes.
fn sum_of_squares(values: &[f64]) -> f64 {
    let mut sums = [0.0; 8];
    for chunk in values.chunks_exact(8) {
        for (sum, value) in sums.iter_mut().zip(chunk) {
            *sum += value * value;
        }
    }
    let rest = values.chunks_exact(8).remainder().iter().map(|v| v * v).sum::<f64>();
    sums.iter().sum::<f64>() + rest
}
