//! [`Zmm`] and [`Ymm`]: the registers of AVX-512 and AVX2.

use super::Wide;
use core::arch::x86_64::*;

macro_rules! register {
    ($(#[$doc:meta])* $name:ident($register:ty), $lanes:literal; $splat:ident, $load:ident, $store:ident,
     $add:ident, $sub:ident, $mul:ident, $div:ident, $sqrt:ident, $fma:ident, $fnma:ident,
     $xor:ident, $andnot:ident, $and:ident, $or:ident, |$x:ident, $n:ident| $scale:expr, |$a:ident, $b:ident, $then:ident, $otherwise:ident| $lt:expr, $le:expr, $eq:expr, $transpose:ident) => {
        $(#[$doc])*
        #[derive(Clone, Copy)]
        pub(crate) struct $name($register);

        // SAFETY of all blocks: values of this type live only inside tasks that `run` has started with the target features;
        // loads and stores check the length of their slices.
        impl Wide for $name {
            const LANES: usize = $lanes;

            #[inline(always)]
            fn splat(x: f64) -> Self {
                $name(unsafe { $splat(x) })
            }
            #[inline(always)]
            fn load(from: &[f64]) -> Self {
                assert!(from.len() >= $lanes);
                $name(unsafe { $load(from.as_ptr()) })
            }
            #[inline(always)]
            fn store(self, to: &mut [f64]) {
                assert!(to.len() >= $lanes);
                unsafe { $store(to.as_mut_ptr(), self.0) }
            }
            #[inline(always)]
            unsafe fn read(from: *const f64) -> Self {
                $name(unsafe { $load(from) })
            }
            #[inline(always)]
            unsafe fn write(self, to: *mut f64) {
                unsafe { $store(to, self.0) }
            }
            #[inline(always)]
            fn add(self, b: Self) -> Self {
                $name(unsafe { $add(self.0, b.0) })
            }
            #[inline(always)]
            fn sub(self, b: Self) -> Self {
                $name(unsafe { $sub(self.0, b.0) })
            }
            #[inline(always)]
            fn mul(self, b: Self) -> Self {
                $name(unsafe { $mul(self.0, b.0) })
            }
            #[inline(always)]
            fn div(self, b: Self) -> Self {
                $name(unsafe { $div(self.0, b.0) })
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                $name(unsafe { $sqrt(self.0) })
            }
            #[inline(always)]
            fn neg(self) -> Self {
                $name(unsafe { $xor(self.0, $splat(-0.0)) })
            }
            #[inline(always)]
            fn xor(self, sign: Self) -> Self {
                $name(unsafe { $xor(self.0, sign.0) })
            }
            #[inline(always)]
            fn abs(self) -> Self {
                $name(unsafe { $andnot($splat(-0.0), self.0) })
            }
            #[inline(always)]
            fn copysign(self, sign: Self) -> Self {
                $name(unsafe { $or($andnot($splat(-0.0), self.0), $and($splat(-0.0), sign.0)) })
            }
            #[inline(always)]
            fn scale2(self, n: Self) -> Self {
                let ($x, $n) = (self.0, n.0);
                $name(unsafe { $scale })
            }
            #[inline(always)]
            fn mul_add(self, a: Self, b: Self) -> Self {
                $name(unsafe { $fma(self.0, a.0, b.0) })
            }
            #[inline(always)]
            fn neg_mul_add(self, a: Self, b: Self) -> Self {
                $name(unsafe { $fnma(self.0, a.0, b.0) })
            }
            #[inline(always)]
            fn select_lt(self, than: Self, then: Self, otherwise: Self) -> Self {
                let ($a, $b, $then, $otherwise) = (self.0, than.0, then.0, otherwise.0);
                $name(unsafe { $lt })
            }
            #[inline(always)]
            fn select_le(self, than: Self, then: Self, otherwise: Self) -> Self {
                let ($a, $b, $then, $otherwise) = (self.0, than.0, then.0, otherwise.0);
                $name(unsafe { $le })
            }
            #[inline(always)]
            fn select_eq(self, to: Self, then: Self, otherwise: Self) -> Self {
                let ($a, $b, $then, $otherwise) = (self.0, to.0, then.0, otherwise.0);
                $name(unsafe { $eq })
            }
            #[inline(always)]
            fn transpose(square: [Self; 8]) -> [Self; 8] {
                // Loops, because closures are not always inlined, and cost more than the work if they are not.
                let (mut numbers, mut rows) = ([square[0].0; 8], square);
                let mut i = 0;
                while i < $lanes {
                    numbers[i] = square[i].0;
                    i += 1;
                }
                let numbers = unsafe { $transpose(numbers) };
                i = 0;
                while i < $lanes {
                    rows[i] = $name(numbers[i]);
                    i += 1;
                }
                rows
            }
        }
    };
}

register! {
    /// Eight numbers in a register of AVX-512.
    Zmm(__m512d), 8; _mm512_set1_pd, _mm512_loadu_pd, _mm512_storeu_pd,
    _mm512_add_pd, _mm512_sub_pd, _mm512_mul_pd, _mm512_div_pd, _mm512_sqrt_pd, _mm512_fmadd_pd, _mm512_fnmadd_pd,
    _mm512_xor_pd, _mm512_andnot_pd, _mm512_and_pd, _mm512_or_pd, |x, n| _mm512_scalef_pd(x, n), |a, b, then, otherwise|
    _mm512_mask_blend_pd(_mm512_cmp_pd_mask::<_CMP_LT_OQ>(a, b), otherwise, then),
    _mm512_mask_blend_pd(_mm512_cmp_pd_mask::<_CMP_LE_OQ>(a, b), otherwise, then),
    _mm512_mask_blend_pd(_mm512_cmp_pd_mask::<_CMP_EQ_OQ>(a, b), otherwise, then), eight
}

register! {
    /// Four numbers in a register of AVX2.
    Ymm(__m256d), 4; _mm256_set1_pd, _mm256_loadu_pd, _mm256_storeu_pd,
    _mm256_add_pd, _mm256_sub_pd, _mm256_mul_pd, _mm256_div_pd, _mm256_sqrt_pd, _mm256_fmadd_pd, _mm256_fnmadd_pd,
    _mm256_xor_pd, _mm256_andnot_pd, _mm256_and_pd, _mm256_or_pd, |x, n| {
        let n = _mm256_cvtepi32_epi64(_mm256_cvtpd_epi32(n));
        // Half of it, rounded down; shifts of 64 bits have no sign here.
        let half = _mm256_sub_epi64(_mm256_srli_epi64::<1>(_mm256_add_epi64(n, _mm256_set1_epi64x(4096))), _mm256_set1_epi64x(2048));
        let power = |n| _mm256_castsi256_pd(_mm256_slli_epi64::<52>(_mm256_add_epi64(n, _mm256_set1_epi64x(1023))));
        _mm256_mul_pd(_mm256_mul_pd(x, power(half)), power(_mm256_sub_epi64(n, half)))
    }, |a, b, then, otherwise|
    _mm256_blendv_pd(otherwise, then, _mm256_cmp_pd::<_CMP_LT_OQ>(a, b)),
    _mm256_blendv_pd(otherwise, then, _mm256_cmp_pd::<_CMP_LE_OQ>(a, b)),
    _mm256_blendv_pd(otherwise, then, _mm256_cmp_pd::<_CMP_EQ_OQ>(a, b)), four
}

/// Rows and columns of eight by eight changed over: pairs of numbers, then pairs of pairs, then halves.
///
/// # Safety
/// AVX-512 must be there.
#[inline(always)]
unsafe fn eight([a, b, c, d, e, f, g, h]: [__m512d; 8]) -> [__m512d; 8] {
    // SAFETY: as the caller says.
    unsafe {
        let (ab, cd) = (_mm512_unpacklo_pd(a, b), _mm512_unpacklo_pd(c, d));
        let (ef, gh) = (_mm512_unpacklo_pd(e, f), _mm512_unpacklo_pd(g, h));
        let [r0, r2, r4, r6] = quarters(ab, cd, ef, gh);
        let (ab, cd) = (_mm512_unpackhi_pd(a, b), _mm512_unpackhi_pd(c, d));
        let (ef, gh) = (_mm512_unpackhi_pd(e, f), _mm512_unpackhi_pd(g, h));
        let [r1, r3, r5, r7] = quarters(ab, cd, ef, gh);
        [r0, r1, r2, r3, r4, r5, r6, r7]
    }
}

/// Transposes four by four pairs. (A closure would not always be inlined.)
///
/// # Safety
/// AVX-512 must be there.
#[inline(always)]
unsafe fn quarters(a: __m512d, b: __m512d, c: __m512d, d: __m512d) -> [__m512d; 4] {
    // SAFETY: as the caller says.
    unsafe {
        let (even, odd) = (_mm512_shuffle_f64x2::<0x88>(a, b), _mm512_shuffle_f64x2::<0xdd>(a, b));
        let (even_, odd_) = (_mm512_shuffle_f64x2::<0x88>(c, d), _mm512_shuffle_f64x2::<0xdd>(c, d));
        [
            _mm512_shuffle_f64x2::<0x88>(even, even_),
            _mm512_shuffle_f64x2::<0x88>(odd, odd_),
            _mm512_shuffle_f64x2::<0xdd>(even, even_),
            _mm512_shuffle_f64x2::<0xdd>(odd, odd_),
        ]
    }
}

/// The same of four by four, the first of each.
///
/// # Safety
/// AVX2 must be there.
#[inline(always)]
unsafe fn four([a, b, c, d, rest @ ..]: [__m256d; 8]) -> [__m256d; 8] {
    // SAFETY: as the caller says.
    unsafe {
        let (low, high) = (_mm256_unpacklo_pd(a, b), _mm256_unpackhi_pd(a, b));
        let (low_, high_) = (_mm256_unpacklo_pd(c, d), _mm256_unpackhi_pd(c, d));
        let [e, f, g, h] = rest;
        [
            _mm256_permute2f128_pd::<0x20>(low, low_),
            _mm256_permute2f128_pd::<0x20>(high, high_),
            _mm256_permute2f128_pd::<0x31>(low, low_),
            _mm256_permute2f128_pd::<0x31>(high, high_),
            e,
            f,
            g,
            h,
        ]
    }
}
