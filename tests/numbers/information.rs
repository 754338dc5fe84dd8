#![cfg(feature = "std")]
//! The information triangle against faer's QR, against itself, and against closed forms.
use faer::{Mat, linalg::solvers::SolveLstsq};
use greybox::information::{Block, Information, RankDeficient, SquareMatrix};
use proptest::{prelude::*, test_runner::RngSeed};
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

struct Counting;

thread_local! {
    // Of this thread alone: the test harness has threads of its own.
    static COUNT: Cell<usize> = const { Cell::new(0) };
}

// SAFETY: hands every call on to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        COUNT.with(|count| count.set(count.get() + 1));
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Numbers in -1..1, the same on every run.
struct Noise(u64);
impl Noise {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
}

type Row = (Vec<f64>, f64);

fn random_rows(columns: usize, rows: usize, seed: u64) -> Vec<Row> {
    let mut noise = Noise(seed);
    (0..rows).map(|_| ((0..columns).map(|_| noise.next()).collect(), noise.next())).collect()
}

fn absorbed(columns: usize, rows: &[Row], capacity: usize) -> Information {
    let mut information = Information::new(columns);
    let mut block = Block::new(columns, capacity);
    for (phi, y) in rows {
        if block.is_full() {
            information.absorb(&mut block);
        }
        assert!(block.push(phi, *y));
    }
    information.absorb(&mut block);
    assert_eq!(information.rows(), rows.len() as u64);
    information
}

fn entries(information: &Information) -> Vec<f64> {
    let width = information.columns() + 1;
    (0..width).flat_map(|i| (i..width).map(move |j| information.at(i, j))).collect()
}

#[track_caller]
fn assert_close(a: &Information, b: &Information, tolerance: f64) {
    assert_eq!((a.columns(), a.rows()), (b.columns(), b.rows()));
    let largest = entries(a).iter().fold(0.0, |m: f64, e| m.max(e.abs()));
    for (a, b) in entries(a).iter().zip(entries(b)) {
        assert!((a - b).abs() <= tolerance * largest, "{a} {b}");
    }
}

#[test]
fn any_split_into_blocks_gives_the_same_triangle() {
    for columns in [0, 1, 2, 3, 4, 5, 6, 9, 13] {
        let rows = random_rows(columns, 333, 7 + columns as u64);
        let mut by_row = Information::new(columns);
        rows.iter().for_each(|(phi, y)| by_row.absorb_row(phi, *y));
        for capacity in [1, 2, 7, 8, 64, 100, 256, 1000] {
            assert_close(&by_row, &absorbed(columns, &rows, capacity), 1e-13);
        }
    }
}

/// Least squares by faer: QR with the rows as they are.
fn by_faer(columns: usize, rows: &[Row]) -> Vec<f64> {
    let phi = Mat::from_fn(rows.len(), columns, |i, j| rows[i].0[j]);
    let y = Mat::from_fn(rows.len(), 1, |i, _| rows[i].1);
    let d = phi.qr().solve_lstsq(&y);
    (0..columns).map(|j| d[(j, 0)]).collect()
}

fn residual_sum(rows: &[Row], d: &[f64]) -> f64 {
    rows.iter().map(|(phi, y)| (y - phi.iter().zip(d).map(|(p, d)| p * d).sum::<f64>()).powi(2)).sum()
}

#[track_caller]
fn assert_all(a: &[f64], b: &[f64], relative: f64) {
    assert_eq!(a.len(), b.len());
    for (a, b) in a.iter().zip(b) {
        assert!((a - b).abs() <= relative * b.abs(), "{a} {b}");
    }
}

fn matrix(matrix: &SquareMatrix) -> Vec<f64> {
    matrix.rows().flatten().copied().collect()
}

