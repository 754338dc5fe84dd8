//! The sandwich covariance, for fits with weights, a robust loss or a pre-filter.
//!
//! It is `A^-1 B A^-1` (Huber 1967; White 1980). `A` is the curvature of the cost, `E[psi'] sum w g g'`. `B` is the
//! covariance of the score: the sum of squares of the samples' own scores, `w psi(z) g` added up over the outputs.
//! What is known of single errors, and of the variance that is made of them, is in [`scores`].
//!
//! A pre-filter correlates the errors. Where those before it are white, with covariance `S` between the outputs, the
//! score is theirs times the weighted slopes passed through the filter backward in time (its adjoint), from rest at the
//! end of the record to its first sample. A forward pass instead counts what happens at the begin of a record wrongly:
//! errors of initial states came out several times too large.

mod filtered;
mod pooled;
mod scores;

use crate::information::{Block, Covariance, Information};
use crate::optimize::{Infeasible, Linearization};
use crate::problem::{Accumulate, Objective};
use crate::sweep::Window;
use filtered::ImpulseResponse;
use nalgebra::DMatrix;
use pooled::{Moments, Pooled};
use scores::Spread;

/// One less the leverage of a measurement that alone determines an unknown: its error is rounding.
pub(super) const ALONE: f64 = 1e-6;
/// Rows that are absorbed together.
const ROWS: usize = 256;

/// Curvature of the cost and triangles of the scores, a pair per experiment.
#[derive(Clone)]
pub(crate) struct Sandwich {
    bread: Linearization,
    scores: Vec<Information>,
    /// Mean of `psi'`, by which the curvature is to be multiplied.
    curvature: f64,
    /// By which the squares of the scores are to be multiplied.
    scale: f64,
}

impl Sandwich {
    /// The curvature of plain least squares, still without scores.
    pub fn plain(linear: &Linearization) -> Self {
        Sandwich { bread: linear.clone(), scores: vec![], curvature: 1.0, scale: 1.0 }
    }

    /// The same curvature, with these scores.
    pub fn with(&self, scores: Vec<Information>) -> Self {
        Sandwich { scores, scale: 1.0, ..self.clone() }
    }

    /// `A^-1 B A^-1` over all unknowns that are not held.
    pub fn covariance(&self, held: &[bool]) -> Option<Covariance> {
        let scale = self.scale / (self.curvature * self.curvature);
        Some(self.bread.sandwich(held, &self.scores)?.times(scale))
    }
}

/// What the first pass sums up over all measurements.
pub(crate) struct Tally {
    weights: f64,
    curvature: f64,
    /// Sums of the products of two outputs' influences.
    influence: DMatrix<f64>,
    /// Sums of the variance that white noise of variance one would have.
    expected: Vec<f64>,
    /// Of each output's influences.
    moments: Vec<Moments>,
}

impl Tally {
    fn new(outputs: usize) -> Self {
        Tally {
            weights: 0.0,
            curvature: 0.0,
            influence: DMatrix::zeros(outputs, outputs),
            expected: vec![0.0; outputs],
            moments: vec![Moments::default(); outputs],
        }
    }

    fn add(&mut self, other: Tally) {
        self.weights += other.weights;
        self.curvature += other.curvature;
        self.influence += other.influence;
        self.expected.iter_mut().zip(other.expected).for_each(|(sum, other)| *sum += other);
        self.moments.iter_mut().zip(other.moments).for_each(|(sum, other)| sum.add(other));
    }
}

/// Whether the settings make the classical covariance wrong, independent of the data.
pub(crate) fn is_needed(objective: &Objective<'_>) -> bool {
    objective.is_weighted() || objective.problem.settings.prefilter.is_some() || objective.is_robust()
}

/// A sandwich, and the degrees of freedom of the variance of each unknown as far as they are known: infinite otherwise.
pub(crate) struct Judged {
    pub covariance: Covariance,
    pub degrees: Vec<f64>,
}

/// The sandwich over all unknowns that are not held, in two more passes with slopes; `None` if it has no number.
pub(crate) fn sandwich(
    objective: &Objective<'_>,
    coordinates: &[f64],
    held: &[bool],
) -> Result<Option<Judged>, Infeasible> {
    Passes { objective, coordinates }.sandwich(held)
}

/// The curvature for the weights and the loss of a fit, in one pass with slopes; its scores are still missing.
pub(crate) fn curvature(objective: &Objective<'_>, coordinates: &[f64]) -> Result<Sandwich, Infeasible> {
    Ok(Passes { objective, coordinates }.without_scores()?.0)
}

/// The row of a prior on unknown `i` among the columns of experiment `e`.
pub(crate) fn prior_row(objective: &Objective<'_>, e: usize, i: usize, slope: f64) -> Vec<f64> {
    objective.problem.unknowns.columns(e).map(|c| if c == i { slope } else { 0.0 }).collect()
}

/// The rows and columns of one experiment.
pub(super) fn of_experiment(objective: &Objective<'_>, covariance: &Covariance, e: usize) -> DMatrix<f64> {
    let columns: Vec<usize> = objective.problem.unknowns.columns(e).collect();
    DMatrix::from(&covariance.dense(&columns))
}

/// Passes over the data at a point.
struct Passes<'p> {
    objective: &'p Objective<'p>,
    coordinates: &'p [f64],
}

