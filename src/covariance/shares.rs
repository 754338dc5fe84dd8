//! Unknowns whose intervals rest on one or two measurements.
//!
//! If all errors, times the roots of their weights, have one variance, a measurement with slopes `g` and weight `w` makes the
//! part `w (c g)^2 / c_i` of the variance of unknown `i`, where `c` is its row of the inverse curvature and `c_i` the diagonal
//! entry. Where this part is close to one, the interval is as right as what is assumed of this measurement's noise: the fit
//! passes through it, so its error does not tell.

mod pass;

use crate::covariance::leverage::ALONE;
use crate::covariance::sizes::Sizes;
use crate::problem::Objective;
use nalgebra::DMatrix;
pub(crate) use pass::Pass;

/// Part of the variance from which on one measurement, or two together, decide.
pub(crate) const DECIDES: f64 = 0.9;

/// A measurement, and its part in the variance of an unknown.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Share {
    pub part: f64,
    pub experiment: usize,
    pub output: usize,
    pub sample: usize,
}

/// The two largest shares in the variance of an unknown, the largest first; of equal ones those that were taken first.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Largest([Share; 2]);

impl Largest {
    pub fn take(&mut self, share: Share) {
        let Largest([first, second]) = self;
        if share.part > first.part {
            *second = std::mem::replace(first, share);
        } else if share.part > second.part {
            *second = share;
        }
    }

    /// The measurements that decide: one, or two together.
    pub fn decisive(&self) -> Option<&[Share]> {
        let Largest(shares) = self;
        (1..=shares.len()).map(|count| &shares[..count]).find(|shares| part(shares) >= DECIDES)
    }

    pub fn append(&mut self, later: Largest) {
        later.0.into_iter().for_each(|share| self.take(share));
    }
}

/// The largest shares of the unknowns of one experiment, and the sizes of the errors that have them.
pub(crate) struct Shares {
    experiment: usize,
    inverse: DMatrix<f64>,
    moved: Vec<f64>,
    parts: Vec<f64>,
    largest: Vec<Largest>,
    sizes: Sizes,
}

impl Shares {
    /// With the inverse curvature of the experiment's unknowns.
    pub fn new(experiment: usize, inverse: DMatrix<f64>) -> Self {
        let columns = inverse.nrows();
        let none = || vec![0.0; columns];
        let (largest, sizes) = (vec![Largest::default(); columns], Sizes::new(columns));
        Shares { experiment, inverse, moved: none(), parts: none(), largest, sizes }
    }

    /// The number of slopes that a measurement has.
    pub fn columns(&self) -> usize {
        self.moved.len()
    }

    /// By how much an error of one would move each unknown, by the slopes of the last call.
    pub fn moved(&self) -> &[f64] {
        &self.moved
    }

    /// Sets by how much an error of one would move each unknown, and returns by how much it would move its own prediction.
    pub fn move_by(&mut self, slopes: &[f64]) -> f64 {
        self.moved.fill(0.0);
        for (column, slope) in self.inverse.column_iter().zip(slopes) {
            self.moved.iter_mut().zip(&column).for_each(|(moved, entry)| *moved += entry * slope);
        }
        self.moved.iter().zip(slopes).map(|(moved, slope)| moved * slope).sum()
    }

    /// Takes a measurement with these slopes and this error, and returns its leverage.
    pub fn take(&mut self, weight: f64, slopes: &[f64], error: f64, (output, sample): (usize, usize)) -> f64 {
        let leverage = weight * self.move_by(slopes);
        for (c, (moved, largest)) in self.moved.iter().zip(&mut self.largest).enumerate() {
            let part = weight * moved * moved / self.inverse[(c, c)];
            self.parts[c] = part;
            largest.take(Share { part, experiment: self.experiment, output, sample });
        }
        // The error of a measurement that alone determines an unknown is rounding.
        if 1.0 - leverage > ALONE {
            self.sizes.take(&self.parts, weight * error * error / (1.0 - leverage));
        }
        leverage
    }

    pub fn append(&mut self, later: &Shares) {
        self.largest.iter_mut().zip(&later.largest).for_each(|(largest, later)| largest.append(*later));
        self.sizes.append(&later.sizes);
    }
}

/// The largest shares of all unknowns from those of the experiments.
pub(crate) fn of_all<'s>(objective: &Objective<'_>, all: impl Iterator<Item = &'s Shares>) -> Vec<Largest> {
    let unknowns = &objective.problem.unknowns;
    let mut largest = vec![Largest::default(); unknowns.row.len()];
    for (e, one) in all.enumerate() {
        unknowns.columns(e).zip(&one.largest).for_each(|(i, own)| largest[i].append(*own));
    }
    largest
}

