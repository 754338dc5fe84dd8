//! The covariance where the errors are autocorrelated: it allows the scores to be correlated over time and of changing
//! size (heteroscedasticity and autocorrelation consistent, HAC).
//!
//! The scores of each experiment are prewhitened by a vector autoregression of order one, summed over lags with
//! Bartlett's weights (Newey and West, Econometrica 55 (1987) 703) at Andrews' bandwidth (Econometrica 59 (1991) 817,
//! eqs. 6.2 and 6.4), and recolored (Andrews and Monahan, Econometrica 60 (1992) 953). Newey and West's sum is the sum
//! of squares of moving sums, which a triangle absorbs like any other rows; so two passes over the data serve, and no
//! score is kept longer than the bandwidth.
//!
//! The autoregression works on scores of unit covariance: so its singular values are below one, and the result does not
//! depend on the choice of units or parameters.

use super::sandwich::{self, Sandwich};
use crate::information::{Block, Information};
use crate::optimize::Linearization;
use crate::problem::{Accumulate, Objective, each};
use crate::sweep::Window;
use nalgebra::DMatrix;
use std::collections::VecDeque;

/// Largest singular value of the autoregression (Andrews and Monahan 1992, section 3).
const LARGEST: f64 = 0.97;
/// Rows that are absorbed together.
const ROWS: usize = 256;

/// The sandwich for autocorrelated errors, and over how many samples they are correlated beyond the autoregression.
pub(crate) struct Hac {
    pub sandwich: Sandwich,
    pub lags: usize,
}

/// Two passes with slopes. `None` where the scores of the unknowns that are not held are linearly dependent.
pub(crate) fn hac(
    objective: &Objective<'_>,
    coordinates: &[f64],
    linear: &Linearization,
    held: &[bool],
) -> Option<Hac> {
    let mut found = match sandwich::is_needed(objective) {
        true => sandwich::curvature(objective, coordinates).ok()?,
        false => Sandwich::plain(linear),
    };
    let unknowns = &objective.problem.unknowns;
    let kept = |e: usize| -> Vec<usize> {
        let columns = unknowns.columns(e).enumerate();
        columns.filter(|(_, i)| !held[*i]).map(|(c, _)| c).collect()
    };
    let roots = each(objective.experiments(), |e| long_run(objective, e, coordinates, &kept(e)));
    let mut longest = 0;
    let mut scores = Vec::with_capacity(roots.len());
    for (e, root) in roots.into_iter().enumerate() {
        let (triangle, lags) = root?;
        longest = longest.max(lags);
        let kept = kept(e);
        let columns = unknowns.columns(e).count();
        let mut own = Information::new(columns);
        for i in 0..kept.len() {
            let mut row = vec![0.0; columns];
            kept.iter().enumerate().for_each(|(j, &c)| row[c] = triangle[(i, j)]);
            own.absorb_row(&row, 0.0);
        }
        scores.push(own);
    }
    for (i, slope, _) in unknowns.priors(coordinates) {
        let e = unknowns.row[i].experiment.unwrap_or(0);
        scores[e].absorb_row(&sandwich::prior_row(objective, e, i, slope), 0.0);
    }
    (found.scores, found.scale) = (scores, 1.0);
    Some(Hac { sandwich: found, lags: longest })
}

/// A root (rows) of the long-run covariance of one experiment's scores times their number, and the lags it took.
fn long_run(objective: &Objective<'_>, e: usize, coordinates: &[f64], kept: &[usize]) -> Option<(DMatrix<f64>, usize)> {
    let n = kept.len();
    if n == 0 {
        return Some((DMatrix::zeros(0, 0), 0));
    }
    let each_score = || EachScore::new(objective, e, kept, Lagged::new(n));
    let lagged = objective.gather_one(coordinates, e, true, each_score).ok()?.into;
    let Lagged { count, mut triangle, mut block, products, .. } = lagged;
    triangle.absorb(&mut block);
    let length = count as f64;
    // To scores of unit covariance: z = s w.
    let root = DMatrix::from_fn(n, n, |i, j| triangle.at(i, j)) / length.sqrt();
    let w = root.solve_upper_triangular(&DMatrix::identity(n, n))?;
    let standard = |product: &DMatrix<f64>| w.transpose() * product * &w / length;
    let (one, two) = (standard(&products[0]), standard(&products[1]));
    // A decomposition of what is not finite would panic.
    if !one.iter().all(|value| value.is_finite()) {
        return None;
    }
    let mut svd = one.clone().try_svd(true, true, f64::EPSILON, 1000)?;
    svd.singular_values.iter_mut().for_each(|value| *value = value.min(LARGEST));
    let a = svd.recompose().ok()?;
    let window = bandwidth(&one, &two, &a, count);

    let each_score = || EachScore::new(objective, e, kept, MovingSums::new(&w, &a, window));
    let sums = objective.gather_one(coordinates, e, true, each_score).ok()?.into.triangle();
    let recolor = (DMatrix::identity(n, n) - &a).try_inverse()?;
    let result = DMatrix::from_fn(n, n, |i, j| sums.at(i, j)) * recolor.transpose() * root;
    result.iter().all(|value| value.is_finite()).then_some((result, window - 1))
}

