//! How well the unknowns are known: classical, or the sandwich where weights, a robust loss or a pre-filter call for it.
//!
//! The sandwich is `A^-1 B A^-1` (Huber 1967; White 1980). `A` is the curvature of the cost, `E[psi'] sum w g g'`. `B` is
//! the covariance of the score: the sum of squares of the samples' own scores, `w psi(z) g` added up over the outputs.
//! Errors of a fit are smaller than the noise by the part of it that the fit took over, so each is divided by one less its
//! leverage (HC3: MacKinnon and White, J. Econometrics 29 (1985) 305).
//!
//! A pre-filter colors the errors. Where those before it are white, with covariance `S` between the outputs, the score is
//! theirs times the weighted slopes passed through the filter backward in time (its adjoint), from rest at the end of the
//! record to its first sample. A forward pass instead counts what happens at the begin of a record wrongly: errors of
//! initial states came out several times too large.

use super::objective::{Objective, Rows};
use crate::information::{Block, Covariance, Information};
use crate::optimize::{Infeasible, Linearization};
use crate::predict::WINDOW;
use crate::prefilter::{Butterworth, FilterState};
use nalgebra::DMatrix;

/// One less the leverage of a measurement that alone determines an unknown: its error is rounding.
const ALONE: f64 = 1e-6;

/// Bread and meat of the sandwich, one pair of triangles per experiment.
pub(super) struct Sandwich {
    bread: Linearization,
    meat: Vec<Information>,
    /// Mean of `psi'`, by which the bread is to be multiplied.
    curvature: f64,
    /// By which the meat is to be multiplied.
    meat_scale: f64,
}

/// What the first pass sums up over all measurements.
pub(super) struct Tally {
    weights: f64,
    curvature: f64,
    /// Sums of the products of two outputs' influences.
    influence: DMatrix<f64>,
    /// Sums of the variance that white noise of variance one would have.
    expected: Vec<f64>,
}

