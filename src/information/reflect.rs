//! The block Householder reflections that absorb rows into the triangle: the hot loops.
//!
//! Step `k` reflects the triangle's row `k` and the block's column `x = k` into one number. With the diagonal `a >= 0`,
//! `b = sqrt(a^2 + x.x)` and a later column `c` with triangle entry `r`, the new entry is `(a r + x.c) / b`, already with
//! a positive diagonal, and the column becomes `c - x (r + new) / (a + b)`. Both entries are computed as corrections of
//! the old ones, which a long record makes ever smaller: rounding does not pile up with the number of blocks.
//!
//! One sweep over the block does both the columns' update of step `k` and the products of step `k + 1`, several columns
//! at a time, so that each entry is loaded and stored once per step. Sums have a fixed order and nothing is fused, hence
//! the same bits whatever vector unit serves (six slopes, per row: 8 ns with SSE2, 3.7 with AVX2, 3.4 with AVX-512).

use super::block::{Block, LANES, Parts};

type Lane = [f64; LANES];

/// Columns swept together.
const GROUP: usize = 4;

/// Squares between these neither overflow nor lose digits to underflow.
const SAFE: core::ops::RangeInclusive<f64> = 1e-200..=1e200;

/// Absorbs the rows of the block, whose columns are used up by it.
pub(super) fn absorb(triangle: &mut [f64], block: &mut Block) {
    #[cfg(target_arch = "x86_64")]
    {
        if is_x86_feature_detected!("avx512f") {
            // SAFETY: the processor has just said that it has this feature.
            return unsafe { avx512(triangle, block) };
        }
        if is_x86_feature_detected!("avx2") {
            // SAFETY: as above.
            return unsafe { avx2(triangle, block) };
        }
    }
    reflect(triangle, block);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f")]
fn avx512(triangle: &mut [f64], block: &mut Block) {
    reflect(triangle, block);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn avx2(triangle: &mut [f64], block: &mut Block) {
    reflect(triangle, block);
}

#[inline(always)]
fn reflect(triangle: &mut [f64], block: &mut Block) {
    let Parts { columns, stride, rows, products } = block.parts();
    let (mut columns, _) = columns.as_chunks_mut::<LANES>();
    let (stride, rows) = (stride / LANES, rows / LANES);
    if rows == 0 {
        return;
    }
    let (mut triangle, mut products) = (triangle, products);
    sweep(None, columns, stride, rows, products);
    while !products.is_empty() {
        let (row, below) = triangle.split_at_mut(products.len());
        let mut scale = 1.0;
        if !SAFE.contains(&(row[0] * row[0] + products[0])) {
            scale = rescale(row[0], &mut columns[..rows]);
            products_again(columns, stride, rows, products);
        }
        let (x, later) = columns.split_at_mut(stride);
        let (product, factors) = products.split_at_mut(1);
        if scale == 0.0 {
            // A column of zeros leaves the rest as it is.
            factors.fill(0.0);
        } else {
            let a = row[0] * scale;
            let squares = product[0];
            let sum = a + (a * a + squares).sqrt();
            let (by_sum, growth) = (1.0 / sum, squares / sum);
            let b = a + growth;
            let by_b = 1.0 / b;
            row[0] = b / scale;
            for (r, factor) in row[1..].iter_mut().zip(factors.iter_mut()) {
                let new = *r + (*factor - *r * growth) * by_b;
                *factor = (*r + new) * by_sum;
                *r = new;
            }
        }
        sweep(Some(&x[..rows]), later, stride, rows, factors);
        (triangle, columns, products) = (below, later, factors);
    }
}

/// Subtracts `factors[j] x` from column `j`, if there is an `x`, then puts the products of the first column with all
/// columns into `factors`.
#[inline(always)]
fn sweep(x: Option<&[Lane]>, columns: &mut [Lane], stride: usize, rows: usize, factors: &mut [f64]) {
    let head = factors.len().min(GROUP);
    let (first, mut columns) = columns.split_at_mut(head * stride);
    let (first_factors, mut factors) = factors.split_at_mut(head);
    match head {
        0 => return,
        1 => group::<1>(x, None, first, stride, rows, first_factors),
        2 => group::<2>(x, None, first, stride, rows, first_factors),
        3 => group::<3>(x, None, first, stride, rows, first_factors),
        _ => group::<GROUP>(x, None, first, stride, rows, first_factors),
    }
    let pivot = Some(&first[..rows]);
    while !factors.is_empty() {
        let size = factors.len().min(GROUP);
        let (some, later) = columns.split_at_mut(size * stride);
        let (some_factors, rest) = factors.split_at_mut(size);
        match size {
            1 => group::<1>(x, pivot, some, stride, rows, some_factors),
            2 => group::<2>(x, pivot, some, stride, rows, some_factors),
            3 => group::<3>(x, pivot, some, stride, rows, some_factors),
            _ => group::<GROUP>(x, pivot, some, stride, rows, some_factors),
        }
        (columns, factors) = (later, rest);
    }
}

/// The sweep of `N` columns; without a pivot it is the first of them.
#[inline(always)]
fn group<const N: usize>(
    x: Option<&[Lane]>,
    pivot: Option<&[Lane]>,
    columns: &mut [Lane],
    stride: usize,
    rows: usize,
    factors: &mut [f64],
) {
    let mut columns = columns.chunks_exact_mut(stride);
    let columns: [&mut [Lane]; N] = core::array::from_fn(|_| &mut columns.next().unwrap_or_default()[..rows]);
    let factor: [f64; N] = core::array::from_fn(|j| factors[j]);
    let mut sums = [[0.0; LANES]; N];
    for i in 0..rows {
        let mut first = pivot.map_or([0.0; LANES], |pivot| pivot[i]);
        for j in 0..N {
            let entry = &mut columns[j][i];
            if let Some(x) = x {
                for l in 0..LANES {
                    entry[l] -= factor[j] * x[i][l];
                }
            }
            if j == 0 && pivot.is_none() {
                first = *entry;
            }
            for l in 0..LANES {
                sums[j][l] += first[l] * entry[l];
            }
        }
    }
    // The copy gives LLVM stores by which it finds that the sums are vectors.
    let kept = sums;
    totals(&kept, factors);
}

// Not inlined: seen together with the loop, these sums make LLVM shuffle the lanes in every turn of the loop.
#[inline(never)]
fn totals(sums: &[Lane], totals: &mut [f64]) {
    for (s, total) in sums.iter().zip(totals) {
        *total = ((s[0] + s[4]) + (s[1] + s[5])) + ((s[2] + s[6]) + (s[3] + s[7]));
    }
}

#[cold]
#[inline(never)]
fn products_again(columns: &mut [Lane], stride: usize, rows: usize, products: &mut [f64]) {
    sweep(None, columns, stride, rows, products);
}

/// Multiplies a column by the power of two that brings it and the diagonal near one; zero if both are zero, one if they
/// are not finite.
#[cold]
#[inline(never)]
fn rescale(diagonal: f64, x: &mut [Lane]) -> f64 {
    let entries = x.as_flattened_mut();
    let largest = entries.iter().fold(diagonal, |largest, entry| largest.max(entry.abs()));
    if !entries.iter().all(|entry| entry.is_finite()) {
        return 1.0;
    }
    if largest == 0.0 {
        return 0.0;
    }
    let exponent = (largest.to_bits() >> 52).clamp(1, 2045);
    let scale = f64::from_bits((2046 - exponent) << 52);
    for entry in entries {
        *entry *= scale;
    }
    scale
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A diagonal of 3 and a column of 4 make 5, the entry is `(3 * 10 + 4 * 5) / 5`, and of the right side `(3 * 5 - 4 * 10) / 5 = -5` is
    /// left beside the 12 that were there; the unit, whose squares may overflow or lose digits, does not matter.
    #[test]
    fn units_of_a_column_do_not_matter() {
        for unit in [1e-170, 1e-160, 1e-155, 1.0, 1e153, 1e160] {
            let mut block = Block::new(1, 8);
            assert!(block.push(&[4.0 * unit], 5.0));
            let mut triangle = [3.0 * unit, 10.0, 12.0];
            reflect(&mut triangle, &mut block);
            let found = [triangle[0] / unit, triangle[1], triangle[2]];
            assert!(found.iter().zip([5.0, 10.0, 13.0]).all(|(a, b)| (a - b).abs() < 1e-14), "{unit}: {found:?}");
        }
    }

    #[cfg(target_arch = "x86_64")]
    #[test]
    fn every_vector_unit_gives_the_same_bits() {
        for columns in 0..11 {
            let width = columns + 1;
            let mut block = Block::new(columns, 100);
            let mut seed = 1u64;
            for column in 0..width {
                for entry in block.column_mut(column) {
                    seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
                    *entry = (seed >> 11) as f64 / (1u64 << 52) as f64 - 1.0;
                }
            }
            block.set_len(93);
            let by = |absorb: &dyn Fn(&mut [f64], &mut Block)| {
                let mut triangle = vec![0.0; width * (width + 1) / 2];
                (0..3).for_each(|_| absorb(&mut triangle, &mut block.clone()));
                triangle
            };
            let portable = by(&reflect);
            assert_eq!(by(&absorb), portable);
            if is_x86_feature_detected!("avx2") {
                // SAFETY: the feature is there.
                assert_eq!(by(&|t, b| unsafe { avx2(t, b) }), portable);
            }
        }
    }
}
