//! Runs a loop with the widest vector registers of the machine at hand.
//!
//! The default target of `x86_64` has 16 registers of two lanes; with AVX-512 there are 32, and no copies between them. A
//! [`Kernel`] is compiled for one [`Unit`], and everything that is inlined into it (models too: hence `#[inline]` on them)
//! profits. Two lessons:
//! - The compiler surely inlines a large function only where it has one caller. So the numbers of the two units' loops are of
//!   two types, and each has its own copy of the model, with one caller.
//! - No wider lanes by explicit instructions: where inlining fails they become calls, twenty times slower, while this is
//!   never slower than the portable loop.

/// A loop to be compiled for one unit. `run` and all it calls in its loop must be inlined.
pub(crate) trait Kernel {
    type Output;
    fn run(self) -> Self::Output;
}

/// The instructions that a kernel is compiled for.
pub(crate) trait Unit: Copy {
    fn run<K: Kernel>(self, kernel: K) -> K::Output;
}

/// Those that every machine has.
#[derive(Clone, Copy)]
pub(crate) struct Portable;

impl Unit for Portable {
    #[inline]
    fn run<K: Kernel>(self, kernel: K) -> K::Output {
        kernel.run()
    }
}

/// AVX-512 and FMA, which this machine has: there is no other way to get a value of this type than
/// [`detected`](Wide::detected).
#[derive(Clone, Copy)]
pub(crate) struct Wide(());

impl Wide {
    /// `None` if the machine lacks them.
    pub fn detected() -> Option<Self> {
        #[cfg(target_arch = "x86_64")]
        let found = std::arch::is_x86_feature_detected!("avx512f")
            && std::arch::is_x86_feature_detected!("avx512vl")
            && std::arch::is_x86_feature_detected!("avx512dq")
            && std::arch::is_x86_feature_detected!("fma");
        #[cfg(not(target_arch = "x86_64"))]
        let found = false;
        found.then_some(Wide(()))
    }
}

impl Unit for Wide {
    #[inline]
    fn run<K: Kernel>(self, kernel: K) -> K::Output {
        #[cfg(target_arch = "x86_64")]
        // SAFETY: the features were found on this machine, or there would be no `Wide`.
        return unsafe { wide(kernel) };
        #[cfg(not(target_arch = "x86_64"))]
        kernel.run()
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512vl,avx512dq")]
unsafe fn wide<K: Kernel>(kernel: K) -> K::Output {
    kernel.run()
}
