//! [`Wide`]: a vector register's worth of independent numbers, and loops over them compiled for the machine at hand.
//!
//! A [`Task`] is written once, generic over `Wide`, and compiled for AVX-512, for AVX2 with FMA and portably; [`run`] picks
//! the widest that the processor has. All that a task calls in its loops must be `#[inline(always)]`: a function that is not
//! inlined into the one with the target feature is compiled without it, and 20 to 500 times slower (measured).
//!
//! Lanes never mix, and every operation is one IEEE operation with one rounding, so that a lane's bits do not depend on the
//! width. They do depend on whether the machine fuses a product with a sum: a processor without FMA rounds twice.

mod array;
mod one;
#[cfg(target_arch = "x86_64")]
mod registers;
mod sums;

pub(crate) use sums::{Terms, sums};

use array::Array;
use one::One;
#[cfg(target_arch = "x86_64")]
use registers::{Ymm, Zmm};

/// Numbers side by side.
pub(crate) trait Wide: Copy + Send + Sync + 'static {
    /// How many.
    const LANES: usize;

    /// One number in every lane.
    fn splat(x: f64) -> Self;
    /// The first `LANES` numbers of a slice, which must have as many.
    fn load(from: &[f64]) -> Self;
    /// Into the first `LANES` numbers of a slice, which must have as many.
    fn store(self, to: &mut [f64]);
    /// `LANES` numbers from an address.
    ///
    /// # Safety
    /// They must be readable.
    unsafe fn read(from: *const f64) -> Self;
    /// `LANES` numbers to an address.
    ///
    /// # Safety
    /// They must be writable.
    unsafe fn write(self, to: *mut f64);

    fn add(self, b: Self) -> Self;
    fn sub(self, b: Self) -> Self;
    fn mul(self, b: Self) -> Self;
    fn div(self, b: Self) -> Self;
    fn sqrt(self) -> Self;
    /// The sign bit turned over.
    fn neg(self) -> Self;
    /// The sign bit turned over where that of `sign`, a zero, is set.
    fn xor(self, sign: Self) -> Self;
    /// The sign bit cleared.
    fn abs(self) -> Self;
    /// With the sign bit of `sign`.
    fn copysign(self, sign: Self) -> Self;
    /// Times two to the power of `n`, a whole number between -2100 and 2100 (not checked), rounded once.
    fn scale2(self, n: Self) -> Self;
    /// `self * a + b`, rounded once where the machine can.
    fn mul_add(self, a: Self, b: Self) -> Self;
    /// `b - self * a`, rounded once where the machine can.
    fn neg_mul_add(self, a: Self, b: Self) -> Self;

    /// `then` in the lanes where `self < than`, else `otherwise`; a NaN on either side takes `otherwise`.
    fn select_lt(self, than: Self, then: Self, otherwise: Self) -> Self;
    /// A choice by `<=`.
    fn select_le(self, than: Self, then: Self, otherwise: Self) -> Self;
    /// A choice by `==`.
    fn select_eq(self, to: Self, then: Self, otherwise: Self) -> Self;

    /// Rows and columns of the first `LANES` by `LANES` numbers changed over.
    #[inline(always)]
    fn transpose(square: [Self; 8]) -> [Self; 8] {
        let mut numbers = [[0.0; 8]; 8];
        for (row, numbers) in square.iter().zip(&mut numbers) {
            row.store(numbers);
        }
        let mut rows = square;
        for (at, row) in rows.iter_mut().enumerate().take(Self::LANES) {
            *row = Self::load(&core::array::from_fn::<f64, 8, _>(|from| numbers[from][at]));
        }
        rows
    }

    /// Whether all lanes are below a limit.
    #[inline(always)]
    fn all_below(self, limit: f64) -> bool {
        let mut lanes = [f64::NEG_INFINITY; 8];
        self.store(&mut lanes);
        lanes.iter().all(|lane| *lane < limit)
    }

    /// The lanes joined by a function of two numbers, from the first on.
    #[inline(always)]
    fn fold(self, f: impl Fn(f64, f64) -> f64) -> f64 {
        let mut lanes = [0.0; 8];
        self.store(&mut lanes);
        let mut all = lanes[0];
        for lane in &lanes[1..Self::LANES] {
            all = f(all, *lane);
        }
        all
    }

    /// Each lane through a function of one number.
    #[inline(always)]
    fn map(self, f: impl Fn(f64) -> f64) -> Self {
        let mut lanes = [0.0; 8];
        self.store(&mut lanes);
        for lane in &mut lanes[..Self::LANES] {
            *lane = f(*lane);
        }
        Self::load(&lanes)
    }

    /// Each lane of two vectors through a function of two numbers.
    #[inline(always)]
    fn zip(self, b: Self, f: impl Fn(f64, f64) -> f64) -> Self {
        let (mut lanes, mut others) = ([0.0; 8], [0.0; 8]);
        self.store(&mut lanes);
        b.store(&mut others);
        for (lane, other) in lanes[..Self::LANES].iter_mut().zip(&others) {
            *lane = f(*lane, *other);
        }
        Self::load(&lanes)
    }
}

