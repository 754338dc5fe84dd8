//! Covariances: the inverse of the sum of squares piece by piece (K. Takahashi, J. Fagan and M.-S. Chen, Proc. 8th PICA
//! Conf., 1973, 63), and the sandwich.

use super::Elimination;
use super::reduce::{Gather, Reduced, Reduction, Space, Terms};
use crate::information::Information;
use crate::information::covariance::{Covariance, Part, Scores};
use nalgebra::DMatrix;

/// How the own unknowns of a piece respond to their scores and to a change of the border.
struct Response {
    parent: usize,
    own: Vec<usize>,
    border: Vec<usize>,
    /// `(R' R)^-1` of the own unknowns' triangle `R`.
    scores: DMatrix<f64>,
    /// `R^-1` times the columns of the border; the unknowns move by minus that.
    gain: DMatrix<f64>,
}

impl Elimination {
    /// `(sum of squares)^-1` over all unknowns that are not held, the covariance of the minimizer per unit variance of the
    /// rows' noise; `None` where they are not determined.
    pub fn covariance(&self, held: &[bool]) -> Option<Covariance> {
        let part = |response: Response| Part { variance: row_major(&response.scores), ..response.part() };
        let parts = self.responses(held)?.into_iter().map(part).collect();
        self.finite(parts)
    }

    /// The sandwich `A^-1 B A^-1` over all unknowns that are not held: `A` is the sum of squares of this problem, `B` that
    /// of the scores, a triangle for each piece over the columns of the piece's own (`y` is not used; missing triangles
    /// and columns are zeros). Scores of different pieces are independent. `None` where the unknowns are not determined,
    /// or a score is not finite.
    pub fn sandwich(&self, held: &[bool], scores: &[Information]) -> Option<Covariance> {
        let responses = self.responses(held)?;
        let mut space = Space::new(self.unknowns());
        // Rows of scores that a part and those below it leave for its border; the last part stands first.
        let mut passed: Vec<DMatrix<f64>> = Vec::with_capacity(responses.len());
        let mut parts = Vec::with_capacity(responses.len());
        for (number, response) in responses.iter().enumerate().rev() {
            let (n, m) = (response.own.len(), response.border.len());
            let triangle = self.scores(number, scores, &responses, &passed, &mut space);
            let root = DMatrix::from_fn(n + m, n + m, |i, j| triangle.at(i, j));
            let moved = root.columns(0, n) * &response.scores;
            let rest = root.columns(n, m) - root.columns(0, n) * &response.gain;
            parts.push(Part {
                variance: row_major(&(moved.transpose() * &moved)),
                scores: Some(Scores {
                    response: row_major(&response.scores),
                    passed: row_major(&(moved.transpose() * &rest)),
                }),
                ..response.part()
            });
            passed.push(rest);
        }
        parts.reverse();
        self.finite(parts)
    }

    /// The triangle of a part's own scores and of what its children pass on, over its free unknowns. Part 0 is that of the
    /// shared unknowns, part `k + 1` that of piece `k`.
    fn scores(
        &self,
        number: usize,
        scores: &[Information],
        responses: &[Response],
        passed: &[DMatrix<f64>],
        space: &mut Space,
    ) -> Information {
        let columns = [responses[number].own.as_slice(), &responses[number].border].concat();
        let shared: Vec<usize> = (0..self.shared).collect();
        let piece = number.checked_sub(1);
        let all = piece.map_or(&shared, |piece| &self.pieces[piece].columns);
        let own = piece.and_then(|piece| scores.get(piece));
        let below: usize = self.children(piece).iter().map(|child| passed[responses.len() - 2 - child].nrows()).sum();
        let mut gather = Gather::new(all, &columns, own.map_or(0, |own| own.columns() + 1) + below, space);
        if let Some(scores) = own {
            gather.own_rows(scores, all, &[]);
        }
        for child in self.children(piece) {
            for row in passed[responses.len() - 2 - child].row_iter() {
                let row: Vec<f64> = row.iter().copied().collect();
                gather.push(&row, &responses[child + 1].border, 0.0);
            }
        }
        gather.triangle()
    }

    fn finite(&self, parts: Vec<Part>) -> Option<Covariance> {
        let covariance = Covariance::of_parts(vec![1.0; self.unknowns()], parts);
        covariance.is_finite().then_some(covariance)
    }

    /// Of the shared unknowns, then of each piece; `None` where a triangle has no inverse.
    fn responses(&self, held: &[bool]) -> Option<Vec<Response>> {
        let Reduction { total, pieces } = self.reduce(Terms { held, ..Terms::default() });
        let parents = self.pieces.iter().map(|piece| piece.parent.map_or(0, |parent| parent + 1));
        let pieces = pieces.iter().zip(parents).map(|(piece, parent)| response(piece, parent));
        std::iter::once(response(&total, 0)).chain(pieces).collect()
    }
}

impl Response {
    fn part(&self) -> Part {
        let (own, border) = (self.own.clone(), self.border.clone());
        Part { parent: self.parent, own, border, gain: row_major(&self.gain), variance: vec![], scores: None }
    }
}

fn response(piece: &Reduced<'_>, parent: usize) -> Option<Response> {
    let (own, border) = piece.columns.split_at(piece.own);
    let n = own.len();
    let triangle = DMatrix::from_fn(n, n, |i, j| piece.triangle.at(i, j));
    let inverse = triangle.solve_upper_triangular(&DMatrix::identity(n, n))?;
    let gain = &inverse * DMatrix::from_fn(n, border.len(), |i, j| piece.triangle.at(i, n + j));
    let scores = &inverse * inverse.transpose();
    Some(Response { parent, own: own.to_vec(), border: border.to_vec(), scores, gain })
}

fn row_major(matrix: &DMatrix<f64>) -> Vec<f64> {
    matrix.transpose().as_slice().to_vec()
}
