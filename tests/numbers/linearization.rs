//! The triangles of [`Linearization`] against the same rows in one dense triangle and against their definition.

use greybox::information::Information;
use greybox::optimize::Linearization;

const SHARED: usize = 3;
const OWN: [usize; 3] = [2, 0, 1];
const UNKNOWNS: usize = 6;

/// A row of all unknowns and its `y`.
type Row = (Vec<f64>, f64);

/// Numbers in -1..1, the same each time (a linear congruence, Knuth's MMIX).
fn random() -> impl FnMut() -> f64 {
    let mut state = 7u64;
    move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
}

/// Three blocks, dense as one block, and the rows.
fn problem() -> (Linearization, Linearization, Vec<Row>) {
    let (mut next, mut begin) = (random(), SHARED);
    let (mut blocks, mut rows) = (vec![], vec![]);
    let mut dense = Information::new(UNKNOWNS);
    for own in OWN {
        let mut block = Information::new(own + SHARED);
        for _ in 0..8 {
            let phi: Vec<f64> = (0..own + SHARED).map(|_| next()).collect();
            let y = next();
            block.absorb_row(&phi, y);
            let mut row = vec![0.0; UNKNOWNS];
            row[begin..begin + own].copy_from_slice(&phi[..own]);
            row[..SHARED].copy_from_slice(&phi[own..]);
            dense.absorb_row(&row, y);
            rows.push((row, y));
        }
        begin += own;
        blocks.push(block);
    }
    let cost = 0.5 * rows.iter().map(|(_, y)| y * y).sum::<f64>();
    (Linearization::new(cost, SHARED, blocks), Linearization::new(cost, UNKNOWNS, vec![dense]), rows)
}

fn error(row: &Row, d: &[f64]) -> f64 {
    row.1 - row.0.iter().zip(d).map(|(phi, d)| phi * d).sum::<f64>()
}

/// Well-conditioned sums of some twenty terms of order one: rounding stays below this.
fn close(a: &[f64], b: &[f64]) {
    assert_eq!(a.len(), b.len());
    assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-13), "{a:?} against {b:?}");
}

#[test]
fn elimination_equals_the_dense_solution() {
    let (arrow, dense, _) = problem();
    assert_eq!((arrow.unknowns(), arrow.shared()), (UNKNOWNS, SHARED));
    close(&arrow.gradient(), &dense.gradient());
    close(&arrow.column_norms(), &dense.column_norms());
    close(&[arrow.sum_of_squares(), arrow.cost], &[dense.sum_of_squares(), 0.5 * dense.sum_of_squares()]);
    let damping = [0.3, 0.0, 0.1, 0.7, 0.0, 2.0];
    for mask in 0..1u32 << UNKNOWNS {
        let held: Vec<bool> = (0..UNKNOWNS).map(|i| mask >> i & 1 == 1).collect();
        for damping in [[0.0; UNKNOWNS], damping] {
            let step = arrow.step(&damping, &held).expect("it is determined");
            close(&step, &dense.step(&damping, &held).expect("it is determined"));
            assert!(step.iter().zip(&held).all(|(step, held)| !held || *step == 0.0));
        }
    }
}

#[test]
fn a_step_minimizes_the_damped_sum_of_squares() {
    let (arrow, _, rows) = problem();
    let damping = [0.3, 0.0, 0.1, 0.7, 0.0, 2.0];
    let held = [false, true, false, false, false, false];
    let step = arrow.step(&damping, &held).expect("it is determined");
    // The derivative of the damped sum of squares along each free unknown is zero.
    for i in (0..UNKNOWNS).filter(|&i| !held[i]) {
        let slope: f64 = rows.iter().map(|row| row.0[i] * error(row, &step)).sum();
        assert!((slope - damping[i].powi(2) * step[i]).abs() < 1e-13, "unknown {i}");
    }
}

#[test]
fn the_predicted_reduction_is_that_of_the_rows() {
    let (arrow, _, rows) = problem();
    for scale in [1.0, 1e-3, 1e-9] {
        let step: Vec<f64> = [0.3, -0.2, 0.5, 0.1, -0.4, 0.6].iter().map(|d| d * scale).collect();
        // (y^2 - e^2) / 2 row by row as (y - e)(y + e) / 2, which does not cancel.
        let half = |row: &Row| {
            let change: f64 = row.0.iter().zip(&step).map(|(phi, d)| phi * d).sum();
            0.5 * change * (row.1 + error(row, &step))
        };
        let expected: f64 = rows.iter().map(half).sum();
        assert!((arrow.predicted_reduction(&step) / expected - 1.0).abs() < 1e-12, "at {scale}");
    }
    let full = arrow.step(&[0.0; UNKNOWNS], &[false; UNKNOWNS]).expect("it is determined");
    let left: f64 = rows.iter().map(|row| error(row, &full).powi(2)).sum();
    close(&[arrow.sum_of_squares() - 2.0 * arrow.predicted_reduction(&full)], &[left]);
}

#[test]
fn what_is_not_determined_has_no_step() {
    let mut block = Information::new(2);
    block.absorb_row(&[1.0, 1.0], 2.0);
    block.absorb_row(&[2.0, 2.0], 4.0);
    let linear = Linearization::new(10.0, 2, vec![block]);
    assert_eq!(linear.step(&[0.0, 0.0], &[false, false]), None);
    close(&linear.step(&[0.0, 0.0], &[false, true]).expect("one alone is determined"), &[2.0, 0.0]);
    // A little damping shares the step evenly.
    let step = linear.step(&[1e-6, 1e-6], &[false, false]).expect("damping determines it");
    assert!((step[0] - 1.0).abs() < 1e-9 && (step[1] - 1.0).abs() < 1e-9, "{step:?}");
}

#[test]
fn information_counted_from_another_point() {
    let (_, dense, rows) = problem();
    let origin = [0.3, -0.2, 0.5, 0.1, -0.4, 0.6];
    let (block, _) = dense.columns().next().expect("one block");
    let moved = block.about(&origin);
    let rest: Vec<f64> = moved.solve().expect("it is determined").iter().zip(&origin).map(|(d, o)| d + o).collect();
    close(&rest, &block.solve().expect("it is determined"));
    close(&[moved.residual_at_zero()], &[rows.iter().map(|row| error(row, &origin).powi(2)).sum()]);
}
