//! Householder reflections of many triangles at once, a vector register's worth of lanes at a time.
//!
//! A reflection makes one number of a diagonal entry of the triangle and the rows' column below it, as in `reflect.rs`, each
//! lane by itself. Two are applied together, because a store costs as much as two products: the first sweep over the rows
//! reflects the second column of a pair and takes the products of both with all later ones, the second sweep reflects those
//! (R. Schreiber and C. Van Loan, SIAM J. Sci. Stat. Comput. 10 (1989) 53). Columns are unrolled in groups that the
//! registers can hold.
//!
//! Per row and lane, with eight lanes on a Zen 5 core: 0.35 ns for three columns, 1.1 for six, 2.3 for nine, 12 for 16.

use crate::wide::{Task, Wide};

/// Rows reflected together: twice as many would not fit into the fast cache with six columns, half as many would take a seventh
/// longer for their divisions and square roots. The bits depend on it.
pub(super) const ROWS: usize = 128;

/// Squares of a column that sum up to less count as zero: their relative error is no more that of rounding.
const VANISHING: f64 = 1e-280;

/// See [`Triangles::absorb`](super::Triangles::absorb).
pub(super) struct Absorb<'a> {
    /// Columns of a row, `y` included.
    pub columns: usize,
    pub lanes: usize,
    /// `[entry][lane]`, the lanes filled up to a multiple of eight.
    pub triangles: &'a mut [f64],
    /// `[row][column][lane]`.
    pub rows: &'a mut [f64],
    /// Two numbers for each column, `[column][lane]` of eight lanes.
    pub factors: &'a mut [f64],
    /// Room for [`ROWS`] rows of eight lanes.
    pub scratch: &'a mut [f64],
}

impl Task for Absorb<'_> {
    type Output = ();

    #[inline(always)]
    fn run<W: Wide>(self) {
        // A register of AVX-512 holds eight numbers and there are 32; else four, and there may be 16.
        if W::LANES == 8 { self.registers::<W, 8, 5>() } else { self.registers::<W, 4, 2>() }
    }
}

impl Absorb<'_> {
    /// `L` is the number of lanes of `W`, `GROUP` the most columns of a sweep.
    #[inline(always)]
    fn registers<W: Wide, const L: usize, const GROUP: usize>(self) {
        let Absorb { columns, lanes, triangles, rows, factors, scratch } = self;
        if lanes == 0 {
            return;
        }
        let (factors, _) = factors.as_chunks_mut::<L>();
        let (scratch, _) = scratch.as_chunks_mut::<L>();
        let (triangles, _) = triangles.as_chunks_mut::<L>();
        // Distance from one entry of a triangle to the next, in registers.
        let stride = lanes.next_multiple_of(8) / L;
        for rows in rows.chunks_mut(ROWS * columns * lanes) {
            for first in (0..lanes).step_by(L) {
                let rows = if lanes == L { rows.as_chunks_mut().0 } else { copied(rows, lanes, first, scratch) };
                reflect::<W, L, GROUP>(&mut triangles[first / L..], stride, rows, columns, factors);
            }
        }
    }
}

/// The lanes of one register, from `first` on, side by side; beyond the last there are zeros.
#[inline(always)]
fn copied<'s, const L: usize>(
    rows: &[f64],
    lanes: usize,
    first: usize,
    scratch: &'s mut [[f64; L]],
) -> &'s mut [[f64; L]] {
    let mut count = 0;
    for (from, to) in rows.chunks_exact(lanes).zip(scratch.iter_mut()) {
        match from[first..].first_chunk() {
            Some(from) => *to = *from,
            None => {
                *to = [0.0; L];
                to[..lanes - first].copy_from_slice(&from[first..]);
            }
        }
        count += 1;
    }
    &mut scratch[..count]
}

/// A reflection of a column and the diagonal entry above it into that entry. With the diagonal `a >= 0`, the column `x` and
/// `b = sqrt(a^2 + x.x)`, an entry `r` above another column `c` becomes `r + (x.c - growth r) / b`, a correction that a long
/// record makes ever smaller, and the column `c - factor x`.
struct Reflection<W> {
    growth: W,
    by_sum: W,
    by_b: W,
}

impl<W: Wide> Reflection<W> {
    /// Of the column with this sum of squares.
    #[inline(always)]
    fn new<const L: usize>(diagonal: &mut [f64; L], squares: W) -> Self {
        let (zero, one, vanishing) = (W::splat(0.0), W::splat(1.0), W::splat(VANISHING));
        let a = W::load(diagonal);
        let sum = a.add(a.mul_add(a, squares).sqrt());
        let by_sum = squares.select_lt(vanishing, zero, one.div(sum));
        let growth = squares.mul(by_sum);
        let b = a.add(growth);
        b.store(diagonal);
        Reflection { growth, by_sum, by_b: squares.select_lt(vanishing, zero, one.div(b)) }
    }

    /// Reflects an entry, by the product of its column with the reflected one, and returns the factor.
    #[inline(always)]
    fn reflect<const L: usize>(&self, entry: &mut [f64; L], product: W) -> W {
        let r = W::load(entry);
        let new = r.add(self.growth.neg_mul_add(r, product).mul(self.by_b));
        new.store(entry);
        r.add(new).mul(self.by_sum)
    }
}

/// Absorbs the rows, `[row][column]`, of one register's lanes; entry `i` of their triangles stands at `i * stride`.
#[inline(always)]
fn reflect<W: Wide, const L: usize, const GROUP: usize>(
    triangles: &mut [[f64; L]],
    stride: usize,
    rows: &mut [[f64; L]],
    columns: usize,
    factors: &mut [[f64; L]],
) {
    let (with_x, with_z) = factors.split_at_mut(columns);
    let mut products = first_products::<W, L>(rows, columns);
    let (mut k, mut row) = (0, 0);
    while k < columns {
        let first = Reflection::new(&mut triangles[row * stride], products[0]);
        if k + 1 == columns {
            return;
        }
        let later = columns - k - 2;
        let factor = first.reflect(&mut triangles[(row + 1) * stride], products[1]);
        let [squares, with_first] = all_products::<W, L, GROUP>(rows, columns, k, factor, with_x, with_z);
        let below = row + columns - k;
        let second = Reflection::new(&mut triangles[below * stride], squares);
        for j in 0..later {
            let factor = first.reflect(&mut triangles[(row + 2 + j) * stride], W::load(&with_x[j]));
            let product = factor.neg_mul_add(with_first, W::load(&with_z[j]));
            factor.store(&mut with_x[j]);
            second.reflect(&mut triangles[(below + 1 + j) * stride], product).store(&mut with_z[j]);
        }
        products = all_updates::<W, L, GROUP>(rows, columns, k, &with_x[..later], &with_z[..later]);
        row = below + columns - k - 1;
        k += 2;
    }
}

/// The products of the first column with itself and with the second.
#[inline(always)]
fn first_products<W: Wide, const L: usize>(rows: &[[f64; L]], columns: usize) -> [W; 2] {
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
fn all_products<W: Wide, const L: usize, const GROUP: usize>(
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
fn all_updates<W: Wide, const L: usize, const GROUP: usize>(
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