proptest! {
    #![proptest_config(ProptestConfig { rng_seed: RngSeed::Fixed(1), ..ProptestConfig::default() })]

    #[test]
    fn solves_as_faer_does(columns in 1usize..9, extra in 0usize..300, seed: u64) {
        let rows = random_rows(columns, columns * 4 + extra, seed);
        let information = absorbed(columns, &rows, 64);
        let (ours, faers) = (information.solve().unwrap(), by_faer(columns, &rows));
        for (a, b) in ours.iter().zip(&faers) {
            // Random matrices of at least four rows per column: condition below 100.
            prop_assert!((a - b).abs() <= 1e-12, "{a} {b}");
        }
        prop_assert!((information.residual() / residual_sum(&rows, &faers) - 1.0).abs() <= 1e-12);
        prop_assert!((information.residual_at_zero() / residual_sum(&rows, &vec![0.0; columns]) - 1.0).abs() <= 1e-12);
    }

    #[test]
    fn merging_is_absorbing(columns in 0usize..7, seed: u64, cut in 0usize..90, second in 0usize..90) {
        let rows = random_rows(columns, 90, seed);
        let (low, high) = (cut.min(second), cut.max(second));
        let parts = [&rows[..low], &rows[low..high], &rows[high..]].map(|part| absorbed(columns, part, 32));
        let whole = absorbed(columns, &rows, 90);
        let (mut left, mut right) = (parts[0].clone(), parts[1].clone());
        left.merge(&parts[1]);
        left.merge(&parts[2]);
        right.merge(&parts[2]);
        let mut other = parts[0].clone();
        other.merge(&right);
        assert_close(&left, &whole, 1e-13);
        assert_close(&other, &whole, 1e-13);
    }

    #[test]
    fn select_eliminate_and_damping_agree_with_the_rows(seed: u64, first in 0usize..5) {
        let rows = random_rows(5, 40, seed);
        let whole = absorbed(5, &rows, 16);

        let picked = [3, 0, 4];
        let some: Vec<Row> = rows.iter().map(|(phi, y)| (picked.map(|j| phi[j]).to_vec(), *y)).collect();
        assert_close(&whole.select(&picked), &absorbed(3, &some, 40), 1e-13);

        // Eliminated columns do not change the others' solution, nor the smallest residual.
        let rest = whole.eliminate(first);
        assert_eq!((rest.columns(), rest.rows()), (5 - first, 40));
        let (d, full) = (rest.solve().unwrap(), whole.solve().unwrap());
        for (a, b) in d.iter().zip(&full[first..]) {
            prop_assert!((a - b).abs() <= 1e-14 * full.iter().fold(1.0, |m: f64, d| m.max(d.abs())));
        }
        prop_assert_eq!(rest.residual(), whole.residual());

        let diagonal = [0.5, 2.0, 0.0, 1e-3, 7.0];
        let mut more = rows.clone();
        more.extend((0..5).map(|i| ((0..5).map(|j| if i == j { diagonal[i] } else { 0.0 }).collect(), 0.0)));
        let damped = whole.damped(&diagonal);
        prop_assert_eq!(damped.rows(), 40);
        assert_all(&damped.solve().unwrap(), &absorbed(5, &more, 64).solve().unwrap(), 1e-10);
    }
}

#[test]
fn columns_that_a_triangle_does_not_have_are_zero() {
    let (narrow, wide) = (random_rows(2, 20, 1), random_rows(4, 20, 2));
    let padded: Vec<Row> =
        narrow.iter().map(|(phi, y)| ([phi[0], phi[1], 0.0, 0.0].to_vec(), *y)).chain(wide.clone()).collect();
    let expected = absorbed(4, &padded, 8);
    let (mut a, mut b) = (absorbed(2, &narrow, 8), absorbed(4, &wide, 8));
    let mut c = a.clone();
    let kept = b.clone();
    b.merge(&a);
    a.merge(&kept);
    for (phi, y) in &wide {
        c.absorb_row(phi, *y);
    }
    assert_close(&a, &expected, 1e-13);
    assert_close(&b, &expected, 1e-13);
    assert_close(&c, &expected, 1e-13);
    let beyond = kept.select(&[1, 9]);
    assert_eq!(beyond.column_norms()[1], 0.0);
    assert_eq!(kept.eliminate(9).columns(), 0);
    assert_eq!(kept.eliminate(9).residual(), kept.residual());
}

#[test]
fn gradient_and_column_norms_are_those_of_the_rows() {
    let rows = random_rows(4, 100, 3);
    let information = absorbed(4, &rows, 32);
    for j in 0..4 {
        let gradient: f64 = rows.iter().map(|(phi, y)| -phi[j] * y).sum();
        let norm = rows.iter().map(|(phi, _)| phi[j].powi(2)).sum::<f64>().sqrt();
        assert!((information.gradient()[j] - gradient).abs() <= 1e-13 * 100.0);
        assert_all(&[information.column_norms()[j]], &[norm], 1e-14);
    }
}

