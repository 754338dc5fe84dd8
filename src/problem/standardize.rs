//! [`Standardize`]: from errors and slopes in the units of the outputs to standardized ones.

use super::Whitening;
use super::job::Job;
use crate::prefilter::Butterworth;
use crate::sweep::Window;
use crate::wide::{self, Task, Wide};
use std::f64::consts::FRAC_1_SQRT_2;

/// From errors and slopes in the units of the outputs to standardized ones, with respect to the coordinates.
pub(super) struct Standardize<'s> {
    /// The whitening of each lane.
    whitening: Vec<&'s Whitening>,
    prefilter: Option<(&'s Butterworth, Vec<f64>)>,
    /// Factors of the entries of the rows of a sample, output by output, column by column, lane by lane; empty where
    /// all are one. A factor is the derivative of the quantity with respect to its coordinate, divided by the noise
    /// level.
    factors: Vec<f64>,
}

impl<'s> Standardize<'s> {
    /// For windows of `lanes` lanes.
    pub fn new(jobs: &[&'s Job<'s>], lanes: usize) -> Self {
        let objective = jobs[0].objective;
        let prefilter = objective.problem.settings.prefilter.as_ref().map(|filter| (filter, vec![]));
        let predicted = objective.sweep.predicts_variance();
        let columns = jobs[0].seeds.len() + 1;
        let mut factors = Vec::with_capacity(objective.outputs() * columns * lanes);
        for j in 0..objective.outputs() {
            let unit = |job: &Job<'_>| match &job.objective.whitening {
                Whitening::Diagonal(sigma) if !predicted => 1.0 / sigma[j],
                _ => 1.0,
            };
            for column in 0..columns {
                let scale = |job: &&Job<'_>| unit(job) * job.scales.get(column).unwrap_or(&1.0);
                factors.extend(jobs.iter().map(scale).chain(std::iter::repeat(1.0)).take(lanes));
            }
        }
        if factors.iter().all(|factor| *factor == 1.0) {
            factors.clear();
        }
        let whitening = jobs.iter().map(|job| &job.objective.whitening).collect();
        Standardize { whitening, prefilter, factors }
    }

    /// The lane and the sample whose error is not finite, where there is one.
    pub fn apply(&mut self, window: &mut Window) -> Result<(), (usize, usize)> {
        if !window.whole {
            check(window)?;
        }
        if let Some((filter, states)) = &mut self.prefilter {
            let width = window.outputs() * window.columns() * window.lanes();
            filter.filter_rows(window.rows_mut(), width, states);
            window.clear_unmeasured();
        }
        if window.has_variances() {
            by_variance(window)?;
        } else {
            self.whitening.iter().enumerate().for_each(|(lane, whitening)| whitening.decorrelate(window, lane));
        }
        if !self.factors.is_empty() {
            wide::run(window.width, Multiply { rows: window.rows_mut(), factors: &self.factors });
            if window.has_variances() {
                wide::run(window.width, Multiply { rows: window.variance_rows_mut(), factors: &self.factors });
            }
        }
        if self.factors.contains(&0.0) {
            leave_out(window.rows_mut(), &self.factors);
            if window.has_variances() {
                leave_out(window.variance_rows_mut(), &self.factors);
            }
        }
        Ok(())
    }
}

/// Sets slopes to zero that are left out, infinite or not.
fn leave_out(rows: &mut [f64], factors: &[f64]) {
    for rows in rows.chunks_exact_mut(factors.len()) {
        rows.iter_mut().zip(factors).filter(|(_, factor)| **factor == 0.0).for_each(|(entry, _)| *entry = 0.0);
    }
}

/// The first lane and sample whose error is not finite, if there is one.
fn check(window: &Window) -> Result<(), (usize, usize)> {
    let (lanes, last) = (window.lanes(), window.columns() - 1);
    for k in 0..window.len() {
        for j in 0..window.outputs() {
            let errors = &window.row(k, j)[last * lanes..];
            if let Some(lane) = errors.iter().position(|error| !error.is_finite()) {
                return Err((lane, window.begin[lane] + k));
            }
        }
    }
    Ok(())
}

/// Multiplies the rows of each sample by the same factors.
struct Multiply<'m> {
    rows: &'m mut [f64],
    factors: &'m [f64],
}

impl Task for Multiply<'_> {
    type Output = ();

    #[inline(always)]
    fn run<W: Wide>(self) {
        for rows in self.rows.chunks_exact_mut(self.factors.len()) {
            let (mut rows, mut factors) = (rows.chunks_exact_mut(W::LANES), self.factors.chunks_exact(W::LANES));
            for (row, factor) in (&mut rows).zip(&mut factors) {
                W::load(row).mul(W::load(factor)).store(row);
            }
            for (entry, factor) in rows.into_remainder().iter_mut().zip(factors.remainder()) {
                *entry *= factor;
            }
        }
    }
}

