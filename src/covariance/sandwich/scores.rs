//! The scores of independent errors.
//!
//! An error that is divided by one less its leverage is the noise of the measurement less the error of what all others predict
//! for it, whose variance is `h / (1 - h)` times that of the noise at leverage `h`. Where a measurement determines an unknown, both
//! are of one size and may cancel by chance: of straight lines with one far measurement, noisier than the others, 84 % were covered.
//! [`CANCELED`] times the variance of that prediction, by the noise of all measurements, is therefore added to the square.
//!
//! Where the others predict a measurement with more than five times its noise, they say nothing of its noise, and the variance of that
//! prediction nothing of the estimate. One less the leverage counts as [`LEAST`] there at least: of a measurement that alone determines an
//! unknown the variance is then `CANCELED / LEAST`, ten times that of the noise of all, instead of growing without bound. Where variances
//! are predicted, as by a filter whose first measurement alone determines the initial state, it is the predicted one.

use crate::covariance::leverage::LEAST;
use crate::covariance::shares::Shares;
use crate::information::Gathering;
use crate::problem::{Accumulate, Objective};
use crate::sweep::Window;
use core::f64::consts::FRAC_1_SQRT_2;
use nalgebra::DMatrix;

/// Part of a prediction's variance that is added to the square of the error. An interval of an unknown that one measurement alone
/// determines then covers 95.7 % of normal errors where that measurement's deviation is 2.2 times that of the prediction, and more
/// where it is larger or smaller; with 0.35 it covered 93.8 % of 2,000 lines through 41 measurements.
const CANCELED: f64 = 0.4;

/// The triangle of the scores.
pub(crate) struct Scores<'s> {
    objective: &'s Objective<'s>,
    experiment: usize,
    pub shares: Shares,
    /// Variance of all errors times the roots of their weights.
    noise: f64,
    /// The root of the curvature along the logarithm of a variance relative to that along a mean.
    variance: f64,
    pub scores: Gathering,
    row: Vec<f64>,
    /// By what the errors of a sample move each unknown; the second less the part of them that is certain.
    moves: Vec<[f64; 2]>,
    /// The variance of each unknown, and the sum of squares by which it is uncertain.
    variances: Vec<[f64; 2]>,
}

impl<'s> Scores<'s> {
    /// By the inverse of the curvature of the experiment's unknowns.
    pub fn new(
        objective: &'s Objective<'s>,
        experiment: usize,
        inverse: DMatrix<f64>,
        noise: f64,
        variance: f64,
    ) -> Self {
        let columns = inverse.nrows();
        let none = || vec![[0.0; 2]; columns];
        let (shares, scores, row) = (Shares::new(experiment, inverse), Gathering::new(columns), vec![0.0; columns]);
        Scores { objective, experiment, shares, noise, variance, scores, row, moves: none(), variances: none() }
    }

    /// Adds the score of these slopes by an influence, and what it moves the unknowns by, of which the part `certain` is not.
    fn add_score(&mut self, slopes: &[f64], influence: f64, certain: f64) {
        self.row.iter_mut().zip(slopes).for_each(|(row, slope)| *row += slope * influence);
        for ([move_by, uncertain], moved) in self.moves.iter_mut().zip(self.shares.moved()) {
            *move_by += moved * influence;
            *uncertain += moved * influence * certain;
        }
    }
}

impl Accumulate for Scores<'_> {
    fn add(&mut self, window: &Window, lane: usize) {
        let (lanes, loss) = (window.lanes(), self.objective.loss());
        let mut slopes = vec![0.0; self.row.len()];
        for k in 0..window.samples[lane] {
            let sample = window.begin[lane] + k;
            let weight = self.objective.weight(self.experiment, sample);
            self.row.fill(0.0);
            self.moves.fill([0.0; 2]);
            for j in (0..window.outputs()).filter(|&j| weight > 0.0 && window.is_measured(k, j, lane)) {
                let take = |row: &[f64], slopes: &mut [f64]| {
                    slopes.iter_mut().zip(row.iter().skip(lane).step_by(lanes)).for_each(|(to, from)| *to = *from);
                };
                let z = window.error(k, j, lane);
                let psi = loss.map_or(z, |loss| loss.psi(z));
                if window.has_variances() {
                    take(window.variance_row(k, j), &mut slopes);
                    let leverage = weight * self.variance * self.variance * self.shares.move_by(&slopes);
                    let less = (1.0 - leverage).max(LEAST);
                    let second = weight * (psi * z - self.objective.problem.kappa) * FRAC_1_SQRT_2;
                    self.add_score(&slopes, second / less, less.sqrt());
                }
                take(window.row(k, j), &mut slopes);
                let leverage = self.shares.take(weight, &slopes, z, (j, sample));
                let less = (1.0 - leverage).max(LEAST);
                let mut part = CANCELED * leverage / less;
                if window.has_variances() && less == LEAST {
                    part = 1.0;
                } else {
                    self.add_score(&slopes, weight * psi / less, less.sqrt());
                }
                let canceled = (part * weight * self.noise).sqrt();
                slopes.iter_mut().for_each(|slope| *slope *= canceled);
                self.scores.take(&slopes, 0.0);
            }
            self.scores.take(&self.row, 0.0);
            for ([variance, spread], [move_by, uncertain]) in self.variances.iter_mut().zip(&self.moves) {
                *variance += move_by * move_by;
                *spread += uncertain.powi(4);
            }
        }
    }

    fn append(&mut self, later: Self) {
        self.shares.append(&later.shares);
        self.scores.append(later.scores);
        for (own, later) in self.variances.iter_mut().zip(&later.variances) {
            own.iter_mut().zip(later).for_each(|(own, later)| *own += later);
        }
    }
}

/// Degrees of freedom of the variance of each unknown, by Satterthwaite's rule (Biometrics Bulletin 2 (1946) 110): the variance is the
/// sum of the squares of what the samples move it by, each of which has, if normal, a variance of two thirds of its own square
/// on average. What the leverage takes is made up for by what is added to the square ([`CANCELED`]), and counts as certain. Of an
/// unknown of one experiment its own samples count.
pub(crate) fn degrees(objective: &Objective<'_>, all: &[Scores<'_>]) -> Vec<f64> {
    let unknowns = &objective.problem.unknowns;
    let mut sums = vec![[0.0; 2]; unknowns.row.len()];
    for (e, one) in all.iter().enumerate() {
        for (i, own) in unknowns.columns(e).zip(&one.variances) {
            sums[i].iter_mut().zip(own).for_each(|(sum, own)| *sum += own);
        }
    }
    let degrees = |[variance, squares]: [f64; 2]| {
        let spread = 2.0 / 3.0 * squares;
        let found = 2.0 * (variance * variance - spread) / spread;
        if found.is_finite() { found.max(1.0) } else { f64::INFINITY }
    };
    sums.into_iter().map(degrees).collect()
}
