//! How well the unknowns are known where the errors are colored: the covariance that allows the scores to be correlated
//! over time and of changing size (HAC).
//!
//! The scores of each experiment are prewhitened by a vector autoregression of order one, summed over lags with
//! Bartlett's weights (Newey and West, Econometrica 55 (1987) 703) at Andrews' bandwidth (Econometrica 59 (1991) 817,
//! eqs. 6.2 and 6.4), and colored again (Andrews and Monahan, Econometrica 60 (1992) 953). Newey and West's sum is the
//! sum of squares of moving sums, which a triangle absorbs like any other rows; so two passes over the data serve, and no
//! score is kept longer than the bandwidth.
//!
//! The autoregression works on scores of unit covariance: so its singular values are below one, and the result does not
//! depend on the choice of units or parameters.

use super::covariance::Sandwich;
use super::objective::{Objective, Rows};
use super::source::Halt;
use crate::information::{Block, Information};
use crate::optimize::Linearization;
use crate::predict::WINDOW;
use nalgebra::DMatrix;
use std::collections::VecDeque;

/// Largest singular value of the autoregression (Andrews and Monahan 1992, section 3).
const LARGEST: f64 = 0.97;
/// Rows that are absorbed together.
const BLOCK: usize = 256;

/// The sandwich for colored errors, and over how many samples it found them to be correlated beyond the autoregression.
pub(super) struct Colored {
    pub sandwich: Sandwich,
    pub lags: usize,
}

/// Sums of products of the scores with those one and two samples before, and the triangle of the scores themselves.
struct Lagged {
    count: usize,
    triangle: Information,
    products: [DMatrix<f64>; 2],
}