/// Standardizes errors by their predicted variances `v`: rows `dy / sqrt(v), z = e / sqrt(v)`, and the slopes of the variances as
/// `dv / (sqrt(2) v)`, so that with `(z^2 - 1) / sqrt(2)` beside them the least-squares gradient is that of the likelihood.
fn by_variance(window: &mut Window) -> Result<(), (usize, usize)> {
    let (lanes, columns, outputs) = (window.lanes(), window.columns(), window.outputs());
    let width = window.width;
    let positive = window.whole && wide::run(width, Positive { variances: window.variance_rows_mut(), columns, lanes });
    let samples = if positive { 0 } else { window.len() };
    for (k, j) in (0..samples).flat_map(|k| (0..outputs).map(move |j| (k, j))) {
        let measured = window.measured(k, j);
        let variances = window.variance_row(k, j)[(columns - 1) * lanes..].iter().enumerate();
        let wrong = |(lane, v): &(usize, &f64)| !(**v > 0.0 && v.is_finite()) && measured >> lane & 1 == 1;
        if let Some((lane, _)) = variances.clone().find(wrong) {
            return Err((lane, window.begin[lane] + k));
        }
    }
    let (rows, variances) = window.rows_and_variances_mut();
    wide::run(width, ByVariance { rows, variances, columns, lanes });
    Ok(())
}

/// Whether all variances are positive and finite; lanes that fill no register are not looked at, and it is not said of them.
struct Positive<'v> {
    variances: &'v [f64],
    columns: usize,
    lanes: usize,
}

impl Task for Positive<'_> {
    type Output = bool;

    #[inline(always)]
    fn run<W: Wide>(self) -> bool {
        let Positive { variances, columns, lanes } = self;
        let (mut least, mut differences) = (W::splat(1.0), W::splat(0.0));
        for row in variances.chunks_exact(columns * lanes) {
            for v in row[(columns - 1) * lanes..].chunks_exact(W::LANES) {
                let v = W::load(v);
                least = v.select_lt(least, v, least);
                differences = differences.add(v.sub(v));
            }
        }
        // A difference of what is not finite is not a number.
        lanes % W::LANES == 0 && differences.all_below(1.0) && W::splat(0.0).sub(least).all_below(0.0)
    }
}

/// Divides errors and their slopes by `sqrt(v)`, and slopes of variances by `sqrt(2) v`. Where nothing was measured all of them are zero, `v` too, and
/// stay so.
struct ByVariance<'v> {
    rows: &'v mut [f64],
    variances: &'v mut [f64],
    columns: usize,
    lanes: usize,
}

impl Task for ByVariance<'_> {
    type Output = ();

    #[inline(always)]
    fn run<W: Wide>(self) {
        let ByVariance { rows, variances, columns, lanes } = self;
        let (width, last) = (columns * lanes, (columns - 1) * lanes);
        let (zero, one) = (W::splat(0.0), W::splat(1.0));
        // A variance's row is that of an error, or where variances repeat themselves that of an output.
        let apart = variances.len();
        for (number, second) in variances.chunks_exact_mut(width).enumerate() {
            let begins = (number * width..rows.len()).step_by(apart);
            for first in (0..lanes - lanes % W::LANES).step_by(W::LANES) {
                let v = W::load(&second[last + first..]);
                let v = v.select_eq(zero, one, v);
                let (root, half) = (one.div(v.sqrt()), W::splat(FRAC_1_SQRT_2).div(v));
                for row in begins.clone() {
                    for at in (row + first..row + width).step_by(lanes) {
                        W::load(&rows[at..]).mul(root).store(&mut rows[at..]);
                    }
                }
                for at in (first..last).step_by(lanes) {
                    W::load(&second[at..]).mul(half).store(&mut second[at..]);
                }
            }
            for lane in lanes - lanes % W::LANES..lanes {
                let v = if second[last + lane] == 0.0 { 1.0 } else { second[last + lane] };
                let (root, half) = (1.0 / v.sqrt(), FRAC_1_SQRT_2 / v);
                for row in begins.clone() {
                    rows[row + lane..row + width].iter_mut().step_by(lanes).for_each(|entry| *entry *= root);
                }
                second[lane..last].iter_mut().step_by(lanes).for_each(|entry| *entry *= half);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A slope that a factor of zero would make NaN is zero; its error, and all others, stay.
    #[test]
    fn infinite_slopes_are_left_out() {
        let mut rows = [f64::INFINITY, 2.0, 3.0, f64::NAN, 5.0, f64::INFINITY];
        leave_out(&mut rows, &[0.0, 1.0, 2.0]);
        assert_eq!(rows, [0.0, 2.0, 3.0, 0.0, 5.0, f64::INFINITY]);
    }

    /// Errors of 3 with a variance of 4 and slopes of 6 and 5: `z = 3 / 2`, `dy = 6 / 2`, `dv = 5 / (4 sqrt(2))`. A variance that is none is
    /// named by its sample, counted from the begin of the record.
    #[test]
    fn errors_are_divided_by_their_deviation() {
        for (variance, failed) in [(4.0, None), (0.0, Some((0, 102))), (f64::INFINITY, Some((0, 102)))] {
            let mut window = Window::new(1, 1, 1, 4, true);
            (window.begin[0], window.samples[0]) = (100, 3);
            for k in 0..3 {
                window.set_measured(k, 0, 1);
                window.row_mut(k, 0).copy_from_slice(&[6.0, 3.0]);
                window.variance_row_mut(k, 0).copy_from_slice(&[5.0, if k == 2 { variance } else { 4.0 }]);
            }
            assert_eq!(by_variance(&mut window).err(), failed);
            if failed.is_none() {
                assert_eq!(window.row(1, 0), [3.0, 1.5]);
                assert!((window.variance_row(1, 0)[0] - 5.0 / 32f64.sqrt()).abs() < 1e-15);
                assert_eq!(window.log_variance(1, 0, 0), 4f64.ln());
            }
        }
    }
}
