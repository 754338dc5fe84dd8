//! Runs a loop with the widest vector registers of the machine at hand.
//!
//! The default target of `x86_64` has 16 registers of two lanes; with AVX-512 there are 32, and no copies between them. A
//! [`Kernel`] is compiled once portably and once for that, and everything that is inlined into it (models too: hence
//! `#[inline]` on them) profits. Two lessons:
//! - The compiler surely inlines a large function only where it has one caller. So the numbers of the two loops are of
//!   two types, and each has its own copy of the model, with one caller.
//! - No wider lanes by explicit instructions: where inlining fails they become calls, twenty times slower, while this is
//!   never slower than the portable loop.

use crate::lanes::Number;

/// A loop to be compiled for one type of numbers. `run` and all it calls in its loop must be inlined.
pub(crate) trait Kernel {
    type Number: Number;
    type Output;
    fn run(self) -> Self::Output;
}

/// Whether this machine has the wide unit.
pub(crate) fn has_wide() -> bool {
    #[cfg(target_arch = "x86_64")]
    return std::arch::is_x86_feature_detected!("avx512f")
        && std::arch::is_x86_feature_detected!("avx512vl")
        && std::arch::is_x86_feature_detected!("avx512dq")
        && std::arch::is_x86_feature_detected!("fma");
    #[cfg(not(target_arch = "x86_64"))]
    return false;
}

/// Runs the kernel: one of fused numbers in the wide unit, which the machine must have.
#[inline]
pub(crate) fn run<K: Kernel>(kernel: K) -> K::Output {
    #[cfg(target_arch = "x86_64")]
    if K::Number::FUSED && has_wide() {
        // SAFETY: the features were just found on this machine.
        return unsafe { wide(kernel) };
    }
    kernel.run()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512vl,avx512dq")]
unsafe fn wide<K: Kernel>(kernel: K) -> K::Output {
    kernel.run()
}
