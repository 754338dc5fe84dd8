//! [`Array`]: four numbers, left to the compiler.

use super::Wide;
use super::one::scaled;

/// Four numbers in an array.
#[derive(Clone, Copy)]
pub(crate) struct Array<const FUSED: bool>([f64; 4]);

impl<const FUSED: bool> Array<FUSED> {
    #[inline(always)]
    fn each(self, b: Self, f: impl Fn(f64, f64) -> f64) -> Self {
        let ([a0, a1, a2, a3], [b0, b1, b2, b3]) = (self.0, b.0);
        Array([f(a0, b0), f(a1, b1), f(a2, b2), f(a3, b3)])
    }

    #[inline(always)]
    fn either(self, then: Self, otherwise: Self, b: Self, holds: impl Fn(f64, f64) -> bool) -> Self {
        let mut chosen = otherwise.0;
        let mut i = 0;
        while i < 4 {
            if holds(self.0[i], b.0[i]) {
                chosen[i] = then.0[i];
            }
            i += 1;
        }
        Array(chosen)
    }
}

impl<const FUSED: bool> Wide for Array<FUSED> {
    const LANES: usize = 4;

    #[inline(always)]
    fn splat(x: f64) -> Self {
        Array([x; 4])
    }
    #[inline(always)]
    fn load(from: &[f64]) -> Self {
        Array([from[0], from[1], from[2], from[3]])
    }
    #[inline(always)]
    fn store(self, to: &mut [f64]) {
        to[..4].copy_from_slice(&self.0);
    }
    #[inline(always)]
    unsafe fn read(from: *const f64) -> Self {
        // SAFETY: as the caller says.
        Array(unsafe { from.cast::<[f64; 4]>().read() })
    }
    #[inline(always)]
    unsafe fn write(self, to: *mut f64) {
        // SAFETY: as the caller says.
        unsafe { to.cast::<[f64; 4]>().write(self.0) }
    }
    #[inline(always)]
    fn add(self, b: Self) -> Self {
        self.each(b, |a, b| a + b)
    }
    #[inline(always)]
    fn sub(self, b: Self) -> Self {
        self.each(b, |a, b| a - b)
    }
    #[inline(always)]
    fn mul(self, b: Self) -> Self {
        self.each(b, |a, b| a * b)
    }
    #[inline(always)]
    fn div(self, b: Self) -> Self {
        self.each(b, |a, b| a / b)
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        self.each(self, |a, _| a.sqrt())
    }
    #[inline(always)]
    fn neg(self) -> Self {
        self.each(self, |a, _| -a)
    }
    #[inline(always)]
    fn xor(self, sign: Self) -> Self {
        self.each(sign, |a, sign| f64::from_bits(a.to_bits() ^ sign.to_bits()))
    }
    #[inline(always)]
    fn abs(self) -> Self {
        self.each(self, |a, _| a.abs())
    }
    #[inline(always)]
    fn copysign(self, sign: Self) -> Self {
        self.each(sign, |a, sign| a.copysign(sign))
    }
    #[inline(always)]
    fn scale2(self, n: Self) -> Self {
        self.each(n, scaled)
    }
    #[inline(always)]
    fn mul_add(self, a: Self, b: Self) -> Self {
        let product = |i: usize| if FUSED { self.0[i].mul_add(a.0[i], b.0[i]) } else { self.0[i] * a.0[i] + b.0[i] };
        Array([product(0), product(1), product(2), product(3)])
    }
    #[inline(always)]
    fn neg_mul_add(self, a: Self, b: Self) -> Self {
        self.neg().mul_add(a, b)
    }
    #[inline(always)]
    fn select_lt(self, than: Self, then: Self, otherwise: Self) -> Self {
        self.either(then, otherwise, than, |a, b| a < b)
    }
    #[inline(always)]
    fn select_le(self, than: Self, then: Self, otherwise: Self) -> Self {
        self.either(then, otherwise, than, |a, b| a <= b)
    }
    #[inline(always)]
    fn select_eq(self, to: Self, then: Self, otherwise: Self) -> Self {
        self.either(then, otherwise, to, |a, b| a == b)
    }
}
