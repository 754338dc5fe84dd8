//! Blocks that occur twice: buffers that were written again.

use super::Suspicion;
use crate::wide::{self, Task, Wide, Width};
use rustc_hash::{FxBuildHasher, FxHashMap};

/// The shortest block that is reported.
const SHORTEST: usize = 20;
/// Values that are kept to be found again, about. A block is found that holds one of them, of `n / 64` values almost always.
const KEPT: usize = 64;

/// Values that are looked at together.
const BLOCK: usize = 64;

/// The longest block that occurs twice. Of all values those are compared whose bits end so (all of a short column), so
/// that both occurrences of a block offer the same ones.
pub(super) fn repeated(values: &[f64]) -> Option<Suspicion> {
    let mask = (values.len() / KEPT).next_power_of_two() as u64 - 1;
    let mut first: FxHashMap<u64, usize> = FxHashMap::with_capacity_and_hasher(2 * KEPT, FxBuildHasher);
    let mut longest: Option<(usize, usize, usize)> = None;
    let mut known = 0;
    for (b, block) in values.chunks(BLOCK).enumerate() {
        let mut kept = wide::run(Width::widest(), Endings { values: block, mask });
        while kept != 0 {
            let k = b * BLOCK + kept.trailing_zeros() as usize;
            kept &= kept - 1;
            if values[k].is_nan() || k < known {
                continue;
            }
            let before = *first.entry(values[k].to_bits()).or_insert(k);
            if before == k {
                continue;
            }
            let back = (0..before).take_while(|i| values[before - 1 - i] == values[k - 1 - i]).count();
            let on = (0..values.len() - k).take_while(|i| values[before + i] == values[k + i]).count();
            let length = (back + on).min(k - before);
            if length >= SHORTEST && longest.is_none_or(|(_, _, known)| length > known) {
                longest = Some((before - back, k - back, length));
                known = k + on;
            }
        }
    }
    longest.map(|(begin, again, length)| Suspicion::Repeated { samples: begin..begin + length, again })
}

/// Which of the values have bits that end so.
struct Endings<'v> {
    /// Of a block.
    values: &'v [f64],
    mask: u64,
}

impl Task for Endings<'_> {
    type Output = u64;

    #[inline(always)]
    fn run<W: Wide>(self) -> u64 {
        let mut bits = 0;
        for (k, value) in self.values.iter().enumerate() {
            // Multiplied, because the last bits of short decimal numbers are often alike.
            let ending = (value.to_bits().wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 40) & self.mask;
            bits |= u64::from(ending == 0) << k;
        }
        bits
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Irrational steps never repeat; a copied block is found with its place and length.
    #[test]
    fn a_copied_block_is_found() {
        for n in [300, 20_000] {
            let mut values: Vec<f64> = (0..n).map(|k| (k as f64 * 0.618_033_988_749_895).sin()).collect();
            assert_eq!(repeated(&values), None);
            let end = 40 + 2 * n / 5;
            values.copy_within(40..end, end + 10);
            assert_eq!(repeated(&values), Some(Suspicion::Repeated { samples: 40..end, again: end + 10 }), "{n}");
        }
    }

    /// A constant repeats, but no block of it stands apart from itself: at most half of the column.
    #[test]
    fn short_columns_do_not_panic() {
        for values in [vec![], vec![1.0], vec![f64::NAN; 5], vec![2.0; 60]] {
            assert!(repeated(&values).is_none_or(|found| matches!(found, Suspicion::Repeated { .. })), "{values:?}");
        }
    }
}
