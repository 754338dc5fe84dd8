//! Scores of independent errors, and how well the variances that they make are known.
//!
//! An error of a fit is smaller than the noise by the part of it that the fit took over, so each is divided by one less its
//! leverage (HC3: MacKinnon and White, J. Econometrics 29 (1985) 305). The variance that comes out for an unknown is made of
//! few squares where few measurements determine it, so intervals take Student's t with as many degrees of freedom as it would
//! have with noise of one size (Bell and McCaffrey, Survey Methodology 28 (2002) 169; Imbens and Kolesar, Review of Economics
//! and Statistics 98 (2016) 701).
//!
//! Of a measurement that determines an unknown almost alone, as the first of a record does an initial state, nothing is left in
//! the error. Beyond a leverage of a quarter the noise that all measurements tell of takes the place of its square, more and more.

use super::pooled::Pooled;
use super::{ALONE, Passes, ROWS, of_experiment};
use crate::information::{Block, Covariance, Information};
use crate::optimize::Infeasible;
use crate::problem::{Accumulate, Objective};
use crate::sweep::Window;
use nalgebra::DMatrix;

/// Leverage up to which the square of an error alone says how large the noise is.
const OWN: f64 = 0.25;
/// The power by which it counts less beyond: with 4 a variance of two measurements has 25 degrees of freedom.
const FADES: i32 = 4;

impl Passes<'_> {
    /// The triangle of each experiment's scores, sample by sample; adds up the `spread` of the variance of each unknown.
    pub(super) fn scores(
        &self,
        inverse: &Covariance,
        pooled: &Pooled,
        spread: &mut [Spread],
    ) -> Result<Vec<Information>, Infeasible> {
        let make = |experiment: usize| {
            let inverse = of_experiment(self.objective, inverse, experiment);
            let columns = inverse.nrows();
            Scores {
                objective: self.objective,
                experiment,
                inverse,
                pooled,
                triangle: Information::new(columns),
                block: Block::new(columns, ROWS),
                spread: vec![Spread::default(); columns],
                rows: DMatrix::zeros(columns, self.objective.outputs()),
                row: vec![0.0; columns],
            }
        };
        let all = self.objective.gather(self.coordinates, true, make)?;
        let absorbed = |(e, mut one): (usize, Scores<'_>)| {
            one.triangle.absorb(&mut one.block);
            for (i, own) in self.objective.problem.unknowns.columns(e).zip(&one.spread) {
                spread[i].add(own);
            }
            one.triangle
        };
        Ok(all.into_iter().enumerate().map(absorbed).collect())
    }
}

/// Sums of the parts that measurements have in the variance of an unknown, and of the variances of these parts.
#[derive(Clone, Copy, Default)]
pub(super) struct Spread {
    variance: f64,
    spread: f64,
}

impl Spread {
    /// Takes the part `variance` of a measurement with this leverage, of which its own error makes up the share `own`. Squares of
    /// errors that share a leverage are correlated, which raises their variance as division by one less the leverage does.
    fn take(&mut self, variance: f64, own: f64, leverage: f64) {
        let own = own * variance;
        self.add(&Spread { variance, spread: 2.0 * own * own / (1.0 - leverage).max(ALONE) });
    }

    fn add(&mut self, other: &Spread) {
        self.variance += other.variance;
        self.spread += other.spread;
    }

    /// Satterthwaite's degrees of freedom; infinite where no error has a share.
    pub fn degrees(&self) -> f64 {
        if self.spread > 0.0 { 2.0 * self.variance * self.variance / self.spread } else { f64::INFINITY }
    }
}

/// The share that a measurement's own error has in what is said of its noise.
fn own(leverage: f64) -> f64 {
    ((1.0 - leverage).max(0.0) / (1.0 - OWN)).min(1.0).powi(FADES)
}

