//! Accumulators of scores in order of time.

use super::ROWS;
use crate::information::{Block, Information};
use crate::judge::sandwich::{ALONE, form};
use crate::problem::{Accumulate, Objective};
use crate::sweep::Window;
use core::f64::consts::FRAC_1_SQRT_2;
use nalgebra::DMatrix;
use std::collections::VecDeque;

/// An accumulator of scores in order of time.
pub(super) trait AccumulateScores: Send {
    fn take(&mut self, score: &[f64]);
    /// Adds the accumulator of the scores that follow.
    fn append(&mut self, later: Self);
}

/// The score of each sample, `sum over the outputs of w psi(z) g`, in the columns kept, where variances `v` are predicted with
/// `w (psi(z) z - kappa) dv / (2 v)`; each error divided by the root of one less its leverage, with which the variance of independent
/// errors is right (HC2). Without the root, as in the sandwich for independent errors, the error of an initial state that a single
/// measurement determines is several times too large.
pub(super) struct EachScore<'s, T> {
    objective: &'s Objective<'s>,
    experiment: usize,
    kept: &'s [usize],
    /// The inverse of the curvature in all columns of the experiment.
    inverse: &'s DMatrix<f64>,
    slopes: Vec<f64>,
    score: Vec<f64>,
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
        EachScore { objective, experiment, kept, inverse, slopes, score, into }
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
                let less = (1.0 - weight * form(self.inverse, &self.slopes)).max(ALONE);
                let influence = loss.map_or(z, |loss| loss.psi(z));
                let psi = weight * influence / less.sqrt();
                for (score, &c) in self.score.iter_mut().zip(self.kept) {
                    *score += psi * self.slopes[c];
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
        self.into.append(later.into);
    }
}

/// Sums of products of the scores with those one and two samples before, and the triangle of the scores themselves.
pub(super) struct Lagged {
    pub count: usize,
    pub triangle: Information,
    pub block: Block,
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
            triangle: Information::new(n),
            block: Block::new(n, ROWS),
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
        self.triangle.gather(&mut self.block, score, 0.0);
        self.count += 1;
    }

    fn append(&mut self, mut later: Self) {
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
        self.triangle.absorb(&mut self.block);
        later.triangle.absorb(&mut later.block);
        self.triangle.merge(&later.triangle);
        self.count += later.count;
    }
}

