//! [`Values`]: extremes, levels and runs of a column, in one pass and two over its extremes.

use super::Suspicion;
use crate::wide::{self, Task, Wide, Width};
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
/// The fewest other runs that are about as long as that of an extreme which is one step of several.
const STEPS: usize = 3;
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

/// Statistics of a column from one pass.
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
            let values = &values[piece.clone()];
            let range = wide::run(Width::widest(), Ends { values });
            found.least = found.least.min(range.least);
            found.greatest = found.greatest.max(range.greatest);
            found.missing += range.missing;
            found.measured += values.len() - range.missing;
            found.add_levels(piece);
            if runs {
                found.add_runs(piece);
            }
        }
        found
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
        let values = &self.values[piece.clone()];
        let mut begin = 0;
        for first in (1..values.len()).step_by(BLOCK) {
            let after = values.len().min(first + BLOCK);
            if !wide::run(Width::widest(), Repeats { values: &values[first - 1..after] }) {
                self.end_run(piece.start + begin..piece.start + first);
                begin = after - 1;
                continue;
            }
            for k in first..after {
                if values[k] == values[k - 1] {
                    self.repeats += 1;
                } else {
                    self.end_run(piece.start + begin..piece.start + k);
                    begin = k;
                }
            }
        }
        self.end_run(piece.start + begin..piece.end);
    }

    fn end_run(&mut self, run: Range<usize>) {
        if run.len() > self.longest.len() {
            self.longest = run;
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

    /// Whether there are many values, and a third of them or more equal the one before.
    pub fn repeats_mostly(&self) -> bool {
        self.levels.is_none() && 3 * self.repeats >= self.measured
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
        let (mut low, mut high, mut at_least, mut at_greatest) = (f64::INFINITY, f64::NEG_INFINITY, 0, 0);
        for piece in self.pieces {
            let task = Neighbors { values: &self.values[piece.clone()], least: self.least, greatest: self.greatest };
            let found = wide::run(Width::widest(), task);
            (low, high) = (low.min(found.low), high.max(found.high));
            (at_least, at_greatest) = (at_least + found.at_least, at_greatest + found.at_greatest);
        }
        let one = |value: f64, next: f64, count: usize, others: f64| Extreme { value, count, next, others };
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
        let limit = |extreme: &&Extreme| clips(extreme) && !self.is_step(extreme);
        let one = |&Extreme { value, count, .. }: &Extreme| Suspicion::Clipped { value, count };
        extremes.iter().filter(limit).map(one).collect()
    }

    /// Whether an extreme is one of several steps: it occurs in one run, and runs of other values are about as long.
    fn is_step(&self, extreme: &Extreme) -> bool {
        let runs = self.pieces.iter().flat_map(|piece| self.values[piece.clone()].chunk_by(|a, b| a == b));
        let (at, others): (Vec<&[f64]>, Vec<&[f64]>) = runs.partition(|run| run[0] == extreme.value);
        at.len() == 1 && others.iter().filter(|run| 2 * run.len() >= extreme.count).count() >= STEPS
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

/// Values that are looked at together for runs.
const BLOCK: usize = 64;

/// Least and greatest value, and how many are missing.
struct Ends<'v> {
    values: &'v [f64],
}

struct Span {
    least: f64,
    greatest: f64,
    missing: usize,
}

impl Task for Ends<'_> {
    type Output = Span;

    #[inline(always)]
    fn run<W: Wide>(self) -> Span {
        let (mut least, mut greatest, mut missing) =
            (W::splat(f64::INFINITY), W::splat(f64::NEG_INFINITY), W::splat(0.0));
        let registers = self.values.chunks_exact(W::LANES);
        let rest = registers.remainder();
        for values in registers {
            let values = W::load(values);
            // False for what is not a number.
            least = values.select_lt(least, values, least);
            greatest = greatest.select_lt(values, values, greatest);
            missing = missing.add(values.select_eq(values, W::splat(0.0), W::splat(1.0)));
        }
        let rest_missing = rest.iter().filter(|value| value.is_nan()).count();
        Span {
            least: rest.iter().copied().fold(least.fold(f64::min), f64::min),
            greatest: rest.iter().copied().fold(greatest.fold(f64::max), f64::max),
            missing: missing.fold(|a, b| a + b) as usize + rest_missing,
        }
    }
}

/// Whether a value equals the one before.
struct Repeats<'v> {
    values: &'v [f64],
}

