//! [`Elimination`]: least squares over unknowns that stand in a tree, without ever forming the whole triangle.
//!
//! All pieces of a problem (records, segments of a record) share some unknowns; others belong to one piece, or to one piece
//! and those below it. Each piece's rows form a triangle of its *own* unknowns and of a *border* of unknowns of the pieces
//! above. The own unknowns are minimized out inside the piece, and what the triangle then says of the border goes to the
//! parent, from the leaves to the shared unknowns; solutions go back down. Time and memory are linear in the number of
//! pieces. This is the multifrontal QR factorization (J. W. H. Liu, SIAM Review 34 (1992) 82; T. A. Davis, *Direct Methods
//! for Sparse Linear Systems*, 2006, chapter 5) for a tree that the caller knows.

mod bounds;
mod inverse;
mod rank;
mod reduce;

pub use rank::Undetermined;

use super::Information;

/// Triangles of pieces in a tree, and what follows from them: steps, rank, covariances.
///
/// The unknowns are numbered in the order of declaration: first the shared ones, then the own ones of each piece.
#[derive(Clone, Debug)]
pub struct Elimination {
    shared: usize,
    /// Norm of each unknown's column, over all pieces.
    norms: Vec<f64>,
    pieces: Vec<Piece>,
    /// The pieces directly below the shared unknowns.
    top: Vec<usize>,
}

#[derive(Clone, Debug)]
struct Piece {
    parent: Option<usize>,
    children: Vec<usize>,
    own: usize,
    /// The unknown behind each column of the triangle: its own ones, then the border.
    columns: Vec<usize>,
    triangle: Information,
}

/// A piece cannot be put where it is said to stand.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum BadPiece {
    /// There is no such parent.
    #[error("there is no piece number {parent} to stand below; {pieces} were added so far")]
    Parent {
        /// The parent asked for.
        parent: usize,
        /// Number of pieces.
        pieces: usize,
    },
    /// The border holds an unknown that the parent's triangle has not, or holds one twice.
    #[error("unknown {unknown} of the border must be one of the parent's own or border unknowns, and occur once")]
    Border {
        /// The unknown.
        unknown: usize,
    },
}

impl Elimination {
    /// No pieces yet, and this many shared unknowns: numbers `0..shared`.
    pub fn new(shared: usize) -> Self {
        Elimination { shared, norms: vec![0.0; shared], pieces: vec![], top: vec![] }
    }

    /// Pieces directly below the shared unknowns, the columns of whose triangles are their own unknowns and then all the
    /// shared ones.
    pub fn of_records(shared: usize, triangles: Vec<Information>) -> Self {
        let mut all = Self::new(shared);
        all.pieces.reserve(triangles.len());
        for triangle in triangles {
            all.push(None, (0..shared).collect(), triangle);
        }
        all
    }

    /// Adds a piece below another (`None`: directly below the shared unknowns) and gives its number. The last columns of its
    /// triangle are those of the `border`, unknowns of its parent or of the parent's border; the columns before belong to
    /// new unknowns of its own, numbered from [`unknowns`](Self::unknowns) on. A triangle with fewer columns than the
    /// border is filled up with columns of zeros.
    ///
    /// # Errors
    /// No such parent, or a border that is not part of the parent's columns.
    pub fn add(&mut self, parent: Option<usize>, border: Vec<usize>, triangle: Information) -> Result<usize, BadPiece> {
        let known = |unknown: usize| match parent {
            None => unknown < self.shared,
            Some(parent) => self.pieces[parent].columns.contains(&unknown),
        };
        if let Some(parent) = parent
            && parent >= self.pieces.len()
        {
            return Err(BadPiece::Parent { parent, pieces: self.pieces.len() });
        }
        match (0..border.len()).find(|&c| !known(border[c]) || border[..c].contains(&border[c])) {
            Some(c) => Err(BadPiece::Border { unknown: border[c] }),
            None => Ok(self.push(parent, border, triangle)),
        }
    }

    /// Adds a piece whose parent and border are known to be right.
    fn push(&mut self, parent: Option<usize>, border: Vec<usize>, mut triangle: Information) -> usize {
        triangle.widen(border.len());
        let (number, own) = (self.pieces.len(), triangle.columns() - border.len());
        let columns: Vec<usize> = (self.norms.len()..self.norms.len() + own).chain(border).collect();
        self.norms.resize(self.norms.len() + own, 0.0);
        for (&unknown, norm) in columns.iter().zip(triangle.column_norms()) {
            self.norms[unknown] = self.norms[unknown].hypot(norm);
        }
        match parent {
            None => self.top.push(number),
            Some(parent) => self.pieces[parent].children.push(number),
        }
        self.pieces.push(Piece { parent, children: vec![], own, columns, triangle });
        number
    }

    /// The pieces directly below a piece, or below the shared unknowns.
    fn children(&self, piece: Option<usize>) -> &[usize] {
        piece.map_or(&self.top, |piece| &self.pieces[piece].children)
    }

    /// Number of unknowns that all pieces share.
    pub fn shared(&self) -> usize {
        self.shared
    }

    /// Number of unknowns, shared and own.
    pub fn unknowns(&self) -> usize {
        self.norms.len()
    }

    /// How many rows the triangles stand for.
    pub fn rows(&self) -> u64 {
        self.pieces.iter().map(|piece| piece.triangle.rows()).sum()
    }

    /// The triangle of each piece and the unknown behind each of its columns: its own ones, then the border.
    pub fn columns(&self) -> impl Iterator<Item = (&Information, &[usize])> {
        self.pieces.iter().map(|piece| (&piece.triangle, piece.columns.as_slice()))
    }

    /// Gradient of half the sum of squares.
    pub fn gradient(&self) -> Vec<f64> {
        let mut gradient = vec![0.0; self.unknowns()];
        for (triangle, columns) in self.columns() {
            for (&unknown, slope) in columns.iter().zip(triangle.gradient()) {
                gradient[unknown] += slope;
            }
        }
        gradient
    }

    /// Norm of each unknown's column of the Jacobian.
    pub fn column_norms(&self) -> Vec<f64> {
        self.norms.clone()
    }

    /// Sum of squares at the point itself.
    pub fn sum_of_squares(&self) -> f64 {
        self.pieces.iter().map(|piece| piece.triangle.residual_at_zero()).sum()
    }

    /// By how much half the sum of squares falls along a step, if the slopes held. Missing entries of the step are zero.
    pub fn predicted_reduction(&self, step: &[f64]) -> f64 {
        let mut reduction = 0.0;
        for (triangle, columns) in self.columns() {
            // Row by row, |z|^2 - |z - R d|^2 = (2 z - R d) R d, which does not cancel.
            for i in 0..columns.len() {
                let (y, row) = triangle.row(i);
                let change: f64 = row.iter().zip(&columns[i..]).map(|(r, &unknown)| r * entry(step, unknown)).sum();
                reduction += change * (y - 0.5 * change);
            }
        }
        reduction
    }
}

/// Entry `i` of a vector whose missing entries are zero.
fn entry(vector: &[f64], i: usize) -> f64 {
    vector.get(i).copied().unwrap_or(0.0)
}
