//! [`One`]: a single number.

use super::Wide;

/// `a 2^n` in two factors, neither of which overflows where the result does not.
#[inline(always)]
pub(super) fn scaled(a: f64, n: f64) -> f64 {
    let n = n as i64;
    let half = n >> 1;
    let power = |n: i64| f64::from_bits(((n + 1023) as u64) << 52);
    a * power(half) * power(n - half)
}

/// One number: for trajectories that run alone.
#[derive(Clone, Copy)]
pub(crate) struct One<const FUSED: bool>(f64);

impl<const FUSED: bool> Wide for One<FUSED> {
    const LANES: usize = 1;

    #[inline(always)]
    fn splat(x: f64) -> Self {
        One(x)
    }
    #[inline(always)]
    fn load(from: &[f64]) -> Self {
        One(from[0])
    }
    #[inline(always)]
    fn store(self, to: &mut [f64]) {
        to[0] = self.0;
    }
    #[inline(always)]
    unsafe fn read(from: *const f64) -> Self {
        // SAFETY: as the caller says.
        One(unsafe { from.read() })
    }
    #[inline(always)]
    unsafe fn write(self, to: *mut f64) {
        // SAFETY: as the caller says.
        unsafe { to.write(self.0) }
    }
    #[inline(always)]
    fn add(self, b: Self) -> Self {
        One(self.0 + b.0)
    }
    #[inline(always)]
    fn sub(self, b: Self) -> Self {
        One(self.0 - b.0)
    }
    #[inline(always)]
    fn mul(self, b: Self) -> Self {
        One(self.0 * b.0)
    }
    #[inline(always)]
    fn div(self, b: Self) -> Self {
        One(self.0 / b.0)
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        One(self.0.sqrt())
    }
    #[inline(always)]
    fn neg(self) -> Self {
        One(-self.0)
    }
    #[inline(always)]
    fn xor(self, sign: Self) -> Self {
        One(f64::from_bits(self.0.to_bits() ^ sign.0.to_bits()))
    }
    #[inline(always)]
    fn abs(self) -> Self {
        One(self.0.abs())
    }
    #[inline(always)]
    fn copysign(self, sign: Self) -> Self {
        One(self.0.copysign(sign.0))
    }
    #[inline(always)]
    fn scale2(self, n: Self) -> Self {
        One(scaled(self.0, n.0))
    }
    #[inline(always)]
    fn mul_add(self, a: Self, b: Self) -> Self {
        One(if FUSED { self.0.mul_add(a.0, b.0) } else { self.0 * a.0 + b.0 })
    }
    #[inline(always)]
    fn neg_mul_add(self, a: Self, b: Self) -> Self {
        self.neg().mul_add(a, b)
    }
    #[inline(always)]
    fn select_lt(self, than: Self, then: Self, otherwise: Self) -> Self {
        if self.0 < than.0 { then } else { otherwise }
    }
    #[inline(always)]
    fn select_le(self, than: Self, then: Self, otherwise: Self) -> Self {
        if self.0 <= than.0 { then } else { otherwise }
    }
    #[inline(always)]
    fn select_eq(self, to: Self, then: Self, otherwise: Self) -> Self {
        if self.0 == to.0 { then } else { otherwise }
    }
}
