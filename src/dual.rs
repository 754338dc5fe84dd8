//! [`Dual`]: a value and its slopes, propagated exactly through arithmetic (forward-mode differentiation; Griewank and
//! Walther, *Evaluating Derivatives*, 2008, ch. 3).
//!
//! Speed rests on two things. The slopes are a fixed array walked two at a time in vector registers. And a quotient multiplies by the reciprocal of its divisor, which is computed once where the divisor does not
//! change (a parameter inside a time loop); its value may therefore differ from `a / b` in the last bit.

use crate::lanes::{Fused, lanes};
use crate::scalar::Scalar;
use core::cmp::Ordering;
use core::iter::Sum;
use core::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

/// A value and its slopes with respect to `N` quantities. `UNIT` is for the library's own loops: leave it out.
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
pub struct Dual<const N: usize, const UNIT: u8 = 0> {
    /// The value.
    pub value: f64,
    /// d value / d quantity, one entry per quantity.
    pub slopes: [f64; N],
}

impl<const N: usize> Dual<N> {
    /// A number that depends on nothing: all slopes zero.
    #[inline(always)]
    pub const fn constant(value: f64) -> Self {
        Dual { value, slopes: [0.0; N] }
    }

    /// The quantity number `lane` itself: slope one there, zero elsewhere (everywhere, when `lane >= N`).
    #[inline(always)]
    pub fn variable(value: f64, lane: usize) -> Self {
        let mut slopes = [0.0; N];
        if let Some(slope) = slopes.get_mut(lane) {
            *slope = 1.0;
        }
        Dual { value, slopes }
    }
}

impl<const N: usize, const UNIT: u8> Dual<N, UNIT> {
    #[inline(always)]
    fn with(value: f64, slope: impl Fn(usize) -> f64) -> Self {
        let mut slopes = [0.0; N];
        let mut i = 0;
        while i < N {
            slopes[i] = slope(i);
            i += 1;
        }
        Dual { value, slopes }
    }

    /// The chain rule where `df` may be infinite: what does not vary contributes nothing (no `0 * inf`).
    #[inline(always)]
    fn chain_singular(self, f: f64, df: f64) -> Self {
        Self::with(f, |i| if self.slopes[i] == 0.0 { 0.0 } else { self.slopes[i] * df })
    }
}

impl<const N: usize, const UNIT: u8> Default for Dual<N, UNIT> {
    #[inline(always)]
    fn default() -> Self {
        Self::from(0.0)
    }
}

impl<const N: usize, const UNIT: u8> From<f64> for Dual<N, UNIT> {
    #[inline(always)]
    fn from(value: f64) -> Self {
        Dual { value, slopes: [0.0; N] }
    }
}

impl<const N: usize, const UNIT: u8> PartialEq for Dual<N, UNIT> {
    #[inline(always)]
    fn eq(&self, other: &Self) -> bool {
        self.value == other.value
    }
}

impl<const N: usize, const UNIT: u8> PartialOrd for Dual<N, UNIT> {
    #[inline(always)]
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        self.value.partial_cmp(&other.value)
    }
}

impl<const N: usize, const UNIT: u8> PartialEq<f64> for Dual<N, UNIT> {
    #[inline(always)]
    fn eq(&self, other: &f64) -> bool {
        self.value == *other
    }
}

impl<const N: usize, const UNIT: u8> PartialOrd<f64> for Dual<N, UNIT> {
    #[inline(always)]
    fn partial_cmp(&self, other: &f64) -> Option<Ordering> {
        self.value.partial_cmp(other)
    }
}

impl<const N: usize, const UNIT: u8> Neg for Dual<N, UNIT> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        let slopes = lanes!(N; x in self.slopes; sign = -1.0; x * sign);
        Dual { value: -self.value, slopes }
    }
}

