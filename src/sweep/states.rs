//! [`States`]: the states of a record by a filter, and smoothed by all measurements.

use super::Prepared;
use super::filtered::{Filter, SLOPES};
use crate::dual::Dual;
use crate::functions::delays;
use crate::integrate::{Duals, Stuck};
use crate::layout::Layout;
use crate::moments::entry;
use crate::predict::{Intervals, Plant, SecondOrder, transition};
use crate::record::Record;

/// The states of a record with their covariance, by the parameters and the initial state of an estimate, whose own uncertainty is not in it.
#[derive(Clone, Debug, PartialEq)]
pub struct States {
    /// Name of each state.
    pub names: Vec<String>,
    /// The mean of each state, a column each.
    pub means: Vec<Vec<f64>>,
    /// The standard deviation of each state, a column each. One that measurements after the sample lower to less than `sqrt(n 2e-16)` of that by the
    /// measurements before it, `n` states, is shown as that much: a difference of variances has no more digits.
    pub deviations: Vec<Vec<f64>>,
    /// The covariance at each sample, row by row, in products of the units of the states.
    pub covariances: Vec<Vec<f64>>,
}

/// What a filter did at a sample.
struct Visited {
    updates: Vec<Update>,
    /// State and covariance after them.
    carry: Vec<f64>,
    /// The slopes of the state at the next sample with respect to this one, row by row; empty where they are not asked for.
    slopes: Vec<f64>,
}

/// A measurement that was taken in.
struct Update {
    /// The output's row of slopes.
    row: Vec<f64>,
    /// What one unit of its error moves each state.
    gain: Vec<f64>,
    error: f64,
    variance: f64,
}

impl Filter<'_> {
    /// The states after each sample's measurements, or `smoothed`.
    ///
    /// # Errors
    /// The sample that could not be reached or predicted.
    pub fn states(&self, record: &Record, carry: &[f64], p: &[f64], smoothed: bool) -> Result<States, usize> {
        let visited = self.visited(record, carry, p, smoothed)?;
        let filtered = |one: &Visited| split(self.layout.states.len(), &one.carry);
        Ok(match smoothed {
            true => smooth(self.layout, &visited),
            false => States::new(self.layout, visited.iter().map(filtered)),
        })
    }

    fn visited(&self, record: &Record, carry: &[f64], p: &[f64], smoothed: bool) -> Result<Vec<Visited>, usize> {
        let (n, outputs) = (self.layout.states.len(), self.layout.outputs.len());
        let (steps, late, intervals) =
            (self.predictor.values(), delays(self.values, &self.late, p), Intervals::default());
        let constant: Vec<Duals> = p.iter().map(|p| Dual::constant(*p)).collect();
        let of_slopes: Vec<Intervals<Duals>> = (0..n.div_ceil(SLOPES)).map(|_| Intervals::default()).collect();
        let (prepared, mut carry) = (Prepared::default(), carry.to_vec());
        let from = (record, &prepared);
        let mut visited = Vec::with_capacity(record.len());
        for k in 0..record.len() {
            let plant = self.plant(self.values, self.between(from, k, &late), p, &intervals);
            let mut updates = vec![];
            for (j, channel) in record.outputs().iter().enumerate().filter(|(_, channel)| !channel.values[k].is_nan()) {
                let (mean, variance) = steps.predict(&plant, &carry, j);
                let error = channel.values[k] - mean;
                if !(error.is_finite() && variance > 0.0 && variance.is_finite()) {
                    return Err(k);
                }
                let rows = match self.predictor.is_second_order() {
                    true => plant.output_moments(&carry).slopes,
                    false => {
                        let mut rows = vec![0.0; outputs * n];
                        plant.output_slopes(&carry[..n], &mut rows);
                        rows
                    }
                };
                let row = rows[j * n..][..n].to_vec();
                let moved = |i: usize| (0..n).map(|l| carry[n + entry(n, i, l)] * row[l]).sum::<f64>() / variance;
                let gain = (0..n).map(moved).collect();
                updates.push(Update { row, gain, error, variance });
                steps.correct(&plant, &mut carry, j, error);
            }
            let (after, last) = (carry.clone(), k + 1 == record.len());
            // To the second order the next mean depends on the covariance, too, so that its derivative is not the product of the mean slopes. Equations
            // that are crossed exactly are affine, where the two are the same.
            let of_means = self.predictor.is_second_order() && !self.method.is_exact();
            let slopes = match smoothed && !last {
                true if of_means => transition::<SecondOrder>(&plant, &carry),
                true => self.slopes(from, k, &carry, &constant, &of_slopes),
                false => Ok(vec![]),
            };
            let slopes = slopes.map_err(|Stuck| k + 1)?;
            visited.push(Visited { updates, carry: after, slopes });
            if !last {
                steps.advance(&plant, &mut carry).map_err(|Stuck| k + 1)?;
            }
        }
        Ok(visited)
    }

    /// The slopes of the state at the next sample with respect to the state at this one.
    fn slopes(
        &self,
        from: (&Record, &Prepared),
        k: usize,
        carry: &[f64],
        p: &[Duals],
        all_intervals: &[Intervals<Duals>],
    ) -> Result<Vec<f64>, Stuck> {
        let n = self.layout.states.len();
        let late = delays(self.duals, &self.late, p);
        let mut slopes = vec![0.0; n * n];
        for (intervals, first) in all_intervals.iter().zip((0..n).step_by(SLOPES)) {
            let seeded = |(i, x): (usize, &f64)| match i < n {
                true => Dual::variable(*x, i.wrapping_sub(first)),
                false => Dual::constant(*x),
            };
            let mut next: Vec<Duals> = carry.iter().enumerate().map(seeded).collect();
            let plant = self.plant(self.duals, self.between(from, k, &late), p, intervals);
            self.predictor.duals().advance(&plant, &mut next)?;
            for (i, x) in next[..n].iter().enumerate() {
                slopes[i * n..][..n].iter_mut().skip(first).zip(x.slopes).for_each(|(to, slope)| *to = slope);
            }
        }
        Ok(slopes)
    }
}

