//! How a [`Covariance`] is stored, and what is checked of a stored one.

use super::{Covariance, Part, SquareMatrix};
use serde::{Deserialize, Serialize};

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Stored {
    #[serde(with = "crate::real")]
    scales: Vec<f64>,
    parts: Vec<Part>,
    /// The matrix itself, row by row, for other programs; it follows from the rest, and is not read.
    #[serde(default)]
    matrix: Option<SquareMatrix>,
}

/// With more unknowns the matrix is left out: a file's size is linear in their number.
const DENSE: usize = 100;

impl From<Covariance> for Stored {
    fn from(covariance: Covariance) -> Self {
        let all: Vec<usize> = (0..covariance.size()).collect();
        let matrix = (all.len() <= DENSE).then(|| covariance.dense(&all));
        let Covariance { scales, parts, .. } = covariance;
        Stored { scales, parts, matrix }
    }
}

impl TryFrom<Stored> for Covariance {
    type Error = String;

    fn try_from(Stored { scales, parts, .. }: Stored) -> Result<Self, String> {
        let mut taken = vec![false; scales.len()];
        if parts.is_empty() {
            return Err("a covariance has at least the part of the shared unknowns".to_owned());
        }
        for (number, part) in parts.iter().enumerate() {
            let wrong = |what: &str| Err(format!("part {number} of a covariance {what}"));
            if number > 0 && part.parent >= number || number == 0 && (part.parent != 0 || !part.border.is_empty()) {
                return wrong("must stand below one before it; the first has no border");
            }
            let (n, m) = (part.own.len(), part.border.len());
            let scores = part.scores.as_ref().map_or((n * n, n * m), |s| (s.response.len(), s.passed.len()));
            if (part.variance.len(), part.gain.len()) != (n * n, n * m) || scores != (n * n, n * m) {
                return wrong(&format!("has matrices that do not fit {n} own unknowns and a border of {m}"));
            }
            if part.scores.is_some() != parts[0].scores.is_some() {
                return wrong("has scores where another has none");
            }
            if !part.own.is_sorted_by(|a, b| a < b) || part.own.iter().any(|&i| i >= scales.len() || taken[i]) {
                return wrong("has own unknowns out of order, out of range, or of another part");
            }
            let parent = &parts[part.parent];
            let known = |i: &usize| parent.own.contains(i) || parent.border.contains(i);
            if number > 0 && !part.border.iter().all(known) {
                return wrong("has a border that its parent does not know");
            }
            part.own.iter().for_each(|&i| taken[i] = true);
        }
        Ok(Covariance::of_parts(scales, parts))
    }
}
