//! Steps, damped or not.

use super::{Problem, Random, close, random_tree};
use greybox::information::{BadPiece, Elimination, Information};
use greybox::nalgebra::DVector;

/// Random rows, nine for each piece of at most seven columns: condition below a few hundred, so that 1e-12 is some
/// thousand roundings.
pub(super) const ROUNDING: f64 = 1e-12;

pub(super) fn problems() -> impl Iterator<Item = (Problem, Random)> {
    (0..60).map(|seed| {
        let mut random = Random::new(seed);
        let (shared, records) = (1 + random.below(3), 1 + random.below(4));
        let pieces = random_tree(shared, records, &mut random);
        (Problem::new(shared, &pieces, 9, &mut random, |_, x| x), random)
    })
}

#[test]
fn sums_over_the_pieces_are_the_dense_ones() {
    for (problem, mut random) in problems() {
        let Problem { tree, jacobian, y, .. } = &problem;
        close(&tree.gradient(), (-jacobian.transpose() * y).as_slice(), ROUNDING);
        let norms: Vec<f64> = jacobian.column_iter().map(|column| column.norm()).collect();
        close(&tree.column_norms(), &norms, ROUNDING);
        close(&[tree.sum_of_squares()], &[y.norm_squared()], ROUNDING);
        assert_eq!(tree.rows(), y.len() as u64);
        for scale in [1.0, 1e-9] {
            let step: Vec<f64> = (0..problem.unknowns()).map(|_| random.next() * scale).collect();
            let change = jacobian * DVector::from_column_slice(&step);
            // |y|^2 - |y - J d|^2 without cancellation.
            let expected = change.dot(&(y - 0.5 * &change));
            close(&[tree.predicted_reduction(&step) / scale], &[expected / scale], ROUNDING);
        }
    }
}

#[test]
fn a_step_is_the_dense_minimizer() {
    for (problem, mut random) in problems() {
        let n = problem.unknowns();
        for case in 0..8 {
            let held: Vec<bool> = (0..n).map(|_| case & 1 == 1 && random.next() > 0.3).collect();
            let damping: Vec<f64> = (0..n).map(|_| if case & 2 == 2 { random.next().max(0.0) } else { 0.0 }).collect();
            let step = problem.tree.step(&damping, &held).expect("it is determined");
            close(&step, problem.dense_step(&damping, &held).as_slice(), ROUNDING);
            assert!(step.iter().zip(&held).all(|(d, held)| !held || *d == 0.0));
        }
        let full = problem.tree.step(&[], &[]).expect("what is missing is zero and not held");
        let left = (&problem.y - &problem.jacobian * DVector::from_column_slice(&full)).norm_squared();
        let lowered = problem.tree.sum_of_squares() - 2.0 * problem.tree.predicted_reduction(&full);
        close(&[lowered], &[left], ROUNDING);
        assert_eq!(problem.tree.rows(), problem.y.len() as u64);
    }
}

