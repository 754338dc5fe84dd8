//! [`Timeline`]: signals over time, a record of any length as a drawing that can be zoomed into.
//!
//! Where all samples are too many to keep, each column of the drawing stands for several: it keeps the least and the
//! greatest of them, so that a single spike among ten million samples is seen, and pieces of the record are kept sample by
//! sample beside.

use core::ops::Range;
use serde::{Deserialize, Serialize};

/// Signals over time, below each other.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Timeline {
    /// The unit of all times.
    pub time_unit: String,
    /// Time of the record's first sample, which all others count from.
    #[serde(with = "crate::real")]
    pub start: f64,
    /// The panels, from top to bottom.
    pub panels: Vec<Panel>,
    /// The numbers: first those of the whole record, then pieces of it sample by sample, if the first are not.
    pub stretches: Vec<Stretch>,
}

/// Lines over one axis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Panel {
    /// Name of the signal.
    pub name: String,
    /// Unit of its axis.
    pub unit: String,
    /// Its role in the record.
    pub kind: PanelKind,
    /// Its lines, from the lowest to the topmost.
    pub lines: Vec<Line>,
}

/// Role of a panel in the record.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum PanelKind {
    /// Measured and predicted output.
    Response,
    /// Measured less predicted.
    Residual,
    /// A state, estimated by a filter; its axis has room for its band.
    State,
    /// An input.
    Input,
}

/// A line, or a band about one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Line {
    /// Its meaning; [`Style::Confidence`](super::Style::Confidence) and
    /// [`Style::Prediction`](super::Style::Prediction) are half widths of a band about the mean of the panel's predicted
    /// line.
    pub style: super::Style,
    /// Its label.
    pub name: String,
    /// Whether it keeps its value from sample to sample.
    pub held: bool,
}

/// All lines over a part of the record.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Stretch {
    /// Samples in one column; one, if they are drawn one by one.
    pub samples_per_column: u64,
    /// Time of the first sample in each column (s from the start). A column without any value is a gap.
    #[serde(with = "crate::real")]
    pub t: Vec<f64>,
    /// The values of each line, panel by panel.
    pub traces: Vec<Trace>,
}

/// The values of a line in each column; `None` where there is none.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Trace {
    /// Least values; of half widths of a band, the medians.
    #[serde(with = "crate::real")]
    pub low: Vec<Option<f64>>,
    /// Greatest values; empty where they are the least ones.
    #[serde(with = "crate::real")]
    pub high: Vec<Option<f64>>,
    /// Means; empty where they are the least values, or where no band is drawn about them.
    #[serde(with = "crate::real")]
    pub mean: Vec<Option<f64>>,
}

/// The samples of a column that are kept.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Keep {
    /// The least and the greatest.
    Extremes,
    /// These and the mean.
    ExtremesAndMean,
    /// The median.
    Median,
}

/// A record as a timeline reads it; not a number where missing.
pub(crate) struct Samples<'a> {
    /// Time of each sample, and its unit.
    pub t: &'a [f64],
    pub time_unit: &'a str,
    /// Samples before which time jumps.
    pub gaps: &'a [usize],
    /// The lines, panel by panel.
    pub lines: Vec<(Keep, &'a [f64])>,
}

impl Timeline {
    /// A timeline that keeps so many numbers at most, and `pieces` sample by sample besides, where not all samples are.
    pub(crate) fn new(panels: Vec<Panel>, samples: &Samples<'_>, numbers: usize, pieces: &[Range<usize>]) -> Timeline {
        let (n, lines) = (samples.t.len(), samples.lines.len().max(1));
        let start = samples.t.first().copied().unwrap_or(0.0);
        let mut stretches = if n * lines <= numbers {
            vec![samples.stretch(0..n, n, start)]
        } else {
            let each = |keep: &Keep| [2, 3, 1][*keep as usize];
            let per_column: usize = samples.lines.iter().map(|(keep, _)| each(keep)).sum();
            vec![samples.stretch(0..n, numbers / per_column.max(1), start)]
        };
        if stretches[0].samples_per_column > 1 {
            stretches.extend(pieces.iter().map(|piece| samples.stretch(piece.clone(), piece.len(), start)));
        }
        Timeline { time_unit: samples.time_unit.to_owned(), start, panels, stretches }
    }

