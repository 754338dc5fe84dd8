//! [`Objective`]: the fit as a function of its unknowns.
//!
//! The way of a sample: the predictor lays down errors and slopes window by window; each window is filtered, standardized
//! and weighted in place; the triangle absorbs it. Nothing is kept of the samples.

use super::noise::Whitening;
use super::source::{Halt, Located, OVERFLOW, Source};
use super::unknowns::Unknowns;
use crate::error::Failure;
use crate::information::{Block, Information};
use crate::loss::Loss;
use crate::optimize::{Infeasible, LeastSquares, Linearization};
use crate::parameter::Transform;
use crate::predict::{Seed, WINDOW, Window};
use crate::prefilter::{Butterworth, FilterState};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// What a fit minimizes, as a problem for its own and for argmin's solvers.
///
/// The unknowns are coordinates in a row: shared parameters, then each experiment's free initial states and own
/// parameters; parameters declared with `.log()` by their logarithm. [`names`](Self::names) tells the order. The cost is
/// the sum over samples and outputs of `weight * rho(error / sigma)`, plus half the squares of the priors.
#[derive(Clone)]
pub struct Objective<'a> {
    pub(crate) source: Arc<dyn Source + 'a>,
    pub(crate) unknowns: &'a Unknowns,
    pub(crate) loss: Option<&'a dyn Loss>,
    pub(crate) prefilter: Option<&'a Butterworth>,
    pub(crate) whitening: Whitening,
    pub(crate) control: &'a Control,
    /// Norm of the measurements, standardized and weighted as the errors.
    pub(crate) data_norm: f64,
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