/// Triangle of the moving sums of `window` prewhitened scores, each divided by the root of the window.
pub(super) struct MovingSums<'m> {
    w: &'m DMatrix<f64>,
    a: &'m DMatrix<f64>,
    window: usize,
    /// The first `window` scores, with which a sum reaches back to those before; they are prewhitened and summed when
    /// these are known.
    first: Vec<Vec<f64>>,
    recent: VecDeque<Vec<f64>>,
    sums: Vec<f64>,
    before: Vec<f64>,
    triangle: Information,
    block: Block,
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
            triangle: Information::new(n),
            block: Block::new(n, ROWS),
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
            self.triangle.gather(&mut self.block, &row, 0.0);
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
        whole.triangle.absorb(&mut whole.block);
        whole.triangle
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

    fn append(&mut self, mut later: Self) {
        for score in &later.first {
            self.take(score);
        }
        // With a full window of its own scores, it no longer depends on those before.
        if later.first.len() == later.window {
            (self.recent, self.sums, self.before) = (later.recent, later.sums, later.before);
        }
        self.triangle.absorb(&mut self.block);
        later.triangle.absorb(&mut later.block);
        self.triangle.merge(&later.triangle);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Experiment, Fit, Huber, Kalman, Kind, Model, Nothing, Scalar, Time, free, signals};

    fn scores(count: usize) -> Vec<Vec<f64>> {
        (0..count).map(|k| vec![(1.3 * k as f64).sin(), (0.7 * k as f64).cos() + 0.1]).collect()
    }

    /// Pieces of no, one, two and more scores, gathered one after the other.
    fn in_pieces<T: AccumulateScores>(make: impl Fn() -> T) -> T {
        let (all, mut whole) = (scores(17), make());
        for (from, to) in [(0, 1), (1, 1), (1, 3), (3, 9), (9, 10), (10, 17)] {
            let mut piece = make();
            all[from..to].iter().for_each(|score| piece.take(score));
            whole.append(piece);
        }
        whole
    }

    /// `sum s[t] s[t - k]'` and the triangle of the scores.
    #[test]
    fn products_are_those_of_the_whole() {
        let (all, mut found) = (scores(17), in_pieces(|| Lagged::new(2)));
        found.triangle.absorb(&mut found.block);
        assert_eq!(found.count, 17);
        let product = |lag: usize, i: usize, j: usize| (lag..17).map(|t| all[t][i] * all[t - lag][j]).sum::<f64>();
        for (i, j) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            for lag in [1, 2] {
                assert!((found.products[lag - 1][(i, j)] - product(lag, i, j)).abs() < 1e-12, "{lag}: {i} {j}");
            }
            let squares: f64 = (0..=i.min(j)).map(|k| found.triangle.at(k, i) * found.triangle.at(k, j)).sum();
            assert!((squares - product(0, i, j)).abs() < 1e-12, "{i} {j}");
        }
    }

    /// However they are put together: pieces of one score are put behind each other before they follow others.
    #[test]
    fn products_do_not_depend_on_the_order_of_putting_together() {
        let (all, whole) = (scores(7), in_order(&scores(7), &[7]));
        let mut late = in_order(&all[2..], &[1, 1, 1, 2]);
        let mut found = in_order(&all[..2], &[1, 1]);
        assert_eq!(late.first, all[2..4]);
        late.append(Lagged::new(2));
        found.append(late);
        for (found, whole) in found.products.iter().zip(&whole.products) {
            assert!((found - whole).abs().max() < 1e-14, "{found} {whole}");
        }
    }

    /// Scores in pieces of these lengths.
    fn in_order(all: &[Vec<f64>], lengths: &[usize]) -> Lagged {
        let (mut whole, mut from) = (Lagged::new(2), 0);
        for length in lengths {
            let mut piece = Lagged::new(2);
            all[from..from + length].iter().for_each(|score| piece.take(score));
            whole.append(piece);
            from += length;
        }
        whole
    }

    /// The squares of the moving sums are Newey and West's: `sum over lags of (1 - k / window) sum v[t] v[t - k]'`, of scores
    /// `v[t] = z[t] - a z[t - 1]`, `z = s w`.
    #[test]
    fn moving_sums_are_weighted_lags() {
        let w = DMatrix::from_row_slice(2, 2, &[2.0, 0.5, 0.0, 1.5]);
        let a = DMatrix::from_row_slice(2, 2, &[0.6, 0.1, -0.2, 0.3]);
        for window in [1, 2, 4] {
            let found = in_pieces(|| MovingSums::new(&w, &a, window)).triangle();
            let z: Vec<Vec<f64>> = scores(17).iter().map(|s| vec![2.0 * s[0], 0.5 * s[0] + 1.5 * s[1]]).collect();
            let fresh = |t: usize, i: usize| {
                let before = |j: usize| if t > 0 { z[t - 1][j] } else { 0.0 };
                z[t][i] - a[(i, 0)] * before(0) - a[(i, 1)] * before(1)
            };
            for (i, j) in [(0, 0), (0, 1), (1, 1)] {
                let sum = |t: usize, s: usize| {
                    let weight = 1.0 - t.abs_diff(s) as f64 / window as f64;
                    if weight > 0.0 { weight * fresh(t, i) * fresh(s, j) } else { 0.0 }
                };
                let expected: f64 = (0..17).flat_map(|t| (0..17).map(move |s| (t, s))).map(|(t, s)| sum(t, s)).sum();
                let squares: f64 = (0..=i.min(j)).map(|k| found.at(k, i) * found.at(k, j)).sum();
                assert!((squares - expected).abs() < 1e-11, "{window}: {i} {j}: {squares} {expected}");
            }
        }
    }

    signals! { struct Position { x: "m" } }
    signals! { struct Levels { drift: "m", noise: "m" } }

    /// `x[k+1] = x[k] + w`, seen with noise.
    #[derive(Clone)]
    struct Walk;

    impl Model for Walk {
        type State = Position;
        type Input = Nothing;
        type Output = Position;
        type Parameters = Levels;
        const KIND: Kind = Kind::Discrete;

        fn next<S: Scalar>(&self, _t: S, x: &Position<S>, _u: &Nothing, _p: &Levels<S>) -> Position<S> {
            *x
        }

        fn diffusion<S: Scalar>(&self, p: &Levels<S>) -> Position<S> {
            Position { x: p.drift }
        }

        fn noise<S: Scalar>(&self, p: &Levels<S>) -> Position<S> {
            Position { x: p.noise }
        }

        fn output<S: Scalar>(&self, _t: S, x: &Position<S>, _u: &Nothing, _p: &Levels<S>) -> Position<S> {
            *x
        }
    }

    /// Sums of scores, and of their squares.
    struct Sums(Vec<f64>, Vec<f64>);

    impl AccumulateScores for Sums {
        fn take(&mut self, score: &[f64]) {
            self.0.iter_mut().zip(score).for_each(|(sum, s)| *sum += s);
            self.1.iter_mut().zip(score).for_each(|(sum, s)| *sum += s * s);
        }

        fn append(&mut self, later: Self) {
            self.0.iter_mut().zip(later.0).for_each(|(sum, s)| *sum += s);
            self.1.iter_mut().zip(later.1).for_each(|(sum, s)| *sum += s);
        }
    }

    /// At a minimum the scores sum to zero, also those of predicted variances, of squared and of robust losses: with one
    /// measurement in twelve far out, a tenth of a root of their number would show. Without leverage, which is left out here.
    #[test]
    fn scores_of_a_minimum_sum_to_zero() {
        let (mut random, mut x) = (crate::random::Random::stream(3, 1), 0.0);
        let outputs = (0..600).map(|k| {
            x += 0.1 * random.normal();
            let size = if k % 12 == 5 { 2.0 } else { 0.3 };
            Position { x: x + size * random.normal() }
        });
        let outputs: Vec<Position> = outputs.collect();
        let time = Time::Uniform { start: 0.0, step: 1.0 };
        let record = Experiment::new(&Walk, time, vec![Nothing {}; 600], outputs).unwrap();
        let parameters = Levels { drift: free(0.2).log(), noise: free(0.2).log() };
        let fit = || Fit::new(&Walk, &record).parameters(parameters).predictor(Kalman);
        for problem in [fit().problem().unwrap(), fit().loss(Huber(1.345)).problem().unwrap()] {
            let coordinates = problem.run().unwrap().coordinates();
            let objective = problem.objective().unwrap();
            let n = coordinates.len();
            let (kept, inverse) = ((0..n).collect::<Vec<usize>>(), DMatrix::zeros(n, n));
            let make = || EachScore::new(&objective, 0, (&kept, &inverse), Sums(vec![0.0; n], vec![0.0; n]));
            let Sums(sums, squares) = objective.gather_one(&coordinates, 0, true, make).ok().unwrap().into;
            for (sum, square) in sums.iter().zip(&squares) {
                assert!(sum.abs() < 1e-3 * square.sqrt(), "{sums:?} {squares:?}");
            }
        }
    }
}