/// How many prewhitened scores a moving sum takes, from the correlations of the standardized scores at lags one and
/// two, the autoregression `a` and the number of scores.
fn bandwidth(one: &DMatrix<f64>, two: &DMatrix<f64>, a: &DMatrix<f64>, count: usize) -> usize {
    let (n, length) = (a.nrows(), count as f64);
    // Covariances of the prewhitened scores at lags zero and one.
    let zero = DMatrix::identity(n, n) - a * one.transpose() - one * a.transpose() + a * a.transpose();
    let next = one - two * a.transpose() - a + a * one * a.transpose();
    let (mut above, mut below) = (0.0, 0.0);
    for i in 0..n {
        let variance = zero[(i, i)].max(0.0).powi(2);
        let rho = (next[(i, i)] / zero[(i, i)]).clamp(-LARGEST, LARGEST);
        if rho.is_finite() {
            above += 4.0 * rho * rho * variance / ((1.0 - rho).powi(6) * (1.0 + rho).powi(2));
            below += variance / (1.0 - rho).powi(4);
        }
    }
    let andrews = if below > 0.0 { 1.1447 * (above / below * length).cbrt() } else { 0.0 };
    // Andrews' rule uses the correlation at lag one only; the longer of Schwert's rules (J. Business and Economic
    // Statistics 7 (1989) 147) allows for what the autoregression leaves at longer lags.
    let schwert = 12.0 * (length / 100.0).powf(0.25);
    (andrews.max(schwert).ceil() as usize + 1).clamp(1, (count / 2).max(1))
}

/// An accumulator of scores in order of time.
trait AccumulateScores: Send {
    fn take(&mut self, score: &[f64]);
    /// Adds the accumulator of the scores that follow.
    fn append(&mut self, later: Self);
}

/// The score of each sample, `sum over the outputs of w psi(z) g`, in the columns kept.
struct EachScore<'s, T> {
    objective: &'s Objective<'s>,
    experiment: usize,
    kept: &'s [usize],
    score: Vec<f64>,
    into: T,
}

impl<'s, T> EachScore<'s, T> {
    fn new(objective: &'s Objective<'s>, experiment: usize, kept: &'s [usize], into: T) -> Self {
        EachScore { objective, experiment, kept, score: vec![0.0; kept.len()], into }
    }
}

impl<T: AccumulateScores> Accumulate for EachScore<'_, T> {
    fn add(&mut self, window: &Window, lane: usize) {
        let loss = self.objective.loss();
        for k in 0..window.samples[lane] {
            let weight = self.objective.weight(self.experiment, window.begin[lane] + k);
            self.score.fill(0.0);
            for j in 0..window.outputs() {
                let z = window.error(k, j, lane);
                let psi = weight * loss.map_or(z, |loss| loss.psi(z));
                for (score, &c) in self.score.iter_mut().zip(self.kept) {
                    *score += psi * window.at(k, j, c, lane);
                }
                if window.has_variances() {
                    let variance = window.variance_row(k, j);
                    let at = |column: usize| variance[column * window.lanes() + lane];
                    let second = weight * at(window.columns() - 1);
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
struct Lagged {
    count: usize,
    triangle: Information,
    block: Block,
    products: [DMatrix<f64>; 2],
    /// The last two scores, the last one first.
    before: [Vec<f64>; 2],
    /// The first two.
    first: Vec<Vec<f64>>,
}

impl Lagged {
    fn new(n: usize) -> Self {
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
struct MovingSums<'m> {
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
    fn new(w: &'m DMatrix<f64>, a: &'m DMatrix<f64>, window: usize) -> Self {
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
        let fresh = (0..n).map(rest).collect();
        self.before = z;
        fresh
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
    fn triangle(self) -> Information {
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
        let fresh = self.prewhitened(score);
        self.slide(&fresh, counts);
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
