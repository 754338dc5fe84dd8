//! [`Pair`]: two slopes in one register of the processor.
//!
//! Left to itself the compiler packs plain arrays of slopes into vectors badly or not at all, depending on their number
//! (measured on one RK4 step of a motor with five slopes: 47 to 165 ns). Two lanes are what every `x86_64` has, so no
//! run-time dispatch is needed and nothing hinges on inlining; wider units gained less than a fifth, because one
//! trajectory is bound by latency.
//!
//! Numbers of the [`WIDE`] unit multiply and add in one instruction, which shortens that latency: a fit took 6 % less time.
//! The instruction is written out, because the compiler makes a call of it in whatever it does not inline.

use core::ops::{Add, Mul, Sub};

#[cfg(target_arch = "x86_64")]
use core::arch::x86_64::{__m128d, _mm_add_pd, _mm_loadu_pd, _mm_mul_pd, _mm_set1_pd, _mm_storeu_pd, _mm_sub_pd};

#[cfg(target_arch = "x86_64")]
#[derive(Clone, Copy)]
pub(crate) struct Pair(__m128d);

#[cfg(not(target_arch = "x86_64"))]
#[derive(Clone, Copy)]
pub(crate) struct Pair([f64; 2]);

/// Which registers a number is made for, as a const parameter.
pub(crate) type Unit = u8;
/// What every machine of the target has.
#[cfg(feature = "std")]
pub(crate) const PORTABLE: Unit = 0;
/// AVX-512 and fused multiply-add. Numbers of this unit occur only in loops that found both on the machine at hand.
pub(crate) const WIDE: Unit = 1;

impl Pair {
    /// Entries `at` and `at + 1`; nothing is read, and zeros come back, beyond the end.
    #[inline(always)]
    pub fn load<const N: usize>(from: &[f64; N], at: usize) -> Self {
        if at + 2 > N {
            return Pair::splat(0.0);
        }
        // SAFETY: both entries lie within the array; SSE2 is part of x86_64.
        #[cfg(target_arch = "x86_64")]
        return Pair(unsafe { _mm_loadu_pd(from.as_ptr().add(at)) });
        #[cfg(not(target_arch = "x86_64"))]
        return Pair([from[at], from[at + 1]]);
    }

    /// Writes entries `at` and `at + 1`; nothing beyond the end.
    #[inline(always)]
    pub fn store<const N: usize>(self, to: &mut [f64; N], at: usize) {
        if at + 2 <= N {
            // SAFETY: both entries lie within the array; SSE2 is part of x86_64.
            #[cfg(target_arch = "x86_64")]
            unsafe {
                _mm_storeu_pd(to.as_mut_ptr().add(at), self.0)
            }
            #[cfg(not(target_arch = "x86_64"))]
            {
                [to[at], to[at + 1]] = self.0;
            }
        }
    }

    /// The same number twice.
    #[inline(always)]
    pub fn splat(value: f64) -> Self {
        // SAFETY: SSE2 is part of x86_64.
        #[cfg(target_arch = "x86_64")]
        return Pair(unsafe { _mm_set1_pd(value) });
        #[cfg(not(target_arch = "x86_64"))]
        return Pair([value; 2]);
    }
}

macro_rules! operator {
    ($($trait:ident $method:ident $op:tt $intrinsic:ident;)*) => {$(
        impl $trait for Pair {
            type Output = Pair;
            #[inline(always)]
            fn $method(self, other: Pair) -> Pair {
                // SAFETY: SSE2 is part of x86_64.
                #[cfg(target_arch = "x86_64")]
                return Pair(unsafe { $intrinsic(self.0, other.0) });
                #[cfg(not(target_arch = "x86_64"))]
                return Pair([self.0[0] $op other.0[0], self.0[1] $op other.0[1]]);
            }
        }
    )*};
}
operator! { Add add + _mm_add_pd; Sub sub - _mm_sub_pd; Mul mul * _mm_mul_pd; }

/// Products that are added to something.
pub(crate) trait Fused: Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> {
    /// `self * by + to`.
    #[inline(always)]
    fn times_plus<const UNIT: Unit>(self, by: Self, to: Self) -> Self {
        self * by + to
    }

    /// `to - self * by`.
    #[inline(always)]
    fn times_from<const UNIT: Unit>(self, by: Self, to: Self) -> Self {
        to - self * by
    }
}

impl Fused for f64 {}

#[cfg(not(target_arch = "x86_64"))]
impl Fused for Pair {}

#[cfg(target_arch = "x86_64")]
macro_rules! fused {
    ($instruction:literal, $by:expr, $with:expr, $to:expr) => {{
        let mut sum = $to.0;
        // SAFETY: numbers of the unit WIDE occur only where the machine has FMA.
        unsafe {
            core::arch::asm!(
                concat!($instruction, " {0}, {1}, {2}"), inout(xmm_reg) sum, in(xmm_reg) $by.0, in(xmm_reg) $with.0,
                options(pure, nomem, nostack, preserves_flags)
            );
        }
        Pair(sum)
    }};
}

#[cfg(target_arch = "x86_64")]
impl Fused for Pair {
    #[inline(always)]
    fn times_plus<const UNIT: Unit>(self, by: Self, to: Self) -> Self {
        if UNIT == WIDE { fused!("vfmadd231pd", self, by, to) } else { self * by + to }
    }

    #[inline(always)]
    fn times_from<const UNIT: Unit>(self, by: Self, to: Self) -> Self {
        if UNIT == WIDE { fused!("vfnmadd231pd", self, by, to) } else { to - self * by }
    }
}

/// The slopes `[expression; N]` in pairs, where `x` (and `y`) run through the slopes of `a` (and `b`) and the scalars are
/// the same for all.
macro_rules! lanes {
    ($n:ident; $($x:ident in $a:expr),+; $($s:ident = $scalar:expr),*; $expression:expr) => {{
        let mut slopes = [0.0; $n];
        {
            $(let $s = $crate::lanes::Pair::splat($scalar);)*
            let mut pair = 0;
            while pair + 2 <= $n {
                $(let $x = $crate::lanes::Pair::load(&$a, pair);)+
                $crate::lanes::Pair::store($expression, &mut slopes, pair);
                pair += 2;
            }
        }
        if $n % 2 == 1 {
            $(let $s = $scalar;)*
            $(let $x = $a[$n - 1];)+
            slopes[$n - 1] = $expression;
        }
        slopes
    }};
}
pub(crate) use lanes;
