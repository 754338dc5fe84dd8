//! Random numbers that are the same everywhere: SplitMix64 (Steele, Lea and Flood, OOPSLA 2014).

use rand_distr::Distribution;
use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::{Rng, SeedableRng};

/// A stream of random numbers.
#[derive(Clone, Debug)]
pub(crate) struct Random(SplitMix64);

impl Random {
    /// Stream number `stream` of a seed.
    pub fn stream(seed: u64, stream: u64) -> Self {
        let mut random = SplitMix64::seed_from_u64(seed ^ stream.wrapping_mul(0xd605_bbb5_8c8a_bbfd));
        // Neighboring seeds part ways.
        Random(SplitMix64::seed_from_u64(random.next_u64() ^ stream))
    }

    /// Evenly from zero (included) to one.
    pub fn uniform(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// From the standard normal distribution.
    pub fn normal(&mut self) -> f64 {
        rand_distr::StandardNormal.sample(&mut self.0)
    }

    /// Evenly among `0..n`; zero if `n` is.
    pub fn below(&mut self, n: usize) -> usize {
        ((self.uniform() * n as f64) as usize).min(n.saturating_sub(1))
    }
}