impl Passes<'_> {
    fn sandwich(&self, held: &[bool]) -> Result<Option<Judged>, Infeasible> {
        let (sandwich, tally) = self.without_scores()?;
        let Some(inverse) = sandwich.bread.covariance(held) else { return Ok(None) };
        let unknowns = &self.objective.problem.unknowns;
        let mut spread = vec![Spread::default(); unknowns.row.len()];
        let (mut scores, scale) = match &self.objective.problem.settings.prefilter {
            Some(filter) => self.filtered_scores(&inverse, filter, &tally)?,
            None => {
                let estimated = held.iter().filter(|held| !**held).count();
                (self.scores(&inverse, &Pooled::of(&tally, estimated), &mut spread)?, 1.0)
            }
        };
        for (i, slope, _) in unknowns.priors(self.coordinates) {
            let e = unknowns.row[i].experiment.unwrap_or(0);
            scores[e].absorb_row(&prior_row(self.objective, e, i, slope / scale.sqrt()), 0.0);
        }
        let covariance = Sandwich { scores, scale, ..sandwich }.covariance(held);
        let degrees = spread.iter().map(Spread::degrees).collect();
        Ok(covariance.map(|covariance| Judged { covariance, degrees }))
    }

    /// The curvature for the weights and the loss of this fit, in one pass with slopes; its scores are still missing.
    fn without_scores(&self) -> Result<(Sandwich, Tally), Infeasible> {
        let outputs = self.objective.outputs();
        let make = |experiment: usize| {
            let columns = self.objective.problem.unknowns.columns(experiment).count();
            let tally = Tally::new(outputs);
            let (bread, block) = (Information::new(columns), Block::new(columns, ROWS));
            let impulse = self.objective.problem.settings.prefilter.as_ref().map(ImpulseResponse::new);
            Curvature { objective: self.objective, experiment, tally, bread, block, impulse, row: vec![0.0; columns] }
        };
        let all = self.objective.gather(self.coordinates, true, make)?;
        let mut tally = Tally::new(outputs);
        let mut blocks = Vec::with_capacity(all.len());
        for mut one in all {
            one.bread.absorb(&mut one.block);
            blocks.push(one.bread);
            tally.add(one.tally);
        }
        let curvature = tally.curvature / tally.weights;
        for (i, slope, _) in self.objective.problem.unknowns.priors(self.coordinates) {
            let e = self.objective.problem.unknowns.row[i].experiment.unwrap_or(0);
            // A prior is a measurement of unit variance; the bread is multiplied by the mean curvature later.
            blocks[e]
                .absorb_row(&prior_row(self.objective, e, i, slope / curvature.max(f64::MIN_POSITIVE).sqrt()), 0.0);
        }
        let bread = Linearization::new(0.0, self.objective.problem.unknowns.shared(), blocks);
        Ok((Sandwich { bread, scores: vec![], curvature, scale: 1.0 }, tally))
    }
}

/// The triangle of `sqrt(w) g`, and sums of the errors.
struct Curvature<'c> {
    objective: &'c Objective<'c>,
    experiment: usize,
    tally: Tally,
    bread: Information,
    block: Block,
    impulse: Option<ImpulseResponse<'c>>,
    row: Vec<f64>,
}

impl Accumulate for Curvature<'_> {
    fn add(&mut self, window: &Window, lane: usize) {
        let (outputs, lanes) = (window.outputs(), window.lanes());
        let loss = self.objective.loss();
        let mut psi = vec![0.0; outputs];
        for k in 0..window.samples[lane] {
            let w = self.objective.weight(self.experiment, window.begin[lane] + k);
            let expected = self.impulse.as_mut().map_or(1.0, ImpulseResponse::next);
            psi.fill(0.0);
            for j in (0..outputs).filter(|&j| w > 0.0 && window.is_measured(k, j, lane)) {
                let z = window.error(k, j, lane);
                psi[j] = loss.map_or(z, |loss| loss.psi(z));
                self.tally.weights += w;
                self.tally.curvature += w * loss.map_or(1.0, |loss| loss.slope(z));
                self.tally.expected[j] += expected;
                self.tally.moments[j].take(psi[j], w);
                let values = window.row(k, j).iter().skip(lane).step_by(lanes);
                self.row.iter_mut().zip(values).for_each(|(to, from)| *to = from * w.sqrt());
                self.bread.gather(&mut self.block, &self.row, 0.0);
            }
            for (i, j) in (0..outputs).flat_map(|i| (0..outputs).map(move |j| (i, j))) {
                self.tally.influence[(i, j)] += psi[i] * psi[j];
            }
        }
    }

    fn append(&mut self, mut later: Self) {
        later.bread.absorb(&mut later.block);
        self.bread.absorb(&mut self.block);
        self.bread.merge(&later.bread);
        self.tally.add(later.tally);
    }
}

/// `v' m v`.
pub(super) fn form(m: &DMatrix<f64>, v: &[f64]) -> f64 {
    let product =
        |(column, b): (nalgebra::DVectorView<'_, f64>, &f64)| column.iter().zip(v).map(|(m, a)| m * a).sum::<f64>() * b;
    m.column_iter().zip(v).map(product).sum()
}