impl Objective<'_> {
    /// Two passes with slopes. `None` where the scores of the unknowns that are not held are linearly dependent.
    pub(super) fn colored(&self, coordinates: &[f64], linear: &Linearization, held: &[bool]) -> Option<Colored> {
        let mut sandwich = match self.needs_sandwich() {
            true => self.without_meat(coordinates).ok()?.0,
            false => Sandwich::plain(linear),
        };
        let mut longest = 0;
        let mut meat = Vec::with_capacity(self.experiments());
        for e in 0..self.experiments() {
            let columns: Vec<usize> = self.unknowns.columns(e).collect();
            let kept: Vec<usize> = (0..columns.len()).filter(|&c| !held[columns[c]]).collect();
            let (triangle, lags) = self.long_run(e, coordinates, &kept)?;
            longest = longest.max(lags);
            let mut own = Information::new(columns.len());
            for i in 0..kept.len() {
                let mut row = vec![0.0; columns.len()];
                kept.iter().enumerate().for_each(|(j, &c)| row[c] = triangle[(i, j)]);
                own.absorb_row(&row, 0.0);
            }
            meat.push(own);
        }
        for (i, slope, _) in self.unknowns.priors(coordinates) {
            let e = self.unknowns.row[i].experiment.unwrap_or(0);
            meat[e].absorb_row(&self.prior_row(e, i, slope), 0.0);
        }
        sandwich.replace_meat(meat);
        Some(Colored { sandwich, lags: longest })
    }

    /// A root (rows) of the long-run covariance of one experiment's scores times their number, and the lags it took.
    fn long_run(&self, e: usize, coordinates: &[f64], kept: &[usize]) -> Option<(DMatrix<f64>, usize)> {
        let n = kept.len();
        if n == 0 {
            return Some((DMatrix::zeros(0, 0), 0));
        }
        let Lagged { count, triangle, products } = self.lagged(e, coordinates, kept).ok()?;
        let length = count as f64;
        // To scores of unit covariance: z = s w.
        let root = DMatrix::from_fn(n, n, |i, j| triangle.at(i, j)) / length.sqrt();
        let w = root.solve_upper_triangular(&DMatrix::identity(n, n))?;
        let standard = |product: &DMatrix<f64>| w.transpose() * product * &w / length;
        let (one, two) = (standard(&products[0]), standard(&products[1]));
        let mut svd = one.clone().try_svd(true, true, f64::EPSILON, 1000)?;
        svd.singular_values.iter_mut().for_each(|value| *value = value.min(LARGEST));
        let a = svd.recompose().ok()?;
        // What the prewhitened scores will show of themselves.
        let zero = DMatrix::identity(n, n) - &a * one.transpose() - &one * a.transpose() + &a * a.transpose();
        let next = &one - &two * a.transpose() - &a + &a * &one * a.transpose();
        let (mut above, mut below) = (0.0, 0.0);
        for i in 0..n {
            let variance = zero[(i, i)].max(0.0).powi(2);
            let rho = (next[(i, i)] / zero[(i, i)]).clamp(-LARGEST, LARGEST);
            if rho.is_finite() {
                above += 4.0 * rho * rho * variance / ((1.0 - rho).powi(6) * (1.0 + rho).powi(2));
                below += variance / (1.0 - rho).powi(4);
            }
        }
        let bandwidth = if below > 0.0 { 1.1447 * (above / below * length).cbrt() } else { 0.0 };
        // Andrews' rule sees the correlation with the score before only; what the autoregression leaves at longer lags is
        // given the room of the longer of Schwert's rules (J. Business and Economic Statistics 7 (1989) 147).
        let room = 12.0 * (length / 100.0).powf(0.25);
        let window = (bandwidth.max(room).ceil() as usize + 1).clamp(1, (count / 2).max(1));

        let sums = self.moving_sums(e, coordinates, kept, &w, &a, window).ok()?;
        let recolor = (DMatrix::identity(n, n) - &a).try_inverse()?;
        let result = DMatrix::from_fn(n, n, |i, j| sums.at(i, j)) * recolor.transpose() * root;
        result.iter().all(|value| value.is_finite()).then_some((result, window - 1))
    }

    fn lagged(&self, e: usize, coordinates: &[f64], kept: &[usize]) -> Result<Lagged, Halt> {
        let n = kept.len();
        let mut products = [DMatrix::zeros(n, n), DMatrix::zeros(n, n)];
        let (mut triangle, mut block) = (Information::new(n), Block::new(n, BLOCK));
        let (mut before, mut count) = ([vec![0.0; n], vec![0.0; n]], 0);
        self.each_score(e, coordinates, kept, &mut |score| {
            for (product, before) in products.iter_mut().zip(&before) {
                for j in 0..n {
                    for i in 0..n {
                        product[(i, j)] += score[i] * before[j];
                    }
                }
            }
            before.swap(0, 1);
            before[0].copy_from_slice(score);
            triangle.gather(&mut block, score, 0.0);
            count += 1;
        })?;
        triangle.absorb(&mut block);
        Ok(Lagged { count, triangle, products })
    }

    /// Triangle of the moving sums of `window` prewhitened scores, each divided by the root of the window.
    fn moving_sums(
        &self,
        e: usize,
        coordinates: &[f64],
        kept: &[usize],
        w: &DMatrix<f64>,
        a: &DMatrix<f64>,
        window: usize,
    ) -> Result<Information, Halt> {
        let n = kept.len();
        let share = (window as f64).sqrt().recip();
        let (mut triangle, mut block) = (Information::new(n), Block::new(n, BLOCK));
        let mut recent: VecDeque<Vec<f64>> = (0..window).map(|_| vec![0.0; n]).collect();
        let (mut sums, mut row) = (vec![0.0; n], vec![0.0; n]);
        let (mut z, mut before) = (vec![0.0; n], vec![0.0; n]);
        let mut slide = |new: &[f64]| {
            let mut oldest = recent.pop_front().unwrap_or_default();
            for i in 0..n {
                sums[i] += new[i] - oldest[i];
                row[i] = sums[i] * share;
                oldest[i] = new[i];
            }
            recent.push_back(oldest);
            triangle.gather(&mut block, &row, 0.0);
        };
        let mut fresh = vec![0.0; n];
        self.each_score(e, coordinates, kept, &mut |score| {
            for j in 0..n {
                z[j] = (0..=j).map(|i| score[i] * w[(i, j)]).sum();
            }
            for i in 0..n {
                fresh[i] = z[i] - (0..n).map(|j| a[(i, j)] * before[j]).sum::<f64>();
            }
            before.copy_from_slice(&z);
            slide(&fresh);
        })?;
        fresh.fill(0.0);
        (1..window).for_each(|_| slide(&fresh));
        triangle.absorb(&mut block);
        Ok(triangle)
    }

    /// Shows the score of each sample, `sum over the outputs of w psi(z) g`, in the columns kept.
    fn each_score(
        &self,
        e: usize,
        coordinates: &[f64],
        kept: &[usize],
        visit: &mut dyn FnMut(&[f64]),
    ) -> Result<(), Halt> {
        let (columns, rows) = (self.unknowns.columns(e).count(), self.outputs() * WINDOW);
        let mut score = vec![0.0; kept.len()];
        self.walk(e, coordinates, true, &mut |Rows { begin, samples, window }| {
            let (slopes, errors) = window.data_mut().split_at(columns * rows);
            for k in 0..samples {
                let weight = self.source.weight(e, begin + k);
                score.fill(0.0);
                for row in (k..rows).step_by(WINDOW) {
                    let z = errors[row];
                    let psi = weight * self.loss.map_or(z, |loss| loss.psi(z));
                    for (score, c) in score.iter_mut().zip(kept) {
                        *score += psi * slopes[c * rows + row];
                    }
                }
                visit(&score);
            }
        })
    }
}