impl Objective<'_> {
    /// Whether the classical covariance would be wrong whatever the data say.
    pub(super) fn needs_sandwich(&self) -> bool {
        self.source.is_weighted() || self.prefilter.is_some() || self.is_robust()
    }

    /// Whether the loss bends the cost of large errors.
    pub(super) fn is_robust(&self) -> bool {
        self.loss.is_some_and(|loss| loss.weight(1e3) < 1.0)
    }

    /// The sandwich over all unknowns that are not held, in two more passes with slopes; `None` if it has no number.
    pub(super) fn sandwich(&self, coordinates: &[f64], held: &[bool]) -> Result<Option<Covariance>, Infeasible> {
        let (sandwich, tally) = self.without_meat(coordinates)?;
        let Some(inverse) = sandwich.bread.covariance(held) else { return Ok(None) };
        let (mut meat, meat_scale) = match self.prefilter {
            Some(filter) => self.filtered_scores(coordinates, &inverse, filter, &tally)?,
            None => (self.scores(coordinates, &inverse)?, 1.0),
        };
        for (i, slope, _) in self.unknowns.priors(coordinates) {
            let e = self.unknowns.row[i].experiment.unwrap_or(0);
            meat[e].absorb_row(&self.prior_row(e, i, slope / meat_scale.sqrt()), 0.0);
        }
        Ok(Sandwich { meat, meat_scale, ..sandwich }.covariance(held))
    }

    /// The bread for the weights and the loss of this fit, in one pass with slopes.
    pub(super) fn without_meat(&self, coordinates: &[f64]) -> Result<(Sandwich, Tally), Infeasible> {
        let (mut blocks, tally) = self.bread(coordinates)?;
        let curvature = tally.curvature / tally.weights;
        for (i, slope, _) in self.unknowns.priors(coordinates) {
            let e = self.unknowns.row[i].experiment.unwrap_or(0);
            // A prior is a measurement of unit variance; the bread is multiplied by the mean curvature later.
            blocks[e].absorb_row(&self.prior_row(e, i, slope / curvature.max(f64::MIN_POSITIVE).sqrt()), 0.0);
        }
        let bread = Linearization::new(0.0, self.unknowns.shared(), blocks);
        Ok((Sandwich { bread, meat: vec![], curvature, meat_scale: 1.0 }, tally))
    }

    /// The row of a prior on unknown `i` among the columns of experiment `e`.
    pub(super) fn prior_row(&self, e: usize, i: usize, slope: f64) -> Vec<f64> {
        self.unknowns.columns(e).map(|c| if c == i { slope } else { 0.0 }).collect()
    }

    /// The triangles of `sqrt(w) g`, and what there is to know of the errors.
    fn bread(&self, coordinates: &[f64]) -> Result<(Vec<Information>, Tally), Infeasible> {
        let outputs = self.outputs();
        let rows = outputs * WINDOW;
        let mut tally = Tally {
            weights: 0.0,
            curvature: 0.0,
            influence: DMatrix::zeros(outputs, outputs),
            expected: vec![0.0; outputs],
        };
        let mut blocks = vec![];
        for e in 0..self.experiments() {
            let columns = self.unknowns.columns(e).count();
            let (mut bread, mut block) = (Information::new(columns), Block::new(columns, rows));
            let (mut weight, mut psi) = (vec![0.0; rows], vec![0.0; rows]);
            let mut gain = self.prefilter.map(Gain::new);
            let visit = &mut |Rows { begin, samples, window }: Rows<'_>| {
                weight.fill(0.0);
                psi.fill(0.0);
                for k in 0..samples {
                    let (w, gain) = (self.source.weight(e, begin + k), gain.as_mut().map_or(1.0, Gain::next));
                    for j in (0..outputs).filter(|j| w > 0.0 && window.measured[j * WINDOW + k]) {
                        let (row, z) = (j * WINDOW + k, window.errors()[j * WINDOW + k]);
                        (weight[row], psi[row]) = (w, self.loss.map_or(z, |loss| loss.psi(z)));
                        tally.weights += w;
                        tally.curvature += w * self.loss.map_or(1.0, |loss| loss.slope(z));
                        tally.expected[j] += gain;
                    }
                }
                for (i, j) in (0..outputs).flat_map(|i| (0..outputs).map(move |j| (i, j))) {
                    let products = (0..samples).map(|k| psi[i * WINDOW + k] * psi[j * WINDOW + k]);
                    tally.influence[(i, j)] += products.sum::<f64>();
                }
                for (c, column) in window.columns_mut().take(columns).enumerate() {
                    for ((to, from), weight) in block.column_mut(c).iter_mut().zip(column).zip(&weight) {
                        *to = *from * weight.sqrt();
                    }
                }
                block.column_mut(columns).fill(0.0);
                block.set_len(rows);
                bread.absorb(&mut block);
            };
            self.walk(e, coordinates, true, visit).map_err(|_| Infeasible::Cancelled)?;
            blocks.push(bread);
        }
        Ok((blocks, tally))
    }

    /// The triangle of each experiment's scores, sample by sample.
    fn scores(&self, coordinates: &[f64], inverse: &Covariance) -> Result<Vec<Information>, Infeasible> {
        let rows = self.outputs() * WINDOW;
        let mut meat = vec![];
        for e in 0..self.experiments() {
            let inverse = self.of_experiment(inverse, e);
            let columns = inverse.nrows();
            let (mut scores, mut block) = (Information::new(columns), Block::new(columns, WINDOW));
            let mut slopes = vec![0.0; columns];
            let visit = &mut |Rows { begin, samples, window }: Rows<'_>| {
                for c in 0..=columns {
                    block.column_mut(c).fill(0.0);
                }
                let errors = window.errors().to_vec();
                let measured = window.measured.clone();
                let data = window.data_mut();
                for k in 0..samples {
                    let weight = self.source.weight(e, begin + k);
                    for row in (k..rows).step_by(WINDOW).filter(|&row| measured[row] && weight > 0.0) {
                        slopes.iter_mut().enumerate().for_each(|(c, slope)| *slope = data[c * rows + row]);
                        let z = errors[row];
                        let less = (1.0 - weight * form(&inverse, &slopes)).max(ALONE);
                        let influence = weight * self.loss.map_or(z, |loss| loss.psi(z)) / less;
                        for (c, slope) in slopes.iter().enumerate() {
                            block.column_mut(c)[k] += slope * influence;
                        }
                    }
                }
                block.set_len(samples);
                scores.absorb(&mut block);
            };
            self.walk(e, coordinates, true, visit).map_err(|_| Infeasible::Cancelled)?;
            meat.push(scores);
        }
        Ok(meat)
    }

    /// The triangle of each experiment's scores where a filter colored white errors, and the factor for all of them by
    /// which the noise is larger than the errors. Holds the slopes of one experiment at a time.
    fn filtered_scores(
        &self,
        coordinates: &[f64],
        inverse: &Covariance,
        filter: &Butterworth,
        tally: &Tally,
    ) -> Result<(Vec<Information>, f64), Infeasible> {
        let outputs = self.outputs();
        let expected = |i: usize| tally.expected[i].max(f64::MIN_POSITIVE);
        let noise =
            DMatrix::from_fn(outputs, outputs, |i, j| tally.influence[(i, j)] / (expected(i) * expected(j)).sqrt());
        let deviations = DMatrix::from_diagonal(&noise.diagonal().map(f64::sqrt));
        let factor = noise.cholesky().map_or(deviations, |cholesky| cholesky.l());
        let (mut meat, mut taken) = (vec![], 0.0);
        for e in 0..self.experiments() {
            let inverse = self.of_experiment(inverse, e);
            let (columns, samples) = (inverse.nrows(), self.source.samples(e));
            // Column by column of slopes, output by output, backward in time.
            let mut slopes = vec![0.0; columns * outputs * samples];
            let mut measured = vec![false; outputs * samples];
            let visit = &mut |Rows { begin, samples: here, window }: Rows<'_>| {
                for k in 0..here {
                    let (weight, back) = (self.source.weight(e, begin + k), samples - 1 - begin - k);
                    for j in 0..outputs {
                        measured[j * samples + back] = window.measured[j * WINDOW + k];
                        for (c, column) in window.columns_mut().take(columns).enumerate() {
                            slopes[(c * outputs + j) * samples + back] = weight * column[j * WINDOW + k];
                        }
                    }
                }
            };
            self.walk(e, coordinates, true, visit).map_err(|_| Infeasible::Cancelled)?;
            filter.filter(&mut slopes, samples, samples, &mut vec![FilterState::default(); columns * outputs]);
            let (mut scores, mut block) = (Information::new(columns), Block::new(columns, WINDOW));
            let mut score = vec![0.0; columns];
            for k in 0..samples {
                let at = |c: usize, j: usize| {
                    if measured[j * samples + k] { slopes[(c * outputs + j) * samples + k] } else { 0.0 }
                };
                for j in 0..outputs {
                    score.iter_mut().enumerate().for_each(|(c, score)| *score = at(c, j));
                    taken += form(&inverse, &score);
                    score.iter_mut().enumerate().for_each(|(c, score)| {
                        *score = (j..outputs).map(|i| factor[(i, j)] * at(c, i)).sum();
                    });
                    if !block.push(&score, 0.0) {
                        scores.absorb(&mut block);
                        let _ = block.push(&score, 0.0);
                    }
                }
            }
            scores.absorb(&mut block);
            meat.push(scores);
        }
        let expected: f64 = tally.expected.iter().sum();
        Ok((meat, expected / (expected - taken).max(f64::MIN_POSITIVE)))
    }

    /// The rows and columns of one experiment.
    fn of_experiment(&self, covariance: &Covariance, e: usize) -> DMatrix<f64> {
        let columns: Vec<usize> = self.unknowns.columns(e).collect();
        DMatrix::from(&covariance.dense(&columns))
    }
}

