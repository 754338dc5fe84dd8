//! Rank and directions of which nothing is known.

use super::{Problem, Random, random_tree};
use greybox::information::{Elimination, Information, Undetermined};
use greybox::nalgebra::DVector;

/// As singular values are compared in fits.
const TOLERANCE: f64 = 1e-11;

/// Each direction changes no output, the directions are independent, as many as singular values are zero, and what is
/// left when one unknown is held for each is determined.
fn check(problem: &Problem, held: &[bool]) -> Undetermined {
    let Problem { tree, jacobian, .. } = problem;
    let n = problem.unknowns();
    let found = tree.undetermined(held, TOLERANCE);
    let norms = tree.column_norms();
    let mut scaled = jacobian.clone();
    for i in 0..n {
        let scale = if held[i] {
            0.0
        } else if norms[i] > 0.0 {
            norms[i].recip()
        } else {
            1.0
        };
        scaled.column_mut(i).iter_mut().for_each(|x| *x *= scale);
    }
    let values = scaled.clone().svd(false, false).singular_values;
    let rank = values.iter().filter(|value| **value > TOLERANCE).count();
    let free = held.iter().filter(|held| !**held).count();
    assert_eq!(found.directions.len(), free - rank, "{values}");
    let mut dense = vec![];
    for direction in &found.directions {
        let mut d = DVector::zeros(n);
        direction.iter().for_each(|&(i, component)| d[i] = component);
        assert!((d.norm() - 1.0).abs() < 1e-14 && (0..n).all(|i| !held[i] || d[i] == 0.0), "{direction:?}");
        // Columns of unit norm: rounding of a sum of some ten terms.
        assert!((&scaled * &d).norm() < 1e-13, "{direction:?}");
        dense.push(d);
    }
    if !dense.is_empty() {
        let least = greybox::nalgebra::DMatrix::from_columns(&dense).svd(false, false).singular_values.min();
        assert!(least > 1e-3, "directions all but dependent: {least}");
    }
    let one_each = found.held.iter().filter(|held| **held).count() - (n - free);
    assert_eq!(one_each, found.directions.len());
    assert!(held.iter().zip(&found.held).all(|(before, after)| !before || *after));
    // The fewer rows, the worse the condition that is left: at worst 1e4 here, its square times rounding.
    let left = tree.covariance(&found.held).expect("it is determined").diagonal();
    for (variance, expected) in left.iter().zip(problem.dense_inverse(&found.held).diagonal().iter()) {
        assert!((variance - expected).abs() <= 1e-7 * expected, "{variance} and {expected}");
    }
    found
}

#[test]
fn full_rank_has_no_directions() {
    for seed in 0..20 {
        let mut random = Random::new(seed);
        let pieces = random_tree(3, 3, &mut random);
        let problem = Problem::new(3, &pieces, 9, &mut random, |_, x| x);
        let held: Vec<bool> = (0..problem.unknowns()).map(|i| i % 4 == 1).collect();
        assert!(check(&problem, &vec![false; problem.unknowns()]).directions.is_empty());
        assert_eq!(check(&problem, &held).held, held);
    }
}

/// Pieces with fewer rows than unknowns, and unknowns without influence.
#[test]
fn too_few_rows_leave_the_directions_that_the_dense_matrix_has() {
    let mut most = 0;
    for seed in 0..200 {
        let mut random = Random::new(100 + seed);
        let shared = 1 + random.below(3);
        let records = 1 + random.below(3);
        let pieces = random_tree(shared, records, &mut random);
        let rows = 1 + random.below(3);
        let idle = random.below(20);
        let problem = Problem::new(shared, &pieces, rows, &mut random, |i, x| if i == idle { 0.0 } else { x });
        let held: Vec<bool> = (0..problem.unknowns()).map(|i| seed % 2 == 1 && i % 5 == 1).collect();
        most = most.max(check(&problem, &held).directions.len());
    }
    assert!(most > 4, "{most}");
}

/// Several directions of the same unknowns: each holds another one.
#[test]
fn many_directions_hold_as_many_unknowns() {
    for seed in 0..200 {
        let mut random = Random::new(900 + seed);
        let problem = Problem::new(5, &[(None, vec![0, 1, 2, 3, 4], 0)], 2, &mut random, |_, x| x);
        assert_eq!(check(&problem, &[false; 5]).directions.len(), 3);
    }
}

/// Two unknowns of a record are known only together, and with a shared one: what is held of the record must not be taken
/// for what is left, in whatever order its segment's border names them.
#[test]
fn holding_an_unknown_leaves_the_others_in_their_columns() {
    for (scales, border) in
        [([1.0, 2.0], [1, 2, 0]), ([1.0, 2.0], [2, 1, 0]), ([2.0, 1.0], [1, 2, 0]), ([2.0, 1.0], [2, 1, 0])]
    {
        let mut random = Random::new(31);
        let mut row = || {
            let v = random.next();
            [3.0 * v, scales[0] * v, scales[1] * v]
        };
        let mut tree = Elimination::new(1);
        let (mut own, mut below) = (Information::new(3), Information::new(3));
        for _ in 0..9 {
            let [shared, first, second] = row();
            own.absorb_row(&[first, second, shared], 1.0);
            let row = row();
            below.absorb_row(&border.map(|i: usize| row[i]), 1.0);
        }
        let record = tree.add(None, vec![0], own).expect("the shared unknown");
        tree.add(Some(record), border.to_vec(), below).expect("what the record knows");
        assert_eq!(tree.undetermined(&[], TOLERANCE).directions.len(), 2, "{scales:?} {border:?}");
    }
}

/// A common offset and one of each record stand in for each other; a gain beside them is known.
#[test]
fn a_direction_through_the_shared_unknowns_names_those_below() {
    let mut tree = Elimination::new(2);
    for record in 0..4 {
        let mut triangle = Information::new(3);
        for k in 0..10 {
            // Own offset, common offset in another unit, gain.
            triangle.absorb_row(&[1.0, 1e-3, f64::from(k * (record + 1))], f64::from(k % 3));
        }
        tree.add(None, vec![0, 1], triangle).expect("the shared unknowns");
    }
    let found = tree.undetermined(&[], TOLERANCE);
    let [direction] = found.directions.as_slice() else { panic!("{found:?}") };
    // In units of their influence: the common offset acts on four records, each other on one.
    let sign = direction[0].1.signum();
    for (i, expected) in [1.0, 0.0, -0.5, -0.5, -0.5, -0.5].into_iter().enumerate() {
        let found = direction.iter().find(|(j, _)| i == *j).map_or(0.0, |(_, d)| *d);
        assert!((sign * found - expected / 2f64.sqrt()).abs() < 1e-12, "{direction:?}");
    }
    assert_eq!(found.held, [true, false, false, false, false, false]);
    // What is known does not depend on which of them is held.
    let by = |held: usize| {
        let held: Vec<bool> = (0..6).map(|i| i == held).collect();
        tree.covariance(&held).expect("it is determined").get(1, 1)
    };
    assert!((by(0) / by(3) - 1.0).abs() < 1e-12);
}