#[test]
fn columns_of_any_magnitude_are_absorbed_to_full_accuracy() {
    let scales = [1e-150, 1e150, 1e12, 1e-12, 1e-80, 3e120];
    let rows = random_rows(6, 200, 4);
    let scaled: Vec<Row> =
        rows.iter().map(|(phi, y)| (phi.iter().zip(scales).map(|(p, s)| p * s).collect(), *y)).collect();
    let plain = absorbed(6, &rows, 64).solve().unwrap();
    let by_row = {
        let mut information = Information::new(6);
        scaled.iter().for_each(|(phi, y)| information.absorb_row(phi, *y));
        information
    };
    for information in [absorbed(6, &scaled, 64), absorbed(6, &scaled, 1), by_row] {
        let d: Vec<f64> = information.solve().unwrap().iter().zip(scales).map(|(d, s)| d * s).collect();
        assert_all(&d, &plain, 1e-11);
        let scales: Vec<f64> = information.column_norms().iter().map(|norm| 1.0 / norm).collect();
        assert!(information.decomposition(&scales).unwrap().condition() < 10.0);
    }
    // Variances of the first and second unknown are beyond the range of f64 (1e300, 1e-300): the others are right.
    let (all, reference) =
        (absorbed(6, &scaled, 64).covariance().unwrap(), absorbed(6, &rows, 64).covariance().unwrap());
    for (i, j) in [(2, 2), (3, 3), (2, 3), (4, 4), (2, 4), (0, 1)] {
        assert_all(&[all[(i, j)] * scales[i] * scales[j]], &[reference[(i, j)]], 1e-11);
    }
}

#[test]
fn nearly_coincident_columns_keep_their_covariance() {
    // [u v] has a Gram matrix that is well conditioned; the columns are u and u + delta v.
    let delta = 1e-7;
    let scales = [1e12, 1e-12];
    let basis = random_rows(2, 1000, 5);
    let gram = |i: usize, j: usize| basis.iter().map(|(b, _)| b[i] * b[j]).sum::<f64>();
    let determinant = gram(0, 0) * gram(1, 1) - gram(0, 1).powi(2);
    let (uu, uv, vv) = (gram(1, 1) / determinant, -gram(0, 1) / determinant, gram(0, 0) / determinant);
    // d_u = d_0 + d_1 and d_v = delta d_1, hence d_1 = d_v / delta and d_0 = d_u - d_v / delta.
    let exact = [uu - 2.0 * uv / delta + vv / delta.powi(2), uv / delta - vv / delta.powi(2), vv / delta.powi(2)];

    let rows: Vec<Row> =
        basis.iter().map(|(b, y)| (vec![b[0] * scales[0], (b[0] + delta * b[1]) * scales[1]], *y)).collect();
    let covariance = absorbed(2, &rows, 100).covariance().unwrap();
    let ours = [(0, 0), (0, 1), (1, 1)].map(|(i, j)| covariance[(i, j)] * scales[i] * scales[j]);
    // Rounding of the rows themselves moves delta by 1e-9 of itself.
    assert_all(&ours, &exact, 1e-7);

    // What the normal equations would give: the determinant is lost to rounding.
    let gram = |i: usize, j: usize| rows.iter().map(|(phi, _)| phi[i] / scales[i] * phi[j] / scales[j]).sum::<f64>();
    let normal = gram(0, 0) / (gram(0, 0) * gram(1, 1) - gram(0, 1).powi(2));
    assert!((normal / exact[2] - 1.0).abs() > 1e-3, "{normal} {}", exact[2]);
}

#[test]
fn sandwich_is_the_product_of_its_layers() {
    let rows = random_rows(3, 50, 6);
    let information = absorbed(3, &rows, 16);
    let bread = nalgebra::DMatrix::from(&information.covariance().unwrap());
    // With the bread's own rows as meat it is the plain covariance.
    assert_all(&matrix(&information.sandwich(&information).unwrap()), bread.as_slice(), 1e-12);

    let errors: Vec<Row> = rows.iter().map(|(phi, y)| (phi.iter().map(|p| p * y).collect(), 0.0)).collect();
    let meat = nalgebra::DMatrix::from_fn(3, 3, |i, j| errors.iter().map(|(m, _)| m[i] * m[j]).sum());
    let expected = &bread * meat * &bread;
    assert_all(&matrix(&information.sandwich(&absorbed(3, &errors, 7)).unwrap()), expected.as_slice(), 1e-11);
}

#[test]
fn leverage_is_the_diagonal_of_the_projection() {
    let rows = random_rows(4, 60, 12);
    let information = absorbed(4, &rows, 16);
    let covariance = information.covariance().unwrap();
    let mut total = 0.0;
    for (phi, _) in &rows {
        let product: f64 = (0..16).map(|k| phi[k / 4] * covariance[(k / 4, k % 4)] * phi[k % 4]).sum();
        let leverage = information.leverage(phi).unwrap();
        assert_all(&[leverage], &[product], 1e-12);
        total += leverage;
    }
    // The trace of a projection is its rank.
    assert_all(&[total], &[4.0], 1e-13);
    assert!(Information::new(1).leverage(&[1.0]).is_err());
}

