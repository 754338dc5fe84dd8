//! The block Householder reflections that absorb rows into the triangle: the hot loops.
//!
//! Step `k` reflects the triangle's row `k` and the block's column `x = k` into one number. With the diagonal `a >= 0`,
//! `b = sqrt(a^2 + x.x)` and a later column `c` with triangle entry `r`, the new entry is `(a r + x.c) / b`, already with
//! a positive diagonal, and the column becomes `c - x (r + new) / (a + b)`: no difference of like numbers.
//!
//! One sweep over the block does both the columns' update of step `k` and the products of step `k + 1`, several columns
//! at a time, so that each entry is loaded and stored once per step. Sums have a fixed order and are not fused, hence
//! the same triangle with and without vector features.

use super::block::{Block, LANES, Parts};

type Lane = [f64; LANES];

/// Columns swept together.
const GROUP: usize = 4;

/// Squares between these neither overflow nor lose digits to underflow.
const SAFE: core::ops::RangeInclusive<f64> = 1e-200..=1e200;

#[inline(always)]
pub(super) fn absorb(triangle: &mut [f64], block: &mut Block) {
    let Parts { columns, stride, rows, products } = block.parts();
    let (columns, _) = columns.as_chunks_mut::<LANES>();
    let (stride, rows) = (stride / LANES, rows / LANES);
    if rows == 0 {
        return;
    }
    let mut triangle = triangle;
    let mut columns = columns;
    let mut products = products;
    first_products(columns, stride, rows, products);
    while !products.is_empty() {
        let (row, below) = triangle.split_at_mut(products.len());
        let (x, later) = columns.split_at_mut(stride);
        let mut scale = 1.0;
        if !SAFE.contains(&(row[0] * row[0] + products[0])) {
            scale = rescale(row[0], &mut x[..rows]);
            first_products_of(&x[..rows], later, stride, products);
        }
        let (product, rest) = products.split_at_mut(1);
        if scale == 0.0 {
            // A column of zeros leaves all as it is.
            if !rest.is_empty() {
                first_products(later, stride, rows, rest);
            }
        } else {
            let a = row[0] * scale;
            let b = (a * a + product[0]).sqrt();
            row[0] = b / scale;
            for (r, factor) in row[1..].iter_mut().zip(rest.iter_mut()) {
                let new = (a * *r + *factor) / b;
                *factor = (*r + new) / (a + b);
                *r = new;
            }
            sweep(&x[..rows], later, stride, rest);
        }
        (triangle, columns, products) = (below, later, rest);
    }
}

/// Subtracts `factors[j] x` from each column, then puts the products with the first of them into `factors`.
#[inline(always)]
fn sweep(x: &[Lane], columns: &mut [Lane], stride: usize, factors: &mut [f64]) {
    let head = factors.len().min(GROUP);
    let (first, mut columns) = columns.split_at_mut(head * stride);
    let (first_factors, mut factors) = factors.split_at_mut(head);
    match head {
        1 => sweep_group::<1>(x, None, first, stride, first_factors),
        2 => sweep_group::<2>(x, None, first, stride, first_factors),
        3 => sweep_group::<3>(x, None, first, stride, first_factors),
        4 => sweep_group::<4>(x, None, first, stride, first_factors),
        _ => (),
    }
    while !factors.is_empty() {
        let size = factors.len().min(GROUP);
        let (group, later) = columns.split_at_mut(size * stride);
        let (group_factors, rest) = factors.split_at_mut(size);
        let pivot = Some(&first[..x.len()]);
        match size {
            1 => sweep_group::<1>(x, pivot, group, stride, group_factors),
            2 => sweep_group::<2>(x, pivot, group, stride, group_factors),
            3 => sweep_group::<3>(x, pivot, group, stride, group_factors),
            _ => sweep_group::<4>(x, pivot, group, stride, group_factors),
        }
        (columns, factors) = (later, rest);
    }
}

/// One group of `N` columns; without a pivot the first of them is the pivot.
#[inline(always)]
fn sweep_group<const N: usize>(
    x: &[Lane],
    pivot: Option<&[Lane]>,
    columns: &mut [Lane],
    stride: usize,
    factors: &mut [f64],
) {
    let rows = x.len();
    let mut chunks = columns.chunks_exact_mut(stride);
    let columns: [&mut [Lane]; N] = core::array::from_fn(|_| &mut chunks.next().unwrap_or_default()[..rows]);
    let factor: [f64; N] = core::array::from_fn(|j| factors[j]);
    let mut sums = [[0.0; LANES]; N];
    for i in 0..rows {
        let mut first = match pivot {
            Some(pivot) => pivot[i],
            None => [0.0; LANES],
        };
        for j in 0..N {
            let entry = &mut columns[j][i];
            for l in 0..LANES {
                entry[l] -= factor[j] * x[i][l];
            }
            if j == 0 && pivot.is_none() {
                first = *entry;
            }
            for l in 0..LANES {
                sums[j][l] += first[l] * entry[l];
            }
        }
    }
    for j in 0..N {
        factors[j] = total(sums[j]);
    }
}

/// Products of the first column with itself and all later ones.
#[inline(always)]
fn first_products(columns: &[Lane], stride: usize, rows: usize, products: &mut [f64]) {
    let (x, later) = columns.split_at(stride);
    first_products_of(&x[..rows], later, stride, products);
}

#[inline(always)]
fn first_products_of(x: &[Lane], later: &[Lane], stride: usize, products: &mut [f64]) {
    products[0] = dot(x, x);
    for (product, column) in products[1..].iter_mut().zip(later.chunks_exact(stride)) {
        *product = dot(x, &column[..x.len()]);
    }
}

#[inline(always)]
fn dot(a: &[Lane], b: &[Lane]) -> f64 {
    let mut sums = [[0.0; LANES]; 2];
    let ((a, a_last), (b, b_last)) = (a.as_chunks::<2>(), b.as_chunks::<2>());
    for (a, b) in a.iter().zip(b) {
        for j in 0..2 {
            for l in 0..LANES {
                sums[j][l] += a[j][l] * b[j][l];
            }
        }
    }
    for (a, b) in a_last.iter().zip(b_last) {
        for l in 0..LANES {
            sums[0][l] += a[l] * b[l];
        }
    }
    total(core::array::from_fn(|l| sums[0][l] + sums[1][l]))
}

#[inline(always)]
fn total(s: Lane) -> f64 {
    ((s[0] + s[4]) + (s[1] + s[5])) + ((s[2] + s[6]) + (s[3] + s[7]))
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
