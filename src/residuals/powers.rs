//! Sums of errors and powers of their predictions, for tests of the model's shape and of changes between parts of the data.
//!
//! Errors of a model of the right shape are uncorrelated with every function of what it predicts (Ramsey, J. Royal Statistical
//! Society B 31 (1969) 350), in every part of the data. The fit has removed from the errors what its unknowns explain, so that by
//! chance a regression explains no more of them than of the noise: the tests hold without slopes, with a level that is at most the
//! nominal one.

use crate::problem::Objective;
use crate::record::Record;
use crate::wide::{Terms, Wide, sums};
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

/// Regressors of a test of shape: a constant and three powers.
pub(crate) const SHAPE: usize = 4;
/// Regressors of a part of the data: a constant, the prediction, and its change from the sample before.
const PART: usize = 3;
/// More records than these are not compared one by one.
pub(crate) const COMPARED: usize = 100;
/// With fewer degrees of freedom the errors are not examined: Fisher's distribution is that of normal errors.
const FEWEST: f64 = 30.0;
/// A regressor of which less than this part of its square is left beside the others is one of their combinations.
const ALIKE: f64 = 1e-9;

/// Center and width of a range of predictions, which makes their powers numbers around one.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Scale {
    center: f64,
    inverse: f64,
}

impl Scale {
    /// Of a channel with these ranges in the records.
    pub fn over(ranges: impl Iterator<Item = Option<(f64, f64)>>) -> Self {
        let nothing = (f64::INFINITY, f64::NEG_INFINITY);
        Scale::new(ranges.flatten().fold(nothing, |(low, high), (a, b)| (low.min(a), high.max(b))))
    }

    fn new((least, greatest): (f64, f64)) -> Self {
        let inverse = (0.5 * (greatest - least)).recip();
        Scale { center: 0.5 * (least + greatest), inverse: if inverse.is_finite() { inverse } else { 0.0 } }
    }

    #[inline(always)]
    pub fn of<W: Wide>(self, y: W, error: W) -> W {
        y.sub(error).sub(W::splat(self.center)).mul(W::splat(self.inverse))
    }

    /// A prediction, scaled.
    pub fn one(self, prediction: f64) -> f64 {
        (prediction - self.center) * self.inverse
    }
}

/// `c, c^2, c^3, e, e c, e c^2, e c^3, e^2` of scaled predictions `c` and errors `e`.
#[derive(Clone, Copy)]
struct Low(Scale);

impl Terms<2, 8> for Low {
    #[inline(always)]
    fn of<W: Wide>(self, [y, e]: [W; 2]) -> [W; 8] {
        let c = self.0.of(y, e);
        let (square, product) = (c.mul(c), e.mul(c));
        [c, square, square.mul(c), e, product, e.mul(square), product.mul(square), e.mul(e)]
    }
}

/// `c^4, c^5, c^6` and, with the change `d` of `c` from the sample before, `d, c d, d^2, e d`.
#[derive(Clone, Copy)]
struct High(Scale);

impl Terms<4, 7> for High {
    #[inline(always)]
    fn of<W: Wide>(self, [y, e, y_before, e_before]: [W; 4]) -> [W; 7] {
        let c = self.0.of(y, e);
        let d = c.sub(self.0.of(y_before, e_before));
        let square = c.mul(c);
        let fourth = square.mul(square);
        [fourth, fourth.mul(c), fourth.mul(square), d, c.mul(d), d.mul(d), e.mul(d)]
    }
}

/// Sums over samples that follow another one.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Powers {
    count: f64,
    low: [f64; 8],
    high: [f64; 7],
}

impl Powers {
    /// Takes all samples but the first, from their measured values and errors.
    pub fn add(&mut self, scale: Scale, values: &[f64], errors: &[f64]) {
        let Some(count) = values.len().checked_sub(1).filter(|count| *count > 0) else { return };
        let low = sums([&values[1..], &errors[1..]], Low(scale));
        let high = sums([&values[1..], &errors[1..], &values[..count], &errors[..count]], High(scale));
        self.append(&Powers { count: count as f64, low, high });
    }

    pub fn append(&mut self, other: &Powers) {
        self.count += other.count;
        self.low.iter_mut().zip(other.low).for_each(|(sum, other)| *sum += other);
        self.high.iter_mut().zip(other.high).for_each(|(sum, other)| *sum += other);
    }

