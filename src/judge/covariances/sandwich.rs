//! The sandwich covariance, for fits with weights, a robust loss or a pre-filter.
//!
//! It is `A^-1 B A^-1` (Huber 1967; White 1980). `A` is the curvature of the cost, `E[psi'] sum w g g'`. `B` is the
//! covariance of the score: the sum of squares of the samples' own scores, `w psi(z) g` added up over the outputs.
//! Errors of a fit are smaller than the noise by the part of it that the fit took over, so each is divided by one less
//! its leverage (HC3: MacKinnon and White, J. Econometrics 29 (1985) 305), and what this leaves out is added ([`scores`]).
//!
//! A pre-filter correlates the errors. Where those before it are white, with covariance `S` between the outputs, the
//! score is theirs times the weighted slopes passed through the filter backward in time (its adjoint), from rest at the
//! end of the record to its first sample. A forward pass instead counts what happens at the begin of a record wrongly:
//! errors of initial states came out several times too large.

mod scores;

use crate::information::{Block, Covariance, Information};
use crate::judge::evidence::shares::{self, Largest, Shares};
use crate::judge::leverage::{form, of_experiment, prior_row};
use crate::optimize::{Infeasible, Linearization};
use crate::prefilter::Butterworth;
use crate::problem::{Accumulate, Objective};
use crate::sweep::Window;
use nalgebra::DMatrix;
use scores::Scores;

/// Rows that are absorbed together.
const ROWS: usize = 256;

/// A sandwich covariance.
pub(crate) struct Robust {
    /// `None` if it has no number.
    pub covariance: Option<Covariance>,
    /// The largest shares in the variances, which a pre-filter has none of.
    pub shares: Option<Vec<Largest>>,
    /// Degrees of freedom of the variance of each unknown, infinite where they are not examined.
    pub degrees: Vec<f64>,
}

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

    /// The curvature without the mean curvature of the loss, and that.
    pub fn bread(self) -> (Linearization, f64) {
        (self.bread, self.curvature)
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
    /// Sum of the squared influences times their weights, and their number.
    squares: f64,
    count: f64,
}

impl Tally {
    fn new(outputs: usize) -> Self {
        Tally {
            weights: 0.0,
            curvature: 0.0,
            influence: DMatrix::zeros(outputs, outputs),
            expected: vec![0.0; outputs],
            squares: 0.0,
            count: 0.0,
        }
    }

    fn add(&mut self, other: Tally) {
        self.weights += other.weights;
        self.curvature += other.curvature;
        self.influence += other.influence;
        self.expected.iter_mut().zip(other.expected).for_each(|(sum, other)| *sum += other);
        self.squares += other.squares;
        self.count += other.count;
    }

    /// The variance of errors times the roots of their weights, by their influences.
    fn noise(&self) -> f64 {
        self.squares / self.count.max(1.0) * (self.weights / self.curvature).powi(2)
    }
}

/// The sandwich over all unknowns that are not held, in two more passes with slopes.
pub(crate) fn sandwich(objective: &Objective<'_>, coordinates: &[f64], held: &[bool]) -> Result<Robust, Infeasible> {
    Passes { objective, coordinates }.sandwich(held)
}

/// The curvature for the weights and the loss of a fit, in one pass with slopes; its scores are still missing.
pub(crate) fn curvature(objective: &Objective<'_>, coordinates: &[f64]) -> Result<Sandwich, Infeasible> {
    Ok(Passes { objective, coordinates }.without_scores()?.0)
}

/// Passes over the data at a point.
struct Passes<'p> {
    objective: &'p Objective<'p>,
    coordinates: &'p [f64],
}

