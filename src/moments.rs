//! [`Moments`]: mean and covariance of functions of a state that is uncertain.

/// Moments of `m` functions of a Gaussian state of `n` quantities, in the units of the functions.
#[derive(Clone, Debug, PartialEq)]
pub struct Moments<S> {
    /// The mean of each function: `m`.
    pub mean: Vec<S>,
    /// The means of their slopes with respect to the state, row by row: `m n`.
    pub slopes: Vec<S>,
    /// The covariance that their curvature adds, upper triangle row by row: `m (m + 1) / 2`; empty to the first order.
    pub spread: Vec<S>,
}

/// Where entry `(i, j)` of a symmetric matrix of `n` rows stands, its upper triangle row by row.
pub(crate) fn entry(n: usize, i: usize, j: usize) -> usize {
    let (i, j) = (i.min(j), i.max(j));
    i * (2 * n - i + 1) / 2 + j - i
}
