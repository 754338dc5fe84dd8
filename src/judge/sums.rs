//! Sums over numbers side by side, in vector registers.

use crate::wide::{self, Task, Wide, Width};

/// Number of partial sums, the same for registers of any width, so that the bits of a result do not depend on the processor.
const BLOCK: usize = 8;

/// The `N` numbers that are summed, from one number of each of `A` sequences.
pub(super) trait Terms<const A: usize, const N: usize>: Copy {
    fn of<W: Wide>(self, of: [W; A]) -> [W; N];
}

/// Sums the terms over all places of sequences, the first of which is no longer than any other.
pub(super) fn sums<const A: usize, const N: usize>(of: [&[f64]; A], terms: impl Terms<A, N>) -> [f64; N] {
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
        let mut k = whole;
        while k < of[0].len() {
            let mut numbers = [W::splat(0.0); A];
            let mut i = 0;
            while i < A {
                numbers[i] = W::splat(of[i][k]);
                i += 1;
            }
            let terms = terms.of(numbers);
            let mut i = 0;
            while i < N {
                let mut alike = [0.0; BLOCK];
                terms[i].store(&mut alike);
                totals[i][k - whole] += alike[0];
                i += 1;
            }
            k += 1;
        }
        totals.map(|parts| parts.iter().sum())
    }
}
