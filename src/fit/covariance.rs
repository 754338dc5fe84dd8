//! How well the unknowns are known: classical, or the sandwich where weights, a robust loss or a pre-filter call for it.
//!
//! The sandwich is `A^-1 B A^-1` (Huber 1967; White 1980). `A` is the curvature of the cost, `E[psi'] sum w g g'`. `B` is
//! the covariance of the score: the sum of squares of the samples' own scores, `w psi(z) g` added up over the outputs.
//! A pre-filter colors the errors; where those before it are white, their scores are the slopes filtered once more (the
//! filter's adjoint, which a causal pass equals but for the ends of the record).

use super::objective::{Objective, Rows};
use crate::information::{Block, Information, SquareMatrix};
use crate::integrate::Integrator;
use crate::model::Model;
use crate::optimize::{Infeasible, Linearization};
use crate::predict::{Predictor, WINDOW};
use crate::prefilter::FilterState;
use crate::signals::Signals;
use nalgebra::DMatrix;

/// Bread and meat of the sandwich, one pair of triangles per experiment.
pub(super) struct Sandwich {
    bread: Linearization,
    meat: Vec<Information>,
    /// Mean of `psi'`, by which the bread is to be multiplied.
    curvature: f64,
    /// By which the meat is to be multiplied.
    meat_scale: f64,
}

impl<M: Model, I: Integrator<M>, P: Predictor<M>> Objective<'_, M, I, P> {
    /// Whether the classical covariance would be wrong whatever the data say.
    pub(super) fn needs_sandwich(&self) -> bool {
        self.weighting.is_some() || self.prefilter.is_some() || self.loss.is_some_and(|loss| loss.weight(1e3) < 1.0)
    }

    /// One more pass with slopes.
    pub(super) fn sandwich(&self, coordinates: &[f64]) -> Result<Sandwich, Infeasible> {
        let (mut blocks, mut meat) = (vec![], vec![]);
        let (mut weights, mut curvature) = (0.0, 0.0);
        let (mut influence, mut count) = (0.0, 0.0);
        for e in 0..self.experiments.len() {
            let columns = self.unknowns.columns(e).count();
            let rows = M::Output::LEN * WINDOW;
            let (mut bread, mut scores) = (Information::new(columns), Information::new(columns));
            let mut block = Block::new(columns, rows);
            let mut again = vec![FilterState::default(); columns * M::Output::LEN];
            let mut scratch = vec![0.0; columns * rows];
            let visit = &mut |Rows { begin, samples, window }: Rows<'_>| {
                let errors = window.errors().to_vec();
                let mut weight = vec![0.0; rows];
                for (row, &z) in errors.iter().enumerate() {
                    if window.measured[row] && row % WINDOW < samples {
                        weight[row] = self.sample_weight(e, begin + row % WINDOW);
                        let psi = self.loss.map_or(z, |loss| loss.psi(z));
                        weights += weight[row];
                        curvature += weight[row] * self.loss.map_or(1.0, |loss| loss.slope(z));
                        if weight[row] > 0.0 {
                            influence += psi * psi;
                            count += 1.0;
                        }
                    }
                }
                for (c, column) in window.columns_mut().take(columns).enumerate() {
                    for ((to, from), weight) in block.column_mut(c).iter_mut().zip(&*column).zip(&weight) {
                        *to = *from * weight.sqrt();
                    }
                    for ((to, from), weight) in scratch[c * rows..].iter_mut().zip(column).zip(&weight) {
                        *to = *from * weight;
                    }
                }
                block.column_mut(columns).fill(0.0);
                block.set_len(rows);
                bread.absorb(&mut block);
                match self.prefilter {
                    Some(filter) => {
                        filter.filter(&mut scratch, WINDOW, samples, &mut again);
                        for c in 0..columns {
                            block.column_mut(c).copy_from_slice(&scratch[c * rows..(c + 1) * rows]);
                        }
                        block.set_len(rows);
                    }
                    None => {
                        for c in 0..columns {
                            let column = block.column_mut(c);
                            for k in 0..WINDOW {
                                column[k] = (k..rows)
                                    .step_by(WINDOW)
                                    .map(|row| {
                                        let z = errors[row];
                                        scratch[c * rows + row] * self.loss.map_or(z, |loss| loss.psi(z))
                                    })
                                    .sum();
                            }
                        }
                        block.set_len(WINDOW);
                    }
                }
                scores.absorb(&mut block);
            };
            self.walk(e, coordinates, true, visit).map_err(|_| Infeasible::Cancelled)?;
            blocks.push(bread);
            meat.push(scores);
        }
        for (i, slope, _) in self.unknowns.priors(coordinates) {
            let e = self.unknowns.row[i].experiment.unwrap_or(0);
            let unit = |value: f64| -> Vec<f64> {
                self.unknowns.columns(e).map(|c| if c == i { value } else { 0.0 }).collect()
            };
            // A prior is a measurement of unit variance; the bread is multiplied by the mean curvature later.
            blocks[e].absorb_row(&unit(slope / (curvature / weights).max(f64::MIN_POSITIVE).sqrt()), 0.0);
            meat[e].absorb_row(&unit(slope), 0.0);
        }
        let meat_scale = match self.prefilter {
            // Variance of the white errors behind the filtered ones.
            Some(filter) => influence / f64::max(count, 1.0) / power_gain(filter),
            None => 1.0,
        };
        let bread = Linearization::new(0.0, self.unknowns.shared(), blocks);
        Ok(Sandwich { bread, meat, curvature: curvature / weights, meat_scale })
    }
}

