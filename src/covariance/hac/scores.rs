//! Accumulators of scores in order of time.

use crate::covariance::leverage::{LEAST, form};
use crate::information::{Gathering, Information};
use crate::problem::{Accumulate, Objective};
use crate::sweep::Window;
use core::f64::consts::FRAC_1_SQRT_2;
use nalgebra::DMatrix;
use std::collections::VecDeque;

/// An accumulator of scores in order of time.
pub(crate) trait AccumulateScores: Send {
    fn take(&mut self, score: &[f64]);
    /// Adds the accumulator of the scores that follow.
    fn append(&mut self, later: Self);
}

/// The score of each sample in the columns kept: the sum over the outputs of `w psi(z) g` and, where variances `v` are predicted, of
/// `w (psi(z) z - kappa) dv / (2 v)`. Each error is divided by the root of one less its leverage, with which the variance of
/// independent errors is right (HC2). A measurement that alone determines an unknown, as the first one may determine an initial state, has an
/// error of next to zero whatever its noise. It has no score here; its slopes are kept ([`EachScore::alone`]).
pub(crate) struct EachScore<'s, T> {
    objective: &'s Objective<'s>,
    experiment: usize,
    kept: &'s [usize],
    /// The inverse of the curvature in all columns of the experiment.
    inverse: &'s DMatrix<f64>,
    slopes: Vec<f64>,
    score: Vec<f64>,
    /// The slopes of the measurements that alone determine an unknown, times the roots of their weights.
    alone: Vec<Vec<f64>>,
    /// The sum of the squared influences of the others times their weights, and their number.
    squares: [f64; 2],
    pub into: T,
}

impl<'s, T> EachScore<'s, T> {
    pub fn new(
        objective: &'s Objective<'s>,
        experiment: usize,
        (kept, inverse): (&'s [usize], &'s DMatrix<f64>),
        into: T,
    ) -> Self {
        let (slopes, score) = (vec![0.0; inverse.nrows()], vec![0.0; kept.len()]);
        EachScore { objective, experiment, kept, inverse, slopes, score, alone: vec![], squares: [0.0; 2], into }
    }

    /// The scores of the measurements that alone determine an unknown, of which nothing but the mean square of the others is known. Each is a row of the
    /// columns kept.
    pub fn alone(&self, mean_square: f64) -> Vec<Vec<f64>> {
        let size = mean_square.sqrt();
        self.alone.iter().map(|row| row.iter().map(|slope| slope * size).collect()).collect()
    }

    /// The mean square of the influences of the other measurements.
    pub fn mean_square(&self) -> f64 {
        let [sum, count] = self.squares;
        sum / count.max(1.0)
    }
}

impl<T: AccumulateScores> Accumulate for EachScore<'_, T> {
    fn add(&mut self, window: &Window, lane: usize) {
        let loss = self.objective.loss();
        // Samples without a measurement have no score, and do not stand between those that have.
        let any = |k: &usize| (0..window.outputs()).any(|j| window.is_measured(*k, j, lane));
        for k in (0..window.samples[lane]).filter(any) {
            let weight = self.objective.weight(self.experiment, window.begin[lane] + k);
            self.score.fill(0.0);
            for j in 0..window.outputs() {
                let z = window.error(k, j, lane);
                self.slopes.iter_mut().enumerate().for_each(|(c, slope)| *slope = window.at(k, j, c, lane));
                let less = 1.0 - weight * form(self.inverse, &self.slopes);
                let influence = loss.map_or(z, |loss| loss.psi(z));
                if less > LEAST {
                    let psi = weight * influence / less.sqrt();
                    for (score, &c) in self.score.iter_mut().zip(self.kept) {
                        *score += psi * self.slopes[c];
                    }
                    self.squares[0] += weight * influence * influence / less;
                    self.squares[1] += f64::from(weight > 0.0 && window.is_measured(k, j, lane));
                } else {
                    self.alone.push(self.kept.iter().map(|&c| weight.sqrt() * self.slopes[c]).collect());
                }
                if window.has_variances() {
                    let variance = window.variance_row(k, j);
                    let at = |column: usize| variance[column * window.lanes() + lane];
                    // Of `rho(z) + kappa/2 ln v` with slopes `dv / (sqrt(2) v)`.
                    let second = weight * (influence * z - self.objective.problem.kappa) * FRAC_1_SQRT_2;
                    for (score, &c) in self.score.iter_mut().zip(self.kept) {
                        *score += second * at(c);
                    }
                }
            }
            self.into.take(&self.score);
        }
    }

    fn append(&mut self, later: Self) {
        self.alone.extend(later.alone);
        self.squares.iter_mut().zip(later.squares).for_each(|(own, later)| *own += later);
        self.into.append(later.into);
    }
}

/// Sums of products of the scores with those one and two samples before, and the triangle of the scores themselves.
pub(crate) struct Lagged {
    pub count: usize,
    pub scores: Gathering,
    pub products: [DMatrix<f64>; 2],
    /// The last two scores, the last one first.
    before: [Vec<f64>; 2],
    /// The first two.
    first: Vec<Vec<f64>>,
}