    /// The lines in the order of the traces.
    pub(crate) fn lines(&self) -> impl Iterator<Item = (&Panel, &Line)> {
        self.panels.iter().flat_map(|panel| panel.lines.iter().map(move |line| (panel, line)))
    }
}

impl Samples<'_> {
    /// A range of the samples in some `columns` columns.
    pub(crate) fn stretch(&self, range: Range<usize>, columns: usize, start: f64) -> Stretch {
        let per_column = range.len().div_ceil(columns.max(1)).max(1);
        let mut found = Stretch { samples_per_column: per_column as u64, ..Stretch::default() };
        found.traces = vec![Trace::default(); self.lines.len()];
        let Some(last) = range.end.checked_sub(1).filter(|last| *last >= range.start) else { return found };
        // Shorter gaps are narrower than a column.
        let shortest = if per_column == 1 { 0.0 } else { (self.t[last] - self.t[range.start]) / columns as f64 };
        let cuts = self.gaps.iter().copied().filter(|&k| range.start < k && k < range.end);
        let cuts = cuts.filter(|&k| self.t[k] - self.t[k - 1] > shortest);
        let mut begin = range.start;
        for end in cuts.chain([range.end]) {
            for first in (begin..end).step_by(per_column) {
                let column = first..(first + per_column).min(end);
                found.t.push(self.t[first] - start);
                for (trace, (keep, values)) in found.traces.iter_mut().zip(&self.lines) {
                    trace.push(*keep, &values[column.clone()], per_column);
                }
            }
            if end < range.end {
                found.t.push(self.t[end - 1] - start);
                found.traces.iter_mut().for_each(Trace::interrupt);
            }
            begin = end;
        }
        found
    }
}

impl Trace {
    /// One more column of these values.
    fn push(&mut self, keep: Keep, values: &[f64], per_column: usize) {
        let finite = || values.iter().copied().filter(|value| value.is_finite());
        if per_column == 1 {
            return self.low.push(finite().next());
        }
        if keep == Keep::Median {
            let mut sorted: Vec<f64> = finite().collect();
            let middle = sorted.len() / 2;
            let median = (!sorted.is_empty()).then(|| *sorted.select_nth_unstable_by(middle, f64::total_cmp).1);
            return self.low.push(median);
        }
        let count = finite().count();
        self.low.push(finite().reduce(f64::min));
        self.high.push(finite().reduce(f64::max));
        if keep == Keep::ExtremesAndMean {
            self.mean.push((count > 0).then(|| finite().sum::<f64>() / count as f64));
        }
    }

    /// One more column without a value.
    fn interrupt(&mut self) {
        let kept = (!self.high.is_empty(), !self.mean.is_empty());
        self.low.push(None);
        if kept.0 {
            self.high.push(None);
        }
        if kept.1 {
            self.mean.push(None);
        }
    }

    /// Least and greatest value of each column.
    pub(crate) fn extremes(&self) -> impl Iterator<Item = Option<(f64, f64)>> {
        let high = if self.high.is_empty() { &self.low } else { &self.high };
        self.low.iter().zip(high).map(|(low, high)| Some(((*low)?, (*high)?)))
    }

