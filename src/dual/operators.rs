//! Comparisons, which are of values alone, and arithmetic.

use super::Dual;
use crate::scalar::Scalar;
use core::cmp::Ordering;
use core::iter::Sum;
use core::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

impl<const N: usize, T: Scalar> PartialEq for Dual<N, T> {
    #[inline(always)]
    fn eq(&self, other: &Self) -> bool {
        self.value == other.value
    }
}

impl<const N: usize, T: Scalar> PartialOrd for Dual<N, T> {
    #[inline(always)]
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        self.value.partial_cmp(&other.value)
    }
}

impl<const N: usize, T: Scalar> PartialEq<f64> for Dual<N, T> {
    #[inline(always)]
    fn eq(&self, other: &f64) -> bool {
        self.value == *other
    }
}

impl<const N: usize, T: Scalar> PartialOrd<f64> for Dual<N, T> {
    #[inline(always)]
    fn partial_cmp(&self, other: &f64) -> Option<Ordering> {
        self.value.partial_cmp(other)
    }
}

impl<const N: usize, T: Scalar> Neg for Dual<N, T> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Dual { value: -self.value, slopes: T::slopes_times(&self.slopes, T::from(-1.0)) }
    }
}

impl<const N: usize, T: Scalar> Add for Dual<N, T> {
    type Output = Self;
    #[inline(always)]
    fn add(self, b: Self) -> Self {
        Dual { value: self.value + b.value, slopes: T::slopes_plus(&self.slopes, &b.slopes) }
    }
}

impl<const N: usize, T: Scalar> Sub for Dual<N, T> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, b: Self) -> Self {
        Dual { value: self.value - b.value, slopes: T::slopes_minus(&self.slopes, &b.slopes) }
    }
}

impl<const N: usize, T: Scalar> Mul for Dual<N, T> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, b: Self) -> Self {
        let slopes = T::slopes_of_product(&self.slopes, b.value, &b.slopes, self.value);
        Dual { value: self.value * b.value, slopes }
    }
}

impl<const N: usize, T: Scalar> Div for Dual<N, T> {
    type Output = Self;
    #[inline(always)]
    fn div(self, b: Self) -> Self {
        let reciprocal = T::from(1.0) / b.value;
        let value = self.value * reciprocal;
        Dual { value, slopes: T::slopes_of_quotient(&self.slopes, &b.slopes, value, reciprocal) }
    }
}

impl<const N: usize, T: Scalar> Add<f64> for Dual<N, T> {
    type Output = Self;
    #[inline(always)]
    fn add(self, b: f64) -> Self {
        Dual { value: self.value + b, slopes: self.slopes }
    }
}

impl<const N: usize, T: Scalar> Sub<f64> for Dual<N, T> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, b: f64) -> Self {
        Dual { value: self.value - b, slopes: self.slopes }
    }
}

impl<const N: usize, T: Scalar> Mul<f64> for Dual<N, T> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, b: f64) -> Self {
        Dual { value: self.value * b, slopes: T::slopes_times(&self.slopes, T::from(b)) }
    }
}

impl<const N: usize, T: Scalar> Div<f64> for Dual<N, T> {
    type Output = Self;
    #[inline(always)]
    fn div(self, b: f64) -> Self {
        self * (1.0 / b)
    }
}

macro_rules! assign {
    ($($trait:ident $method:ident $op:tt;)*) => {$(
        impl<const N: usize, T: Scalar> $trait for Dual<N, T> {
            #[inline(always)]
            fn $method(&mut self, b: Self) {
                *self = *self $op b;
            }
        }
        impl<const N: usize, T: Scalar> $trait<f64> for Dual<N, T> {
            #[inline(always)]
            fn $method(&mut self, b: f64) {
                *self = *self $op b;
            }
        }
    )*};
}
assign! { AddAssign add_assign +; SubAssign sub_assign -; MulAssign mul_assign *; DivAssign div_assign /; }

impl<const N: usize, T: Scalar> Sum for Dual<N, T> {
    fn sum<I: Iterator<Item = Self>>(terms: I) -> Self {
        terms.fold(Self::default(), |a, b| a + b)
    }
}
