//! Whether errors are larger, or smaller, where they decide an unknown.
//!
//! The variance of an unknown is a sum over all measurements: of the square of what an error would move it by, times the variance
//! of their noise. If that variance is the same for all, the squares of the errors have the same mean in this sum as without
//! weights (White, Econometrica 48 (1980) 817, here for one unknown at a time). The ratio of both means is that of the true variance to
//! the classical one. How far it is from one by chance depends on the variance of the squares: that of normal errors decides on the
//! covariance, since one that allows for errors of changing size is right for errors of one size, too; that found, which heavy tails
//! and errors of changing size enlarge (Koenker, J. Econometrics 17 (1981) 107), decides on what is said.

use statrs::distribution::{ContinuousCDF, Gamma};

/// Levels, over all unknowns, of the test that decides on the covariance and of that which decides on a warning.
const CHOSEN: f64 = 0.05;
pub(crate) const SAID: f64 = 0.01;
/// Variance of the squares of normal errors of unit variance.
const NORMAL: f64 = 2.0;
/// A variance that differs from the classical one by a smaller part is not worth another method.
const LITTLE: f64 = 0.05;

/// Sums over the errors, and over the errors times the shares in the variance of each unknown.
#[derive(Clone)]
pub(crate) struct Sizes {
    count: f64,
    squares: f64,
    fourths: f64,
    of: Vec<Shared>,
}

/// Sums of the shares of an unknown, of their squares, and of the shares times the squared errors.
#[derive(Clone, Copy, Default)]
struct Shared {
    shares: f64,
    squares: f64,
    errors: f64,
}

impl Shared {
    fn add(&mut self, other: &Shared) {
        self.shares += other.shares;
        self.squares += other.squares;
        self.errors += other.errors;
    }
}

impl Sizes {
    pub fn new(unknowns: usize) -> Self {
        Sizes { count: 0.0, squares: 0.0, fourths: 0.0, of: vec![Shared::default(); unknowns] }
    }

    /// Takes a measurement with these shares, and the square of its error.
    pub fn take(&mut self, shares: &[f64], square: f64) {
        self.count += 1.0;
        self.squares += square;
        self.fourths += square * square;
        for (of, share) in self.of.iter_mut().zip(shares) {
            of.add(&Shared { shares: *share, squares: share * share, errors: share * square });
        }
    }

    /// Takes the number of measurements, the sums of their squared errors and of the squares of these; and of each unknown the sums of the
    /// shares, of their squares, and of shares times squared errors.
    pub fn add_sums(&mut self, [count, squares, fourths]: [f64; 3], of: impl Iterator<Item = [f64; 3]>) {
        (self.count, self.squares, self.fourths) = (self.count + count, self.squares + squares, self.fourths + fourths);
        for (sums, [shares, squares, errors]) in self.of.iter_mut().zip(of) {
            sums.add(&Shared { shares, squares, errors });
        }
    }

    pub fn append(&mut self, later: &Sizes) {
        self.append_to(0..self.of.len(), later);
    }

    /// Adds the sums of an experiment, whose unknowns are these of all.
    pub fn append_to(&mut self, columns: impl Iterator<Item = usize>, own: &Sizes) {
        self.count += own.count;
        self.squares += own.squares;
        self.fourths += own.fourths;
        columns.zip(&own.of).for_each(|(i, of)| self.of[i].add(of));
    }

    /// All sums, those over the errors first.
    #[cfg(test)]
    pub fn sums(&self) -> Vec<f64> {
        let of = self.of.iter().flat_map(|of| [of.shares, of.squares, of.errors]);
        [self.count, self.squares, self.fourths].into_iter().chain(of).collect()
    }

    /// The ratio of the variance of an unknown to the classical one; one without shares or errors.
    fn ratio(&self, i: usize) -> f64 {
        let Shared { shares, errors, .. } = self.of[i];
        let ratio = errors / shares / (self.squares / self.count);
        if ratio.is_finite() { ratio } else { 1.0 }
    }

    /// The probability that errors of one size have a ratio as far from one, by the variance of their squares: it has a Gamma
    /// distribution of mean one, nearly.
    fn p_value(&self, i: usize, of_squares: f64) -> f64 {
        let (Shared { shares, squares, .. }, ratio) = (self.of[i], self.ratio(i));
        let variance = of_squares * (squares / (shares * shares) - 1.0 / self.count);
        let gamma = Gamma::new(1.0 / variance, 1.0 / variance);
        // Equal shares have no variance.
        gamma.map_or(1.0, |gamma| 2.0 * gamma.cdf(ratio).min(gamma.sf(ratio)))
    }

    /// The variance of the squares relative to the square of their mean.
    fn variance_of_squares(&self) -> f64 {
        let mean = self.squares / self.count;
        self.fourths / self.count / (mean * mean) - 1.0
    }

    /// The unknown whose variance differs most from the classical one, of those that are not `held`, by a test with this variance of the
    /// squares at this level: one whose classical interval is too short before those whose is too long.
    fn most(&self, held: &[bool], of_squares: f64, level: f64) -> Option<Uneven> {
        let tested: Vec<usize> = (0..self.of.len()).filter(|&i| !held[i]).collect();
        let of = |&unknown: &usize| {
            let factor = Some(self.ratio(unknown)).filter(|ratio| (ratio - 1.0).abs() > LITTLE)?.sqrt();
            let p_value = self.p_value(unknown, of_squares) * tested.len() as f64;
            (p_value < level).then_some(Uneven { unknown, factor, p_value })
        };
        let far = |one: &Uneven| one.factor.ln().abs();
        let too_short = |one: &Uneven| one.factor > 1.0;
        tested.iter().filter_map(of).max_by(|a, b| too_short(a).cmp(&too_short(b)).then(far(a).total_cmp(&far(b))))
    }

