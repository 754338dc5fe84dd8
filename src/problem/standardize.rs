//! [`Standardize`]: from errors and slopes in the units of the outputs to standardized ones.

use super::Objective;
use super::pass::Job;
use crate::prefilter::Butterworth;
use crate::sweep::Window;

/// From errors and slopes in the units of the outputs to standardized ones, with respect to the coordinates.
pub(super) struct Standardize<'s> {
    objective: &'s Objective<'s>,
    prefilter: Option<(&'s Butterworth, Vec<f64>)>,
    /// By lane, then by column; empty where all are one.
    scales: Vec<Vec<f64>>,
}

impl<'s> Standardize<'s> {
    pub fn new(objective: &'s Objective<'s>, jobs: &[&Job<'_>]) -> Self {
        let prefilter = objective.problem.settings.prefilter.as_ref().map(|filter| (filter, vec![]));
        let plain = jobs.iter().all(|job| job.scales.iter().all(|scale| *scale == 1.0));
        let scales = if plain { vec![] } else { jobs.iter().map(|job| job.scales.clone()).collect() };
        Standardize { objective, prefilter, scales }
    }

    /// The lane and the sample whose error is not finite, where there is one.
    pub fn apply(&mut self, window: &mut Window) -> Result<(), (usize, usize)> {
        let (len, outputs, lanes) = (window.len(), window.outputs(), window.lanes());
        let last = window.columns() - 1;
        for k in 0..len {
            for j in 0..outputs {
                let errors = &window.row(k, j)[last * lanes..];
                if let Some(lane) = errors.iter().position(|error| !error.is_finite()) {
                    return Err((lane, window.begin[lane] + k));
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
        for (lane, scales) in self.scales.iter().enumerate() {
            for (k, j) in (0..len).flat_map(|k| (0..outputs).map(move |j| (k, j))) {
                scale(window.row_mut(k, j), scales, lane, lanes);
                if window.has_variances() {
                    scale(window.variance_row_mut(k, j), scales, lane, lanes);
                }
            }
        }
        Ok(())
    }
}

fn scale(row: &mut [f64], scales: &[f64], lane: usize, lanes: usize) {
    row.iter_mut().skip(lane).step_by(lanes).zip(scales).for_each(|(value, scale)| *value *= scale);
}

/// Standardizes errors by their predicted variances `v`: rows `dy / sqrt(v), z = e / sqrt(v)`, and in the place of the
/// variances the rows `dv / (sqrt(2) v), (z^2 - 1) / sqrt(2)`, whose least-squares gradient is that of the likelihood.
fn by_variance(window: &mut Window) -> Result<(), (usize, usize)> {
    let (lanes, last) = (window.lanes(), window.columns() - 1);
    for k in 0..window.len() {
        for j in 0..window.outputs() {
            for lane in 0..lanes {
                if !window.is_measured(k, j, lane) {
                    continue;
                }
                let v = window.variance(k, j, lane);
                if !(v > 0.0 && v.is_finite()) {
                    return Err((lane, window.begin[lane] + k));
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

