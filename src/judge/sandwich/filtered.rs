//! Scores where a pre-filter correlated errors that were white before it.

use super::{Passes, ROWS, Tally, form, of_experiment};
use crate::information::{Block, Covariance, Information};
use crate::optimize::Infeasible;
use crate::prefilter::Butterworth;
use crate::problem::{Accumulate, Objective};
use crate::sweep::Window;
use nalgebra::DMatrix;

impl Passes<'_> {
    /// The triangle of each experiment's scores where a filter correlated white errors, and the factor for all of them
    /// by which the noise is larger than the errors. Holds the slopes of one experiment at a time.
    pub(super) fn filtered_scores(
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
pub(super) struct ImpulseResponse<'f> {
    filter: &'f Butterworth,
    state: Vec<f64>,
    impulse: f64,
    total: f64,
}

impl<'f> ImpulseResponse<'f> {
    pub fn new(filter: &'f Butterworth) -> Self {
        ImpulseResponse { filter, state: vec![], impulse: 1.0, total: 0.0 }
    }

    pub fn next(&mut self) -> f64 {
        let mut response = [std::mem::take(&mut self.impulse)];
        self.filter.filter_rows(&mut response, 1, &mut self.state);
        self.total += response[0] * response[0];
        self.total
    }
}

#[cfg(test)]
mod tests;
