//! Products of errors with what they may follow from.

use crate::estimate::student::two_sided;
use crate::residuals::powers::{SHAPE, explained};
use crate::whiteness::chi_squared_tail;
use crate::wide::{Terms, Wide, sums};

/// Sums over errors `e` and regressors `z`.
#[derive(Clone, Copy)]
pub(crate) struct Products<const N: usize> {
    regressors: [[f64; N]; N],
    /// Of `e z` and of `e^2 z z'`, which is the covariance of the former, of whatever size the errors are each (White, Econometrica 48
    /// (1980) 817).
    errors: [f64; N],
    squares: [[f64; N]; N],
    sum_of_squares: f64,
}

impl<const N: usize> Default for Products<N> {
    fn default() -> Self {
        Products { regressors: [[0.0; N]; N], errors: [0.0; N], squares: [[0.0; N]; N], sum_of_squares: 0.0 }
    }
}

impl<const N: usize> Products<N> {
    pub fn take(&mut self, z: [f64; N], error: f64) {
        for i in 0..N {
            self.errors[i] += error * z[i];
            for c in 0..N {
                self.regressors[i][c] += z[i] * z[c];
                self.squares[i][c] += error * error * z[i] * z[c];
            }
        }
        self.sum_of_squares += error * error;
    }

    pub fn append(&mut self, other: &Self) {
        let add = |(sum, other): (&mut f64, &f64)| *sum += other;
        self.regressors.as_flattened_mut().iter_mut().zip(other.regressors.as_flattened()).for_each(add);
        self.squares.as_flattened_mut().iter_mut().zip(other.squares.as_flattened()).for_each(add);
        self.errors.iter_mut().zip(&other.errors).for_each(add);
        self.sum_of_squares += other.sum_of_squares;
    }

    pub fn sum_of_squares(&self) -> f64 {
        self.sum_of_squares
    }

    /// The root of the part of the squared errors that follows from the regressors.
    pub fn explained_part(&self) -> f64 {
        let (gain, _) = explained(self.regressors, self.errors);
        (gain / self.sum_of_squares).clamp(0.0, 1.0).sqrt()
    }

    /// The probability that errors follow as much from them by chance.
    pub fn by_chance(&self) -> f64 {
        let (gain, rank) = explained(self.squares, self.errors);
        chi_squared_tail(gain, rank)
    }
}

/// Powers of one regressor, `1, z, z^2, z^3`.
impl Products<SHAPE> {
    /// Adds the products of a series. `present` is one where there is an error; elsewhere it is zero, and so is the error.
    pub fn take_powers(&mut self, values: &[f64], errors: &[f64], present: &[f64]) {
        let sums = sums([errors, values, present], Powers);
        let (regressors, rest) = sums.split_at(POWERS);
        let (squares, products) = rest.split_at(POWERS);
        for i in 0..SHAPE {
            self.errors[i] += products[i];
            for c in 0..SHAPE {
                self.regressors[i][c] += regressors[i + c];
                self.squares[i][c] += squares[i + c];
            }
        }
        self.sum_of_squares += squares[0];
    }
}

/// How many powers the products of two regressors are.
const POWERS: usize = 2 * SHAPE - 1;

/// Sums of `z^i`, of `e^2 z^i` and of `e z^i`.
#[derive(Clone, Copy)]
struct Powers;

impl Terms<3, { 2 * POWERS + SHAPE }> for Powers {
    #[inline(always)]
    fn of<W: Wide>(self, [error, value, present]: [W; 3]) -> [W; 2 * POWERS + SHAPE] {
        let mut terms = [W::splat(0.0); 2 * POWERS + SHAPE];
        let (mut power, mut square, mut product) = (present, error.mul(error), error);
        let mut i = 0;
        while i < POWERS {
            (terms[i], terms[POWERS + i]) = (power, square);
            (power, square) = (power.mul(value), square.mul(value));
            if i < SHAPE {
                terms[2 * POWERS + i] = product;
                product = product.mul(value);
            }
            i += 1;
        }
        terms
    }
}

/// Sums over errors `e` and one regressor `z` that may be zero but for a few samples, such as the steps of an input.
#[derive(Clone, Copy, Default)]
pub(crate) struct Change {
    squares: f64,
    fourths: f64,
    product: f64,
    errors: f64,
    mixed: f64,
}

impl Change {
    /// Adds the sums of a series, whose regressor is `values - before`. `present` is one where there is an error; elsewhere it is zero, and so
    /// is the error.
    pub fn take_differences(&mut self, values: &[f64], before: &[f64], errors: &[f64], present: &[f64]) {
        let [squares, fourths, product, own, mixed] = sums([errors, values, before, present], Differences);
        self.squares += squares;
        self.fourths += fourths;
        self.product += product;
        self.errors += own;
        self.mixed += mixed;
    }

    /// The root of the part of this sum of squared errors that follows from the regressor.
    pub fn explained_part(&self, sum_of_squares: f64) -> f64 {
        let part = self.product * self.product / (self.squares * sum_of_squares);
        if part.is_finite() { part.clamp(0.0, 1.0).sqrt() } else { 0.0 }
    }

