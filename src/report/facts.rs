//! Contents of a report: plain values that do not depend on the model's types.

use crate::diagnose::residuals::Residuals;
use crate::diagnose::{Identifiability, ProcessNoise};
use crate::estimate::{Summary, Unknown};
use crate::information::SquareMatrix;
use crate::numeral::TimeUnit;
use crate::problem::Role;
use crate::section::Plot;

/// An estimate, its records, and what was examined of them.
pub(super) struct Facts {
    pub estimate: Summary,
    /// Name of the equations.
    pub model: String,
    /// Correlation of the unknowns, in their order.
    pub correlation: SquareMatrix,
    pub records: Vec<Record>,
    pub identifiability: Identifiability,
    /// Of a filter, where the test takes no more steps than the estimate did.
    pub process_noise: Option<ProcessNoise>,
}

/// One record of the fit.
pub(super) struct Record {
    pub name: String,
    pub samples: u64,
    /// The unit of its times, which are all in this one.
    pub time_unit: TimeUnit,
    /// Times of the first and last sample.
    pub begin: f64,
    pub end: f64,
    /// Median time from sample to sample.
    pub sample_time: f64,
    /// Times between which samples are lost.
    pub gaps: Vec<(f64, f64)>,
    /// How the input behaves between samples.
    pub hold: String,
    /// The inputs and the measured outputs.
    pub signals: Vec<Signal>,
    /// The predictions of each output.
    pub fits: Vec<OutputFit>,
    /// Its drawing; `None` where too many records would be drawn.
    pub timeline: Option<Plot>,
    /// Its states, or why they are not known; `None` where the predictor is no filter, and where the record is not drawn.
    pub states: Option<Result<States, String>>,
}

/// The states of a record by a filter.
pub(super) struct States {
    pub all: Vec<State>,
    /// Each state over time, smoothed with its band, and filtered.
    pub timeline: Plot,
}

/// A state of a record by a filter.
pub(super) struct State {
    pub name: String,
    pub unit: String,
    /// Least and greatest value, smoothed; `None` where none is a number.
    pub range: Option<(f64, f64)>,
    /// Root mean squares over the samples of the standard deviations, smoothed and filtered.
    pub deviations: [f64; 2],
}

/// A column of a record.
pub(super) struct Signal {
    pub name: String,
    pub unit: String,
    pub role: &'static str,
    /// Samples that were not measured.
    pub missing: u64,
    /// Remarks on its values, independent of the model.
    pub remarks: Vec<String>,
    /// Least value, mean and greatest value, if any was measured.
    pub values: Option<[f64; 3]>,
}

/// One output of one record beside what the model predicted.
pub(super) struct OutputFit {
    pub name: String,
    pub unit: String,
    pub fit_percent: Option<f64>,
    /// Samples for which the method has no prediction.
    pub unpredicted: u64,
    pub residuals: Residuals,
    /// The largest residual in size, with its sign, and its time.
    pub largest: f64,
    pub largest_at: f64,
    /// Whether the histogram is of residuals divided by the deviations that a filter predicts.
    pub standardized: bool,
    pub histogram: Histogram,
    /// The samples about the largest residual, where the drawing of the record does not show them one by one.
    pub closeup: Option<Plot>,
}

/// Counts of residuals in bins of equal width, about zero.
#[derive(Debug, Default, PartialEq)]
pub(super) struct Histogram {
    /// Lower edge of the first bin, in the output's unit.
    pub from: f64,
    pub width: f64,
    pub counts: Vec<u64>,
}

const BINS: usize = 41;

impl Histogram {
    /// Of the residuals that are numbers.
    pub fn new(residuals: &[f64]) -> Histogram {
        let finite = || residuals.iter().copied().filter(|e| e.is_finite());
        let reach = finite().fold(0.0f64, |reach, e| reach.max(e.abs()));
        let width = 2.0 * reach / BINS as f64;
        if !(width > 0.0 && width.is_finite()) {
            return Histogram::default();
        }
        let mut counts = vec![0; BINS];
        for e in finite() {
            counts[(((e + reach) / width) as usize).min(BINS - 1)] += 1;
        }
        Histogram { from: -reach, width, counts }
    }
}

impl Facts {
    /// Whether there is one record only, which then needs no name.
    pub fn single(&self) -> bool {
        self.records.len() == 1
    }

    /// The unknowns with their numbers, parameters or initial states.
    pub fn unknowns(&self, initial: bool) -> impl Iterator<Item = (usize, &Unknown)> {
        let chosen = move |(_, unknown): &(usize, &Unknown)| matches!(unknown.role, Role::InitialState(_)) == initial;
        self.estimate.unknowns.iter().enumerate().filter(chosen)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Four numbers from -1 to 1 in 41 bins of 2/41: at the ends, and at 1.05 / (2/41) = 21.5 and 1.5 / (2/41) = 30.8.
    #[test]
    fn counts_by_hand() {
        let found = Histogram::new(&[-1.0, 0.05, f64::NAN, 0.5, 1.0]);
        assert_eq!((found.from, found.width, found.counts.len()), (-1.0, 2.0 / 41.0, BINS));
        let filled: Vec<usize> = (0..BINS).filter(|&bin| found.counts[bin] == 1).collect();
        assert_eq!((filled, found.counts.iter().sum::<u64>()), (vec![0, 21, 30, 40], 4));
        for nothing in [vec![], vec![f64::NAN; 5], vec![0.0; 5]] {
            assert_eq!(Histogram::new(&nothing), Histogram::default());
        }
    }
}
