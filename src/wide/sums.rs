//! Sums over numbers side by side, in vector registers.

use crate::wide::{self, Task, Wide, Width};

/// Number of partial sums, the same for registers of any width, so that the bits of a result do not depend on the processor.
const BLOCK: usize = 8;

/// The `N` numbers that are summed, from one number of each of `A` sequences.
pub(crate) trait Terms<const A: usize, const N: usize>: Copy {
    fn of<W: Wide>(self, of: [W; A]) -> [W; N];
}

/// Sums the terms over all places of sequences, the first of which is no longer than any other.
pub(crate) fn sums<const A: usize, const N: usize>(of: [&[f64]; A], terms: impl Terms<A, N>) -> [f64; N] {
    wide::run(Width::widest(), Sums { of, terms })
}

struct Sums<'s, const A: usize, const N: usize, T> {
    of: [&'s [f64]; A],
    terms: T,
}

impl<const A: usize, const N: usize, T: Terms<A, N>> Task for Sums<'_, A, N, T> {
    type Output = [f64; N];

    #[inline(always)]
    fn run<W: Wide>(self) -> [f64; N] {
        let Sums { of, terms } = self;
        let whole = of[0].len() - of[0].len() % BLOCK;
        let mut totals = [[0.0; BLOCK]; N];
        let mut begin = 0;
        while begin < BLOCK {
            let mut sums = [W::splat(0.0); N];
            let mut k = begin;
            while k < whole {
                let mut numbers = [W::splat(0.0); A];
                let mut i = 0;
                while i < A {
                    numbers[i] = W::load(&of[i][k..]);
                    i += 1;
                }
                let terms = terms.of(numbers);
                let mut i = 0;
                while i < N {
                    sums[i] = sums[i].add(terms[i]);
                    i += 1;
                }
                k += BLOCK;
            }
            let mut i = 0;
            while i < N {
                sums[i].store(&mut totals[i][begin..]);
                i += 1;
            }
            begin += W::LANES;
        }
        // The rest, filled up with zeros whose terms are left out.
        let left = of[0].len() - whole;
        let mut begin = 0;
        while begin < left {
            let mut numbers = [W::splat(0.0); A];
            let mut i = 0;
            while i < A {
                let mut filled = [0.0; BLOCK];
                let count = (left - begin).min(W::LANES);
                filled[..count].copy_from_slice(&of[i][whole + begin..][..count]);
                numbers[i] = W::load(&filled);
                i += 1;
            }
            let terms = terms.of(numbers);
            let mut i = 0;
            while i < N {
                let mut values = [0.0; BLOCK];
                terms[i].store(&mut values);
                let mut lane = 0;
                while lane < W::LANES && begin + lane < left {
                    totals[i][begin + lane] += values[lane];
                    lane += 1;
                }
                i += 1;
            }
            begin += W::LANES;
        }
        totals.map(|parts| parts.iter().sum())
    }
}
