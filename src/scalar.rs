//! [`Scalar`]: what a model's equations are written in.
//!
//! A model is generic over its number type, so that the same text runs on plain `f64` (simulation, observers) and on
//! [`Dual`](crate::Dual) (exact slopes). Constants stand to the right of an operator: `x * 2.0`, not `2.0 * x`, because
//! Rust lets a library add operators to its own type on the left only.

mod table;

#[cfg(feature = "std")]
pub use table::Table;
pub use table::{Extrapolation, Grid, Interpolation, TableError};

use crate::lanes::{Sums, slopes_in_pairs};
use core::fmt::Debug;
use core::iter::Sum;
use core::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

/// A question about two numbers; the answer is no where one of them is not a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
pub enum Comparison {
    /// `a < b`
    Less,
    /// `a <= b`
    LessOrEqual,
    /// `a == b`
    Equal,
}

impl Comparison {
    /// The answer for two numbers.
    #[inline(always)]
    pub fn holds<T: PartialOrd>(self, a: T, b: T) -> bool {
        match self {
            Comparison::Less => a < b,
            Comparison::LessOrEqual => a <= b,
            Comparison::Equal => a == b,
        }
    }
}

/// A real number, or one that carries its slopes.
///
/// Comparison (`<`, `==`) is by value. Functions with a kink or a jump (`abs`, `signum`, `max`, `min`, `floor`, ...) have
/// the one-sided slope of the branch that the value takes; a smooth stand-in for `signum` is `(x / width).tanh()`.
pub trait Scalar:
    Copy
    + Debug
    + Default
    + From<f64>
    + PartialEq
    + PartialOrd
    + PartialEq<f64>
    + PartialOrd<f64>
    + Neg<Output = Self>
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Add<f64, Output = Self>
    + Sub<f64, Output = Self>
    + Mul<f64, Output = Self>
    + Div<f64, Output = Self>
    + AddAssign
    + SubAssign
    + MulAssign
    + DivAssign
    + AddAssign<f64>
    + SubAssign<f64>
    + MulAssign<f64>
    + DivAssign<f64>
    + Sum
    + Send
    + Sync
    + 'static
{
    /// The value without its slopes.
    fn value(&self) -> f64;

    /// `self + k * a`; slopes may be rounded once instead of twice.
    #[inline(always)]
    fn plus_times(self, k: Self, a: f64) -> Self {
        self + k * a
    }
    /// `f(self)`, given the value `f` and the slope `df` of a scalar function at `self`: the chain rule, for functions
    /// that are not listed here.
    fn chain(self, f: f64, df: f64) -> Self;

    /// `then` where the comparison of `a` with `b` holds, else `otherwise`, with the slopes of the one that is taken.
    ///
    /// For an `if` whose sides cost little; it lets a model be read as a graph in one pass.
    #[inline(always)]
    fn select(comparison: Comparison, a: Self, b: Self, then: Self, otherwise: Self) -> Self {
        if comparison.holds(a, b) { then } else { otherwise }
    }

    /// Square root.
    fn sqrt(self) -> Self;
    /// Cubic root.
    fn cbrt(self) -> Self;
    /// `self` to an integer power.
    fn powi(self, n: i32) -> Self;
    /// `self` to a constant power.
    fn powf(self, n: f64) -> Self;
    /// `self` to a power that has slopes of its own.
    fn pow(self, n: Self) -> Self;
    /// Exponential.
    fn exp(self) -> Self;
    /// Two to the power of `self`.
    fn exp2(self) -> Self;
    /// `exp(self) - 1`, accurate near zero.
    fn exp_m1(self) -> Self;
    /// Natural logarithm.
    fn ln(self) -> Self;
    /// `ln(1 + self)`, accurate near zero.
    fn ln_1p(self) -> Self;
    /// Logarithm to base 2.
    fn log2(self) -> Self;
    /// Logarithm to base 10.
    fn log10(self) -> Self;
    /// Sine (rad).
    fn sin(self) -> Self;
    /// Cosine (rad).
    fn cos(self) -> Self;
    /// Sine and cosine (rad).
    fn sin_cos(self) -> (Self, Self);
    /// Tangent (rad).
    fn tan(self) -> Self;
    /// Arc sine (rad).
    fn asin(self) -> Self;
    /// Arc cosine (rad).
    fn acos(self) -> Self;
    /// Arc tangent (rad).
    fn atan(self) -> Self;
    /// Angle (rad) of the point with ordinate `self` and abscissa `x`.
    fn atan2(self, x: Self) -> Self;
    /// Hyperbolic sine.
    fn sinh(self) -> Self;
    /// Hyperbolic cosine.
    fn cosh(self) -> Self;
    /// Hyperbolic tangent.
    fn tanh(self) -> Self;
    /// Inverse hyperbolic sine.
    fn asinh(self) -> Self;
    /// Inverse hyperbolic cosine.
    fn acosh(self) -> Self;
    /// Inverse hyperbolic tangent.
    fn atanh(self) -> Self;
    /// `sqrt(self^2 + other^2)` without overflow.
    fn hypot(self, other: Self) -> Self;
    /// `1 / self`.
    fn recip(self) -> Self;
    /// `self * a + b`.
    fn mul_add(self, a: Self, b: Self) -> Self;
    /// Absolute value; slope `signum`.
    fn abs(self) -> Self;
    /// `+1` or `-1` by the sign bit, as `f64::signum`; slope zero.
    fn signum(self) -> Self;
    /// The larger of two, with its slopes.
    fn max(self, other: Self) -> Self;
    /// The smaller of two, with its slopes.
    fn min(self, other: Self) -> Self;
    /// `self` kept within `low..=high`.
    fn clamp(self, low: f64, high: f64) -> Self;
    /// Largest integer not above `self`; slope zero.
    fn floor(self) -> Self;
    /// Smallest integer not below `self`; slope zero.
    fn ceil(self) -> Self;
    /// Nearest integer; slope zero.
    fn round(self) -> Self;
    /// Integer part; slope zero.
    fn trunc(self) -> Self;
    /// `self - self.trunc()`.
    fn fract(self) -> Self;
    /// Remainder of `self / period`, in `0..period`.
    fn rem_euclid(self, period: f64) -> Self;
    /// `self` with the sign of `sign`.
    fn copysign(self, sign: Self) -> Self;

    /// The value of a table at a place, or its derivative of these orders there; [`Grid::at`] is shorter.
    fn look_up(table: &Grid<'_>, at: [Self; 2], order: [u8; 2]) -> Self;

    /// `x + y`, entry by entry: slope arithmetic of [`Dual`](crate::Dual), as all that follows.
    #[doc(hidden)]
    #[inline(always)]
    fn slopes_plus<const N: usize>(x: &[Self; N], y: &[Self; N]) -> [Self; N] {
        core::array::from_fn(|i| x[i] + y[i])
    }
    /// `x - y`.
    #[doc(hidden)]
    #[inline(always)]
    fn slopes_minus<const N: usize>(x: &[Self; N], y: &[Self; N]) -> [Self; N] {
        core::array::from_fn(|i| x[i] - y[i])
    }
    /// `x v`.
    #[doc(hidden)]
    #[inline(always)]
    fn slopes_times<const N: usize>(x: &[Self; N], v: Self) -> [Self; N] {
        core::array::from_fn(|i| x[i] * v)
    }
    /// `y u + x v`.
    #[doc(hidden)]
    #[inline(always)]
    fn slopes_of_product<const N: usize>(x: &[Self; N], v: Self, y: &[Self; N], u: Self) -> [Self; N] {
        core::array::from_fn(|i| y[i] * u + x[i] * v)
    }
    /// `(x - y q) r`.
    #[doc(hidden)]
    #[inline(always)]
    fn slopes_of_quotient<const N: usize>(x: &[Self; N], y: &[Self; N], q: Self, r: Self) -> [Self; N] {
        core::array::from_fn(|i| (x[i] - y[i] * q) * r)
    }
    /// `x + y a`.
    #[doc(hidden)]
    #[inline(always)]
    fn slopes_plus_times<const N: usize>(x: &[Self; N], y: &[Self; N], a: f64) -> [Self; N] {
        core::array::from_fn(|i| x[i].plus_times(y[i], a))
    }
}

macro_rules! by_std_or_libm {
    ($($name:ident = $libm:ident ( $($arg:ident),* );)*) => {$(
        #[inline(always)]
        fn $name(self $(, $arg: Self)*) -> Self {
            #[cfg(feature = "std")]
            return f64::$name(self $(, $arg)*);
            #[cfg(not(feature = "std"))]
            return libm::$libm(self $(, $arg)*);
        }
    )*};
}

impl Scalar for f64 {
    #[inline(always)]
    fn value(&self) -> f64 {
        *self
    }
    #[inline(always)]
    fn chain(self, f: f64, _df: f64) -> f64 {
        f
    }
    by_std_or_libm! {
        sqrt = sqrt(); cbrt = cbrt(); exp = exp(); exp2 = exp2(); exp_m1 = expm1(); ln = log(); ln_1p = log1p();
        log2 = log2(); log10 = log10(); sin = sin(); cos = cos(); tan = tan(); asin = asin(); acos = acos();
        atan = atan(); atan2 = atan2(x); sinh = sinh(); cosh = cosh(); tanh = tanh(); asinh = asinh(); acosh = acosh();
        atanh = atanh(); hypot = hypot(other); powf = pow(n); floor = floor(); ceil = ceil(); round = round();
        trunc = trunc();
    }
    #[inline(always)]
    fn powi(self, n: i32) -> f64 {
        #[cfg(feature = "std")]
        return f64::powi(self, n);
        #[cfg(not(feature = "std"))]
        return libm::pow(self, n as f64);
    }
    #[inline(always)]
    fn pow(self, n: f64) -> f64 {
        Scalar::powf(self, n)
    }
    #[inline(always)]
    fn sin_cos(self) -> (f64, f64) {
        (Scalar::sin(self), Scalar::cos(self))
    }
    #[inline(always)]
    fn recip(self) -> f64 {
        1.0 / self
    }
    // Two roundings on purpose: the fused form is a slow call where the hardware instruction is not enabled.
    #[inline(always)]
    fn mul_add(self, a: f64, b: f64) -> f64 {
        self * a + b
    }
    #[inline(always)]
    fn abs(self) -> f64 {
        f64::abs(self)
    }
    #[inline(always)]
    fn signum(self) -> f64 {
        f64::signum(self)
    }
    #[inline(always)]
    fn max(self, other: f64) -> f64 {
        f64::max(self, other)
    }
    #[inline(always)]
    fn min(self, other: f64) -> f64 {
        f64::min(self, other)
    }
    // Not `f64::clamp`, which panics when the limits are out of order.
    #[inline(always)]
    fn clamp(self, low: f64, high: f64) -> f64 {
        if self > high {
            high
        } else if self < low {
            low
        } else {
            self
        }
    }
    #[inline(always)]
    fn fract(self) -> f64 {
        self - Scalar::trunc(self)
    }
    #[inline(always)]
    fn rem_euclid(self, period: f64) -> f64 {
        let r = self % period;
        if r < 0.0 { r + f64::abs(period) } else { r }
    }
    #[inline(always)]
    fn copysign(self, sign: f64) -> f64 {
        f64::copysign(self, sign)
    }
    #[inline]
    fn look_up(table: &Grid<'_>, at: [f64; 2], order: [u8; 2]) -> f64 {
        table.derivative(at, order)
    }
    slopes_in_pairs!(false);
}