/// The sizes of all errors from those of the experiments.
pub(crate) fn sizes_of_all<'s>(objective: &Objective<'_>, all: impl Iterator<Item = &'s Shares>) -> Sizes {
    let unknowns = &objective.problem.unknowns;
    let mut sizes = Sizes::new(unknowns.row.len());
    all.enumerate().for_each(|(e, one)| sizes.append_to(unknowns.columns(e), &one.sizes));
    sizes
}

/// The part that these measurements have together.
pub(crate) fn part(shares: &[Share]) -> f64 {
    shares.iter().map(|share| share.part).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn share(part: f64, sample: usize) -> Share {
        Share { part, experiment: 0, output: 0, sample }
    }

    fn largest(parts: &[f64]) -> Largest {
        let mut largest = Largest::default();
        parts.iter().enumerate().for_each(|(sample, part)| largest.take(share(*part, sample)));
        largest
    }

    /// Of two equal ones the first is kept, also where pieces of a record are joined.
    #[test]
    fn the_two_largest() {
        let of_all = largest(&[0.1, 0.4, 0.2, 0.4, 0.3]);
        assert_eq!(of_all, Largest([share(0.4, 1), share(0.4, 3)]));
        let mut joined = largest(&[0.1, 0.4]);
        let mut later = Largest::default();
        [0.2, 0.4, 0.3].into_iter().enumerate().for_each(|(k, part)| later.take(share(part, 2 + k)));
        joined.append(later);
        assert_eq!(joined, of_all);
    }

    #[test]
    fn one_or_two_decide() {
        let decisive = |parts: &[f64]| largest(parts).decisive().map_or(0, <[Share]>::len);
        let found = [&[0.91, 0.05][..], &[0.89, 0.02], &[0.5, 0.41], &[0.5, 0.39], &[]].map(decisive);
        assert_eq!(found, [1, 2, 2, 0, 0]);
    }

    /// Pieces of a record, in order of time: of each unknown the largest shares of all pieces, as if one had taken them all.
    #[test]
    fn pieces_of_a_record_join() {
        let new = || Shares::new(3, DMatrix::from_row_slice(2, 2, &[2.0, 0.0, 0.0, 5.0]));
        let slopes: Vec<[f64; 2]> = (0..6).map(|k| [(k * k % 7) as f64, (k * k * k % 11) as f64]).collect();
        let take = |range: std::ops::Range<usize>| {
            let mut shares = new();
            range.for_each(|k| _ = shares.take(1.0, &slopes[k], 0.0, (0, k)));
            shares
        };
        let mut joined = take(0..3);
        joined.append(&take(3..6));
        // Squares of the slopes 0, 1, 4, 2, 2, 4 times 2, and of 0, 1, 8, 5, 9, 4 times 5.
        let of = |parts: [(f64, usize); 2]| Largest(parts.map(|(part, k)| Share { experiment: 3, ..share(part, k) }));
        assert_eq!(joined.largest, [of([(32.0, 2), (32.0, 5)]), of([(405.0, 4), (320.0, 2)])]);
        assert_eq!((joined.columns(), take(0..6).largest), (2, joined.largest));
    }

    /// Slopes (1, 0), (0, 2), (1, 1) with weights 1, 1 and 2: the inverse curvature is that of [[3, 2], [2, 6]], which is
    /// [[6, -2], [-2, 3]] / 14. The shares of each unknown add up to one, the leverages to the number of unknowns.
    #[test]
    fn shares_and_leverages_by_hand() {
        let inverse = DMatrix::from_row_slice(2, 2, &[6.0, -2.0, -2.0, 3.0]) / 14.0;
        let mut shares = Shares::new(0, inverse);
        let rows = [(1.0, [1.0, 0.0]), (1.0, [0.0, 2.0]), (2.0, [1.0, 1.0])];
        let take = |(k, (weight, slopes)): (usize, (f64, [f64; 2]))| shares.take(weight, &slopes, 0.0, (0, k));
        let leverages: Vec<f64> = rows.into_iter().enumerate().map(take).collect();
        let expected = [6.0 / 14.0, 12.0 / 14.0, 10.0 / 14.0];
        assert!(leverages.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-15), "{leverages:?}");
        // (6, -4, 4) and (-2, 6, 1), squared, times the weights, over 6 * 14 and 3 * 14.
        let expected = [[(36.0 / 84.0, 0), (32.0 / 84.0, 2)], [(36.0 / 42.0, 1), (4.0 / 42.0, 0)]];
        for (Largest(found), expected) in shares.largest.iter().zip(expected) {
            for (found, (part, sample)) in found.iter().zip(expected) {
                assert!((found.part - part).abs() < 1e-15 && found.sample == sample, "{found:?}");
            }
        }
    }
}
