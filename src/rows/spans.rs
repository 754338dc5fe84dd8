//! The rows of each record in parts of equal length, output by output.

use crate::information::{Gathering, Information};
use crate::problem::{Accumulate, Objective, Weighing};
use crate::sweep::Window;

/// Spans of equal length of each record.
pub(crate) const SPANS: usize = 16;
/// Rows that are absorbed together, in each of many triangles.
const ROWS: usize = 64;

/// Rows of a part of an experiment.
pub(crate) struct Span<R = Information> {
    pub rows: R,
    /// Of the squared errors, of their squares, and the number of errors.
    pub sums: [f64; 3],
}

/// The parts of equal length of one experiment, output by output.
pub(crate) type Spans = Vec<Vec<Span>>;

/// These parts while they are summed up.
pub(crate) struct SumSpans<'h> {
    objective: &'h Objective<'h>,
    experiment: usize,
    weighing: Weighing<'h>,
    of: Vec<Vec<Span<Gathering>>>,
    row: Vec<f64>,
}

/// The part of a record that a sample is in.
pub(crate) fn span(sample: usize, samples: usize) -> usize {
    sample * SPANS / samples.max(1)
}

impl<'h> SumSpans<'h> {
    pub fn new(objective: &'h Objective<'h>, experiment: usize) -> Self {
        let columns = objective.problem.unknowns.columns(experiment).count();
        let part = || Span { rows: Gathering::in_blocks(columns, ROWS), sums: [0.0; 3] };
        let of = (0..objective.outputs()).map(|_| (0..SPANS).map(|_| part()).collect()).collect();
        SumSpans { objective, experiment, weighing: Weighing::new(objective, experiment), of, row: vec![0.0; columns] }
    }

    pub fn complete(self) -> Spans {
        let part = |Span { rows, sums }: Span<Gathering>| Span { rows: rows.triangle(), sums };
        self.of.into_iter().map(|parts| parts.into_iter().map(part).collect()).collect()
    }
}

impl Accumulate for SumSpans<'_> {
    fn add(&mut self, window: &Window, lane: usize) {
        let samples = self.objective.problem.records[self.experiment].len();
        for k in 0..window.samples[lane] {
            let number = span(window.begin[lane] + k, samples);
            let weight = self.objective.weight(self.experiment, window.begin[lane] + k);
            for j in (0..window.outputs()).filter(|&j| window.is_measured(k, j, lane) && weight > 0.0) {
                let part = &mut self.of[j][number];
                let [(root, error), (of_variance, second)] = self.weighing.rows(window, k, j, lane);
                let values = window.row(k, j).iter().skip(lane).step_by(window.lanes());
                self.row.iter_mut().zip(values).for_each(|(to, from)| *to = root * from);
                part.sums.iter_mut().zip([error * error, error.powi(4), 1.0]).for_each(|(sum, one)| *sum += one);
                part.rows.take(&self.row, error);
                if window.has_variances() {
                    let slope = |column: usize| of_variance * window.variance_at(k, j, column, lane);
                    self.row.iter_mut().enumerate().for_each(|(c, to)| *to = slope(c));
                    part.rows.take(&self.row, second);
                }
            }
        }
    }

    fn append(&mut self, later: Self) {
        for (part, later) in self.of.iter_mut().flatten().zip(later.of.into_iter().flatten()) {
            part.rows.append(later.rows);
            part.sums.iter_mut().zip(later.sums).for_each(|(sum, later)| *sum += later);
        }
    }
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