impl<const N: usize, const UNIT: u8> Add for Dual<N, UNIT> {
    type Output = Self;
    #[inline(always)]
    fn add(self, b: Self) -> Self {
        let slopes = lanes!(N; x in self.slopes, y in b.slopes;; x + y);
        Dual { value: self.value + b.value, slopes }
    }
}

impl<const N: usize, const UNIT: u8> Sub for Dual<N, UNIT> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, b: Self) -> Self {
        let slopes = lanes!(N; x in self.slopes, y in b.slopes;; x - y);
        Dual { value: self.value - b.value, slopes }
    }
}

impl<const N: usize, const UNIT: u8> Mul for Dual<N, UNIT> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, b: Self) -> Self {
        let slopes =
            lanes!(N; x in self.slopes, y in b.slopes; u = self.value, v = b.value; y.times_plus::<UNIT>(u, x * v));
        Dual { value: self.value * b.value, slopes }
    }
}

impl<const N: usize, const UNIT: u8> Div for Dual<N, UNIT> {
    type Output = Self;
    #[inline(always)]
    fn div(self, b: Self) -> Self {
        let reciprocal = 1.0 / b.value;
        let value = self.value * reciprocal;
        let slopes =
            lanes!(N; x in self.slopes, y in b.slopes; q = value, r = reciprocal; y.times_from::<UNIT>(q, x) * r);
        Dual { value, slopes }
    }
}

impl<const N: usize, const UNIT: u8> Add<f64> for Dual<N, UNIT> {
    type Output = Self;
    #[inline(always)]
    fn add(self, b: f64) -> Self {
        Dual { value: self.value + b, slopes: self.slopes }
    }
}

impl<const N: usize, const UNIT: u8> Sub<f64> for Dual<N, UNIT> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, b: f64) -> Self {
        Dual { value: self.value - b, slopes: self.slopes }
    }
}

impl<const N: usize, const UNIT: u8> Mul<f64> for Dual<N, UNIT> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, b: f64) -> Self {
        let slopes = lanes!(N; x in self.slopes; v = b; x * v);
        Dual { value: self.value * b, slopes }
    }
}

impl<const N: usize, const UNIT: u8> Div<f64> for Dual<N, UNIT> {
    type Output = Self;
    #[inline(always)]
    fn div(self, b: f64) -> Self {
        let reciprocal = 1.0 / b;
        let slopes = lanes!(N; x in self.slopes; r = reciprocal; x * r);
        Dual { value: self.value * reciprocal, slopes }
    }
}

macro_rules! assign {
    ($($trait:ident $method:ident $op:tt;)*) => {$(
        impl<const N: usize, const UNIT: u8> $trait for Dual<N, UNIT> {
            #[inline(always)]
            fn $method(&mut self, b: Self) {
                *self = *self $op b;
            }
        }
        impl<const N: usize, const UNIT: u8> $trait<f64> for Dual<N, UNIT> {
            #[inline(always)]
            fn $method(&mut self, b: f64) {
                *self = *self $op b;
            }
        }
    )*};
}
assign! { AddAssign add_assign +; SubAssign sub_assign -; MulAssign mul_assign *; DivAssign div_assign /; }

impl<const N: usize, const UNIT: u8> Sum for Dual<N, UNIT> {
    fn sum<I: Iterator<Item = Self>>(terms: I) -> Self {
        terms.fold(Self::default(), |a, b| a + b)
    }
}