#[test]
fn dependent_columns_are_found_at_any_scale() {
    // Third column: twice the first less the second; the fourth does nothing. Their scales differ by 1e24.
    let scales = [1e-12, 1.0, 1e12, 1.0, 1e6];
    let rows: Vec<Row> = random_rows(3, 300, 8)
        .into_iter()
        .map(|(b, y)| {
            let phi = [b[0], b[1], 2.0 * b[0] - b[1], 0.0, b[2]];
            (phi.iter().zip(scales).map(|(p, s)| p * s).collect(), y)
        })
        .collect();
    let information = absorbed(5, &rows, 64);
    let error = information.solve().unwrap_err();
    assert_eq!(error.column, 2);
    assert!(error.independence < 1e-14 && error.to_string().contains("column 2 depends on those before it"));
    assert_eq!(information.covariance().unwrap_err(), error);
    assert_eq!(information.select(&[0, 3]).solve(), Err(RankDeficient { column: 1, norm: 0.0, independence: 0.0 }));
    assert!(information.select(&[0, 1, 4]).solve().is_ok());

    let spectrum = information.decomposition(&scales.map(|s| 1.0 / s)).unwrap();
    assert_eq!(spectrum.rank(1e-12), 3);
    let (null, length) = (spectrum.null_directions(1e-12), 6f64.sqrt());
    let expected = [[2.0 / length, -1.0 / length, -1.0 / length, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0, 0.0]];
    // The two null directions may come mixed: each expected one lies in their span.
    for direction in expected {
        let inside: f64 = null.iter().map(|v| v.iter().zip(direction).map(|(a, b)| a * b).sum::<f64>().powi(2)).sum();
        assert!((inside - 1.0).abs() < 1e-12, "{inside}");
    }
}

#[test]
fn spectrum_is_that_of_the_rows() {
    // Orthogonal columns of norms 2, 6 and 4.
    let rows = [[1.0, 3.0, 2.0], [1.0, -3.0, 2.0], [1.0, 3.0, -2.0], [1.0, -3.0, -2.0]];
    let information = absorbed(3, &rows.map(|phi| (phi.to_vec(), 1.0)), 4);
    let spectrum = information.decomposition(&[]).unwrap();
    assert_all(&spectrum.values, &[6.0, 4.0, 2.0], 1e-14);
    assert_all(&[spectrum.condition()], &[3.0], 1e-14);
    assert!((spectrum.directions[0][1].abs() - 1.0).abs() < 1e-14);
    assert_eq!(information.decomposition(&[1.0, f64::INFINITY]).unwrap_err().column, 1);
    assert_eq!(Information::new(0).decomposition(&[]).unwrap().condition(), 1.0);
    assert_eq!(Information::new(2).decomposition(&[]).unwrap().condition(), f64::INFINITY);
}

#[test]
fn a_polynomial_as_bad_as_filip_is_fitted_to_rounding() {
    // NIST's Filip: degree 10 on 82 points in -9..-3, where scaled columns still have condition 5e9.
    let rows: Vec<Row> = (0..82)
        .map(|k| {
            let x = -3.0 - k as f64 / 14.0;
            let phi: Vec<f64> = (0..=10).map(|p| x.powi(p)).collect();
            let y = phi.iter().sum();
            (phi, y)
        })
        .collect();
    let information = absorbed(11, &rows, 16);
    let scales: Vec<f64> = information.column_norms().iter().map(|norm| 1.0 / norm).collect();
    let condition = information.decomposition(&scales).unwrap().condition();
    assert!(condition > 1e9 && condition < 1e11, "{condition:e}");
    let d = information.solve().unwrap();
    // Coefficients to condition times rounding, the fitted values to rounding alone.
    for (i, d) in d.iter().enumerate() {
        assert!((d - 1.0).abs() * information.column_norms()[i] / information.column_norms()[10] < 1e-5, "{d}");
    }
    let relative = residual_sum(&rows, &d) / information.residual_at_zero();
    assert!(relative.sqrt() < 1e-13, "{relative:e}");
}

#[test]
fn absorption_needs_no_memory() {
    let (mut information, mut block, mut noise) = (Information::new(6), Block::new(6, 256), Noise(11));
    let before = COUNT.with(Cell::get);
    for _ in 0..100_000 {
        if block.is_full() {
            information.absorb(&mut block);
        }
        assert!(block.push(&[(); 6].map(|()| noise.next()), noise.next()));
    }
    // And where columns have to be scaled.
    block.column_mut(3).fill(1e-170);
    information.absorb(&mut block);
    assert_eq!(COUNT.with(Cell::get), before);
    let _ = std::hint::black_box(Box::new(1));
    assert_eq!(COUNT.with(Cell::get), before + 1, "the counter counts");
}