impl Lagged {
    pub fn new(n: usize) -> Self {
        Lagged {
            count: 0,
            scores: Gathering::new(n),
            products: [DMatrix::zeros(n, n), DMatrix::zeros(n, n)],
            before: [vec![0.0; n], vec![0.0; n]],
            first: vec![],
        }
    }

    /// Products of a score with those before it.
    fn multiply(&mut self, score: &[f64]) {
        for (product, before) in self.products.iter_mut().zip(&self.before) {
            for (j, before) in before.iter().enumerate() {
                for (i, score) in score.iter().enumerate() {
                    product[(i, j)] += score * before;
                }
            }
        }
        self.before.swap(0, 1);
        self.before[0].copy_from_slice(score);
    }
}

impl AccumulateScores for Lagged {
    fn take(&mut self, score: &[f64]) {
        if self.first.len() < 2 {
            self.first.push(score.to_vec());
        }
        self.multiply(score);
        self.scores.take(score, 0.0);
        self.count += 1;
    }

    fn append(&mut self, later: Self) {
        // The products of its first scores among themselves are those of both: they are counted once, here.
        let nothing = || vec![0.0; later.before[0].len()];
        let mut alone = Lagged { before: [nothing(), nothing()], ..Lagged::new(later.before[0].len()) };
        for score in &later.first {
            self.multiply(score);
            alone.multiply(score);
            if self.first.len() < 2 {
                self.first.push(score.clone());
            }
        }
        for (i, product) in self.products.iter_mut().enumerate() {
            *product += &later.products[i] - &alone.products[i];
        }
        if later.count >= 2 {
            self.before = later.before;
        }
        self.scores.append(later.scores);
        self.count += later.count;
    }
}

/// Triangle of the moving sums of `window` prewhitened scores, each divided by the root of the window.
pub(crate) struct MovingSums<'m> {
    w: &'m DMatrix<f64>,
    a: &'m DMatrix<f64>,
    window: usize,
    /// The first `window` scores, with which a sum reaches back to those before; they are prewhitened and summed when
    /// these are known.
    first: Vec<Vec<f64>>,
    recent: VecDeque<Vec<f64>>,
    sums: Vec<f64>,
    before: Vec<f64>,
    rows: Gathering,
}

impl<'m> MovingSums<'m> {
    pub fn new(w: &'m DMatrix<f64>, a: &'m DMatrix<f64>, window: usize) -> Self {
        let n = a.nrows();
        MovingSums {
            w,
            a,
            window,
            first: vec![],
            recent: (0..window).map(|_| vec![0.0; n]).collect(),
            sums: vec![0.0; n],
            before: vec![0.0; n],
            rows: Gathering::new(n),
        }
    }

    /// A score of unit covariance, prewhitened by the one before it.
    fn prewhitened(&mut self, score: &[f64]) -> Vec<f64> {
        let n = score.len();
        let z: Vec<f64> = (0..n).map(|j| (0..=j).map(|i| score[i] * self.w[(i, j)]).sum()).collect();
        let rest = |i: usize| z[i] - (0..n).map(|j| self.a[(i, j)] * self.before[j]).sum::<f64>();
        let rest = (0..n).map(rest).collect();
        self.before = z;
        rest
    }

    fn slide(&mut self, new: &[f64], counts: bool) {
        let part = (self.window as f64).sqrt().recip();
        let mut oldest = self.recent.pop_front().unwrap_or_default();
        for ((sum, new), old) in self.sums.iter_mut().zip(new).zip(&mut oldest) {
            *sum += new - std::mem::replace(old, *new);
        }
        self.recent.push_back(oldest);
        if counts {
            let row: Vec<f64> = self.sums.iter().map(|sum| sum * part).collect();
            self.rows.take(&row, 0.0);
        }
    }

    /// The triangle, after the first scores were summed from zero and the last ones were shifted out of the window.
    pub fn triangle(self) -> Information {
        let n = self.sums.len();
        let mut whole = MovingSums { first: vec![vec![]; self.window], ..MovingSums::new(self.w, self.a, self.window) };
        whole.append(self);
        let nothing = vec![0.0; n];
        for _ in 1..whole.window {
            whole.slide(&nothing, true);
        }
        whole.rows.triangle()
    }
}

impl AccumulateScores for MovingSums<'_> {
    fn take(&mut self, score: &[f64]) {
        let counts = self.first.len() == self.window;
        if !counts {
            self.first.push(score.to_vec());
        }
        let prewhitened = self.prewhitened(score);
        self.slide(&prewhitened, counts);
    }

    fn append(&mut self, later: Self) {
        for score in &later.first {
            self.take(score);
        }
        // With a full window of its own scores, it no longer depends on those before.
        if later.first.len() == later.window {
            (self.recent, self.sums, self.before) = (later.recent, later.sums, later.before);
        }
        self.rows.append(later.rows);
    }
}

#[cfg(test)]
mod tests;
