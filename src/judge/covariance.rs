//! Covariances of the unknowns out of triangles.

use crate::information::{Information, SquareMatrix};
use crate::optimize::Linearization;
use nalgebra::DMatrix;

/// Curvature of the cost and triangles of the scores, a pair per experiment.
pub(crate) struct Sandwich {
    pub bread: Linearization,
    pub scores: Vec<Information>,
    /// Mean of `psi'`, by which the curvature is to be multiplied.
    pub curvature: f64,
    /// By which the squares of the scores are to be multiplied.
    pub scale: f64,
}

/// The inverse of an arrow-shaped triangle, applied column by column: for each block the map from its score to its own
/// step and to the shared one.
struct Inverse {
    /// `(R_ll^-1, R_ll^-1 R_lg)` of each block and the unknowns behind its columns.
    own: Vec<(DMatrix<f64>, DMatrix<f64>, Vec<usize>)>,
    shared: Vec<usize>,
    /// Inverse of the triangle of the shared unknowns.
    total: DMatrix<f64>,
}

fn invert(linear: &Linearization, held: &[bool]) -> Option<Inverse> {
    let (total, shared, blocks) = linear.reduce(&vec![0.0; held.len()], held);
    let triangle = |information: &Information, from: usize, rows: usize, columns: usize| {
        DMatrix::from_fn(rows, columns, |i, j| information.at(i, from + j))
    };
    let inverse = |matrix: DMatrix<f64>| {
        let n = matrix.nrows();
        let solved = matrix.solve_upper_triangular(&DMatrix::identity(n, n))?;
        solved.iter().all(|v| v.is_finite()).then_some(solved)
    };
    let total = inverse(triangle(&total, 0, shared.len(), shared.len()))?;
    let mut own = vec![];
    for (block, unknowns) in blocks {
        let n = unknowns.len() - shared.len();
        let r = inverse(triangle(&block, 0, n, n))?;
        let k = &r * triangle(&block, n, n, shared.len());
        own.push((r, k, unknowns));
    }
    Some(Inverse { own, shared, total })
}

/// `(sum of squares)^-1` over all unknowns that are not held; zero in the rows and columns of those.
pub(crate) fn classical(linear: &Linearization, held: &[bool]) -> Option<SquareMatrix> {
    let Inverse { own, shared, total } = invert(linear, held)?;
    let mut covariance = SquareMatrix::zeros(held.len());
    let cgg = &total * total.transpose();
    place(&mut covariance, &cgg, &shared, &shared);
    let cross: Vec<_> = own.iter().map(|(_, k, _)| k * &cgg).collect();
    for (e, (r, _, unknowns)) in own.iter().enumerate() {
        let mine = &unknowns[..r.nrows()];
        place_both(&mut covariance, &(-&cross[e]), mine, &shared);
        for (f, (_, other, theirs)) in own.iter().enumerate().skip(e) {
            let mut c = &cross[e] * other.transpose();
            if e == f {
                c += r * r.transpose();
            }
            place_both(&mut covariance, &c, mine, &theirs[..other.nrows()]);
        }
    }
    Some(covariance)
}

impl Sandwich {
    /// The curvature of plain least squares, still without scores.
    pub fn plain(linear: &Linearization) -> Self {
        Sandwich { bread: linear.clone(), scores: vec![], curvature: 1.0, scale: 1.0 }
    }

    /// `A^-1 B A^-1` over all unknowns that are not held.
    pub fn covariance(&self, held: &[bool]) -> Option<SquareMatrix> {
        let Inverse { own, shared, total } = invert(&self.bread, held)?;
        let (g, mut covariance) = (shared.len(), SquareMatrix::zeros(held.len()));
        let hessian = &total * total.transpose();
        // Each block's scores, each a row of its meat, as influences on (own, shared); summed squares per block.
        let mut blocks = vec![];
        let mut shared_covariance = DMatrix::zeros(g, g);
        for ((r, k, unknowns), (scores, (_, columns))) in own.iter().zip(self.scores.iter().zip(self.bread.columns())) {
            let kept: Vec<usize> = unknowns.iter().filter_map(|u| columns.iter().position(|c| c == u)).collect();
            let scores = DMatrix::from_fn(scores.columns(), kept.len(), |i, c| scores.at(i, kept[c]));
            let n = r.nrows();
            let (own_scores, shared_scores) = (scores.columns(0, n), scores.columns(n, g));
            let on_shared = (shared_scores - own_scores * k) * &hessian;
            let on_own = own_scores * (r * r.transpose()) - &on_shared * k.transpose();
            shared_covariance += on_shared.transpose() * &on_shared;
            blocks.push((on_own, on_shared));
        }
        place(&mut covariance, &shared_covariance, &shared, &shared);
        for (e, ((r, k, unknowns), (on_own, on_shared))) in own.iter().zip(&blocks).enumerate() {
            let mine = &unknowns[..r.nrows()];
            // What the other blocks' scores do to this block's own unknowns goes through the shared ones.
            let others = &shared_covariance - on_shared.transpose() * on_shared;
            let with_shared = on_own.transpose() * on_shared - k * &others;
            place_both(&mut covariance, &with_shared, mine, &shared);
            let own_covariance = on_own.transpose() * on_own + k * &others * k.transpose();
            place(&mut covariance, &own_covariance, mine, mine);
            for ((_, other, theirs), (their_own, their_shared)) in own.iter().zip(&blocks).skip(e + 1) {
                let rest = &others - their_shared.transpose() * their_shared;
                let c = -(on_own.transpose() * on_shared) * other.transpose()
                    - k * (their_shared.transpose() * their_own)
                    + k * rest * other.transpose();
                place_both(&mut covariance, &c, mine, &theirs[..other.nrows()]);
            }
        }
        let scale = self.scale / (self.curvature * self.curvature);
        let n = covariance.size();
        let scaled = SquareMatrix::from_fn(n, |i, j| covariance[(i, j)] * scale);
        scaled.diagonal().iter().all(|v| v.is_finite()).then_some(scaled)
    }
}

fn place(into: &mut SquareMatrix, part: &DMatrix<f64>, rows: &[usize], columns: &[usize]) {
    for (a, &i) in rows.iter().enumerate() {
        for (b, &j) in columns.iter().enumerate() {
            into[(i, j)] = part[(a, b)];
        }
    }
}

fn place_both(into: &mut SquareMatrix, part: &DMatrix<f64>, rows: &[usize], columns: &[usize]) {
    place(into, part, rows, columns);
    place(into, &part.transpose(), columns, rows);
}
