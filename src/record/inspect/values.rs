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

/// An extreme value, how often it occurs, the value next to it, and the range of all others.
pub(super) struct Extreme {
    value: f64,
    count: usize,
    next: f64,
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

    /// The greatest and the least value; `None` where there are few values.
    pub fn extremes(&self) -> Option<[Extreme; 2]> {
        if self.levels.is_some() || self.least >= self.greatest {
            return None;
        }
        // In four parts each, which the compiler may keep in vector lanes.
        let (mut low, mut high) = ([f64::INFINITY; 4], [f64::NEG_INFINITY; 4]);
        let (mut at_least, mut at_greatest) = ([0u64; 4], [0u64; 4]);
        for piece in self.pieces {
            for four in self.values[piece.clone()].chunks(4) {
                for (i, &value) in four.iter().enumerate() {
                    let (is_least, is_greatest) = (value == self.least, value == self.greatest);
                    at_least[i] += u64::from(is_least);
                    at_greatest[i] += u64::from(is_greatest);
                    low[i] = if value < low[i] && !is_least { value } else { low[i] };
                    high[i] = if value > high[i] && !is_greatest { value } else { high[i] };
                }
            }
        }
        let low = low.into_iter().fold(f64::INFINITY, f64::min);
        let high = high.into_iter().fold(f64::NEG_INFINITY, f64::max);
        let one = |value: f64, next: f64, count: [u64; 4], others: f64| {
            let count = count.iter().sum::<u64>() as usize;
            Extreme { value, count, next, others }
        };
        Some([
            one(self.greatest, high, at_greatest, high - self.least),
            one(self.least, low, at_least, self.greatest - low),
        ])
    }

    /// The greatest or least value, if it is far away from all others.
    pub fn sentinel(&self, extremes: &[Extreme]) -> Option<Suspicion> {
        let one = |&Extreme { value, count, next, others }: &Extreme| {
            let far = (value - next).abs() > FAR * others && others > 0.0;
            let seldom = count as f64 <= SENTINELS * self.measured as f64;
            (far && seldom && (count > 1 || KNOWN.contains(&value))).then_some(Suspicion::Sentinel { value, count })
        };
        extremes.iter().find_map(one)
    }

    /// The extreme values that occur more often than their neighbors.
    pub fn clipped(&self, extremes: &[Extreme]) -> Vec<Suspicion> {
        let at = |next: f64| {
            let values = self.pieces.iter().flat_map(|piece| &self.values[piece.clone()]);
            values.filter(|value| **value == next).count()
        };
        let clips =
            |extreme: &&Extreme| extreme.count >= AT_LIMIT && extreme.count >= AT_LIMIT + NEIGHBORS * at(extreme.next);
        let one = |&Extreme { value, count, .. }: &Extreme| Suspicion::Clipped { value, count };
        extremes.iter().filter(clips).map(one).collect()
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