    /// The same with errors and regressors multiplied by a number.
    fn times(&self, factor: f64) -> Self {
        let square = factor * factor;
        Powers {
            count: square * self.count,
            low: self.low.map(|sum| square * sum),
            high: self.high.map(|sum| square * sum),
        }
    }

    /// The regression on powers of the prediction.
    fn shape(&self) -> (f64, f64) {
        let [c1, c2, c3, e, ec1, ec2, ec3, _] = self.low;
        let [c4, c5, c6, ..] = self.high;
        let gram = [[self.count, c1, c2, c3], [c1, c2, c3, c4], [c2, c3, c4, c5], [c3, c4, c5, c6]];
        explained(gram, [e, ec1, ec2, ec3])
    }

    /// The regression on a constant, the prediction and its change.
    fn part(&self) -> (f64, f64) {
        let [c, cc, _, e, ec, ..] = self.low;
        let [_, _, _, d, cd, dd, ed] = self.high;
        explained::<PART>([[self.count, c, d], [c, cc, cd], [d, cd, dd]], [e, ec, ed])
    }

    fn squares(&self) -> f64 {
        self.low[7]
    }

    /// The probability that so much of the errors follows from the prediction by chance.
    pub fn shape_by_chance(&self) -> f64 {
        let (gain, degrees) = self.shape();
        by_chance(gain, degrees, self.squares() - gain, self.count - degrees)
    }
}

/// The probability that errors of several parts of the data differ as much in how they follow from the prediction.
pub(crate) fn parts_by_chance(parts: &[Powers]) -> f64 {
    let mut whole = Powers::default();
    let (mut gain, mut degrees, mut free) = (0.0, 0.0, 0.0);
    for part in parts.iter().filter(|part| part.count > 2.0 * PART as f64) {
        // In units of the noise of the part.
        let (own, rank) = part.part();
        let variance = (part.squares() - own) / (part.count - rank);
        if !(variance > 0.0 && variance.is_finite()) {
            return 1.0;
        }
        whole.append(&part.times(variance.sqrt().recip()));
        (gain, degrees, free) = (gain + own / variance, degrees + rank, free + part.count - rank);
    }
    let (common, rank) = whole.part();
    by_chance(gain - common, degrees - rank, free, free)
}

/// Fisher's test of a gain with so many degrees of freedom, beside errors of the others.
pub(crate) fn by_chance(gain: f64, degrees: f64, squares: f64, free: f64) -> f64 {
    let ratio = gain / degrees / (squares / free);
    if !(degrees >= 1.0 && free >= FEWEST && ratio.is_finite()) {
        return 1.0;
    }
    FisherSnedecor::new(degrees, free).map_or(1.0, |distribution| distribution.sf(ratio))
}

/// What a regression explains of the errors, and how many of its regressors are no combinations of those before, from their
/// products among each other and with the errors.
pub(crate) fn explained<const D: usize>(mut gram: [[f64; D]; D], mut right: [f64; D]) -> (f64, f64) {
    let (mut gain, mut rank) = (0.0, 0.0);
    let own: [f64; D] = std::array::from_fn(|i| gram[i][i]);
    for i in 0..D {
        let pivot = gram[i][i];
        if !(pivot > ALIKE * own[i] && pivot.is_finite()) {
            continue;
        }
        gain += right[i] * right[i] / pivot;
        rank += 1.0;
        for k in i + 1..D {
            let factor = gram[k][i] / pivot;
            (i..D).for_each(|c| gram[k][c] -= factor * gram[i][c]);
            right[k] -= factor * right[i];
        }
    }
    (gain, rank)
}