impl Objective<'_> {
    /// The names of the unknowns, in order.
    pub fn names(&self) -> Vec<String> {
        self.unknowns.row.iter().map(|unknown| unknown.name.clone()).collect()
    }

    /// The coordinates at which the fit starts.
    pub fn start(&self) -> Vec<f64> {
        self.unknowns.start()
    }

    /// The same with errors and slopes in the units of the outputs.
    pub(crate) fn in_units(&self) -> Self {
        self.with(Whitening::Diagonal(vec![1.0; self.outputs()]))
    }

    /// The same with errors standardized otherwise.
    pub(crate) fn with(&self, whitening: Whitening) -> Self {
        let mut objective = Objective { whitening, ..self.clone() };
        objective.data_norm = objective.norm_of_data();
        objective
    }

    fn norm_of_data(&self) -> f64 {
        let mut squares = 0.0;
        for (output, sigma) in self.whitening.sigma().into_iter().enumerate() {
            for e in 0..self.experiments() {
                let mut values = vec![0.0; self.source.samples(e)];
                self.source.measured(e, output, 0..values.len(), &mut values);
                for (k, y) in values.into_iter().enumerate().filter(|(_, y)| !y.is_nan()) {
                    squares += self.source.weight(e, k) * (y / sigma).powi(2);
                }
            }
        }
        squares.sqrt()
    }

    /// Number of experiments.
    pub(crate) fn experiments(&self) -> usize {
        self.source.experiments()
    }

    /// Number of outputs.
    pub(crate) fn outputs(&self) -> usize {
        self.source.outputs().len()
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
        self.walk_along(experiment, coordinates, &seeds, visit)
    }

    fn walk_along(
        &self,
        experiment: usize,
        coordinates: &[f64],
        seeds: &[Seed],
        visit: &mut dyn FnMut(Rows<'_>),
    ) -> Result<(), Halt> {
        let filtered = if self.prefilter.is_some() { (seeds.len() + 1) * self.outputs() } else { 0 };
        let mut states = vec![FilterState::default(); filtered];
        let place = self.unknowns.place(experiment, coordinates);
        self.source.walk(experiment, &place, seeds, &mut |window| {
            if self.control.stops() {
                return Err(Halt::Cancelled);
            }
            if let Some(row) = window.errors().iter().position(|error| !error.is_finite()) {
                return Err(Halt::Failed { sample: window.begin + row % WINDOW });
            }
            if let Some(filter) = self.prefilter {
                let samples = window.samples;
                filter.filter(window.data_mut(), WINDOW, samples, &mut states);
                window.clear_unmeasured();
            }
            self.whitening.apply(window);
            visit(Rows { begin: window.begin, samples: window.samples, window });
            Ok(())
        })
    }

    /// Cost and triangle of one experiment, priors left out. Where slopes are infinite, those of the unknowns on their bounds
    /// (the root of an initial level of zero) are left out.
    pub(crate) fn experiment(&self, experiment: usize, coordinates: &[f64]) -> Result<(f64, Information), Halt> {
        let mut seeds = self.unknowns.seeds(experiment, coordinates);
        let result = self.experiment_along(experiment, coordinates, &seeds);
        let bounds = self.unknowns.bounds();
        let on_bound = |i: usize| coordinates[i] <= bounds[i].0 || coordinates[i] >= bounds[i].1;
        let columns: Vec<usize> = self.unknowns.columns(experiment).collect();
        if !matches!(result, Err(Halt::Failed { .. })) || !columns.iter().any(|&i| on_bound(i)) {
            return result;
        }
        for (seed, _) in seeds.iter_mut().zip(&columns).filter(|(_, i)| on_bound(**i)) {
            seed.slope = 0.0;
        }
        self.experiment_along(experiment, coordinates, &seeds)
    }

    fn experiment_along(
        &self,
        experiment: usize,
        coordinates: &[f64],
        seeds: &[Seed],
    ) -> Result<(f64, Information), Halt> {
        let columns = self.unknowns.columns(experiment).count();
        let rows = self.outputs() * WINDOW;
        let mut information = Information::new(columns);
        let mut block = Block::new(columns, rows);
        let mut roots = vec![0.0; if self.source.is_weighted() || self.loss.is_some() { rows } else { 0 }];
        let (mut cost, mut measured) = (0.0, 0u64);
        self.walk_along(experiment, coordinates, seeds, &mut |Rows { begin, samples, window }| {
            measured += window.measured.iter().filter(|&&here| here).count() as u64;
            if roots.is_empty() {
                cost += 0.5 * sum_of_squares(window.errors());
                for (c, column) in window.columns_mut().enumerate() {
                    block.column_mut(c).copy_from_slice(column);
                }
            } else {
                roots.fill(1.0);
                if self.source.is_weighted() {
                    for k in 0..samples {
                        let root = self.source.weight(experiment, begin + k);
                        (0..self.outputs()).for_each(|j| roots[j * WINDOW + k] = root);
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
        let results = each(self.experiments(), one);
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
        Ok(Linearization::new(cost, self.unknowns.shared(), blocks).with_data_norm(self.data_norm))
    }

    /// The cost alone.
    pub(crate) fn cost_at(&self, coordinates: &[f64]) -> Result<f64, Infeasible> {
        let mut total = 0.0;
        for e in 0..self.experiments() {
            let visit = &mut |Rows { begin, samples, window }: Rows<'_>| {
                for (row, &z) in window.errors().iter().enumerate() {
                    let k = row % WINDOW;
                    if k < samples {
                        let rho = self.loss.map_or(0.5 * z * z, |loss| loss.rho(z));
                        total += self.source.weight(e, begin + k) * rho;
                    }
                }
            };
            self.walk(e, coordinates, false, visit).map_err(|halt| self.infeasible(e, coordinates, halt))?;
        }
        Ok(total + self.unknowns.priors(coordinates).map(|(_, _, error)| 0.5 * error * error).sum::<f64>())
    }

    pub(super) fn infeasible(&self, experiment: usize, coordinates: &[f64], halt: Halt) -> Infeasible {
        match halt {
            Halt::Cancelled => Infeasible::Cancelled,
            Halt::Failed { sample } => Infeasible::Failed(self.locate(experiment, coordinates, sample).to_string()),
        }
    }

    /// What exactly fails in an experiment that cannot be evaluated; `sample` is where it was noticed.
    pub(crate) fn locate(&self, e: usize, coordinates: &[f64], sample: usize) -> Failure {
        let (label, place) = (&self.unknowns.labels[e], self.unknowns.place(e, coordinates));
        match self.source.locate(e, label, &place, sample, &self.whitening.sigma()) {
            Located::Broken(failure) => failure,
            Located::Largest(largest) => self.unsound_slope(e, coordinates).unwrap_or(largest),
        }
    }

    /// The first slope that is not finite.
    fn unsound_slope(&self, e: usize, coordinates: &[f64]) -> Option<Failure> {
        let mut first: Option<(usize, usize, usize, f64)> = None;
        let unknowns: Vec<usize> = self.unknowns.columns(e).collect();
        let plain = Objective { prefilter: None, ..self.in_units() };
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
        let (sample, output, unknown, value) = first?;
        let (output, unknown) = (self.source.outputs()[output], &self.unknowns.row[unknown].name);
        Some(Failure {
            experiment: self.unknowns.labels[e].clone(),
            sample,
            time: self.source.time(e, sample),
            signal: format!("the slope of output `{output}` with respect to `{unknown}`"),
            value,
            hint: if value.is_nan() { STEEP } else { OVERFLOW },
        })
    }
}

const STEEP: &str = "; the value is finite but has no slope there (a root or a power at zero): start elsewhere, or write \
                     the model so that it is smooth there";
impl LeastSquares for Objective<'_> {
    fn linearize(&self, x: &[f64]) -> Result<Linearization, Infeasible> {
        self.evaluate(x)
    }

    fn bounds(&self) -> Vec<(f64, f64)> {
        self.unknowns.bounds()
    }

    fn sizes(&self) -> Vec<Option<f64>> {
        let size = |transform| (transform == Transform::Log).then_some(1.0);
        self.unknowns.row.iter().map(|unknown| size(unknown.parameter.transform)).collect()
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
