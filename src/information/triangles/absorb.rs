//! Householder reflections of many triangles at once, a vector register's worth of lanes at a time.
//!
//! Step `k` reflects the triangle's row `k` and the rows' column `x = k` into one number, as in `reflect.rs`, each lane by
//! itself. One sweep over the rows does both the update of the later columns by step `k` and the products of column
//! `k + 1` with them for step `k + 1`; the columns of a sweep are unrolled in groups that the registers can hold.
//!
//! Per row and lane, with eight lanes on a Zen 5 core: 0.3 ns for three columns, 1.2 for six, 2.5 for nine, 11 for 16.

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
    /// `[column][lane]` of eight lanes.
    pub factors: &'a mut [f64],
    /// Room for [`ROWS`] rows of eight lanes.
    pub scratch: &'a mut [f64],
}

impl Task for Absorb<'_> {
    type Output = ();

    #[inline(always)]
    fn run<W: Wide>(self) {
        // A register of AVX-512 holds eight numbers and there are 32; else four, and there may be 16.
        if W::LANES == 8 { self.registers::<W, 8, 8>() } else { self.registers::<W, 4, 4>() }
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

/// Absorbs the rows, `[row][column]`, of one register's lanes; entry `i` of their triangles stands at `i * stride`.
#[inline(always)]
fn reflect<W: Wide, const L: usize, const GROUP: usize>(
    triangles: &mut [[f64; L]],
    stride: usize,
    rows: &mut [[f64; L]],
    columns: usize,
    factors: &mut [[f64; L]],
) {
    all_products::<W, L, GROUP>(rows, columns, factors);
    let mut entries = triangles.iter_mut().step_by(stride);
    for k in 0..columns {
        let Some(diagonal) = entries.next() else { return };
        let (zero, one, vanishing) = (W::splat(0.0), W::splat(1.0), W::splat(VANISHING));
        let (a, squares) = (W::load(diagonal), W::load(&factors[0]));
        let sum = a.add(a.mul_add(a, squares).sqrt());
        let by_sum = squares.select_lt(vanishing, zero, one.div(sum));
        let growth = squares.mul(by_sum);
        let b = a.add(growth);
        let by_b = squares.select_lt(vanishing, zero, one.div(b));
        b.store(diagonal);
        let later = columns - k - 1;
        for j in 0..later {
            let Some(entry) = entries.next() else { return };
            let (r, product) = (W::load(entry), W::load(&factors[j + 1]));
            let new = r.add(growth.neg_mul_add(r, product).mul(by_b));
            new.store(entry);
            r.add(new).mul(by_sum).store(&mut factors[j]);
        }
        all_sweeps::<W, L, GROUP>(rows, columns, k, &mut factors[..later]);
    }
}

/// Puts the products of the first column with all columns into `factors`.
#[inline(always)]
fn all_products<W: Wide, const L: usize, const GROUP: usize>(
    rows: &[[f64; L]],
    columns: usize,
    factors: &mut [[f64; L]],
) {
    let mut at = 0;
    while at < columns {
        let size = GROUP.min(columns - at);
        let factors = &mut factors[at..at + size];
        match size {
            1 => products::<W, L, 1>(rows, columns, at, factors),
            2 => products::<W, L, 2>(rows, columns, at, factors),
            3 => products::<W, L, 3>(rows, columns, at, factors),
            4 => products::<W, L, 4>(rows, columns, at, factors),
            5 if GROUP > 4 => products::<W, L, 5>(rows, columns, at, factors),
            6 if GROUP > 4 => products::<W, L, 6>(rows, columns, at, factors),
            7 if GROUP > 4 => products::<W, L, 7>(rows, columns, at, factors),
            _ if GROUP > 4 => products::<W, L, 8>(rows, columns, at, factors),
            _ => {}
        }
        at += size;
    }
}

/// The products of the first column with `N` columns from `at` on.
#[inline(always)]
fn products<W: Wide, const L: usize, const N: usize>(
    rows: &[[f64; L]],
    columns: usize,
    at: usize,
    totals: &mut [[f64; L]],
) {
    let mut sums = [[W::splat(0.0); N]; 2];
    let mut pairs = rows.chunks_exact(2 * columns);
    for pair in &mut pairs {
        let (even, odd) = pair.split_at(columns);
        row_products(even, at, &mut sums[0]);
        row_products(odd, at, &mut sums[1]);
    }
    for even in pairs.remainder().chunks_exact(columns) {
        row_products(even, at, &mut sums[0]);
    }
    store(&sums, totals);
}

#[inline(always)]
fn row_products<W: Wide, const L: usize, const N: usize>(row: &[[f64; L]], at: usize, sums: &mut [W; N]) {
    let Some(some) = row[at..].first_chunk::<N>() else { return };
    let pivot = W::load(&row[0]);
    let mut j = 0;
    while j < N {
        sums[j] = pivot.mul_add(W::load(&some[j]), sums[j]);
        j += 1;
    }
}

/// Subtracts `factors[j]` times column `k` from the `j`-th later one, then puts the products of column `k + 1` with all
/// later ones into `factors`.
#[inline(always)]
fn all_sweeps<W: Wide, const L: usize, const GROUP: usize>(
    rows: &mut [[f64; L]],
    columns: usize,
    k: usize,
    factors: &mut [[f64; L]],
) {
    let mut done = 0;
    while done < factors.len() {
        let size = GROUP.min(factors.len() - done);
        let factors = &mut factors[done..done + size];
        let at = k + 1 + done;
        match size {
            1 => sweep::<W, L, 1>(rows, columns, k, at, factors),
            2 => sweep::<W, L, 2>(rows, columns, k, at, factors),
            3 => sweep::<W, L, 3>(rows, columns, k, at, factors),
            4 => sweep::<W, L, 4>(rows, columns, k, at, factors),
            5 if GROUP > 4 => sweep::<W, L, 5>(rows, columns, k, at, factors),
            6 if GROUP > 4 => sweep::<W, L, 6>(rows, columns, k, at, factors),
            7 if GROUP > 4 => sweep::<W, L, 7>(rows, columns, k, at, factors),
            _ if GROUP > 4 => sweep::<W, L, 8>(rows, columns, k, at, factors),
            _ => {}
        }
        done += size;
    }
}

/// The sweep of `N` columns from `at` on. The first group holds column `k + 1` itself and comes first.
#[inline(always)]
fn sweep<W: Wide, const L: usize, const N: usize>(
    rows: &mut [[f64; L]],
    columns: usize,
    k: usize,
    at: usize,
    factors: &mut [[f64; L]],
) {
    let mut factor = [W::splat(0.0); N];
    let mut j = 0;
    while j < N {
        factor[j] = W::load(&factors[j]);
        j += 1;
    }
    let mut sums = [[W::splat(0.0); N]; 2];
    let first = at == k + 1;
    let mut pairs = rows.chunks_exact_mut(2 * columns);
    for pair in &mut pairs {
        let (even, odd) = pair.split_at_mut(columns);
        row_sweep(even, k, at, first, &factor, &mut sums[0]);
        row_sweep(odd, k, at, first, &factor, &mut sums[1]);
    }
    for even in pairs.into_remainder().chunks_exact_mut(columns) {
        row_sweep(even, k, at, first, &factor, &mut sums[0]);
    }
    store(&sums, factors);
}

#[inline(always)]
fn row_sweep<W: Wide, const L: usize, const N: usize>(
    row: &mut [[f64; L]],
    k: usize,
    at: usize,
    first: bool,
    factor: &[W; N],
    sums: &mut [W; N],
) {
    let (before, later) = row.split_at_mut(at);
    let Some(later) = later.first_chunk_mut::<N>() else { return };
    let x = W::load(&before[k]);
    let mut pivot = if first { x } else { W::load(&before[k + 1]) };
    let mut j = 0;
    while j < N {
        let entry = x.neg_mul_add(factor[j], W::load(&later[j]));
        entry.store(&mut later[j]);
        if first && j == 0 {
            pivot = entry;
        }
        sums[j] = pivot.mul_add(entry, sums[j]);
        j += 1;
    }
}

/// The sums of even and odd rows together.
#[inline(always)]
fn store<W: Wide, const L: usize, const N: usize>(sums: &[[W; N]; 2], totals: &mut [[f64; L]]) {
    let mut j = 0;
    while j < N {
        sums[0][j].add(sums[1][j]).store(&mut totals[j]);
        j += 1;
    }
}
