//! Sums over pairs of numbers, in vector registers.

use crate::wide::{self, Task, Wide, Width};

/// Number of partial sums, the same for registers of any width, so that the bits of a result do not depend on the processor.
const BLOCK: usize = 8;

/// The four numbers that are summed over pairs.
pub(super) trait Terms: Copy {
    fn of<W: Wide>(self, a: W, b: W) -> [W; 4];
}

/// Sums the terms of all pairs `(a[k], b[k])`. `b` must be as long as `a`.
pub(super) fn sums(a: &[f64], b: &[f64], terms: impl Terms) -> [f64; 4] {
    wide::run(Width::widest(), Sums { a, b, terms })
}

struct Sums<'s, T> {
    a: &'s [f64],
    b: &'s [f64],
    terms: T,
}

impl<T: Terms> Task for Sums<'_, T> {
    type Output = [f64; 4];

    #[inline(always)]
    fn run<W: Wide>(self) -> [f64; 4] {
        let Sums { a, b, terms } = self;
        let whole = a.len() - a.len() % BLOCK;
        let mut totals = [[0.0; BLOCK]; 4];
        let mut begin = 0;
        while begin < BLOCK {
            let mut sums = [W::splat(0.0); 4];
            let mut k = begin;
            while k < whole {
                let terms = terms.of(W::load(&a[k..]), W::load(&b[k..]));
                let mut i = 0;
                while i < 4 {
                    sums[i] = sums[i].add(terms[i]);
                    i += 1;
                }
                k += BLOCK;
            }
            let mut i = 0;
            while i < 4 {
                sums[i].store(&mut totals[i][begin..]);
                i += 1;
            }
            begin += W::LANES;
        }
        let mut k = whole;
        while k < a.len() {
            let terms = terms.of(W::splat(a[k]), W::splat(b[k]));
            let mut i = 0;
            while i < 4 {
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