/// Sum of the squared impulse response: by how much a filter changes the variance of white noise.
fn power_gain(filter: &crate::prefilter::Butterworth) -> f64 {
    let mut state = FilterState::<f64>::default();
    let (mut total, mut recent) = (0.0, 0.0f64);
    for k in 0..10_000_000u32 {
        let y = filter.step(&mut state, if k == 0 { 1.0 } else { 0.0 });
        total += y * y;
        recent = recent.max(y.abs());
        if k % 4096 == 4095 {
            if recent * recent <= 1e-16 * total {
                break;
            }
            recent = 0.0;
        }
    }
    total
}

/// The inverse of an arrow-shaped triangle, applied column by column: for each block the map from its score to its own
/// step and to the shared one.
struct Inverse {
    /// `(R_ll^-1, R_ll^-1 R_lg)` of each block and the unknowns behind its columns.
    own: Vec<(DMatrix<f64>, DMatrix<f64>, Vec<usize>)>,
    shared: Vec<usize>,
    /// Inverse of the triangle of the shared unknowns.
    total: DMatrix<f64>,
}

fn invert(linear: &Linearization, held: &[bool]) -> Option<Inverse> {
    let (total, shared, blocks) = linear.reduce(&vec![0.0; held.len()], held);
    let triangle = |information: &Information, from: usize, rows: usize, columns: usize| {
        DMatrix::from_fn(rows, columns, |i, j| information.at(i, from + j))
    };
    let inverse = |matrix: DMatrix<f64>| {
        let n = matrix.nrows();
        let solved = matrix.solve_upper_triangular(&DMatrix::identity(n, n))?;
        solved.iter().all(|v| v.is_finite()).then_some(solved)
    };
    let total = inverse(triangle(&total, 0, shared.len(), shared.len()))?;
    let mut own = vec![];
    for (block, unknowns) in blocks {
        let n = unknowns.len() - shared.len();
        let r = inverse(triangle(&block, 0, n, n))?;
        let k = &r * triangle(&block, n, n, shared.len());
        own.push((r, k, unknowns));
    }
    Some(Inverse { own, shared, total })
}

