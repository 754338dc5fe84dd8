//! Time per row of least squares rows absorbed into triangles: one triangle by [`Information`], and 8 and 16 in lanes by
//! [`Triangles`], where the items are rows times lanes: `cargo bench --bench triangles`.

use divan::{Bencher, counter::ItemsCount};
use greybox::information::{Block, Information, Triangles};

/// Columns of a row, `y` included.
const COLUMNS: [usize; 9] = [2, 3, 4, 5, 6, 8, 9, 12, 16];
/// Rows of a block: two outputs of 64 samples.
const ROWS: usize = 128;
/// Numbers in a cache line.
const LINE: usize = 8;

fn main() {
    divan::main();
}

/// Numbers in -1..1, the same on every run.
fn numbers(count: usize) -> Vec<f64> {
    let mut seed = 1u64;
    let mut next = || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    };
    (0..count).map(|_| next()).collect()
}

/// The rows are used up, so that each block is filled anew: see [`filling_8_lanes`].
fn in_lanes(bencher: Bencher, columns: usize, lanes: usize) {
    let size = ROWS * columns * lanes;
    let filled = numbers(size);
    let mut triangles = Triangles::new(columns - 1, lanes);
    let mut space = vec![0.0; size + LINE];
    let start = space.as_ptr().align_offset(LINE * size_of::<f64>()).min(LINE);
    bencher.counter(ItemsCount::new(ROWS * lanes)).bench_local(|| {
        let rows = &mut space[start..start + size];
        rows.copy_from_slice(&filled);
        triangles.absorb(rows, ROWS);
    });
}

/// The time of the filling alone, which the other benches include.
#[divan::bench(args = COLUMNS)]
fn filling_8_lanes(bencher: Bencher, columns: usize) {
    let filled = numbers(ROWS * columns * 8);
    let mut rows = filled.clone();
    bencher.counter(ItemsCount::new(ROWS * 8)).bench_local(|| divan::black_box(&mut rows).copy_from_slice(&filled));
}

#[divan::bench(args = COLUMNS)]
fn lanes_8(bencher: Bencher, columns: usize) {
    in_lanes(bencher, columns, 8);
}

#[divan::bench(args = COLUMNS)]
fn lanes_16(bencher: Bencher, columns: usize) {
    in_lanes(bencher, columns, 16);
}

#[divan::bench(args = COLUMNS)]
fn one_triangle(bencher: Bencher, columns: usize) {
    const ROWS: usize = 256;
    let filled = numbers(ROWS * columns);
    let mut information = Information::new(columns - 1);
    let mut block = Block::new(columns - 1, ROWS);
    bencher.counter(ItemsCount::new(ROWS)).bench_local(|| {
        for (column, values) in filled.chunks_exact(ROWS).enumerate() {
            block.column_mut(column).copy_from_slice(values);
        }
        block.set_len(ROWS);
        information.absorb(&mut block);
    });
}
