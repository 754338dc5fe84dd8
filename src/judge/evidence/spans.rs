//! The rows of each record in parts of equal length, output by output.

use crate::information::{Block, Information};
use crate::judge::point::Point;
use crate::problem::{Accumulate, Objective};
use crate::sweep::Window;
use statrs::distribution::{ContinuousCDF, FisherSnedecor};
use std::f64::consts::FRAC_1_SQRT_2;

/// Level of the test.
pub(crate) const LEVEL: f64 = 1e-4;
/// A pivot below this part of its column is rounding.
const ROUNDING: f64 = 1e-11;
/// Spans of equal length of each record.
pub(crate) const SPANS: usize = 16;
/// Rows that are absorbed together.
const ROWS: usize = 64;

/// The triangles of one experiment: output by output, each of the parts of equal length.
pub(crate) struct Spans {
    pub of: Vec<Vec<Span>>,
    /// The number of columns of its triangles.
    pub columns: usize,
}

/// The same while it is summed up.
pub(crate) struct SumSpans<'h> {
    objective: &'h Objective<'h>,
    experiment: usize,
    spans: Spans,
    row: Vec<f64>,
}

/// The part of a record that a sample is in.
pub(crate) fn span(sample: usize, samples: usize) -> usize {
    sample * SPANS / samples.max(1)
}

/// Rows of a part of an experiment.
pub(crate) struct Span {
    pub triangle: Information,
    block: Block,
    pub squares: f64,
    pub fourths: f64,
    pub count: u64,
}

impl Span {
    fn new(columns: usize) -> Self {
        Span {
            triangle: Information::new(columns),
            block: Block::new(columns, ROWS),
            squares: 0.0,
            fourths: 0.0,
            count: 0,
        }
    }

    fn append(&mut self, later: &mut Span) {
        self.triangle.absorb(&mut self.block);
        later.triangle.absorb(&mut later.block);
        self.triangle.merge(&later.triangle);
        self.squares += later.squares;
        self.fourths += later.fourths;
        self.count += later.count;
    }
}

impl<'h> SumSpans<'h> {
    pub fn new(objective: &'h Objective<'h>, experiment: usize) -> Self {
        let columns = objective.problem.unknowns.columns(experiment).count();
        let parts = |_| (0..SPANS).map(|_| Span::new(columns)).collect();
        let spans = Spans { of: (0..objective.outputs()).map(parts).collect(), columns };
        SumSpans { objective, experiment, spans, row: vec![0.0; columns] }
    }

    /// With the last rows absorbed.
    pub fn complete(mut self) -> Spans {
        self.spans.of.iter_mut().flatten().for_each(|part| part.triangle.absorb(&mut part.block));
        self.spans
    }
}

impl Accumulate for SumSpans<'_> {
    fn add(&mut self, window: &Window, lane: usize) {
        let samples = self.objective.problem.records[self.experiment].len();
        for k in 0..window.samples[lane] {
            let number = span(window.begin[lane] + k, samples);
            let weight = self.objective.weight(self.experiment, window.begin[lane] + k);
            for j in (0..window.outputs()).filter(|&j| window.is_measured(k, j, lane) && weight > 0.0) {
                let part = &mut self.spans.of[j][number];
                let values = window.row(k, j).iter().skip(lane).step_by(window.lanes());
                let error = window.error(k, j, lane);
                // As in iteratively reweighted least squares, whose minimum is that of the loss.
                let by_loss = self.objective.loss().map_or(1.0, |loss| loss.weight(error));
                let root = (weight * by_loss).sqrt();
                self.row.iter_mut().zip(values).for_each(|(to, from)| *to = root * from);
                let error = root * error;
                part.squares += error * error;
                part.fourths += error.powi(4);
                part.count += 1;
                part.triangle.gather(&mut part.block, &self.row, error);
                if window.has_variances() {
                    let slope = |column: usize| window.variance_at(k, j, column, lane);
                    self.row.iter_mut().enumerate().for_each(|(c, to)| *to = slope(c));
                    let second = (error * error - 1.0) * FRAC_1_SQRT_2;
                    part.triangle.gather(&mut part.block, &self.row, second);
                }
            }
        }
    }

    fn append(&mut self, mut later: Self) {
        for (part, later) in self.spans.of.iter_mut().flatten().zip(later.spans.of.iter_mut().flatten()) {
            part.append(later);
        }
    }
}

/// The probability that records of one plant gain as much by steps of their own, by the slopes that a fit has of each.
pub(crate) fn records_by_chance(point: &Point<'_>) -> f64 {
    let (mut gain, mut left, mut own, mut rows) = (0.0, 0.0, 0.0, 0.0);
    for (triangle, columns) in point.linear.columns() {
        let kept: Vec<usize> = (0..columns.len()).filter(|&c| !point.undetermined.held[columns[c]]).collect();
        let triangle = triangle.select(&kept);
        let norms = triangle.column_norms();
        let told = (0..kept.len()).filter(|&c| triangle.at(c, c).abs() > ROUNDING * norms[c]).count();
        gain += triangle.residual_at_zero() - triangle.residual();
        left += triangle.residual();
        own += told as f64;
        rows += triangle.rows() as f64;
    }
    let common = point.undetermined.held.iter().filter(|held| !**held).count() as f64;
    let (steps, free) = (own - common, rows - own);
    if steps < 1.0 || free < 1.0 || left <= 0.0 {
        return 1.0;
    }
    let statistic = (gain / steps) / (left / free);
    FisherSnedecor::new(steps, free).map_or(1.0, |fisher| fisher.sf(statistic.max(0.0)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of 100 samples the first of each part, and the last.
    #[test]
    fn parts_of_a_record() {
        let begins: Vec<usize> = (0..SPANS).map(|number| (0..100).find(|&k| span(k, 100) == number).unwrap()).collect();
        assert_eq!(begins, [0, 7, 13, 19, 25, 32, 38, 44, 50, 57, 63, 69, 75, 82, 88, 94]);
        assert_eq!(span(99, 100), SPANS - 1);
    }
}
