//! The sweeps over the rows: products of two columns with the later ones, and the update of these.

use crate::wide::Wide;

/// The products of the first column with itself and with the second.
#[inline(always)]
pub(super) fn first_products<W: Wide, const L: usize>(rows: &[[f64; L]], columns: usize) -> [W; 2] {
    let mut sums = [[W::splat(0.0); 2]; 2];
    let mut pairs = rows.chunks_exact(2 * columns);
    for pair in &mut pairs {
        let (even, odd) = pair.split_at(columns);
        first_product(even, &mut sums[0]);
        first_product(odd, &mut sums[1]);
    }
    for even in pairs.remainder().chunks_exact(columns) {
        first_product(even, &mut sums[0]);
    }
    [sums[0][0].add(sums[1][0]), sums[0][1].add(sums[1][1])]
}

#[inline(always)]
fn first_product<W: Wide, const L: usize>(row: &[[f64; L]], sums: &mut [W; 2]) {
    let x = W::load(&row[0]);
    sums[0] = x.mul_add(x, sums[0]);
    if let Some(second) = row.get(1) {
        sums[1] = x.mul_add(W::load(second), sums[1]);
    }
}

/// Subtracts `factor` times column `k`, `x`, from the next one, `z`; then the products of both with all later columns, and
/// those of `z` with itself and with `x`.
#[inline(always)]
pub(super) fn all_products<W: Wide, const L: usize, const GROUP: usize>(
    rows: &mut [[f64; L]],
    columns: usize,
    k: usize,
    factor: W,
    with_x: &mut [[f64; L]],
    with_z: &mut [[f64; L]],
) -> [W; 2] {
    let later = columns - k - 2;
    let mut own = [W::splat(0.0); 2];
    let mut done = 0;
    loop {
        let size = GROUP.min(later - done);
        let (with_x, with_z) = (&mut with_x[done..done + size], &mut with_z[done..done + size]);
        let at = k + 2 + done;
        let first = if done == 0 { Some(factor) } else { None };
        let found = match size {
            1 => products::<W, L, 1>(rows, columns, k, at, first, with_x, with_z),
            2 => products::<W, L, 2>(rows, columns, k, at, first, with_x, with_z),
            3 if GROUP > 2 => products::<W, L, 3>(rows, columns, k, at, first, with_x, with_z),
            4 if GROUP > 2 => products::<W, L, 4>(rows, columns, k, at, first, with_x, with_z),
            5 if GROUP > 2 => products::<W, L, 5>(rows, columns, k, at, first, with_x, with_z),
            _ => products::<W, L, 0>(rows, columns, k, at, first, with_x, with_z),
        };
        if done == 0 {
            own = found;
        }
        done += size;
        if done >= later {
            return own;
        }
    }
}

/// The same of `N` later columns from `at` on. `z` is updated with the first of them, where there is a factor.
#[inline(always)]
fn products<W: Wide, const L: usize, const N: usize>(
    rows: &mut [[f64; L]],
    columns: usize,
    k: usize,
    at: usize,
    factor: Option<W>,
    with_x: &mut [[f64; L]],
    with_z: &mut [[f64; L]],
) -> [W; 2] {
    match factor {
        Some(factor) => products_of::<W, L, N, true>(rows, columns, k, at, factor, with_x, with_z),
        None => products_of::<W, L, N, false>(rows, columns, k, at, W::splat(0.0), with_x, with_z),
    }
}

#[inline(always)]
fn products_of<W: Wide, const L: usize, const N: usize, const FIRST: bool>(
    rows: &mut [[f64; L]],
    columns: usize,
    k: usize,
    at: usize,
    factor: W,
    with_x: &mut [[f64; L]],
    with_z: &mut [[f64; L]],
) -> [W; 2] {
    let mut sums = [Sums::<W, N>::new(), Sums::<W, N>::new()];
    let mut pairs = rows.chunks_exact_mut(2 * columns);
    for pair in &mut pairs {
        let (even, odd) = pair.split_at_mut(columns);
        sums[0].add::<L, FIRST>(even, k, at, factor);
        sums[1].add::<L, FIRST>(odd, k, at, factor);
    }
    for even in pairs.into_remainder().chunks_exact_mut(columns) {
        sums[0].add::<L, FIRST>(even, k, at, factor);
    }
    let [even, odd] = &sums;
    let mut j = 0;
    while j < N {
        even.with_x[j].add(odd.with_x[j]).store(&mut with_x[j]);
        even.with_z[j].add(odd.with_z[j]).store(&mut with_z[j]);
        j += 1;
    }
    [even.own[0].add(odd.own[0]), even.own[1].add(odd.own[1])]
}

/// Sums of products of two columns with `N` others, and of the second with itself and with the first.
struct Sums<W, const N: usize> {
    with_x: [W; N],
    with_z: [W; N],
    own: [W; 2],
}

