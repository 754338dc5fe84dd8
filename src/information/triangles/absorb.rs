//! Householder reflections of many triangles at once, a vector register's worth of lanes at a time.
//!
//! A reflection makes one number of a diagonal entry of the triangle and the rows' column below it, as in `reflect.rs`, each
//! lane by itself. Two are applied together, because a store costs as much as two products: the first sweep over the rows
//! reflects the second column of a pair and takes the products of both with all later ones, the second sweep reflects those
//! (R. Schreiber and C. Van Loan, SIAM J. Sci. Stat. Comput. 10 (1989) 53). Columns are unrolled in groups that the
//! registers can hold.
//!
//! Per row and lane, with eight lanes on a Zen 5 core: 0.35 ns for three columns, 1.1 for six, 2.3 for nine, 12 for 16.

mod sweeps;

use crate::wide::{Task, Wide};
use sweeps::{all_products, all_updates, first_products};

/// Rows reflected together: twice as many would not fit into the fast cache with six columns, half as many would take a twentieth
/// longer for their divisions and square roots. The bits depend on it.
pub(super) const ROWS: usize = 128;

/// Squares of a column that sum up to less count as zero: their relative error is larger than that of rounding.
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
    /// The first of every so many rows is absorbed.
    pub step: usize,
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
        let Absorb { columns, lanes, triangles, rows, step, factors, scratch } = self;
        if lanes == 0 {
            return;
        }
        let (factors, _) = factors.as_chunks_mut::<L>();
        let (scratch, _) = scratch.as_chunks_mut::<L>();
        let (triangles, _) = triangles.as_chunks_mut::<L>();
        // Distance from one entry of a triangle to the next, in registers.
        let stride = lanes.next_multiple_of(8) / L;
        for rows in rows.chunks_mut(ROWS * step * columns * lanes) {
            for first in (0..lanes).step_by(L) {
                let rows = match (lanes == L, step) {
                    (true, 1) => rows.as_chunks_mut().0,
                    _ => copied(rows, (columns, step), lanes, first, scratch),
                };
                reflect::<W, L, GROUP>(&mut triangles[first / L..], stride, rows, columns, factors);
            }
        }
    }
}

/// The lanes of one register, from `first` on, side by side, of the first of every `step` rows; beyond the last lane there are zeros.
#[inline(always)]
fn copied<'s, const L: usize>(
    rows: &[f64],
    (columns, step): (usize, usize),
    lanes: usize,
    first: usize,
    scratch: &'s mut [[f64; L]],
) -> &'s mut [[f64; L]] {
    let mut count = 0;
    for (row, to) in rows.chunks(columns * lanes).step_by(step).zip(scratch.chunks_mut(columns)) {
        for (from, to) in row.chunks_exact(lanes).zip(to) {
            match from[first..].first_chunk() {
                Some(from) => *to = *from,
                None => {
                    *to = [0.0; L];
                    to[..lanes - first].copy_from_slice(&from[first..]);
                }
            }
        }
        count += columns;
    }
    &mut scratch[..count]
}

/// The reflection that turns a diagonal entry `a >= 0` and the column `x` below it into `b = sqrt(a^2 + x.x)` and zeros. Beside it,
/// an entry `r` and the column `c` below it become `new = r + (x.c - growth r) / b` and `c - factor x`, where `growth = b - a`
/// and `factor = (r + new) / (a + b)`. The corrections of `r` shrink as a record grows, so that rounding does not add up.
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