#[test]
fn zero_rows_and_nan_are_no_surprise() {
    let mut information = Information::new(2);
    let mut block = Block::new(2, 10);
    information.absorb(&mut block);
    assert_eq!(information, Information::new(2));
    block.set_len(10);
    information.absorb(&mut block);
    assert_eq!((information.rows(), information.residual_at_zero()), (10, 0.0));
    assert!(block.is_empty());
    assert!(information.solve().is_err());
    // Only `len` rows count, whatever stands behind them.
    block.column_mut(0).fill(f64::NAN);
    block.column_mut(0)[0] = 2.0;
    block.column_mut(1)[1] = -3.0;
    block.column_mut(2)[..2].copy_from_slice(&[4.0, 6.0]);
    block.column_mut(3).fill(1.0);
    block.set_len(1);
    information.absorb(&mut block);
    block.column_mut(0)[..2].copy_from_slice(&[0.0, 0.0]);
    block.column_mut(1)[..2].copy_from_slice(&[-3.0, 0.0]);
    block.column_mut(2)[..2].copy_from_slice(&[6.0, 0.0]);
    block.set_len(2);
    information.absorb(&mut block);
    assert_eq!(information.solve(), Ok(vec![2.0, -2.0]));
    assert_eq!(information.at(0, 0), 2.0);
    assert_eq!(information.at(1, 1), 3.0);

    assert!(!block.push(&[1.0], 1.0));
    for bad in [f64::NAN, f64::INFINITY] {
        let mut poisoned = information.clone();
        poisoned.absorb_row(&[bad, 1.0], 1.0);
        assert!(poisoned.solve().is_err() && poisoned.decomposition(&[]).is_err());
        let mut poisoned = information.clone();
        assert!(block.push(&[1.0, bad], 1.0));
        poisoned.absorb(&mut block);
        assert!(poisoned.solve().is_err() && poisoned.covariance().is_err());
    }
}

/// A block of another width is absorbed as its rows are, the narrower of the two filled up by zeros.
#[test]
fn blocks_of_another_width() {
    for (columns, width) in [(1, 3), (3, 1), (2, 3)] {
        let (mut whole, mut by_rows) = (Information::new(columns), Information::new(columns));
        let mut block = Block::new(width, 8);
        for (phi, y) in random_rows(width, 6, 4) {
            assert!(block.push(&phi, y));
            by_rows.absorb_row(&phi, y);
        }
        whole.absorb(&mut block);
        assert_eq!((whole.rows(), whole.columns()), (6, columns.max(width)));
        for (i, j) in (0..=whole.columns()).flat_map(|i| (i..=whole.columns()).map(move |j| (i, j))) {
            // Rounding of six rows of numbers below one.
            assert!((whole.at(i, j).abs() - by_rows.at(i, j).abs()).abs() < 1e-14, "{columns} {width} {i} {j}");
        }
    }
}

#[test]
fn a_triangle_of_constant_slopes_does_not_drift() {
    // Ten thousand blocks of which only the first tells anything about the first unknown.
    let mut information = Information::new(2);
    information.absorb_row(&[3.0, 0.7], 0.1);
    let before = information.clone();
    let mut block = Block::new(2, 2);
    let mut noise = Noise(9);
    for _ in 0..10_000 {
        assert!(block.push(&[0.0, noise.next()], noise.next()));
        information.absorb(&mut block);
    }
    for j in 0..3 {
        assert_eq!(information.at(0, j), before.at(0, j));
    }
}

#[test]
fn stored_triangles_come_back_and_damaged_ones_do_not() {
    let information = absorbed(3, &random_rows(3, 20, 10), 8);
    let text = serde_json::to_string(&information).unwrap();
    assert_eq!(serde_json::from_str::<Information>(&text).unwrap(), information);
    for columns in ["2", "4", "18446744073709551615"] {
        let error =
            serde_json::from_str::<Information>(&text.replace("\"columns\":3", &format!("\"columns\":{columns}")));
        assert!(error.unwrap_err().to_string().contains("entries, not 10"));
    }
    let matrix = information.covariance().unwrap();
    let text = serde_json::to_string(&matrix).unwrap();
    assert_eq!(serde_json::from_str::<SquareMatrix>(&text).unwrap(), matrix);
    assert!(serde_json::from_str::<SquareMatrix>("[[1,2],[3]]").unwrap_err().to_string().contains("row 1"));
}