impl<const N: usize, const UNIT: u8> Scalar for Dual<N, UNIT> {
    #[inline(always)]
    fn value(&self) -> f64 {
        self.value
    }
    #[inline(always)]
    fn plus_times(self, k: Self, a: f64) -> Self {
        let slopes = lanes!(N; x in self.slopes, y in k.slopes; v = a; y.times_plus::<UNIT>(v, x));
        Dual { value: self.value + k.value * a, slopes }
    }
    #[inline(always)]
    fn chain(self, f: f64, df: f64) -> Self {
        let slopes = lanes!(N; x in self.slopes; d = df; x * d);
        Dual { value: f, slopes }
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        let f = Scalar::sqrt(self.value);
        self.chain_singular(f, 0.5 / f)
    }
    #[inline(always)]
    fn cbrt(self) -> Self {
        let f = Scalar::cbrt(self.value);
        self.chain_singular(f, 1.0 / (3.0 * f * f))
    }
    #[inline(always)]
    fn powi(self, n: i32) -> Self {
        let df = if n == 0 { 0.0 } else { n as f64 * Scalar::powi(self.value, n - 1) };
        self.chain_singular(Scalar::powi(self.value, n), df)
    }
    #[inline(always)]
    fn powf(self, n: f64) -> Self {
        let df = if n == 0.0 { 0.0 } else { n * Scalar::powf(self.value, n - 1.0) };
        self.chain_singular(Scalar::powf(self.value, n), df)
    }
    #[inline(always)]
    fn pow(self, n: Self) -> Self {
        let f = Scalar::powf(self.value, n.value);
        let base = self.powf(n.value);
        // 0^n does not move with n (n > 0): the limit of f ln x, not its 0 * -inf.
        let df = if f == 0.0 { 0.0 } else { f * Scalar::ln(self.value) };
        let exponent = n.chain_singular(f, df);
        Self::with(f, |i| base.slopes[i] + exponent.slopes[i])
    }
    #[inline(always)]
    fn exp(self) -> Self {
        let f = Scalar::exp(self.value);
        self.chain_singular(f, f)
    }
    #[inline(always)]
    fn exp2(self) -> Self {
        let f = Scalar::exp2(self.value);
        self.chain_singular(f, f * core::f64::consts::LN_2)
    }
    #[inline(always)]
    fn exp_m1(self) -> Self {
        let f = Scalar::exp_m1(self.value);
        self.chain_singular(f, f + 1.0)
    }
    #[inline(always)]
    fn ln(self) -> Self {
        self.chain_singular(Scalar::ln(self.value), 1.0 / self.value)
    }
    #[inline(always)]
    fn ln_1p(self) -> Self {
        self.chain_singular(Scalar::ln_1p(self.value), 1.0 / (1.0 + self.value))
    }
    #[inline(always)]
    fn log2(self) -> Self {
        self.chain_singular(Scalar::log2(self.value), core::f64::consts::LOG2_E / self.value)
    }
    #[inline(always)]
    fn log10(self) -> Self {
        self.chain_singular(Scalar::log10(self.value), core::f64::consts::LOG10_E / self.value)
    }
    #[inline(always)]
    fn sin(self) -> Self {
        let (sin, cos) = Scalar::sin_cos(self.value);
        self.chain(sin, cos)
    }
    #[inline(always)]
    fn cos(self) -> Self {
        let (sin, cos) = Scalar::sin_cos(self.value);
        self.chain(cos, -sin)
    }
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        let (sin, cos) = Scalar::sin_cos(self.value);
        (self.chain(sin, cos), self.chain(cos, -sin))
    }
    #[inline(always)]
    fn tan(self) -> Self {
        let f = Scalar::tan(self.value);
        self.chain(f, 1.0 + f * f)
    }
    #[inline(always)]
    fn asin(self) -> Self {
        self.chain_singular(Scalar::asin(self.value), 1.0 / Scalar::sqrt((1.0 - self.value) * (1.0 + self.value)))
    }
    #[inline(always)]
    fn acos(self) -> Self {
        self.chain_singular(Scalar::acos(self.value), -1.0 / Scalar::sqrt((1.0 - self.value) * (1.0 + self.value)))
    }
    #[inline(always)]
    fn atan(self) -> Self {
        self.chain(Scalar::atan(self.value), 1.0 / (1.0 + self.value * self.value))
    }
    #[inline(always)]
    fn atan2(self, x: Self) -> Self {
        // Divided by the radius twice rather than by its square once: no overflow, no 0 / 0 away from the origin.
        let r = Scalar::hypot(self.value, x.value);
        let (dy, dx) = if r > 0.0 { (x.value / r / r, -(self.value / r / r)) } else { (0.0, 0.0) };
        Self::with(Scalar::atan2(self.value, x.value), |i| self.slopes[i] * dy + x.slopes[i] * dx)
    }
    #[inline(always)]
    fn sinh(self) -> Self {
        self.chain_singular(Scalar::sinh(self.value), Scalar::cosh(self.value))
    }
    #[inline(always)]
    fn cosh(self) -> Self {
        self.chain_singular(Scalar::cosh(self.value), Scalar::sinh(self.value))
    }
    #[inline(always)]
    fn tanh(self) -> Self {
        let f = Scalar::tanh(self.value);
        self.chain(f, (1.0 - f) * (1.0 + f))
    }
    #[inline(always)]
    fn asinh(self) -> Self {
        self.chain(Scalar::asinh(self.value), 1.0 / Scalar::hypot(self.value, 1.0))
    }
    #[inline(always)]
    fn acosh(self) -> Self {
        self.chain_singular(Scalar::acosh(self.value), 1.0 / Scalar::sqrt((self.value - 1.0) * (self.value + 1.0)))
    }
    #[inline(always)]
    fn atanh(self) -> Self {
        self.chain_singular(Scalar::atanh(self.value), 1.0 / ((1.0 - self.value) * (1.0 + self.value)))
    }
    #[inline(always)]
    fn hypot(self, other: Self) -> Self {
        let r = Scalar::hypot(self.value, other.value);
        // At the origin the slope along the direction of motion is its length.
        if r == 0.0 {
            return Self::with(r, |i| Scalar::hypot(self.slopes[i], other.slopes[i]));
        }
        let (a, b) = (self.value / r, other.value / r);
        Self::with(r, |i| self.slopes[i] * a + other.slopes[i] * b)
    }
    #[inline(always)]
    fn recip(self) -> Self {
        let f = 1.0 / self.value;
        self.chain_singular(f, -f * f)
    }
    #[inline(always)]
    fn mul_add(self, a: Self, b: Self) -> Self {
        self * a + b
    }
    #[inline(always)]
    fn abs(self) -> Self {
        self.chain(f64::abs(self.value), f64::signum(self.value))
    }
    #[inline(always)]
    fn signum(self) -> Self {
        Self::from(f64::signum(self.value))
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        if self.value >= other.value || other.value.is_nan() { self } else { other }
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        if self.value <= other.value || other.value.is_nan() { self } else { other }
    }
    #[inline(always)]
    fn clamp(self, low: f64, high: f64) -> Self {
        if self.value > high {
            Self::from(high)
        } else if self.value < low {
            Self::from(low)
        } else {
            self
        }
    }
    #[inline(always)]
    fn floor(self) -> Self {
        Self::from(Scalar::floor(self.value))
    }
    #[inline(always)]
    fn ceil(self) -> Self {
        Self::from(Scalar::ceil(self.value))
    }
    #[inline(always)]
    fn round(self) -> Self {
        Self::from(Scalar::round(self.value))
    }
    #[inline(always)]
    fn trunc(self) -> Self {
        Self::from(Scalar::trunc(self.value))
    }
    #[inline(always)]
    fn fract(self) -> Self {
        Dual { value: Scalar::fract(self.value), slopes: self.slopes }
    }
    #[inline(always)]
    fn rem_euclid(self, period: f64) -> Self {
        Dual { value: Scalar::rem_euclid(self.value, period), slopes: self.slopes }
    }
    #[inline(always)]
    fn copysign(self, sign: Self) -> Self {
        if self.value.is_sign_negative() == sign.value.is_sign_negative() { self } else { -self }
    }
}