/// The triangle of the scores.
struct Scores<'s> {
    objective: &'s Objective<'s>,
    experiment: usize,
    inverse: DMatrix<f64>,
    pooled: &'s Pooled,
    triangle: Information,
    block: Block,
    spread: Vec<Spread>,
    /// Weighted slopes times the noise that is not an error's own, output by output.
    rows: DMatrix<f64>,
    row: Vec<f64>,
}

impl Scores<'_> {
    /// Absorbs the scores of the noise that is not the errors' own, which is correlated between the outputs.
    fn absorb_pooled(&mut self) {
        let rows = &self.rows * &self.pooled.factor;
        for row in rows.column_iter() {
            row.iter().zip(&mut self.row).for_each(|(from, to)| *to = *from);
            self.triangle.gather(&mut self.block, &self.row, 0.0);
        }
        self.rows.fill(0.0);
    }
}

impl Accumulate for Scores<'_> {
    fn add(&mut self, window: &Window, lane: usize) {
        let (lanes, loss) = (window.lanes(), self.objective.loss());
        let (mut slopes, mut moved) = (vec![0.0; self.row.len()], vec![0.0; self.row.len()]);
        for k in 0..window.samples[lane] {
            let weight = self.objective.weight(self.experiment, window.begin[lane] + k);
            let mut row = std::mem::take(&mut self.row);
            row.fill(0.0);
            let mut shared = false;
            for j in (0..window.outputs()).filter(|&j| weight > 0.0 && window.is_measured(k, j, lane)) {
                let values = window.row(k, j).iter().skip(lane).step_by(lanes);
                slopes.iter_mut().zip(values).for_each(|(to, from)| *to = *from);
                for (moved, column) in moved.iter_mut().zip(self.inverse.column_iter()) {
                    *moved = weight * column.iter().zip(&slopes).map(|(a, b)| a * b).sum::<f64>();
                }
                let leverage: f64 = moved.iter().zip(&slopes).map(|(a, b)| a * b).sum();
                let (own, noise) = (own(leverage), self.pooled.variance(j, weight));
                let z = window.error(k, j, lane);
                let influence = weight * loss.map_or(z, |loss| loss.psi(z)) * own.sqrt() / (1.0 - leverage).max(ALONE);
                row.iter_mut().zip(&slopes).for_each(|(row, slope)| *row += slope * influence);
                for (spread, moved) in self.spread.iter_mut().zip(&moved) {
                    spread.take(moved * moved * noise, own, leverage);
                }
                if own < 1.0 {
                    shared = true;
                    let rest = weight * (noise * (1.0 - own)).sqrt();
                    self.rows.column_mut(j).iter_mut().zip(&slopes).for_each(|(to, slope)| *to = rest * slope);
                }
            }
            self.row = row;
            self.triangle.gather(&mut self.block, &self.row, 0.0);
            if shared {
                self.absorb_pooled();
            }
        }
    }

    fn append(&mut self, mut later: Self) {
        later.triangle.absorb(&mut later.block);
        self.triangle.absorb(&mut self.block);
        self.triangle.merge(&later.triangle);
        self.spread.iter_mut().zip(&later.spread).for_each(|(spread, later)| spread.add(later));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The mean of `n` measurements has leverages `1 / n` and `n - 1` degrees of freedom; where a quarter of each part is of the own
    /// errors, sixteen times as many.
    #[test]
    fn degrees_of_a_mean() {
        for n in [4, 10] {
            let of = |own: f64| {
                let mut spread = Spread::default();
                (0..n).for_each(|_| spread.take(3.0, own, 1.0 / f64::from(n)));
                spread.degrees()
            };
            assert!((of(1.0) - f64::from(n - 1)).abs() < 1e-12);
            assert!((of(0.25) - 16.0 * f64::from(n - 1)).abs() < 1e-10);
            assert_eq!(of(0.0), f64::INFINITY);
        }
    }

    #[test]
    fn an_error_of_much_leverage_tells_little() {
        assert_eq!([0.0, 0.25, 0.625, 1.0, 1.0 + 1e-15].map(own), [1.0, 1.0, 0.0625, 0.0, 0.0]);
    }
}