impl Task for Repeats<'_> {
    type Output = bool;

    #[inline(always)]
    fn run<W: Wide>(self) -> bool {
        let pairs = self.values.iter().zip(&self.values[1..]);
        pairs.fold(false, |any, (before, value)| any | (before == value))
    }
}

/// How often the extremes occur, and the values next to them.
struct Neighbors<'v> {
    values: &'v [f64],
    least: f64,
    greatest: f64,
}

struct Beside {
    low: f64,
    high: f64,
    at_least: usize,
    at_greatest: usize,
}

impl Task for Neighbors<'_> {
    type Output = Beside;

    #[inline(always)]
    fn run<W: Wide>(self) -> Beside {
        let Neighbors { values, least, greatest } = self;
        let (zero, one) = (W::splat(0.0), W::splat(1.0));
        let (above, below) = (W::splat(f64::INFINITY), W::splat(f64::NEG_INFINITY));
        let (mut low, mut high, mut at_least, mut at_greatest) = (above, below, zero, zero);
        let registers = values.chunks_exact(W::LANES);
        let rest = registers.remainder();
        for values in registers {
            let values = W::load(values);
            at_least = at_least.add(values.select_eq(W::splat(least), one, zero));
            at_greatest = at_greatest.add(values.select_eq(W::splat(greatest), one, zero));
            let (up, down) =
                (values.select_eq(W::splat(least), above, values), values.select_eq(W::splat(greatest), below, values));
            low = up.select_lt(low, up, low);
            high = high.select_lt(down, down, high);
        }
        let (up, down) = (rest.iter().filter(|v| **v != least), rest.iter().filter(|v| **v != greatest));
        Beside {
            low: up.copied().fold(low.fold(f64::min), f64::min),
            high: down.copied().fold(high.fold(f64::max), f64::max),
            at_least: at_least.fold(|a, b| a + b) as usize + rest.iter().filter(|v| **v == least).count(),
            at_greatest: at_greatest.fold(|a, b| a + b) as usize + rest.iter().filter(|v| **v == greatest).count(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Columns of a few hundred values, some missing, with runs that cross the borders of blocks and lengths that do not fill
    /// registers, against plain loops over all values.
    #[test]
    fn registers_find_what_plain_loops_find() {
        let mut bits = 1u64;
        let mut next = |levels: u64| {
            bits = bits.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (bits >> 33) % levels
        };
        for length in 0..300 {
            let levels = [2, 30, 1_000_000][length % 3];
            let mut values: Vec<f64> = (0..length).map(|_| next(levels) as f64 - 7.0).collect();
            if length > 100 {
                // Of 300 lengths some let the run begin with the last value of a block.
                values[length % 89..][..11].fill(3.5);
                values[97] = f64::NAN;
            }
            let pieces = [0..length / 3, length / 3..length];
            let found = Values::of(&values, &pieces, true);
            let measured: Vec<f64> = values.iter().copied().filter(|value| !value.is_nan()).collect();
            assert_eq!((found.measured, found.missing), (measured.len(), length - measured.len()));
            assert_eq!(found.least, measured.iter().copied().fold(f64::INFINITY, f64::min));
            assert_eq!(found.greatest, measured.iter().copied().fold(f64::NEG_INFINITY, f64::max));
            let (mut repeats, mut longest) = (0, 0);
            for piece in &pieces {
                let runs = values[piece.clone()].chunk_by(|a, b| a == b);
                runs.for_each(|run| (repeats, longest) = (repeats + run.len() - 1, longest.max(run.len())));
            }
            assert_eq!((found.repeats, found.longest.len()), (repeats, longest), "{length} values");
            let Some([highest, lowest]) = found.extremes() else { continue };
            for (extreme, sign) in [(highest, 1.0), (lowest, -1.0)] {
                let others = measured.iter().map(|value| sign * value).filter(|value| *value != sign * extreme.value);
                assert_eq!(sign * extreme.next, others.fold(f64::NEG_INFINITY, f64::max));
                assert_eq!(extreme.count, measured.iter().filter(|value| **value == extreme.value).count());
            }
        }
    }
}
