//! [`Linear`]: the numbers that a filter runs on.

use crate::dual::Dual;
use core::ops::{Add, Mul, Sub};

/// Below this a decaying state is nothing; left alone it would reach numbers that the hardware handles 100 times slower.
const NOTHING: f64 = 1e-290;

/// What a filter runs on: values, and values with slopes.
pub trait Linear: Copy + Default + Add<Output = Self> + Sub<Output = Self> + Mul<f64, Output = Self> {
    /// The same, with zero in place of what is too small to matter.
    fn flushed(self) -> Self;
}

impl Linear for f64 {
    #[inline(always)]
    fn flushed(self) -> f64 {
        if self.abs() < NOTHING { 0.0 } else { self }
    }
}

impl<const N: usize> Linear for Dual<N> {
    #[inline(always)]
    fn flushed(self) -> Self {
        Dual { value: self.value.flushed(), slopes: self.slopes.map(f64::flushed) }
    }
}

/// Several columns side by side.
#[derive(Clone, Copy)]
pub struct Lanes<const L: usize>(pub [f64; L]);

impl<const L: usize> Default for Lanes<L> {
    #[inline(always)]
    fn default() -> Self {
        Lanes([0.0; L])
    }
}

impl<const L: usize> Add for Lanes<L> {
    type Output = Self;
    #[inline(always)]
    fn add(self, b: Self) -> Self {
        Lanes(core::array::from_fn(|i| self.0[i] + b.0[i]))
    }
}

impl<const L: usize> Sub for Lanes<L> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, b: Self) -> Self {
        Lanes(core::array::from_fn(|i| self.0[i] - b.0[i]))
    }
}

impl<const L: usize> Mul<f64> for Lanes<L> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, b: f64) -> Self {
        Lanes(self.0.map(|a| a * b))
    }
}

impl<const L: usize> Linear for Lanes<L> {
    #[inline(always)]
    fn flushed(self) -> Self {
        Lanes(self.0.map(f64::flushed))
    }
}
