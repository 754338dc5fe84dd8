//! Parts of a record: operating cycles, gaps, and how much of each output was measured.

use super::{Record, Time, steps};
use crate::numeral::Moment;
use core::fmt;
use std::ops::Range;

/// A time without samples, inside a record.
#[derive(Clone, Debug, PartialEq)]
pub struct Gap {
    /// Index of the first sample after it.
    pub sample: usize,
    /// Time of the last sample before it.
    pub from: Moment,
    /// Time of the first sample after it.
    pub to: Moment,
}

impl fmt::Display for Gap {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "no sample from {} to {} (before sample {})", self.from, self.to, self.sample)
    }
}

/// Of even sampling, a step this much longer than the median one is a gap: midway between none and one lost sample.
const GAP: f64 = 1.5;
/// Sampling is even if half of the steps are within this part of the median one.
const EVEN: f64 = 0.1;
/// Regular long steps are a pattern where they are at least one in so many: rarer ones may be pauses of a logger.
const MANY: usize = 10;
/// Of uneven sampling, a step is a gap that is beyond the longest tenth by so many times the distance of that from the
/// median: of intervals between independent events, three of 100,000 are.
const BEYOND: f64 = 5.0;

/// Whether steps longer than this belong to a pattern of sampling: they are frequent, and nine of ten follow the one before after the same
/// number of samples.
fn is_pattern(stamps: &[f64], longest: f64) -> bool {
    let steps = stamps.windows(2).enumerate();
    let long: Vec<usize> = steps.filter(|(_, pair)| pair[1] - pair[0] > longest).map(|(k, _)| k).collect();
    let mut apart: Vec<usize> = long.windows(2).map(|pair| pair[1] - pair[0]).collect();
    apart.sort_unstable();
    let Some(middle) = apart.get(apart.len() / 2) else { return false };
    let same = apart.iter().filter(|apart| *apart == middle).count();
    MANY * long.len() >= stamps.len() && 10 * same >= 9 * apart.len()
}

/// The longest step that is no gap.
fn longest_step(stamps: &[f64]) -> f64 {
    let mut steps = steps(stamps);
    if steps.is_empty() {
        return f64::INFINITY;
    }
    let (middle, tenth) = (steps.len() / 2, steps.len() * 9 / 10);
    let median = *steps.select_nth_unstable_by(middle, f64::total_cmp).1;
    let alike = steps.iter().filter(|step| (*step / median - 1.0).abs() <= EVEN).count();
    if 2 * alike >= steps.len() && !is_pattern(stamps, GAP * median) {
        return GAP * median;
    }
    let long = *steps.select_nth_unstable_by(tenth, f64::total_cmp).1;
    (GAP * median).max(long + BEYOND * (long - median))
}

impl Record {
    /// Each run of samples for which `running` holds, if it is at least `shortest` samples long, as a record of its own,
    /// numbered from one.
    pub fn cycles(&self, shortest: usize, mut running: impl FnMut(usize) -> bool) -> Vec<Self> {
        let mut runs = Vec::new();
        let mut begin = None;
        for k in 0..self.len() {
            match (running(k), begin) {
                (true, None) => begin = Some(k),
                (false, Some(first)) => {
                    runs.push(first..k);
                    begin = None;
                }
                _ => {}
            }
        }
        runs.extend(begin.map(|first| first..self.len()));
        self.pieces(runs, shortest, "cycle")
    }

    /// The pieces between the [`gaps`](Record::gaps), each a record of its own, numbered from one; a single sample
    /// between two gaps is dropped.
    pub fn without_gaps(&self) -> Vec<Self> {
        let begins: Vec<usize> = [0].into_iter().chain(self.gaps().iter().map(|gap| gap.sample)).collect();
        let ends = begins.iter().skip(1).copied().chain([self.len()]);
        let runs = begins.iter().zip(ends).map(|(&begin, end)| begin..end).collect();
        self.pieces(runs, 0, "piece")
    }

    /// Where time jumps: in even sampling a step of more than 1.5 times the median one, so that a sample or more is lost;
    /// in uneven sampling a step far beyond the spread of the others. Over a gap the input is held as between any two
    /// samples, which is seldom what happened.
    pub fn gaps(&self) -> Vec<Gap> {
        let Time::Stamps(stamps) = &self.time else { return Vec::new() };
        let longest = longest_step(stamps);
        let steps = stamps.windows(2).enumerate();
        let gap = |(k, t): (usize, &[f64])| Gap { sample: k + 1, from: self.shown(t[0]), to: self.shown(t[1]) };
        steps.filter(|(_, t)| t[1] - t[0] > longest).map(gap).collect()
    }

    /// The share of the samples, from 0 to 1, in which each output was measured.
    pub fn coverage(&self) -> Vec<f64> {
        let measured = |values: &[f64]| values.iter().filter(|value| !value.is_nan()).count();
        self.outputs.iter().map(|channel| measured(&channel.values) as f64 / self.len() as f64).collect()
    }

    fn pieces(&self, runs: Vec<Range<usize>>, shortest: usize, what: &str) -> Vec<Self> {
        let runs = runs.into_iter().filter(|run| run.len() >= shortest.max(self.least()));
        runs.enumerate().map(|(i, run)| self.piece(run, format!("{}, {what} {}", self.name, i + 1))).collect()
    }
}