    /// Mean of each column.
    pub(crate) fn means(&self) -> &[Option<f64>] {
        if self.mean.is_empty() { &self.low } else { &self.mean }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn samples<'a>(t: &'a [f64], gaps: &'a [usize], keep: Keep, values: &'a [f64]) -> Samples<'a> {
        Samples { t, time_unit: "s", gaps, lines: vec![(keep, values)] }
    }

    /// The one sample that matters survives, whatever the column it falls into.
    #[test]
    fn no_spike_is_lost() {
        let n = 100_003;
        let t: Vec<f64> = (0..n).map(f64::from).collect();
        for spike in [0, 1, 777, 50_001, n as usize - 1] {
            let mut values = vec![0.0; n as usize];
            values[spike] = 1.0;
            let stretch = samples(&t, &[], Keep::Extremes, &values).stretch(0..n as usize, 2000, 0.0);
            assert!(stretch.t.len() <= 2000);
            let place = stretch.traces[0].high.iter().position(|high| *high == Some(1.0)).unwrap();
            assert!((0.0..stretch.samples_per_column as f64).contains(&(spike as f64 - stretch.t[place])));
            assert_eq!(stretch.traces[0].low[place], Some(0.0));
        }
    }

    /// Samples that are missing throughout a column are a gap; time without samples is one too, if it is wider than a column.
    #[test]
    fn what_is_missing_is_a_gap() {
        let t = [10.0, 11.0, 12.0, 13.0, 14.0, 15.0];
        let values = [1.0, f64::NAN, f64::NAN, f64::NAN, 5.0, 6.0];
        let stretch = samples(&t, &[], Keep::Extremes, &values).stretch(0..6, 3, 10.0);
        assert_eq!((&stretch.t, &stretch.traces[0].low), (&vec![0.0, 2.0, 4.0], &vec![Some(1.0), None, Some(5.0)]));
        let t = [0.0, 1.0, 2.0, 50.0, 51.0, 52.5];
        let jump = samples(&t, &[3, 5], Keep::Extremes, &[1.0; 6]).stretch(0..6, 3, 0.0);
        assert_eq!(jump.t, [0.0, 2.0, 2.0, 50.0, 52.5], "a break at 2 s; the step of 1.5 s is narrower than a column");
        assert_eq!(
            jump.traces[0].high.iter().map(Option::is_some).collect::<Vec<_>>(),
            [true, true, false, true, true]
        );
        let single = samples(&t, &[3, 5], Keep::Extremes, &[1.0; 6]).stretch(0..6, 6, 0.0);
        assert_eq!(single.t, [0.0, 1.0, 2.0, 2.0, 50.0, 51.0, 51.0, 52.5], "sample by sample every gap shows");
    }

    /// A band of half width 0.001 about a sine stays so wide where hundreds of samples share a column; between its least
    /// lower and greatest upper end the sine itself would be counted.
    #[test]
    fn bands_are_as_wide_as_they_are() {
        let t: Vec<f64> = (0..10_000).map(f64::from).collect();
        let (sine, widths): (Vec<f64>, Vec<f64>) = t.iter().map(|t| (t.sin(), 1e-3)).unzip();
        let lines = vec![(Keep::ExtremesAndMean, sine.as_slice()), (Keep::Median, widths.as_slice())];
        let stretch = Samples { t: &t, time_unit: "s", gaps: &[], lines }.stretch(0..t.len(), 50, 0.0);
        let [predicted, half] = &stretch.traces[..] else { panic!("two lines") };
        assert_eq!(half.low, vec![Some(1e-3); 50]);
        // The mean of 200 samples of a sine is at most about 1 / 100 of its amplitude.
        assert!(predicted.means().iter().flatten().all(|mean| mean.abs() < 0.01));
        assert!(predicted.extremes().flatten().all(|(low, high)| high - low > 1.9));
    }

    /// Few samples are kept one by one; of many, the pieces asked for.
    #[test]
    fn numbers_are_bounded() {
        let t: Vec<f64> = (0..5000).map(f64::from).collect();
        let whole = Timeline::new(vec![], &samples(&t, &[], Keep::Extremes, &t), 5000, std::slice::from_ref(&(0..9)));
        assert_eq!((whole.stretches.len(), whole.stretches[0].samples_per_column), (1, 1));
        let thinned =
            Timeline::new(vec![], &samples(&t, &[], Keep::Extremes, &t), 1000, std::slice::from_ref(&(100..109)));
        assert_eq!((thinned.stretches.len(), thinned.stretches[0].t.len()), (2, 500));
        assert_eq!(thinned.stretches[1].t, (100..109).map(f64::from).collect::<Vec<_>>());
    }
}