/// `v' m v`.
fn form(m: &DMatrix<f64>, v: &[f64]) -> f64 {
    let product =
        |(column, b): (nalgebra::DVectorView<'_, f64>, &f64)| column.iter().zip(v).map(|(m, a)| m * a).sum::<f64>() * b;
    m.column_iter().zip(v).map(product).sum()
}

/// Variance that white noise of variance one has after a filter that was at rest: the sum of the squared impulse response
/// so far.
struct Gain<'f> {
    filter: &'f Butterworth,
    state: FilterState,
    impulse: f64,
    total: f64,
}

impl<'f> Gain<'f> {
    fn new(filter: &'f Butterworth) -> Self {
        Gain { filter, state: FilterState::default(), impulse: 1.0, total: 0.0 }
    }

    fn next(&mut self) -> f64 {
        let response = self.filter.step(&mut self.state, std::mem::take(&mut self.impulse));
        self.total += response * response;
        self.total
    }
}

impl Sandwich {
    /// The bread of plain least squares, still without meat.
    pub fn plain(linear: &Linearization) -> Self {
        Sandwich { bread: linear.clone(), meat: vec![], curvature: 1.0, meat_scale: 1.0 }
    }

    /// Takes another covariance of the scores, one triangle per experiment.
    pub fn replace_meat(&mut self, meat: Vec<Information>) {
        (self.meat, self.meat_scale) = (meat, 1.0);
    }

    /// `A^-1 B A^-1` over all unknowns that are not held.
    pub fn covariance(&self, held: &[bool]) -> Option<Covariance> {
        let scale = self.meat_scale / (self.curvature * self.curvature);
        Some(self.bread.sandwich(held, &self.meat)?.times(scale))
    }
}
