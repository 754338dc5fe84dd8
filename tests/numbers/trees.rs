//! Least squares over trees of unknowns, against the same rows in dense matrices.

mod bounds;
mod covariance;
mod rank;
mod steps;

use greybox::information::{Elimination, Information};
use greybox::nalgebra::{DMatrix, DVector};

/// Numbers in -1..1, the same each time (a linear congruence, Knuth's MMIX).
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        // Seeds next to one another begin alike.
        let mut random = Random(seed);
        for _ in 0..3 {
            random.next();
        }
        random
    }

    pub fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    /// `0..count`.
    pub fn below(&mut self, count: usize) -> usize {
        ((self.next() * 0.5 + 0.5) * count as f64) as usize
    }
}

/// A tree and all its rows, dense.
pub struct Problem {
    pub tree: Elimination,
    pub jacobian: DMatrix<f64>,
    pub y: DVector<f64>,
    /// The rows of each piece.
    pub rows_of: Vec<std::ops::Range<usize>>,
}

/// Rows over some unknowns, gathered into a tree.
#[derive(Default)]
struct Rows(Vec<(Vec<(usize, f64)>, f64)>);

impl Problem {
    /// From a tree without triangles: parent, border and number of own unknowns of each piece. Rows are as many as `rows`
    /// says, and `change` may change each entry, given the unknown.
    pub fn new(
        shared: usize,
        pieces: &[(Option<usize>, Vec<usize>, usize)],
        rows: usize,
        random: &mut Random,
        change: impl Fn(usize, f64) -> f64,
    ) -> Self {
        let mut tree = Elimination::new(shared);
        let mut dense = Rows::default();
        let mut rows_of = vec![];
        for (parent, border, own) in pieces {
            let first = tree.unknowns();
            let columns: Vec<usize> = (first..first + own).chain(border.iter().copied()).collect();
            let mut triangle = Information::new(columns.len());
            let begin = dense.0.len();
            for _ in 0..rows {
                let phi: Vec<f64> = columns.iter().map(|&i| change(i, random.next())).collect();
                let y = random.next();
                triangle.absorb_row(&phi, y);
                dense.0.push((columns.iter().copied().zip(phi).collect(), y));
            }
            rows_of.push(begin..dense.0.len());
            tree.add(*parent, border.clone(), triangle).expect("a tree");
        }
        let n = tree.unknowns();
        let mut jacobian = DMatrix::zeros(dense.0.len(), n);
        for (row, (entries, _)) in dense.0.iter().enumerate() {
            entries.iter().for_each(|&(i, value)| jacobian[(row, i)] = value);
        }
        let y = DVector::from_iterator(dense.0.len(), dense.0.iter().map(|(_, y)| *y));
        Problem { tree, jacobian, y, rows_of }
    }

    pub fn unknowns(&self) -> usize {
        self.jacobian.ncols()
    }

    /// The dense minimizer of the damped sum of squares over the unknowns that are not held, by singular values.
    pub fn dense_step(&self, damping: &[f64], held: &[bool]) -> DVector<f64> {
        let (n, m) = (self.unknowns(), self.jacobian.nrows());
        let mut rows = self.jacobian.clone().insert_rows(m, n, 0.0);
        (0..n).for_each(|i| rows[(m + i, i)] = damping[i]);
        (0..n).filter(|&i| held[i]).for_each(|i| rows.column_mut(i).fill(0.0));
        let y = self.y.clone().insert_rows(m, n, 0.0);
        rows.svd(true, true).solve(&y, 1e-10).expect("both sets of vectors")
    }

    /// `(J' J)^-1` of the unknowns that are not held, zeros for the others.
    pub fn dense_inverse(&self, held: &[bool]) -> DMatrix<f64> {
        let free: Vec<usize> = (0..held.len()).filter(|&i| !held[i]).collect();
        let norms: Vec<f64> = free.iter().map(|&i| self.jacobian.column(i).norm()).collect();
        let rows = DMatrix::from_fn(self.jacobian.nrows(), free.len(), |k, c| self.jacobian[(k, free[c])] / norms[c]);
        let mut inverse = DMatrix::zeros(held.len(), held.len());
        if !free.is_empty() {
            let root = rows.svd(true, true).pseudo_inverse(1e-10).expect("a tolerance above zero");
            let product = &root * root.transpose();
            for (a, b) in (0..free.len()).flat_map(|a| (0..free.len()).map(move |b| (a, b))) {
                inverse[(free[a], free[b])] = product[(a, b)] / (norms[a] * norms[b]);
            }
        }
        inverse
    }
}

/// Records of up to two segments below `shared` unknowns, each with up to two own unknowns. A segment's border is all that
/// its record knows, or a part of it, in one order or the other.
pub fn random_tree(shared: usize, records: usize, random: &mut Random) -> Vec<(Option<usize>, Vec<usize>, usize)> {
    let (mut pieces, mut unknowns) = (vec![], shared);
    for _ in 0..records {
        let (record, own) = (pieces.len(), random.below(3));
        let known: Vec<usize> = (unknowns..unknowns + own).chain(0..shared).collect();
        pieces.push((None, (0..shared).collect(), own));
        unknowns += own;
        for _ in 0..random.below(3) {
            let (own, without) = (random.below(3), random.below(known.len() + 1));
            let mut border: Vec<usize> = (0..known.len()).filter(|&c| c != without).map(|c| known[c]).collect();
            if random.next() > 0.0 {
                border.reverse();
            }
            pieces.push((Some(record), border, own));
            unknowns += own;
        }
    }
    pieces
}

#[track_caller]
pub fn close(a: &[f64], b: &[f64], tolerance: f64) {
    assert_eq!(a.len(), b.len());
    assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() <= tolerance), "{a:?} against {b:?}");
}
