//! [`Fused`]: a number whose slopes are multiplied and added in one instruction.

use crate::lanes::{Number, Sums, slopes_in_pairs};
use crate::scalar::{Grid, Scalar};
use crate::wide::Width;
use core::iter::Sum;
use core::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

/// AVX-512 and FMA, which this machine has: [`detected`](Avx512::detected) alone makes one.
#[derive(Clone, Copy)]
pub(crate) struct Avx512(());

impl Avx512 {
    /// `None` if the machine lacks them.
    pub fn detected() -> Option<Self> {
        Width::avx512().map(|_| Avx512(()))
    }
}

/// An `f64` in the loops that have found FMA on the machine at hand; nothing else makes one. Values are those of `f64`.
#[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd)]
#[repr(transparent)]
pub(crate) struct Fused(f64);

// SAFETY: a transparent wrapper of one.
unsafe impl Number for Fused {
    const FUSED: bool = true;
}

impl From<f64> for Fused {
    #[inline(always)]
    fn from(value: f64) -> Self {
        Fused(value)
    }
}

impl PartialEq<f64> for Fused {
    #[inline(always)]
    fn eq(&self, other: &f64) -> bool {
        self.0 == *other
    }
}

impl PartialOrd<f64> for Fused {
    #[inline(always)]
    fn partial_cmp(&self, other: &f64) -> Option<core::cmp::Ordering> {
        self.0.partial_cmp(other)
    }
}

impl Neg for Fused {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Fused(-self.0)
    }
}

macro_rules! operators {
    ($($trait:ident $method:ident $assign:ident $assign_method:ident $op:tt;)*) => {$(
        impl $trait for Fused {
            type Output = Self;
            #[inline(always)]
            fn $method(self, b: Self) -> Self {
                Fused(self.0 $op b.0)
            }
        }
        impl $trait<f64> for Fused {
            type Output = Self;
            #[inline(always)]
            fn $method(self, b: f64) -> Self {
                Fused(self.0 $op b)
            }
        }
        impl $assign for Fused {
            #[inline(always)]
            fn $assign_method(&mut self, b: Self) {
                self.0 = self.0 $op b.0;
            }
        }
        impl $assign<f64> for Fused {
            #[inline(always)]
            fn $assign_method(&mut self, b: f64) {
                self.0 = self.0 $op b;
            }
        }
    )*};
}
operators! {
    Add add AddAssign add_assign +; Sub sub SubAssign sub_assign -;
    Mul mul MulAssign mul_assign *; Div div DivAssign div_assign /;
}

impl Sum for Fused {
    fn sum<I: Iterator<Item = Self>>(terms: I) -> Self {
        terms.fold(Fused(0.0), |a, b| a + b)
    }
}

macro_rules! as_f64 {
    ($($name:ident($($number:ident),*; $($plain:ident: $type:ty),*);)*) => {$(
        #[inline(always)]
        fn $name(self $(, $number: Self)* $(, $plain: $type)*) -> Self {
            Fused(Scalar::$name(self.0 $(, $number.0)* $(, $plain)*))
        }
    )*};
}

impl Scalar for Fused {
    as_f64! {
        chain(; f: f64, df: f64); sqrt(;); cbrt(;); powi(; n: i32); powf(; n: f64); pow(n;); exp(;); exp2(;); exp_m1(;);
        ln(;); ln_1p(;); log2(;); log10(;); sin(;); cos(;); tan(;); asin(;); acos(;); atan(;); atan2(x;); sinh(;); cosh(;);
        tanh(;); asinh(;); acosh(;); atanh(;); hypot(other;); recip(;); mul_add(a, b;); abs(;); signum(;); max(other;);
        min(other;); clamp(; low: f64, high: f64); floor(;); ceil(;); round(;); trunc(;); fract(;);
        rem_euclid(; period: f64); copysign(sign;);
    }
    #[inline(always)]
    fn value(&self) -> f64 {
        self.0
    }
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        (self.sin(), self.cos())
    }
    fn look_up(table: &Grid<'_>, [x, y]: [Self; 2], order: [u8; 2]) -> Self {
        Fused(table.derivative([x.0, y.0], order))
    }
    slopes_in_pairs!(true);
}
