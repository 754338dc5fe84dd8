//! [`Lengths`]: how long the intervals of a record are, those that differ by rounding as one.

use super::{Record, Time};

/// Lengths that differ by no more than this part of themselves are one. A transition over one of them is that of a plant whose rates are
/// larger by as much, so that an estimate moves by as much of itself at most.
const ALIKE: f64 = 1e-9;
/// So are lengths that differ by what rounding leaves of stamps as large as the record's: half a unit in the last place of each of the four.
const ROUNDINGS: f64 = 2.0 * f64::EPSILON;

/// The lengths of the intervals between the samples of a record (s).
#[derive(Debug)]
pub(crate) struct Lengths {
    /// Each once, ascending: the mean of those that are alike, so that they add up to the same time.
    all: Vec<f64>,
    /// The number of that of each interval; empty where there is only one.
    of: Vec<u32>,
}

impl Lengths {
    pub fn of(record: &Record) -> Self {
        match record.times() {
            Time::Uniform { step, .. } => Lengths { all: vec![*step], of: vec![] },
            Time::Stamps(stamps) => Lengths::of_stamps(stamps),
        }
    }

    fn of_stamps(stamps: &[f64]) -> Self {
        let lengths: Vec<f64> = stamps.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let rounding = ROUNDINGS * stamps.iter().fold(0.0, |largest: f64, stamp| largest.max(stamp.abs()));
        let mut order: Vec<u32> = (0..).take(lengths.len()).collect();
        order.sort_unstable_by(|a, b| lengths[*a as usize].total_cmp(&lengths[*b as usize]));
        let length = |interval: u32| lengths[interval as usize];
        // Several measurements at one instant are no time apart, whatever the rounding.
        let alike =
            |first: f64, other: f64| other - first <= (ALIKE * first + rounding) * f64::from(u8::from(first > 0.0));
        let (mut all, mut of) = (vec![], vec![0; lengths.len()]);
        let mut left = &order[..];
        while let [first, ..] = left {
            let (same, others) = left.split_at(left.partition_point(|other| alike(length(*first), length(*other))));
            same.iter().for_each(|interval| of[*interval as usize] = all.len() as u32);
            all.push(same.iter().map(|interval| length(*interval)).sum::<f64>() / same.len() as f64);
            left = others;
        }
        Lengths { all, of }
    }

    /// How many there are.
    pub fn count(&self) -> usize {
        self.all.len()
    }

    /// How many there are from one length to below another.
    pub fn between(&self, [begin, end]: [f64; 2]) -> usize {
        let below = |limit: f64| self.all.partition_point(|length| *length < limit);
        below(end).saturating_sub(below(begin))
    }

    /// That of the interval after a sample; after the last one, where no time passes, that of the last interval. Not a number where there is none.
    pub fn after(&self, sample: usize) -> f64 {
        let number = self.of.get(sample).or(self.of.last()).map_or(0, |number| *number as usize);
        self.all.get(number).copied().unwrap_or(f64::NAN)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 500 stamps `0.1 k` by products, and by sums, have two hundred differences; the stamps of a clock of today in seconds keep seven digits
    /// of a tenth.
    #[test]
    fn lengths_that_differ_by_rounding_are_one() {
        let products: Vec<f64> = (0..500).map(|k| f64::from(k) * 0.1).collect();
        let mut sum = 0.0;
        let sums: Vec<f64> = (0..500)
            .map(|_| {
                sum += 0.1;
                sum
            })
            .collect();
        let today: Vec<f64> = products.iter().map(|t| 1.8e9 + t).collect();
        for (stamps, digits) in [(products, 1e-14), (sums, 1e-12), (today, 1e-8)] {
            let found = Lengths::of_stamps(&stamps);
            assert!(found.count() == 1 && (found.after(7) - 0.1).abs() < digits, "{found:?}");
        }
    }

    /// Gaps, jitter of a millionth, and measurements at one instant are lengths of their own.
    #[test]
    fn lengths_that_differ_by_more() {
        // A clock of today shows a microsecond as four or five of its steps; two measurements at one instant are no time apart.
        assert_eq!(Lengths::of_stamps(&[0.0, 0.0, 5e-7, 5e-7].map(|t| 1.8e9 + t)).count(), 2);
        let found = Lengths::of_stamps(&[0.0, 900.0, 1800.0, 1800.0, 4500.0, 5400.0 + 1e-3, 5400.0 + 1e-3 + 900.0]);
        assert_eq!(found.count(), 4);
        let after: Vec<f64> = (0..8).map(|k| found.after(k)).collect();
        assert_eq!(after[..4], [900.0, 900.0, 0.0, 2700.0]);
        assert_eq!(
            [[0.0, 900.0], [0.0, 900.0005], [900.0005, 1e9], [1e9, 0.0]].map(|range| found.between(range)),
            [1, 2, 2, 0]
        );
        // The sum of stamps that end in a thousandth.
        assert!((after[4] - 900.001).abs() < 1e-9 && (after[5] - 900.0).abs() < 1e-9, "{after:?}");
        assert_eq!(after[5..], [after[5]; 3]);
    }
}