/// Multiple shooting: the states at the borders of segments are unknowns, each segment's rows depend on its own state and
/// on the parameters, and heavily weighted rows ask its end to be the next one's start. Each segment stands below the
/// next one, with the next state and the parameters for a border.
#[test]
fn segments_joined_by_heavy_rows_give_the_dense_step() {
    const SEGMENTS: usize = 40;
    const WEIGHT: f64 = 1e4;
    let (mut random, parameters) = (Random::new(5), 2);
    let mut tree = Elimination::new(parameters);
    // From the last segment to the first: state `s` is unknown `parameters + SEGMENTS - 1 - s`.
    let state = |s: usize| parameters + SEGMENTS - 1 - s;
    let (mut rows, mut parent) = (vec![], None);
    for s in (0..SEGMENTS).rev() {
        let last = s == SEGMENTS - 1;
        let border: Vec<usize> = if last { vec![0, 1] } else { vec![state(s + 1), 0, 1] };
        let columns: Vec<usize> = std::iter::once(state(s)).chain(border.iter().copied()).collect();
        let mut triangle = Information::new(columns.len());
        let mut absorb = |slopes: Vec<(usize, f64)>, y: f64| {
            let slope = |i: &usize| slopes.iter().find(|(j, _)| j == i).map_or(0.0, |(_, slope)| *slope);
            triangle.absorb_row(&columns.iter().map(slope).collect::<Vec<f64>>(), y);
            rows.push((slopes, y));
        };
        for _ in 0..5 {
            absorb(vec![(state(s), random.next()), (0, random.next()), (1, random.next())], random.next());
        }
        if !last {
            // end + 0.9 dx_s + Psi dp - x_(s+1) = 0, times the weight.
            let (a, b, defect) = (random.next(), random.next(), random.next());
            let slopes = [(state(s), 0.9), (0, a), (1, b), (state(s + 1), -1.0)].map(|(i, x)| (i, WEIGHT * x));
            absorb(slopes.to_vec(), WEIGHT * 0.01 * defect);
        }
        parent = Some(tree.add(parent, border, triangle).expect("a chain"));
    }
    let n = tree.unknowns();
    let mut problem = Problem {
        jacobian: greybox::nalgebra::DMatrix::zeros(rows.len(), n),
        y: DVector::from_iterator(rows.len(), rows.iter().map(|row| row.1)),
        rows_of: vec![],
        tree,
    };
    for (row, (slopes, _)) in rows.iter().enumerate() {
        slopes.iter().for_each(|&(i, slope)| problem.jacobian[(row, i)] = slope);
    }
    let held: Vec<bool> = (0..n).map(|i| i == state(0)).collect();
    for held in [vec![false; n], held] {
        let damping = vec![0.1; n];
        // Rows of weight 1e4 among rows of one: four digits fewer.
        let step = problem.tree.step(&damping, &held).expect("it is determined");
        close(&step, problem.dense_step(&damping, &held).as_slice(), 1e-9);
        let covariance = problem.tree.covariance(&held).expect("it is determined");
        let dense = problem.dense_inverse(&held);
        for (i, j) in
            [(0, 0), (0, 1), (state(0), 0), (state(0), state(39)), (state(20), state(21)), (state(3), state(30))]
        {
            assert!((covariance.get(i, j) - dense[(i, j)]).abs() < 1e-9, "{i} {j}");
        }
    }
}

#[test]
fn what_is_not_a_number_or_not_determined_has_no_step() {
    let mut tree = Elimination::new(1);
    let mut good = Information::new(2);
    good.absorb_row(&[1.0, 0.5], 1.0);
    good.absorb_row(&[0.5, 1.0], 2.0);
    tree.add(None, vec![0], good.clone()).expect("the shared unknown");
    assert!(tree.step(&[], &[]).is_some());
    let mut nan = good.clone();
    nan.absorb_row(&[f64::NAN, 1.0], 0.0);
    let mut bad = tree.clone();
    bad.add(None, vec![0], nan).expect("the shared unknown");
    assert_eq!(bad.step(&[], &[]), None);
    assert_eq!(bad.covariance(&[]), None);
}

/// An own unknown that stands in for the shared one in every record: what is left of the shared one is rounding, which
/// must neither count as information nor move a damped step.
#[test]
fn rounding_is_no_information() {
    let (records, mut random) = (50, Random::new(11));
    let (mut tree, mut outputs) = (Elimination::new(1), vec![]);
    for _ in 0..records {
        let mut triangle = Information::new(2);
        let (mut product, mut squares) = (0.0, 0.0);
        for _ in 0..20 {
            let (v, y) = (random.next(), random.next());
            triangle.absorb_row(&[0.3 * v, 0.7 * v], y);
            (product, squares) = (product + v * y, squares + v * v);
        }
        tree.add(None, vec![0], triangle).expect("the shared unknown");
        outputs.push(product / squares);
    }
    assert_eq!(tree.step(&[], &[]), None);
    let held: Vec<bool> = (0..=records).map(|i| i == 0).collect();
    let step = tree.step(&[], &held).expect("what is left is determined");
    // The minimum of |y - 0.3 v d|^2 record by record.
    let alone: Vec<f64> = outputs.iter().map(|output| output / 0.3).collect();
    close(&step[1..], &alone, 1e-13);
    // Damping by a 1e-8th of the norms: the outputs stay, and of all such steps it is the shortest, which minimizes
    // |0.7 N d0|^2 + sum |0.3 n_e d_e|^2 over d0.
    let norms = tree.column_norms();
    let damping: Vec<f64> = norms.iter().map(|norm| 1e-8 * norm).collect();
    let damped = tree.step(&damping, &[]).expect("damping determines it");
    let sum = |f: &dyn Fn(usize) -> f64| (0..records).map(f).sum::<f64>();
    let weight = |e: usize| (norms[1 + e] / 0.3).powi(2);
    let shared = sum(&|e| weight(e) * outputs[e]) * 0.7 / (norms[0].powi(2) + 0.49 * sum(&weight));
    // The damping acts on the outputs by its square, 1e-16; rounding is magnified by its inverse, 1e8.
    close(&damped[..1], &[shared], 1e-7);
    let of_record: Vec<f64> = (0..records).map(|e| 0.7 * damped[0] + 0.3 * damped[1 + e]).collect();
    close(&of_record, &outputs, 1e-13);
}

