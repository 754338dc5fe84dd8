//! Products of errors with what they may follow from.

use super::powers::explained;
use crate::whiteness::chi_squared_tail;

/// Sums over errors `e` and regressors `z`.
#[derive(Clone, Copy)]
pub(super) struct Products<const N: usize> {
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
