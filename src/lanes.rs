//! [`Pair`]: two slopes in one register of the processor.
//!
//! Left to itself the compiler packs plain arrays of slopes into vectors badly or not at all, depending on their number
//! (measured on one RK4 step of a motor with five slopes: 47 to 165 ns). Two lanes are what every `x86_64` has, so no
//! run-time dispatch is needed and nothing hinges on inlining; wider units gained less than a fifth, because one
//! trajectory is bound by latency.
//!
//! The slopes of fused numbers are multiplied and added in one instruction, which shortens that latency: a fit took 6 % less
//! time. The instruction is written out, because the compiler makes a call of it in whatever it does not inline.

use core::ops::{Add, Mul, Sub};

#[cfg(target_arch = "x86_64")]
use core::arch::x86_64::{__m128d, _mm_add_pd, _mm_loadu_pd, _mm_mul_pd, _mm_set1_pd, _mm_storeu_pd, _mm_sub_pd};

#[cfg(target_arch = "x86_64")]
#[derive(Clone, Copy)]
pub(crate) struct Pair(__m128d);

#[cfg(not(target_arch = "x86_64"))]
#[derive(Clone, Copy)]
pub(crate) struct Pair([f64; 2]);

/// A number whose slopes stand in pairs.
///
/// # Safety
/// The type must be laid out as an `f64`.
pub(crate) unsafe trait Number:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self>
{
    /// Whether slopes are multiplied and added in one instruction: only where the machine has FMA.
    #[cfg(feature = "std")]
    const FUSED: bool;
}

// SAFETY: the same type.
unsafe impl Number for f64 {
    #[cfg(feature = "std")]
    const FUSED: bool = false;
}

impl Pair {
    /// Entries `at` and `at + 1`; nothing is read, and zeros come back, beyond the end.
    #[inline(always)]
    pub fn load<T: Number, const N: usize>(from: &[T; N], at: usize) -> Self {
        if at + 2 > N {
            return Pair::splat(0.0f64);
        }
        let first = from.as_ptr().cast::<f64>();
        // SAFETY: both entries lie within the array, and are laid out as `f64`; SSE2 is part of x86_64.
        #[cfg(target_arch = "x86_64")]
        return Pair(unsafe { _mm_loadu_pd(first.add(at)) });
        // SAFETY: as above.
        #[cfg(not(target_arch = "x86_64"))]
        return Pair(unsafe { [*first.add(at), *first.add(at + 1)] });
    }

    /// Writes entries `at` and `at + 1`; nothing beyond the end.
    #[inline(always)]
    pub fn store<T: Number, const N: usize>(self, to: &mut [T; N], at: usize) {
        if at + 2 <= N {
            let first = to.as_mut_ptr().cast::<f64>();
            // SAFETY: both entries lie within the array, and are laid out as `f64`; SSE2 is part of x86_64.
            #[cfg(target_arch = "x86_64")]
            unsafe {
                _mm_storeu_pd(first.add(at), self.0)
            }
            // SAFETY: as above.
            #[cfg(not(target_arch = "x86_64"))]
            unsafe {
                [*first.add(at), *first.add(at + 1)] = self.0;
            }
        }
    }

    /// One number twice.
    #[inline(always)]
    pub fn splat<T: Number>(value: T) -> Self {
        // SAFETY: laid out as an `f64`.
        let value = unsafe { *(&raw const value).cast::<f64>() };
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

#[cfg(target_arch = "x86_64")]
macro_rules! fused {
    ($instruction:literal, $by:expr, $with:expr, $to:expr) => {{
        let mut sum = $to.0;
        // SAFETY: fused numbers occur only where the machine has FMA.
        unsafe {
            core::arch::asm!(
                concat!($instruction, " {0}, {1}, {2}"), inout(xmm_reg) sum, in(xmm_reg) $by.0, in(xmm_reg) $with.0,
                options(pure, nomem, nostack, preserves_flags)
            );
        }
        Pair(sum)
    }};
}

/// Products that are added to something; single numbers are rounded twice in any case.
pub(crate) trait Sums: Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> {
    /// `self * by + to`.
    #[inline(always)]
    fn times_plus<const FUSED: bool>(self, by: Self, to: Self) -> Self {
        self * by + to
    }

    /// `to - self * by`.
    #[inline(always)]
    fn times_from<const FUSED: bool>(self, by: Self, to: Self) -> Self {
        to - self * by
    }
}

impl<T: Number> Sums for T {}

impl Sums for Pair {
    #[cfg(target_arch = "x86_64")]
    #[inline(always)]
    fn times_plus<const FUSED: bool>(self, by: Self, to: Self) -> Self {
        if FUSED { fused!("vfmadd231pd", self, by, to) } else { self * by + to }
    }

    #[cfg(target_arch = "x86_64")]
    #[inline(always)]
    fn times_from<const FUSED: bool>(self, by: Self, to: Self) -> Self {
        if FUSED { fused!("vfnmadd231pd", self, by, to) } else { to - self * by }
    }
}

/// The slopes `[expression; N]` in pairs, where `x` (and `y`) run through the slopes of `a` (and `b`) and the scalars are
/// the same for all.
macro_rules! lanes {
    ($n:ident; $($x:ident in $a:expr),+; $($s:ident = $scalar:expr),*; $expression:expr) => {{
        let mut slopes = [<Self as core::convert::From<f64>>::from(0.0); $n];
        {
            $(let $s = $crate::lanes::Pair::splat($scalar);)*
            let mut pair = 0;
            while pair + 2 <= $n {
                $(let $x = $crate::lanes::Pair::load($a, pair);)+
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

/// The slope arithmetic of [`Scalar`](crate::Scalar), in pairs, for a [`Number`].
macro_rules! slopes_in_pairs {
    ($fused:literal) => {
        #[inline(always)]
        fn slopes_plus<const N: usize>(x: &[Self; N], y: &[Self; N]) -> [Self; N] {
            $crate::lanes::lanes!(N; x in x, y in y;; x + y)
        }
        #[inline(always)]
        fn slopes_minus<const N: usize>(x: &[Self; N], y: &[Self; N]) -> [Self; N] {
            $crate::lanes::lanes!(N; x in x, y in y;; x - y)
        }
        #[inline(always)]
        fn slopes_times<const N: usize>(x: &[Self; N], factor: Self) -> [Self; N] {
            $crate::lanes::lanes!(N; x in x; v = factor; x * v)
        }
        #[inline(always)]
        fn slopes_of_product<const N: usize>(x: &[Self; N], by: Self, y: &[Self; N], with: Self) -> [Self; N] {
            $crate::lanes::lanes!(N; x in x, y in y; u = with, v = by; y.times_plus::<$fused>(u, x * v))
        }
        #[inline(always)]
        fn slopes_of_quotient<const N: usize>(x: &[Self; N], y: &[Self; N], value: Self, over: Self) -> [Self; N] {
            $crate::lanes::lanes!(N; x in x, y in y; q = value, r = over; y.times_from::<$fused>(q, x) * r)
        }
        #[inline(always)]
        fn slopes_plus_times<const N: usize>(x: &[Self; N], y: &[Self; N], a: f64) -> [Self; N] {
            $crate::lanes::lanes!(N; x in x, y in y; v = <Self as core::convert::From<f64>>::from(a);
                y.times_plus::<$fused>(v, x))
        }
    };
}
pub(crate) use slopes_in_pairs;