impl<W: Wide, const N: usize> Sums<W, N> {
    #[inline(always)]
    fn new() -> Self {
        let zero = W::splat(0.0);
        Sums { with_x: [zero; N], with_z: [zero; N], own: [zero; 2] }
    }

    #[inline(always)]
    fn add<const L: usize, const FIRST: bool>(&mut self, row: &mut [[f64; L]], k: usize, at: usize, factor: W) {
        let (pair, later) = row.split_at_mut(at);
        let (Some([x, z]), Some(later)) = (pair[k..].first_chunk_mut::<2>(), later.first_chunk::<N>()) else { return };
        let x = W::load(x);
        let column = if FIRST {
            let reflected = x.neg_mul_add(factor, W::load(z));
            reflected.store(z);
            self.own[0] = reflected.mul_add(reflected, self.own[0]);
            self.own[1] = reflected.mul_add(x, self.own[1]);
            reflected
        } else {
            W::load(z)
        };
        let mut j = 0;
        while j < N {
            let entry = W::load(&later[j]);
            self.with_x[j] = x.mul_add(entry, self.with_x[j]);
            self.with_z[j] = column.mul_add(entry, self.with_z[j]);
            j += 1;
        }
    }
}

/// Subtracts multiples of columns `k` and `k + 1` from all later ones; then the products of the next column with itself and
/// with the one after it.
#[inline(always)]
pub(super) fn all_updates<W: Wide, const L: usize, const GROUP: usize>(
    rows: &mut [[f64; L]],
    columns: usize,
    k: usize,
    of_x: &[[f64; L]],
    of_z: &[[f64; L]],
) -> [W; 2] {
    let mut next = [W::splat(0.0); 2];
    let mut done = 0;
    while done < of_x.len() {
        let size = GROUP.min(of_x.len() - done);
        let (of_x, of_z) = (&of_x[done..done + size], &of_z[done..done + size]);
        let at = k + 2 + done;
        let found = match size {
            1 => updates::<W, L, 1>(rows, columns, k, at, of_x, of_z),
            2 => updates::<W, L, 2>(rows, columns, k, at, of_x, of_z),
            3 if GROUP > 2 => updates::<W, L, 3>(rows, columns, k, at, of_x, of_z),
            4 if GROUP > 2 => updates::<W, L, 4>(rows, columns, k, at, of_x, of_z),
            _ if GROUP > 2 => updates::<W, L, 5>(rows, columns, k, at, of_x, of_z),
            _ => next,
        };
        if done == 0 {
            next = found;
        }
        done += size;
    }
    next
}

/// The same of `N` later columns from `at` on, and the products of the first of them with itself and with the second.
#[inline(always)]
fn updates<W: Wide, const L: usize, const N: usize>(
    rows: &mut [[f64; L]],
    columns: usize,
    k: usize,
    at: usize,
    of_x: &[[f64; L]],
    of_z: &[[f64; L]],
) -> [W; 2] {
    let (mut f, mut g) = ([W::splat(0.0); N], [W::splat(0.0); N]);
    let mut j = 0;
    while j < N {
        (f[j], g[j]) = (W::load(&of_x[j]), W::load(&of_z[j]));
        j += 1;
    }
    let mut sums = [[W::splat(0.0); 2]; 2];
    let mut pairs = rows.chunks_exact_mut(2 * columns);
    for pair in &mut pairs {
        let (even, odd) = pair.split_at_mut(columns);
        update_row(even, k, at, &f, &g, &mut sums[0]);
        update_row(odd, k, at, &f, &g, &mut sums[1]);
    }
    for even in pairs.into_remainder().chunks_exact_mut(columns) {
        update_row(even, k, at, &f, &g, &mut sums[0]);
    }
    [sums[0][0].add(sums[1][0]), sums[0][1].add(sums[1][1])]
}

#[inline(always)]
fn update_row<W: Wide, const L: usize, const N: usize>(
    row: &mut [[f64; L]],
    k: usize,
    at: usize,
    f: &[W; N],
    g: &[W; N],
    sums: &mut [W; 2],
) {
    let (pair, later) = row.split_at_mut(at);
    let (Some([x, z]), Some(later)) = (pair[k..].first_chunk::<2>(), later.first_chunk_mut::<N>()) else { return };
    let (x, z) = (W::load(x), W::load(z));
    let mut first = W::splat(0.0);
    let mut j = 0;
    while j < N {
        let entry = z.neg_mul_add(g[j], x.neg_mul_add(f[j], W::load(&later[j])));
        entry.store(&mut later[j]);
        if j == 0 {
            first = entry;
        }
        if j < 2 {
            sums[j] = first.mul_add(entry, sums[j]);
        }
        j += 1;
    }
}