    /// The probability that errors follow as much from it by chance: Student's, with the variance of what is left of each error, of whatever
    /// size, and as many degrees of freedom as there are samples that count.
    pub fn by_chance(&self) -> f64 {
        let slope = self.product / self.squares;
        let variance = self.errors - 2.0 * slope * self.mixed + slope * slope * self.fourths;
        let (t, degrees) = (self.product / variance.sqrt(), self.squares * self.squares / self.fourths - 1.0);
        two_sided(t, degrees)
    }
}

/// The terms of a [`Change`].
#[derive(Clone, Copy)]
struct Differences;

impl Terms<4, 5> for Differences {
    #[inline(always)]
    fn of<W: Wide>(self, [error, value, before, present]: [W; 4]) -> [W; 5] {
        let z = value.sub(before).mul(present);
        let (square, product) = (z.mul(z), z.mul(error));
        [square, square.mul(square), product, product.mul(product), square.mul(product)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    fn take(sums: &mut Change, z: f64, error: f64) {
        sums.take_differences(&[z], &[0.0], &[error], &[1.0]);
    }

    /// A step every 40th of 1,200 samples, and errors of noise, of another size where the steps are: of 4,000 series one in a hundred is below
    /// the level, 40 with a deviation of 6.3; Student's distribution is that of equal steps, these are uniform, and fewer count.
    #[test]
    fn errors_of_noise_seldom_follow() {
        let (mut random, mut below) = (Random::stream(41, 0), 0);
        for _ in 0..4_000 {
            let mut sums = Change::default();
            for k in 0..1_200 {
                let z = if k % 40 == 0 { 2.0 * random.uniform() - 1.0 } else { 0.0 };
                take(&mut sums, z, random.normal() * (1.0 + z.abs()));
            }
            below += usize::from(sums.by_chance() < 0.01);
        }
        assert!((15..=60).contains(&below), "{below}");
    }

    /// As if each value and each error that is there had been taken by itself: sums of 250 terms in another order.
    #[test]
    fn series_are_taken_as_their_members_are() {
        let mut random = Random::stream(43, 0);
        let values: Vec<f64> = (0..253).map(|_| 2.0 * random.uniform() - 1.0).collect();
        let present: Vec<f64> = (0..253).map(|k| if k % 7 == 3 { 0.0 } else { 1.0 }).collect();
        let errors: Vec<f64> = present.iter().map(|one| one * random.normal()).collect();
        let (mut powers, mut change) = (Products::<SHAPE>::default(), Change::default());
        powers.take_powers(&values[1..], &errors[1..], &present[1..]);
        change.take_differences(&values[1..], &values, &errors[1..], &present[1..]);
        let there: Vec<usize> = (1..253).filter(|k| present[*k] > 0.0).collect();
        let mut by_one = Products::<SHAPE>::default();
        there.iter().for_each(|&k| by_one.take(std::array::from_fn(|i| values[k].powi(i as i32)), errors[k]));
        let near = |a: f64, b: f64| assert!((a / b - 1.0).abs() < 1e-12, "{a} {b}");
        near(powers.explained_part(), by_one.explained_part());
        near(powers.by_chance(), by_one.by_chance());
        near(powers.sum_of_squares(), by_one.sum_of_squares());
        let sum =
            |of: &dyn Fn(f64, f64) -> f64| there.iter().map(|&k| of(values[k] - values[k - 1], errors[k])).sum::<f64>();
        let (squares, all) = (sum(&|z, _| z * z), sum(&|_, e| e * e));
        let slope = sum(&|z, e| z * e) / squares;
        near(change.explained_part(all), (slope * slope * squares / all).sqrt());
        let deviation = sum(&|z, e| z * z * (e - slope * z).powi(2)).sqrt();
        let degrees = squares * squares / sum(&|z, _| z.powi(4)) - 1.0;
        near(change.by_chance(), two_sided(slope * squares / deviation, degrees));
    }

    /// Ten errors of half the steps and noise of a tenth: `t` is `0.5 sqrt(10) / 0.1`, 16, with nine degrees of freedom, about 1e-7.
    #[test]
    fn errors_that_follow_a_few_steps() {
        let (mut random, mut sums, mut squares) = (Random::stream(42, 0), Change::default(), 0.0);
        for k in 0..400 {
            let z = if k % 40 == 0 { 1.0 } else { 0.0 };
            let error = 0.5 * z + 0.1 * random.normal();
            take(&mut sums, z, error);
            squares += error * error;
        }
        assert!(sums.by_chance() < 1e-5, "{}", sums.by_chance());
        // `10 0.25` of `10 0.25 + 400 0.01`, to a tenth.
        assert!((sums.explained_part(squares) - (2.5f64 / 6.5).sqrt()).abs() < 0.07);
        assert_eq!((Change::default().by_chance(), Change::default().explained_part(0.0)), (1.0, 0.0));
    }
}
