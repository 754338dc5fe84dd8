//! [`Number`]: numbers with a fixed count of slopes.

use super::Slope;
use crate::dual::Dual;
use crate::scalar::Scalar;

/// Slopes below this are set to zero: their squares are denormal.
const NEGLIGIBLE: f64 = 1e-150;

/// A number with a fixed count of slopes.
pub(super) trait Number: Scalar {
    type Slope: Slope;
    const SLOPES: usize;
    fn with(value: f64, slope: impl Fn(usize) -> f64) -> Self;
    fn slope(&self, i: usize) -> f64;
    fn flushed(self) -> Self;
}

impl Number for f64 {
    type Slope = f64;
    const SLOPES: usize = 0;
    #[inline(always)]
    fn with(value: f64, _slope: impl Fn(usize) -> f64) -> Self {
        value
    }
    #[inline(always)]
    fn slope(&self, _i: usize) -> f64 {
        0.0
    }
    #[inline(always)]
    fn flushed(self) -> Self {
        self
    }
}

impl<const N: usize, T: Scalar + Slope> Number for Dual<N, T> {
    type Slope = T;
    const SLOPES: usize = N;
    #[inline(always)]
    fn with(value: f64, slope: impl Fn(usize) -> f64) -> Self {
        let mut dual = Self::from(value);
        dual.slopes.iter_mut().enumerate().for_each(|(i, s)| *s = T::from(slope(i)));
        dual
    }
    #[inline(always)]
    fn slope(&self, i: usize) -> f64 {
        self.slopes[i].value()
    }
    #[inline(always)]
    fn flushed(mut self) -> Self {
        for slope in &mut self.slopes {
            if slope.value().abs() < NEGLIGIBLE {
                *slope = T::from(0.0);
            }
        }
        self
    }
}
