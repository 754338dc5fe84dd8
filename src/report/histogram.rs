//! [`Histogram`]: how often which residual occurs.

use serde::{Deserialize, Serialize};

/// Counts in bins of equal width.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Histogram {
    /// Lower edge of the first bin, in the output's unit.
    pub from: f64,
    /// Width of a bin.
    pub width: f64,
    /// Residuals in each bin.
    pub counts: Vec<u64>,
}

const BINS: usize = 41;

impl Histogram {
    /// Of the residuals that are numbers, about zero.
    pub(super) fn new(residuals: &[f64]) -> Histogram {
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