impl Passes<'_> {
    fn sandwich(&self, held: &[bool]) -> Result<Robust, Infeasible> {
        let (sandwich, tally) = self.without_scores()?;
        let degrees = vec![f64::INFINITY; held.len()];
        let Some(inverse) = sandwich.bread.covariance(held) else {
            return Ok(Robust { covariance: None, shares: None, degrees });
        };
        let (mut scores, scale, shares, degrees) = match &self.objective.problem.settings.prefilter {
            Some(filter) => {
                let (scores, scale) = self.filtered_scores(&inverse, filter, &tally)?;
                (scores, scale, None, degrees)
            }
            None => {
                let all = self.scores(&inverse, tally.noise())?;
                let largest = shares::of_all(self.objective, all.iter().map(|one| &one.shares));
                let degrees = scores::degrees(self.objective, &all);
                (all.into_iter().map(|one| one.scores).collect(), 1.0, Some(largest), degrees)
            }
        };
        for (i, slope, _) in self.objective.problem.unknowns.priors(self.coordinates) {
            let e = self.objective.problem.unknowns.row[i].experiment.unwrap_or(0);
            scores[e].absorb_row(&prior_row(self.objective, e, i, slope / scale.sqrt()), 0.0);
        }
        let covariance = Sandwich { scores, scale, ..sandwich }.covariance(held);
        Ok(Robust { covariance, shares, degrees })
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

    /// The scores of each experiment, with the variance of all errors.
    fn scores(&self, inverse: &Covariance, noise: f64) -> Result<Vec<Scores<'_>>, Infeasible> {
        let make = |experiment: usize| {
            let shares = Shares::new(experiment, of_experiment(self.objective, inverse, experiment));
            Scores::new(self.objective, experiment, shares, noise)
        };
        let mut all = self.objective.gather(self.coordinates, true, make)?;
        all.iter_mut().for_each(Scores::complete);
        Ok(all)
    }

    /// The triangle of each experiment's scores where a filter correlated white errors, and the factor for all of them
    /// by which the noise is larger than the errors. Holds the slopes of one experiment at a time.
    fn filtered_scores(
        &self,
        inverse: &Covariance,
        filter: &Butterworth,
        tally: &Tally,
    ) -> Result<(Vec<Information>, f64), Infeasible> {
        let expected = |i: usize| tally.expected[i].max(f64::MIN_POSITIVE);
        let outputs = self.objective.outputs();
        let noise =
            DMatrix::from_fn(outputs, outputs, |i, j| tally.influence[(i, j)] / (expected(i) * expected(j)).sqrt());
        let deviations = DMatrix::from_diagonal(&noise.diagonal().map(f64::sqrt));
        let factor = noise.cholesky().map_or(deviations, |cholesky| cholesky.l());
        let make = |experiment: usize| {
            let columns = self.objective.problem.unknowns.columns(experiment).count();
            let samples = self.objective.problem.records[experiment].len();
            Backward {
                objective: self.objective,
                experiment,
                columns,
                samples,
                slopes: vec![0.0; columns * outputs * samples],
                measured: vec![false; outputs * samples],
            }
        };
        let (mut scores, mut taken) = (vec![], 0.0);
        for e in 0..self.objective.experiments() {
            let mut gathered = self.objective.gather_one(self.coordinates, e, true, || make(e))?;
            let (triangle, part) =
                gathered.scores(filter, &factor, &of_experiment(self.objective, inverse, e), outputs);
            scores.push(triangle);
            taken += part;
        }
        let expected: f64 = tally.expected.iter().sum();
        Ok((scores, expected / (expected - taken).max(f64::MIN_POSITIVE)))
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
                self.tally.squares += w * psi[j] * psi[j];
                self.tally.count += 1.0;
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

/// The weighted slopes of an experiment backward in time: sample by sample, column by column, output by output.
struct Backward<'b> {
    objective: &'b Objective<'b>,
    experiment: usize,
    columns: usize,
    samples: usize,
    slopes: Vec<f64>,
    measured: Vec<bool>,
}

impl Accumulate for Backward<'_> {
    fn add(&mut self, window: &Window, lane: usize) {
        let (outputs, samples) = (window.outputs(), self.samples);
        for k in 0..window.samples[lane] {
            let sample = window.begin[lane] + k;
            let (weight, back) = (self.objective.weight(self.experiment, sample), samples - 1 - sample);
            for j in 0..outputs {
                self.measured[j * samples + back] = window.is_measured(k, j, lane);
                for c in 0..self.columns {
                    self.slopes[(back * self.columns + c) * outputs + j] = weight * window.at(k, j, c, lane);
                }
            }
        }
    }

    fn append(&mut self, later: Self) {
        self.slopes.iter_mut().zip(later.slopes).for_each(|(slope, later)| *slope += later);
        self.measured.iter_mut().zip(later.measured).for_each(|(measured, later)| *measured |= later);
    }
}

impl Backward<'_> {
    /// The triangle of the scores, and the sum of the leverages.
    fn scores(
        &mut self,
        filter: &Butterworth,
        factor: &DMatrix<f64>,
        inverse: &DMatrix<f64>,
        outputs: usize,
    ) -> (Information, f64) {
        let Backward { columns, samples, slopes, measured, .. } = self;
        let (columns, samples) = (*columns, *samples);
        filter.filter_rows(slopes, columns * outputs, &mut vec![]);
        let (mut scores, mut block) = (Information::new(columns), Block::new(columns, ROWS));
        let (mut score, mut taken) = (vec![0.0; columns], 0.0);
        for k in 0..samples {
            let at = |c: usize, j: usize| {
                if measured[j * samples + k] { slopes[(k * columns + c) * outputs + j] } else { 0.0 }
            };
            for j in 0..outputs {
                score.iter_mut().enumerate().for_each(|(c, score)| *score = at(c, j));
                taken += form(inverse, &score);
                score.iter_mut().enumerate().for_each(|(c, score)| {
                    *score = (j..outputs).map(|i| factor[(i, j)] * at(c, i)).sum();
                });
                scores.gather(&mut block, &score, 0.0);
            }
        }
        scores.absorb(&mut block);
        (scores, taken)
    }
}

/// Variance that white noise of variance one has after a filter that was at rest: the sum of the squared impulse
/// response so far.
struct ImpulseResponse<'f> {
    filter: &'f Butterworth,
    state: Vec<f64>,
    impulse: f64,
    total: f64,
}

impl<'f> ImpulseResponse<'f> {
    fn new(filter: &'f Butterworth) -> Self {
        ImpulseResponse { filter, state: vec![], impulse: 1.0, total: 0.0 }
    }

    fn next(&mut self) -> f64 {
        let mut response = [std::mem::take(&mut self.impulse)];
        self.filter.filter_rows(&mut response, 1, &mut self.state);
        self.total += response[0] * response[0];
        self.total
    }
}

#[cfg(test)]
mod tests;
