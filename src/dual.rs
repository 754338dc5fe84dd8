//! [`Dual`]: a value and its slopes, propagated exactly through arithmetic (forward-mode differentiation; Griewank and
//! Walther, *Evaluating Derivatives*, 2008, ch. 3).
//!
//! Speed rests on two things. The slopes are a fixed array, of which two at a time stand in a vector register. And a
//! quotient multiplies by the reciprocal of its divisor, which is computed once where the divisor does not change (a
//! parameter inside a time loop); its value may therefore differ from `a / b` in the last bit.

mod functions;
mod operators;

use crate::scalar::{Comparison, Scalar};

/// A value and its slopes with respect to `N` quantities, in numbers of the type `T`.
///
/// With a dual for `T` the slopes have slopes, second derivatives:
/// ```
/// use greybox::{Dual, Scalar};
/// let x = Dual::<1, Dual<1>>::variable(Dual::variable(3.0, 0), 0);
/// assert_eq!((x * x * x).slopes[0].slopes[0], 18.0); // 6 x
/// ```
///
/// ```
/// use greybox::{Dual, Scalar};
/// let x = Dual::<2>::variable(3.0, 0);
/// let y = Dual::<2>::variable(2.0, 1);
/// let f = x * x * y + y.sin();
/// assert_eq!(f.slopes[0], 12.0); // 2 x y
/// assert_eq!(f.slopes[1], 9.0 + 2f64.cos()); // x^2 + cos y
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Dual<const N: usize, T = f64> {
    /// The value.
    pub value: T,
    /// d value / d quantity, one entry per quantity.
    pub slopes: [T; N],
}

impl<const N: usize, T: Scalar> Dual<N, T> {
    /// A number that depends on nothing: all slopes zero.
    #[inline(always)]
    pub fn constant(value: T) -> Self {
        Dual { value, slopes: [T::from(0.0); N] }
    }

    /// The quantity number `lane` itself: slope one there, zero elsewhere (everywhere, when `lane >= N`).
    #[inline(always)]
    pub fn variable(value: T, lane: usize) -> Self {
        let mut slopes = [T::from(0.0); N];
        if let Some(slope) = slopes.get_mut(lane) {
            *slope = T::from(1.0);
        }
        Dual { value, slopes }
    }

    #[inline(always)]
    fn with(value: T, slope: impl Fn(usize) -> T) -> Self {
        let mut slopes = [T::from(0.0); N];
        let mut i = 0;
        while i < N {
            slopes[i] = slope(i);
            i += 1;
        }
        Dual { value, slopes }
    }

    /// The chain rule where `df` may be infinite: what does not vary contributes nothing (no `0 * inf`).
    #[inline(always)]
    fn chain_singular(self, f: T, df: T) -> Self {
        let zero = T::from(0.0);
        Self::with(f, |i| T::select(Comparison::Equal, self.slopes[i], zero, zero, self.slopes[i] * df))
    }

    /// `1 - value^2` without cancellation.
    #[inline(always)]
    fn one_less_square(self) -> T {
        (T::from(1.0) - self.value) * (self.value + 1.0)
    }

    /// The chain rule.
    #[inline(always)]
    fn chained(self, f: T, df: T) -> Self {
        Dual { value: f, slopes: T::slopes_times(&self.slopes, df) }
    }
}

impl<const N: usize, T: Scalar> Default for Dual<N, T> {
    #[inline(always)]
    fn default() -> Self {
        Self::from(0.0)
    }
}

impl<const N: usize, T: Scalar> From<f64> for Dual<N, T> {
    #[inline(always)]
    fn from(value: f64) -> Self {
        Self::constant(T::from(value))
    }
}
