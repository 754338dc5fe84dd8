//! Elementary functions, with the slope of each.

use super::Dual;
use crate::scalar::{Comparison, Grid, Scalar};

impl<const N: usize, T: Scalar> Scalar for Dual<N, T> {
    #[inline(always)]
    fn value(&self) -> f64 {
        self.value.value()
    }
    #[inline(always)]
    fn plus_times(self, k: Self, a: f64) -> Self {
        let slopes = T::slopes_plus_times(&self.slopes, &k.slopes, a);
        Dual { value: self.value + k.value * a, slopes }
    }
    #[inline(always)]
    fn chain(self, f: f64, df: f64) -> Self {
        // Where the numbers have slopes, those of `df` are not known: not a number, rather than wrong.
        self.chained(self.value.chain(f, df), self.value.chain(df, f64::NAN))
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        let f = self.value.sqrt();
        self.chain_singular(f, T::from(0.5) / f)
    }
    #[inline(always)]
    fn cbrt(self) -> Self {
        let f = self.value.cbrt();
        self.chain_singular(f, T::from(1.0) / (f * f * 3.0))
    }
    #[inline(always)]
    fn powi(self, n: i32) -> Self {
        let df = if n == 0 { T::from(0.0) } else { self.value.powi(n.saturating_sub(1)) * f64::from(n) };
        self.chain_singular(self.value.powi(n), df)
    }
    #[inline(always)]
    fn powf(self, n: f64) -> Self {
        let df = if n == 0.0 { T::from(0.0) } else { self.value.powf(n - 1.0) * n };
        self.chain_singular(self.value.powf(n), df)
    }
    #[inline(always)]
    fn pow(self, n: Self) -> Self {
        let (f, zero) = (self.value.pow(n.value), T::from(0.0));
        let df = self.value.pow(n.value - 1.0) * n.value;
        let base = self.chain_singular(f, T::select(Comparison::Equal, n.value, zero, zero, df));
        // 0^n does not move with n (n > 0): the limit of f ln x, not its 0 * -inf.
        let exponent = n.chain_singular(f, T::select(Comparison::Equal, f, zero, zero, f * self.value.ln()));
        Self::with(f, |i| base.slopes[i] + exponent.slopes[i])
    }
    #[inline(always)]
    fn exp(self) -> Self {
        let f = self.value.exp();
        self.chain_singular(f, f)
    }
    #[inline(always)]
    fn exp2(self) -> Self {
        let f = self.value.exp2();
        self.chain_singular(f, f * core::f64::consts::LN_2)
    }
    #[inline(always)]
    fn exp_m1(self) -> Self {
        let f = self.value.exp_m1();
        self.chain_singular(f, f + 1.0)
    }
    #[inline(always)]
    fn ln(self) -> Self {
        self.chain_singular(self.value.ln(), T::from(1.0) / self.value)
    }
    #[inline(always)]
    fn ln_1p(self) -> Self {
        self.chain_singular(self.value.ln_1p(), T::from(1.0) / (self.value + 1.0))
    }
    #[inline(always)]
    fn log2(self) -> Self {
        self.chain_singular(self.value.log2(), T::from(core::f64::consts::LOG2_E) / self.value)
    }
    #[inline(always)]
    fn log10(self) -> Self {
        self.chain_singular(self.value.log10(), T::from(core::f64::consts::LOG10_E) / self.value)
    }
    #[inline(always)]
    fn sin(self) -> Self {
        let (sin, cos) = self.value.sin_cos();
        self.chained(sin, cos)
    }
    #[inline(always)]
    fn cos(self) -> Self {
        let (sin, cos) = self.value.sin_cos();
        self.chained(cos, -sin)
    }
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        let (sin, cos) = self.value.sin_cos();
        (self.chained(sin, cos), self.chained(cos, -sin))
    }
    #[inline(always)]
    fn tan(self) -> Self {
        let f = self.value.tan();
        self.chained(f, f * f + 1.0)
    }
    #[inline(always)]
    fn asin(self) -> Self {
        self.chain_singular(self.value.asin(), T::from(1.0) / self.one_less_square().sqrt())
    }
    #[inline(always)]
    fn acos(self) -> Self {
        self.chain_singular(self.value.acos(), T::from(-1.0) / self.one_less_square().sqrt())
    }
    #[inline(always)]
    fn atan(self) -> Self {
        self.chained(self.value.atan(), T::from(1.0) / (self.value * self.value + 1.0))
    }
    #[inline(always)]
    fn atan2(self, x: Self) -> Self {
        // Divided by the radius twice rather than by its square once: no overflow, no 0 / 0 away from the origin.
        let (r, zero) = (self.value.hypot(x.value), T::from(0.0));
        let away = |slope: T| T::select(Comparison::Less, zero, r, slope, zero);
        let (dy, dx) = (away(x.value / r / r), away(-(self.value / r / r)));
        Self::with(self.value.atan2(x.value), |i| self.slopes[i] * dy + x.slopes[i] * dx)
    }
    #[inline(always)]
    fn sinh(self) -> Self {
        self.chain_singular(self.value.sinh(), self.value.cosh())
    }
    #[inline(always)]
    fn cosh(self) -> Self {
        self.chain_singular(self.value.cosh(), self.value.sinh())
    }
    #[inline(always)]
    fn tanh(self) -> Self {
        let f = self.value.tanh();
        self.chained(f, (T::from(1.0) - f) * (f + 1.0))
    }
    #[inline(always)]
    fn asinh(self) -> Self {
        self.chained(self.value.asinh(), T::from(1.0) / self.value.hypot(T::from(1.0)))
    }
    #[inline(always)]
    fn acosh(self) -> Self {
        self.chain_singular(self.value.acosh(), T::from(1.0) / ((self.value - 1.0) * (self.value + 1.0)).sqrt())
    }
    #[inline(always)]
    fn atanh(self) -> Self {
        self.chain_singular(self.value.atanh(), T::from(1.0) / self.one_less_square())
    }
    #[inline(always)]
    fn hypot(self, other: Self) -> Self {
        let r = self.value.hypot(other.value);
        // At the origin the slope along the direction of motion is its length.
        if r == 0.0 {
            return Self::with(r, |i| self.slopes[i].hypot(other.slopes[i]));
        }
        let (a, b) = (self.value / r, other.value / r);
        Self::with(r, |i| self.slopes[i] * a + other.slopes[i] * b)
    }
    #[inline(always)]
    fn recip(self) -> Self {
        let f = self.value.recip();
        self.chain_singular(f, -f * f)
    }
    #[inline(always)]
    fn mul_add(self, a: Self, b: Self) -> Self {
        self * a + b
    }
    #[inline(always)]
    fn abs(self) -> Self {
        self.chained(self.value.abs(), self.value.signum())
    }
    #[inline(always)]
    fn signum(self) -> Self {
        Self::constant(self.value.signum())
    }
    // Only what is not a number differs from itself.
    #[inline(always)]
    #[allow(clippy::eq_op)]
    fn max(self, other: Self) -> Self {
        if self.value >= other.value || other.value != other.value { self } else { other }
    }
    #[inline(always)]
    #[allow(clippy::eq_op)]
    fn min(self, other: Self) -> Self {
        if self.value <= other.value || other.value != other.value { self } else { other }
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
        Self::constant(self.value.floor())
    }
    #[inline(always)]
    fn ceil(self) -> Self {
        Self::constant(self.value.ceil())
    }
    #[inline(always)]
    fn round(self) -> Self {
        Self::constant(self.value.round())
    }
    #[inline(always)]
    fn trunc(self) -> Self {
        Self::constant(self.value.trunc())
    }
    #[inline(always)]
    fn fract(self) -> Self {
        Dual { value: self.value.fract(), slopes: self.slopes }
    }
    #[inline(always)]
    fn rem_euclid(self, period: f64) -> Self {
        Dual { value: self.value.rem_euclid(period), slopes: self.slopes }
    }
    #[inline(always)]
    fn copysign(self, sign: Self) -> Self {
        self.chained(self.value.copysign(sign.value), self.value.signum() * sign.value.signum())
    }
    fn look_up(table: &Grid<'_>, [x, y]: [Self; 2], [i, j]: [u8; 2]) -> Self {
        let at = [x.value, y.value];
        let (value, dx) = (T::look_up(table, at, [i, j]), T::look_up(table, at, [i.saturating_add(1), j]));
        if !table.is_surface() {
            return x.chained(value, dx);
        }
        let dy = T::look_up(table, at, [i, j.saturating_add(1)]);
        Dual { value, slopes: T::slopes_of_product(&x.slopes, dx, &y.slopes, dy) }
    }
}
