//! Products of errors with what they may follow from.

use crate::estimate::student::two_sided;
use crate::residuals::powers::explained;
use crate::whiteness::chi_squared_tail;

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
    pub fn take(&mut self, z: f64, error: f64) {
        let (square, product) = (z * z, z * error);
        self.squares += square;
        self.fourths += square * square;
        self.product += product;
        self.errors += product * product;
        self.mixed += square * product;
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    /// A step every 40th of 1,200 samples, and errors of noise, of another size where the steps are: of 4,000 series one in a hundred is below
    /// the level, 40 with a deviation of 6.3; Student's distribution is that of equal steps, these are uniform, and fewer count.
    #[test]
    fn errors_of_noise_seldom_follow() {
        let (mut random, mut below) = (Random::stream(41, 0), 0);
        for _ in 0..4_000 {
            let mut sums = Change::default();
            for k in 0..1_200 {
                let z = if k % 40 == 0 { 2.0 * random.uniform() - 1.0 } else { 0.0 };
                sums.take(z, random.normal() * (1.0 + z.abs()));
            }
            below += usize::from(sums.by_chance() < 0.01);
        }
        assert!((15..=60).contains(&below), "{below}");
    }

    /// Ten errors of half the steps and noise of a tenth: `t` is `0.5 sqrt(10) / 0.1`, 16, with nine degrees of freedom, about 1e-7.
    #[test]
    fn errors_that_follow_a_few_steps() {
        let (mut random, mut sums, mut squares) = (Random::stream(42, 0), Change::default(), 0.0);
        for k in 0..400 {
            let z = if k % 40 == 0 { 1.0 } else { 0.0 };
            let error = 0.5 * z + 0.1 * random.normal();
            sums.take(z, error);
            squares += error * error;
        }
        assert!(sums.by_chance() < 1e-5, "{}", sums.by_chance());
        // `10 0.25` of `10 0.25 + 400 0.01`, to a tenth.
        assert!((sums.explained_part(squares) - (2.5f64 / 6.5).sqrt()).abs() < 0.07);
        assert_eq!((Change::default().by_chance(), Change::default().explained_part(0.0)), (1.0, 0.0));
    }
}