    /// Whether the classical covariance may be wrong.
    pub fn differ(&self, held: &[bool]) -> bool {
        self.most(held, NORMAL, CHOSEN).is_some()
    }

    /// The unknown of which it certainly is wrong, and by most.
    pub fn uneven(&self, held: &[bool]) -> Option<Uneven> {
        self.most(held, self.variance_of_squares(), SAID)
    }

    /// The unknown whose classical interval certainly is too short, and by most, by the variance that squares of normal errors have. That found is larger where
    /// the errors change their size, and so fewer of them would be found: too few where the classical interval stays.
    pub fn too_short(&self, held: &[bool]) -> Option<Uneven> {
        self.most(held, NORMAL, SAID).filter(|one| one.factor > 1.0)
    }
}

/// An unknown where errors are of another size: by which factor its standard error differs from the classical one.
#[derive(Clone, Copy)]
pub(crate) struct Uneven {
    pub unknown: usize,
    pub factor: f64,
    pub p_value: f64,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    /// Four errors, of which the first unknown follows from the last two alone, and the second from all.
    #[test]
    fn a_ratio_by_hand() {
        let mut sizes = Sizes::new(2);
        for (k, square) in [1.0, 1.0, 4.0, 2.0].into_iter().enumerate() {
            sizes.take(&[if k < 2 { 0.0 } else { 0.5 }, 0.25], square);
        }
        // A mean of 3 in place of 2; fourths of 22/4, so an excess of 0.375; shares whose squares add up to 1/2 instead of 1/4.
        assert!((sizes.variance_of_squares() - 0.375).abs() < 1e-15);
        assert!((sizes.ratio(0) - 1.5).abs() < 1e-15);
        let p_value = sizes.p_value(0, 0.375);
        let shape = 1.0 / (0.375 * 0.25);
        assert!((p_value - 2.0 * Gamma::new(shape, shape).unwrap().sf(1.5)).abs() < 1e-15, "{p_value}");
        // Equal shares say nothing.
        assert_eq!((sizes.ratio(1), sizes.p_value(1, 0.375)), (1.0, 1.0));
    }

    /// The shares of a line's slope in `count` measurements between -1 and 1 and of another unknown, and errors of these sizes.
    fn line(random: &mut Random, count: usize, size: impl Fn(f64) -> f64, heavy: bool) -> Sizes {
        let mut sizes = Sizes::new(2);
        for k in 0..count {
            let u = 2.0 * (k as f64 + 0.5) / count as f64 - 1.0;
            let tail = if heavy { 1.0 + random.normal().abs() } else { 1.0 };
            let error = size(u) * tail * random.normal();
            sizes.take(&[u * u, f64::from(u > 0.0)], error * error);
        }
        sizes
    }

    /// Of 2,000 lines whose errors are of one size, normal or with heavy tails, one in a hundred is below the level of 0.01: 20, with
    /// a binomial deviation of 4.5; and, of normal ones, one in twenty below 0.05: 100, with a deviation of 10. Squares are far from normal,
    /// and few, so half to twice as many may be found.
    #[test]
    fn errors_of_one_size_are_seldom_uneven() {
        let mut random = Random::stream(23, 0);
        for (count, heavy) in [(30, false), (200, false), (200, true)] {
            let (mut said, mut chosen) = (0, 0);
            for _ in 0..2_000 {
                let sizes = line(&mut random, count, |_| 1.0, heavy);
                said += usize::from(sizes.uneven(&[false; 2]).is_some());
                chosen += usize::from(sizes.differ(&[false; 2]));
            }
            assert!((10..=40).contains(&said), "{count} errors, heavy tails {heavy}: {said}");
            assert!(heavy || (50..=200).contains(&chosen), "{count} errors: {chosen}");
        }
    }

    /// Sizes in proportion to `u`, the squares' mean is 1/3 and that weighted by `u^2` is 3/5: a ratio of 9/5, in standard errors its root.
    /// In the half that is above zero they are as large as in the other.
    #[test]
    fn errors_that_grow_with_the_slope() {
        let mut random = Random::stream(24, 0);
        let factors = (0..100).map(|_| {
            let found = line(&mut random, 1_000, f64::abs, false).uneven(&[false; 2]).unwrap();
            assert!(found.unknown == 0 && found.p_value < 1e-6, "{} {}", found.unknown, found.p_value);
            found.factor
        });
        // The ratio's own deviation is 5 % of each, so half a percent of the mean.
        let mean = factors.sum::<f64>() / 100.0;
        assert!((mean / 1.8f64.sqrt() - 1.0).abs() < 0.01, "{mean}");
    }

    /// No errors, errors of zero, and those whose squares overflow.
    #[test]
    fn errors_that_say_nothing() {
        for error in [0.0, 1e-170, 1e90, 1e200] {
            let mut sizes = Sizes::new(1);
            (0..10).for_each(|k| sizes.take(&[f64::from(k) / 45.0], error * error));
            assert!(sizes.uneven(&[false]).is_none() && !sizes.differ(&[false]), "{error:e}");
        }
        assert!(Sizes::new(1).uneven(&[false]).is_none());
        let mut held = line(&mut Random::stream(25, 0), 1_000, f64::abs, false);
        held.append(&Sizes::new(2));
        assert!(held.uneven(&[true, false]).is_none() && held.uneven(&[false, true]).is_some());
    }
}
