//! [`Values`]: extremes, levels and runs of a column, in one pass and two over its extremes.

use super::Suspicion;
use core::ops::Range;

/// Levels that are told apart.
const LEVELS: usize = 16;
/// A sentinel is at least so many ranges of the other values away from them.
const FAR: f64 = 5.0;
/// The largest part of a column that sentinels may be.
const SENTINELS: f64 = 0.3;
/// Values that programs write where there is no measurement.
const KNOWN: [f64; 9] = [-999.0, -9999.0, -99.0, 999.0, 9999.0, 99999.0, -99999.0, 32767.0, -32768.0];
/// The fewest samples at a limit, and how much more often than its neighbor it must occur.
const AT_LIMIT: usize = 5;
const NEIGHBORS: usize = 4;
/// The fewest samples of a value that stands still, and the expected number of such runs by chance.
const STILL: usize = 10;
const BY_CHANCE: f64 = 1e-6;
/// A column in which fewer of the values equal the one before is taken as continuous.
const REPEATS: f64 = 0.05;

/// An extreme value, and the values next to it.
struct Extreme {
    value: f64,
    count: usize,
    /// The value next to it, and how often that occurs.
    next: f64,
    neighbors: usize,
    /// The range of all others.
    others: f64,
}

/// What a pass over a column finds.
pub(super) struct Values<'v> {
    values: &'v [f64],
    pieces: &'v [Range<usize>],
    pub measured: usize,
    pub missing: usize,
    pub least: f64,
    pub greatest: f64,
    /// The values, if they are few.
    pub levels: Option<Vec<f64>>,
    /// How often a value equals the one before.
    repeats: usize,
    longest: Range<usize>,
}

impl<'v> Values<'v> {
    /// Of some pieces of a column; runs are looked for if `runs` is set.
    pub fn of(values: &'v [f64], pieces: &'v [Range<usize>], runs: bool) -> Self {
        let mut found = Values {
            values,
            pieces,
            measured: 0,
            missing: 0,
            least: f64::INFINITY,
            greatest: f64::NEG_INFINITY,
            levels: Some(vec![]),
            repeats: 0,
            longest: 0..0,
        };
        for piece in pieces {
            found.add_range(piece);
            found.add_levels(piece);
            if runs {
                found.add_runs(piece);
            }
        }
        found
    }

    fn add_range(&mut self, piece: &Range<usize>) {
        let (mut least, mut greatest, mut missing) = ([self.least; 4], [self.greatest; 4], 0);
        let values = &self.values[piece.clone()];
        for four in values.chunks(4) {
            for ((least, greatest), value) in least.iter_mut().zip(&mut greatest).zip(four) {
                // False for what is not a number.
                *least = if *value < *least { *value } else { *least };
                *greatest = if *value > *greatest { *value } else { *greatest };
                missing += usize::from(value.is_nan());
            }
        }
        self.least = least.into_iter().fold(f64::INFINITY, f64::min);
        self.greatest = greatest.into_iter().fold(f64::NEG_INFINITY, f64::max);
        self.missing += missing;
        self.measured += values.len() - missing;
    }

    fn add_levels(&mut self, piece: &Range<usize>) {
        let Some(levels) = &mut self.levels else { return };
        for value in self.values[piece.clone()].iter().filter(|value| !value.is_nan()) {
            if !levels.contains(value) {
                if levels.len() == LEVELS {
                    self.levels = None;
                    return;
                }
                levels.push(*value);
            }
        }
    }

    fn add_runs(&mut self, piece: &Range<usize>) {
        let mut begin = piece.start;
        for k in piece.start + 1..=piece.end {
            let same = k < piece.end && self.values[k] == self.values[k - 1];
            self.repeats += usize::from(same);
            if !same {
                if k - begin > self.longest.len() {
                    self.longest = begin..k;
                }
                begin = k;
            }
        }
    }

    /// Least distance of two of few values.
    pub fn step(&self) -> Option<f64> {
        let mut levels = self.levels.clone()?;
        levels.sort_by(f64::total_cmp);
        levels.windows(2).map(|pair| pair[1] - pair[0]).reduce(f64::min)
    }

    /// Whether values hardly ever repeat but in the longest run.
    pub fn continuous(&self) -> bool {
        self.levels.is_none() && self.chance_of_repeat() < REPEATS
    }

    /// The part of the values that equal the one before, the longest run left out.
    fn chance_of_repeat(&self) -> f64 {
        let inside = self.longest.len().saturating_sub(1);
        (self.repeats - inside.min(self.repeats)) as f64 / (self.measured.saturating_sub(inside).max(1)) as f64
    }

    fn extreme(&self, greatest: bool) -> Extreme {
        let value = if greatest { self.greatest } else { self.least };
        let (mut low, mut high, mut count) = (f64::INFINITY, f64::NEG_INFINITY, 0);
        for &other in self.pieces.iter().flat_map(|piece| &self.values[piece.clone()]) {
            let here = other == value;
            count += usize::from(here);
            low = if other < low && !here { other } else { low };
            high = if other > high && !here { other } else { high };
        }
        let next = if greatest { high } else { low };
        let neighbors = match count >= AT_LIMIT {
            true => self.pieces.iter().flat_map(|piece| &self.values[piece.clone()]).filter(|v| **v == next).count(),
            false => 0,
        };
        Extreme { value, count, next, neighbors, others: high - low }
    }

    /// The greatest or least value, if it is far away from all others.
    pub fn sentinel(&self) -> Option<Suspicion> {
        if self.levels.is_some() || self.least >= self.greatest {
            return None;
        }
        let one = |greatest: bool| {
            let Extreme { value, count, next, others, .. } = self.extreme(greatest);
            let far = (value - next).abs() > FAR * others && others > 0.0;
            let seldom = count as f64 <= SENTINELS * self.measured as f64;
            (far && seldom && (count > 1 || KNOWN.contains(&value))).then_some(Suspicion::Sentinel { value, count })
        };
        one(true).or_else(|| one(false))
    }

    /// The extreme values that occur more often than their neighbors.
    pub fn clipped(&self) -> Vec<Suspicion> {
        if self.levels.is_some() {
            return vec![];
        }
        let one = |greatest: bool| {
            let Extreme { value, count, neighbors, .. } = self.extreme(greatest);
            (count >= AT_LIMIT + NEIGHBORS * neighbors).then_some(Suspicion::Clipped { value, count })
        };
        [true, false].into_iter().filter_map(one).collect()
    }

    /// The longest run of one value, if chance does not make it.
    pub fn frozen(&self) -> Option<Suspicion> {
        if self.levels.is_some() || self.longest.len() < STILL {
            return None;
        }
        let chance = self.chance_of_repeat().max(1.0 / self.measured as f64);
        let expected = self.measured as f64 * chance.powf(self.longest.len() as f64 - 1.0);
        let (value, samples) = (self.values[self.longest.start], self.longest.clone());
        (expected < BY_CHANCE).then_some(Suspicion::Frozen { value, samples })
    }
}