/// The scales of an objective's predictions; none where errors do not have to be uncorrelated with them: with a loss, weights or a
/// pre-filter, and where predictions restart from measurements with errors of their own.
pub(crate) fn scales(objective: &Objective<'_>) -> Vec<Scale> {
    let all = objective.loss().is_none() && !objective.is_weighted() && objective.problem.settings.prefilter.is_none();
    if !all || objective.sweep.restarts().is_some() {
        return vec![];
    }
    let found: Vec<_> = objective.problem.records.iter().map(Record::inspect_some).collect();
    (0..objective.outputs()).map(|j| Scale::over(found.iter().map(|one| one.outputs[j].range))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;
    use nalgebra::{DMatrix, DVector};

    /// Measured values around 1e5 and their errors.
    fn series(random: &mut Random, count: usize, error: impl Fn(f64, f64, usize) -> f64) -> (Vec<f64>, Vec<f64>) {
        let (mut state, mut values, mut errors) = (0.0, vec![], vec![]);
        for k in 0..count {
            state = 0.8 * state + random.normal();
            let own = error(state, random.normal(), k);
            values.push(1e5 + state + own);
            errors.push(own);
        }
        (values, errors)
    }

    fn scale(values: &[f64]) -> Scale {
        let ends = values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(*v), b.max(*v)));
        Scale::new(ends)
    }

    fn powers(values: &[f64], errors: &[f64]) -> Powers {
        let mut powers = Powers::default();
        powers.add(scale(values), values, errors);
        powers
    }

    /// What a dense least-squares solution leaves, with the same regressors, unscaled.
    #[test]
    fn sums_explain_what_a_regression_does() {
        let (values, errors) = series(&mut Random::stream(5, 0), 203, |c, e, _| 0.1 * c + 0.02 * c * c + e);
        let c: Vec<f64> = values.iter().zip(&errors).map(|(y, e)| y - e - 1e5).collect();
        let e = DVector::from_fn(202, |k, _| errors[k + 1]);
        let gain = |design: DMatrix<f64>| {
            let found = design.clone().svd(true, true).solve(&e, 1e-12).unwrap();
            e.norm_squared() - (&e - design * found).norm_squared()
        };
        let shape = gain(DMatrix::from_fn(202, 4, |k, i| c[k + 1].powi(i as i32)));
        let part = gain(DMatrix::from_fn(202, 3, |k, i| [1.0, c[k + 1], c[k + 1] - c[k]][i]));
        let found = powers(&values, &errors);
        // A value of 1e5 leaves 11 digits of what is around one.
        for ((own, rank), expected, regressors) in [(found.shape(), shape, 4.0), (found.part(), part, 3.0)] {
            assert!((own / expected - 1.0).abs() < 1e-8 && rank == regressors, "{own} {expected} {rank}");
        }
    }

    /// Of 4,000 series of white errors each test is below 0.01 in 40, with a binomial deviation of 6.3.
    #[test]
    fn white_errors_pass_at_the_level() {
        let mut random = Random::stream(6, 0);
        let mut below = [0; 2];
        for _ in 0..4_000 {
            let (values, errors) = series(&mut random, 100, |_, e, _| e);
            let scale = scale(&values);
            let mut halves = [Powers::default(); 2];
            halves[0].add(scale, &values[..50], &errors[..50]);
            halves[1].add(scale, &values[50..], &errors[50..]);
            below[0] += usize::from(powers(&values, &errors).shape_by_chance() < 0.01);
            below[1] += usize::from(parts_by_chance(&halves) < 0.01);
        }
        assert!(below.iter().all(|count| (15..=65).contains(count)), "{below:?}");
    }

    /// A square that was left out; a gain that is 5 % more in one half and less in the other.
    #[test]
    fn errors_that_follow_from_the_prediction() {
        let mut random = Random::stream(7, 0);
        let (values, errors) = series(&mut random, 2_000, |c, e, _| 0.05 * (c * c - 2.8) + e);
        assert!(powers(&values, &errors).shape_by_chance() < 1e-4);
        let (values, errors) = series(&mut random, 2_000, |c, e, k| if k < 1_000 { 0.1 * c + e } else { e - 0.1 * c });
        let scale = scale(&values);
        let mut halves = [Powers::default(); 2];
        halves[0].add(scale, &values[..1_000], &errors[..1_000]);
        halves[1].add(scale, &values[1_000..], &errors[1_000..]);
        assert!(parts_by_chance(&halves) < 1e-6 && powers(&values, &errors).shape_by_chance() > 1e-3);
    }

    /// No samples, one, errors of zero, constant predictions, and numbers that overflow.
    #[test]
    fn errors_that_say_nothing() {
        let constant: Vec<f64> = (0..100).map(|k| 1.0 + f64::from(k % 3)).collect();
        let errors: Vec<f64> = constant.iter().map(|y| y - 2.0).collect();
        let large = [1e200, -1e200].repeat(50);
        for (values, errors) in [
            (&[][..], &[][..]),
            (&[1.0], &[0.5]),
            (&constant, &[0.0; 100]),
            (&[2.0; 100], &[0.0; 100]),
            (&large, &large),
        ] {
            let found = powers(values, errors);
            let parts = [found, found];
            assert_eq!([found.shape_by_chance(), parts_by_chance(&parts)], [1.0; 2], "{:?}", values.first());
        }
        let (_, rank) = powers(&constant, &errors).shape();
        assert_eq!(rank, 1.0);
    }
}