/// A loop over vectors.
pub(crate) trait Task {
    type Output;
    /// Marked `#[inline(always)]`, as all that it calls.
    fn run<W: Wide>(self) -> Self::Output;
}

/// The instructions that a task is compiled for. A value exists only where the processor has them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Width(Instructions);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Instructions {
    #[cfg(target_arch = "x86_64")]
    Avx512,
    #[cfg(target_arch = "x86_64")]
    Avx2,
    #[cfg(target_arch = "x86_64")]
    Fma,
    Portable,
    #[cfg(target_arch = "x86_64")]
    FmaSingle,
    Single,
}

impl Width {
    /// The widest that this processor has.
    pub fn widest() -> Self {
        Self::avx512().or_else(Self::avx2).unwrap_or_else(Self::portable)
    }

    /// Eight lanes in a register.
    pub fn avx512() -> Option<Self> {
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx512f")
            && std::arch::is_x86_feature_detected!("avx512vl")
            && std::arch::is_x86_feature_detected!("avx512dq")
            && std::arch::is_x86_feature_detected!("fma")
        {
            return Some(Width(Instructions::Avx512));
        }
        None
    }

    /// Four lanes in a register.
    pub fn avx2() -> Option<Self> {
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2") && std::arch::is_x86_feature_detected!("fma") {
            return Some(Width(Instructions::Avx2));
        }
        None
    }

    /// Arrays, left to the compiler; with fused products where the processor has them, so that the bits are the same.
    pub fn portable() -> Self {
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("fma") {
            return Width(Instructions::Fma);
        }
        Width(Instructions::Portable)
    }

    /// One number at a time, with fused products where the processor has them.
    pub fn single() -> Self {
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("fma") {
            return Width(Instructions::FmaSingle);
        }
        Width(Instructions::Single)
    }

    /// Lanes of a register.
    pub fn lanes(self) -> usize {
        match self.0 {
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx512 => 8,
            #[cfg(target_arch = "x86_64")]
            Instructions::FmaSingle => 1,
            Instructions::Single => 1,
            _ => 4,
        }
    }
}

/// Runs a task with these instructions.
#[inline]
pub(crate) fn run<T: Task>(width: Width, task: T) -> T::Output {
    match width.0 {
        // SAFETY: a `Width` of this kind is made only where the processor has the features.
        #[cfg(target_arch = "x86_64")]
        Instructions::Avx512 => unsafe { with_avx512(task) },
        // SAFETY: as above.
        #[cfg(target_arch = "x86_64")]
        Instructions::Avx2 => unsafe { with_avx2(task) },
        // SAFETY: as above.
        #[cfg(target_arch = "x86_64")]
        Instructions::Fma => unsafe { with_fma(task) },
        Instructions::Portable => task.run::<Array<{ cfg!(not(target_arch = "x86_64")) }>>(),
        // SAFETY: as above.
        #[cfg(target_arch = "x86_64")]
        Instructions::FmaSingle => unsafe { one_with_fma(task) },
        Instructions::Single => task.run::<One<{ cfg!(not(target_arch = "x86_64")) }>>(),
    }
}

