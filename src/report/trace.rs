//! [`Trace`]: a record of any length as a drawing.
//!
//! Each pixel column keeps the least and the greatest of all samples that fall into it. A single spike among ten million
//! samples is then as visible as in the full record, which skipping samples would lose.

use core::ops::Range;
use serde::{Deserialize, Serialize};

/// Columns of the drawing of a whole record: more than a wide screen has, to leave something to zoom into.
pub(super) const COLUMNS: usize = 2000;

/// Least and greatest value in each column; `None` where there is none.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Band {
    /// Least values.
    pub low: Vec<Option<f64>>,
    /// Greatest values.
    pub high: Vec<Option<f64>>,
}

/// Measured and predicted output and their difference, column by column.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Trace {
    /// Samples in one column; one, if they are drawn one by one.
    pub samples_per_column: u64,
    /// Time of the first sample in each column (s).
    pub t: Vec<f64>,
    /// What was measured.
    pub measured: Band,
    /// What the model predicted.
    pub predicted: Band,
    /// Measured less predicted.
    pub residual: Band,
    /// Where the noise-free output is with 95 % probability, as the unknowns are uncertain; no columns if not made.
    pub confidence: Band,
    /// Where a new measurement is with 95 % probability; no columns if not made.
    pub prediction: Band,
}

/// A record as [`Trace`] reads it: time, measured, predicted; not a number where missing.
#[derive(Default)]
pub(super) struct Rows<'a> {
    pub t: &'a [f64],
    pub measured: &'a [f64],
    pub predicted: &'a [f64],
    /// Half widths of the bands about the prediction; empty if there are none.
    pub confidence: &'a [f64],
    pub prediction: &'a [f64],
}

impl Trace {
    /// The samples of a range in at most so many columns.
    pub(super) fn new(rows: &Rows<'_>, range: Range<usize>, columns: usize) -> Trace {
        let per_column = range.len().div_ceil(columns.max(1)).max(1);
        let mut trace = Trace { samples_per_column: per_column as u64, ..Trace::default() };
        for begin in range.clone().step_by(per_column) {
            let column = begin..(begin + per_column).min(range.end);
            let (y, predicted) = (&rows.measured[column.clone()], &rows.predicted[column.clone()]);
            trace.t.push(rows.t[begin]);
            trace.measured.push(y.iter().copied());
            trace.predicted.push(predicted.iter().copied());
            trace.residual.push(y.iter().zip(predicted).map(|(y, predicted)| y - predicted));
            for (band, widths) in [(&mut trace.confidence, rows.confidence), (&mut trace.prediction, rows.prediction)] {
                if let Some(widths) = widths.get(column.clone()) {
                    let ends = predicted.iter().zip(widths);
                    band.push(ends.flat_map(|(predicted, width)| [predicted - width, predicted + width]));
                }
            }
        }
        trace
    }
}

impl Band {
    /// One more column of these values.
    fn push(&mut self, values: impl Iterator<Item = f64>) {
        let (low, high) = values
            .filter(|value| value.is_finite())
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)));
        self.low.push((low <= high).then_some(low));
        self.high.push((low <= high).then_some(high));
    }

    /// Least and greatest of all columns, if there is any.
    pub(super) fn range(&self) -> Option<(f64, f64)> {
        let low = self.low.iter().flatten().copied().reduce(f64::min)?;
        Some((low, self.high.iter().flatten().copied().reduce(f64::max)?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The one sample that matters survives, whatever the column it falls into.
    #[test]
    fn no_spike_is_lost() {
        let n = 100_003;
        let t: Vec<f64> = (0..n).map(|k| k as f64).collect();
        let predicted = vec![0.0; n];
        for spike in [0, 1, 777, 50_001, n - 1] {
            let mut measured = vec![0.0; n];
            measured[spike] = 1.0;
            measured[n / 2 + 1] = -2.0;
            let rows = Rows { t: &t, measured: &measured, predicted: &predicted, ..Rows::default() };
            let trace = Trace::new(&rows, 0..n, COLUMNS);
            assert!(trace.t.len() <= COLUMNS);
            assert_eq!(trace.measured.range(), Some((-2.0, if spike == n / 2 + 1 { 0.0 } else { 1.0 })));
            assert_eq!(trace.residual, trace.measured);
            let place = trace.measured.high.iter().position(|high| *high == Some(1.0)).unwrap();
            assert!(trace.t[place] <= spike as f64 && spike as f64 - trace.t[place] < trace.samples_per_column as f64);
        }
    }

    /// What is missing in all of a column is a gap.
    #[test]
    fn missing_samples_are_gaps() {
        let t: Vec<f64> = (0..6).map(f64::from).collect();
        let measured = [1.0, f64::NAN, f64::NAN, f64::NAN, 5.0, 6.0];
        let predicted = [0.0; 6];
        let trace = Trace::new(&Rows { t: &t, measured: &measured, predicted: &predicted, ..Rows::default() }, 0..6, 3);
        assert_eq!(trace.measured.low, [Some(1.0), None, Some(5.0)]);
        assert_eq!(trace.residual.high, [Some(1.0), None, Some(6.0)]);
        assert_eq!(trace.predicted.high, [Some(0.0); 3]);
    }

    /// A band spans all of a column: from the least lower end to the greatest upper one.
    #[test]
    fn bands_are_about_the_prediction() {
        let (t, predicted, widths) = ([0.0, 1.0, 2.0, 3.0], [1.0, 2.0, f64::NAN, 3.0], [0.5, 0.1, 9.0, 1.0]);
        let rows = Rows { t: &t, measured: &t, predicted: &predicted, prediction: &widths, ..Rows::default() };
        let trace = Trace::new(&rows, 0..4, 2);
        assert_eq!(
            (trace.prediction.low, trace.prediction.high),
            (vec![Some(0.5), Some(2.0)], vec![Some(2.1), Some(4.0)])
        );
        assert_eq!(trace.confidence, Band::default());
    }
}