/// What segments of two rows leave of the shared column is a 1e-8th of it, which their record's unknown accounts for but
/// for rounding: a 1e-16th of the column is no information, if a 1e-8th of what was left.
#[test]
fn rounding_is_no_information_two_levels_up() {
    let mut random = Random::new(12);
    for _ in 0..50 {
        let mut tree = Elimination::new(1);
        let record = tree.add(None, vec![0], Information::new(2)).expect("the shared unknown");
        for _ in 0..20 {
            let mut triangle = Information::new(3);
            for _ in 0..2 {
                let (u, w) = (random.next(), random.next());
                triangle.absorb_row(&[u, w, 0.7 * u + 1e-8 * w], random.next());
            }
            tree.add(Some(record), vec![1, 0], triangle).expect("what the record knows");
        }
        assert_eq!(tree.step(&[], &[]), None);
        assert!(tree.step(&[], &[false, true]).is_some(), "without the record's unknown a 1e-8th is enough");
    }
}

/// Two columns that are alike but for rounding, among large residuals.
#[test]
fn a_damped_step_does_not_move_along_what_is_not_determined() {
    let mut random = Random::new(13);
    for _ in 0..50 {
        let (a, b) = (random.next(), random.next());
        let mut triangle = Information::new(2);
        for _ in 0..30 {
            let v = random.next();
            triangle.absorb_row(&[a * v, b * v], 1e3 * random.next());
        }
        let tree = Elimination::of_records(2, vec![triangle]);
        let norms = tree.column_norms();
        let damping: Vec<f64> = norms.iter().map(|norm| 1e-8 * norm).collect();
        let step = tree.step(&damping, &[]).expect("damping determines it");
        // The shortest step in scaled unknowns moves both alike.
        let (first, second) = (step[0] * norms[0] * a.signum(), step[1] * norms[1] * b.signum());
        assert!((first - second).abs() <= 1e-6 * first.abs(), "{first} and {second}");
    }
}

#[test]
fn a_piece_must_stand_below_what_its_border_holds() {
    let mut tree = Elimination::new(2);
    let record = tree.add(None, vec![0, 1], Information::new(3)).expect("the shared unknowns");
    assert_eq!(tree.add(Some(7), vec![], Information::new(1)), Err(BadPiece::Parent { parent: 7, pieces: 1 }));
    assert_eq!(tree.add(None, vec![2], Information::new(1)), Err(BadPiece::Border { unknown: 2 }));
    assert_eq!(tree.add(None, vec![1, 1], Information::new(2)), Err(BadPiece::Border { unknown: 1 }));
    assert_eq!(tree.add(Some(record), vec![2, 0], Information::new(5)), Ok(1));
    assert_eq!(tree.unknowns(), 6);
    // Of the record itself: it does not know unknown 4, which is the segment's.
    assert_eq!(tree.add(Some(record), vec![4], Information::new(1)), Err(BadPiece::Border { unknown: 4 }));
    // Fewer columns than the border: the missing ones are zeros.
    tree.add(None, vec![0, 1], Information::new(1)).expect("the shared unknowns");
    assert_eq!(tree.columns().map(|(triangle, _)| triangle.columns()).collect::<Vec<_>>(), [3, 5, 2]);
}