/// `(sum of squares)^-1` over all unknowns that are not held; zero in the rows and columns of those.
pub(crate) fn classical(linear: &Linearization, held: &[bool]) -> Option<SquareMatrix> {
    let Inverse { own, shared, total } = invert(linear, held)?;
    let mut covariance = SquareMatrix::zeros(held.len());
    let cgg = &total * total.transpose();
    place(&mut covariance, &cgg, &shared, &shared);
    let cross: Vec<_> = own.iter().map(|(_, k, _)| k * &cgg).collect();
    for (e, (r, _, unknowns)) in own.iter().enumerate() {
        let mine = &unknowns[..r.nrows()];
        place_both(&mut covariance, &(-&cross[e]), mine, &shared);
        for (f, (_, other, theirs)) in own.iter().enumerate().skip(e) {
            let mut c = &cross[e] * other.transpose();
            if e == f {
                c += r * r.transpose();
            }
            place_both(&mut covariance, &c, mine, &theirs[..other.nrows()]);
        }
    }
    Some(covariance)
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
    pub fn covariance(&self, held: &[bool]) -> Option<SquareMatrix> {
        let Inverse { own, shared, total } = invert(&self.bread, held)?;
        let (g, mut covariance) = (shared.len(), SquareMatrix::zeros(held.len()));
        let hessian = &total * total.transpose();
        // Each block's scores, each a row of its meat, as influences on (own, shared); summed squares per block.
        let mut blocks = vec![];
        let mut shared_covariance = DMatrix::zeros(g, g);
        for ((r, k, unknowns), (meat, (_, columns))) in own.iter().zip(self.meat.iter().zip(self.bread.columns())) {
            let kept: Vec<usize> = unknowns.iter().filter_map(|u| columns.iter().position(|c| c == u)).collect();
            let scores = DMatrix::from_fn(meat.columns(), kept.len(), |i, c| meat.at(i, kept[c]));
            let n = r.nrows();
            let (own_scores, shared_scores) = (scores.columns(0, n), scores.columns(n, g));
            let on_shared = (shared_scores - own_scores * k) * &hessian;
            let on_own = own_scores * (r * r.transpose()) - &on_shared * k.transpose();
            shared_covariance += on_shared.transpose() * &on_shared;
            blocks.push((on_own, on_shared));
        }
        place(&mut covariance, &shared_covariance, &shared, &shared);
        for (e, ((r, k, unknowns), (on_own, on_shared))) in own.iter().zip(&blocks).enumerate() {
            let mine = &unknowns[..r.nrows()];
            // What the other blocks' scores do to this block's own unknowns goes through the shared ones.
            let others = &shared_covariance - on_shared.transpose() * on_shared;
            let with_shared = on_own.transpose() * on_shared - k * &others;
            place_both(&mut covariance, &with_shared, mine, &shared);
            let own_covariance = on_own.transpose() * on_own + k * &others * k.transpose();
            place(&mut covariance, &own_covariance, mine, mine);
            for ((_, other, theirs), (their_own, their_shared)) in own.iter().zip(&blocks).skip(e + 1) {
                let rest = &others - their_shared.transpose() * their_shared;
                let c = -(on_own.transpose() * on_shared) * other.transpose()
                    - k * (their_shared.transpose() * their_own)
                    + k * rest * other.transpose();
                place_both(&mut covariance, &c, mine, &theirs[..other.nrows()]);
            }
        }
        let scale = self.meat_scale / (self.curvature * self.curvature);
        let n = covariance.size();
        let scaled = SquareMatrix::from_fn(n, |i, j| covariance[(i, j)] * scale);
        scaled.diagonal().iter().all(|v| v.is_finite()).then_some(scaled)
    }
}

fn place(into: &mut SquareMatrix, part: &DMatrix<f64>, rows: &[usize], columns: &[usize]) {
    for (a, &i) in rows.iter().enumerate() {
        for (b, &j) in columns.iter().enumerate() {
            into[(i, j)] = part[(a, b)];
        }
    }
}

fn place_both(into: &mut SquareMatrix, part: &DMatrix<f64>, rows: &[usize], columns: &[usize]) {
    place(into, part, rows, columns);
    place(into, &part.transpose(), columns, rows);
}