/// Runs a task with instructions of four lanes: it is compiled for no others.
pub(crate) fn run_narrow<T: Task>(width: Width, task: T) -> T::Output {
    match width.0 {
        // SAFETY: a `Width` of this kind is made only where the processor has the features.
        #[cfg(target_arch = "x86_64")]
        Instructions::Avx2 => unsafe { with_avx2(task) },
        // SAFETY: as above.
        #[cfg(target_arch = "x86_64")]
        Instructions::Fma => unsafe { with_fma(task) },
        _ => task.run::<Array<{ cfg!(not(target_arch = "x86_64")) }>>(),
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512vl,avx512dq,fma")]
unsafe fn with_avx512<T: Task>(task: T) -> T::Output {
    task.run::<Zmm>()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
unsafe fn with_avx2<T: Task>(task: T) -> T::Output {
    task.run::<Ymm>()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "fma")]
unsafe fn with_fma<T: Task>(task: T) -> T::Output {
    task.run::<Array<true>>()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "fma")]
unsafe fn one_with_fma<T: Task>(task: T) -> T::Output {
    task.run::<One<true>>()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each operation on numbers that overflow, vanish and are none.
    struct All;
    const A: [f64; 8] = [1.5, -0.0, f64::NAN, f64::INFINITY, -3.25, 1e308, 4e-320, -2.0];
    const B: [f64; 8] = [1.5, 0.0, 2.0, f64::INFINITY, 7.125, 1e308, f64::NAN, -3.0];
    const C: [f64; 8] = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8];

    impl Task for All {
        type Output = Vec<u64>;
        #[inline(always)]
        fn run<W: Wide>(self) -> Vec<u64> {
            let mut bits = vec![];
            for at in (0..8).step_by(W::LANES) {
                let (a, b, c) = (W::load(&A[at..]), W::load(&B[at..]), W::load(&C[at..]));
                let results = [
                    a.add(b),
                    a.sub(b),
                    a.mul(b),
                    a.div(b),
                    a.abs().sqrt(),
                    a.neg(),
                    a.abs(),
                    a.copysign(b),
                    a.scale2(W::splat(5.0)),
                    a.scale2(W::splat(-1070.0)),
                    a.mul_add(c, b),
                    a.neg_mul_add(c, b),
                    a.select_lt(b, c, a),
                    a.select_le(b, c, a),
                    a.select_eq(b, c, a),
                    a.map(f64::exp),
                    a.zip(b, f64::hypot),
                    W::splat(at as f64),
                ];
                for (number, result) in results.into_iter().enumerate() {
                    let mut lanes = [0.0; 8];
                    result.store(&mut lanes);
                    for (lane, x) in lanes[..W::LANES].iter().enumerate() {
                        // The bits of a NaN are the processor's business; the last row tells the width.
                        let x = if x.is_nan() { f64::NAN } else { *x };
                        if number < 17 {
                            bits.push((number * 8 + at + lane, x.to_bits()));
                        }
                    }
                }
            }
            bits.sort_unstable();
            bits.into_iter().map(|(_, bits)| bits).collect()
        }
    }

    /// Changes rows and columns over.
    struct Transpose;

    impl Task for Transpose {
        type Output = ();
        #[inline(always)]
        fn run<W: Wide>(self) {
            let row = |from: usize| core::array::from_fn::<f64, 8, _>(|at| (8 * from + at) as f64);
            let rows = W::transpose(core::array::from_fn(|from| W::load(&row(from))));
            for (at, row) in rows.into_iter().enumerate().take(W::LANES) {
                let mut numbers = [0.0; 8];
                row.store(&mut numbers);
                let expected: Vec<f64> = (0..W::LANES).map(|from| (8 * from + at) as f64).collect();
                assert_eq!(numbers[..W::LANES], expected);
            }
        }
    }

    #[test]
    fn rows_become_columns() {
        for width in
            [Width::avx512(), Width::avx2(), Some(Width::portable()), Some(Width::single())].into_iter().flatten()
        {
            run(width, Transpose);
        }
    }

    #[test]
    fn every_width_gives_the_same_bits() {
        let reference = run(Width::portable(), All);
        for width in [Width::avx512(), Width::avx2()].into_iter().flatten() {
            assert_eq!(run(width, All), reference, "{width:?}");
        }
        assert_eq!(f64::from_bits(reference[0]), 3.0);
        assert_eq!(f64::from_bits(reference[12 * 8]), 1.5, "equal is not less: a stays");
        assert_eq!(f64::from_bits(reference[13 * 8]), 0.1, "equal is at most: c");
    }
}