/// The fixed-interval smoother of H. E. Rauch, F. Tung and C. T. Striebel (AIAA Journal 3 (1965) 1445-1450) as A. E. Bryson and M. Frazier have it
/// (G. J. Bierman, International Journal of Control 18 (1973) 65-75): what the measurements after a sample say of its state is a
/// gradient and a curvature of their likelihood, carried back from the last sample; no covariance is inverted, which may be singular.
fn smooth(layout: &Layout, visited: &[Visited]) -> States {
    let n = layout.states.len();
    let (mut gradient, mut curvature) = (vec![0.0; n], vec![0.0; n * n]);
    let mut found: Vec<(Vec<f64>, Vec<f64>)> = Vec::with_capacity(visited.len());
    for Visited { updates, carry, slopes } in visited.iter().rev() {
        if !slopes.is_empty() {
            gradient = turned(n, slopes, &gradient, 1);
            curvature = symmetric(n, slopes, &curvature);
        }
        let (x, p) = split(n, carry);
        let moved = turned(n, &p, &gradient, 1);
        let taken = symmetric(n, &p, &curvature);
        let mean = x.iter().zip(moved).map(|(x, moved)| x - moved).collect();
        // A variance is no smaller than the rounding of the difference.
        let left = |(at, (p, taken)): (usize, (&f64, f64))| match at % (n + 1) {
            0 => (p - taken).max(n as f64 * f64::EPSILON * p),
            _ => p - taken,
        };
        found.push((mean, p.iter().zip(taken).enumerate().map(left).collect()));
        for Update { row, gain, error, variance } in updates.iter().rev() {
            // I - k c
            let left = |at: usize| f64::from(u8::from(at / n == at % n)) - gain[at / n] * row[at % n];
            let left: Vec<f64> = (0..n * n).map(left).collect();
            gradient = turned(n, &left, &gradient, 1);
            gradient.iter_mut().zip(row).for_each(|(sum, c)| *sum -= c * error / variance);
            curvature = symmetric(n, &left, &curvature);
            (0..n * n).for_each(|at| curvature[at] += row[at / n] * row[at % n] / variance);
        }
    }
    found.reverse();
    States::new(layout, found.into_iter())
}

/// `a' b` of a square `a` and a `b` of so many columns.
fn turned(n: usize, a: &[f64], b: &[f64], columns: usize) -> Vec<f64> {
    let entry = |at: usize| (0..n).map(|k| a[k * n + at / columns] * b[k * columns + at % columns]).sum();
    (0..n * columns).map(entry).collect()
}

/// `a' b a`, which is symmetric as `b` is.
fn symmetric(n: usize, a: &[f64], b: &[f64]) -> Vec<f64> {
    let half = turned(n, a, b, n);
    let entry = |i: usize, j: usize| (0..n).map(|k| half[i * n + k] * a[k * n + j]).sum::<f64>();
    (0..n * n).map(|at| entry((at / n).min(at % n), (at / n).max(at % n))).collect()
}

/// The state and its covariance row by row.
fn split(n: usize, carry: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let square = (0..n * n).map(|at| carry[n + entry(n, at / n, at % n)]).collect();
    (carry[..n].to_vec(), square)
}

impl States {
    fn new(layout: &Layout, samples: impl Iterator<Item = (Vec<f64>, Vec<f64>)>) -> Self {
        let n = layout.states.len();
        let (means, covariances): (Vec<Vec<f64>>, Vec<Vec<f64>>) = samples.unzip();
        let column = |i: usize| means.iter().map(|mean| mean[i]).collect();
        // A covariance of zero may be rounded to less.
        let deviation = |i: usize| covariances.iter().map(|p| p[i * n + i].max(0.0).sqrt()).collect();
        let (columns, deviations) = ((0..n).map(column).collect(), (0..n).map(deviation).collect());
        let names = layout.states.iter().map(|state| state.name.clone()).collect();
        States { names, means: columns, deviations, covariances }
    }
}
