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

#[cfg(test)]
mod tests {
    use super::super::Scores;
    use super::*;

    type Change = dyn Fn(&mut Vec<Part>);

    /// An unknown; two that follow it; one that follows these and the first.
    fn stored() -> Stored {
        let part = |parent, own: &[usize], border: &[usize]| {
            let (n, m) = (own.len(), border.len());
            let (own, border, gain, variance) = (own.to_vec(), border.to_vec(), vec![0.5; n * m], vec![1.0; n * n]);
            Part { parent, own, border, gain, variance, scores: None }
        };
        let parts = vec![part(0, &[1], &[]), part(0, &[0, 2], &[1]), part(1, &[4], &[0, 1])];
        Stored { scales: vec![1.0; 5], parts, matrix: None }
    }

    fn scores(response: usize, passed: usize) -> Option<Scores> {
        Some(Scores { response: vec![1.0; response], passed: vec![1.0; passed] })
    }

    #[test]
    fn parts_that_do_not_fit_are_refused() {
        assert_eq!(Covariance::try_from(stored()).unwrap().size(), 5);
        let refused = |change: &Change| {
            let mut stored = stored();
            change(&mut stored.parts);
            Covariance::try_from(stored).unwrap_err()
        };
        let below = "must stand below one before it; the first has no border";
        let wrong: [(&Change, &str); 14] = [
            (&|parts| parts.clear(), "at least the part of the shared unknowns"),
            (&|parts| parts[0].parent = 1, below),
            (&|parts| (parts[0].border, parts[0].gain) = (vec![0], vec![1.0]), below),
            (&|parts| parts[1].parent = 1, below),
            (&|parts| parts[2].parent = 3, below),
            (&|parts| parts[1].gain.truncate(1), "matrices that do not fit 2 own unknowns and a border of 1"),
            (&|parts| parts[1].variance.truncate(2), "matrices that do not fit 2 own unknowns and a border of 1"),
            (&|parts| parts[1].scores = scores(4, 1), "matrices that do not fit 2 own unknowns and a border of 1"),
            (&|parts| parts[1].scores = scores(2, 2), "matrices that do not fit 2 own unknowns and a border of 1"),
            (&|parts| parts[1].scores = scores(4, 2), "has scores where another has none"),
            (&|parts| parts[1].own = vec![2, 0], "own unknowns out of order"),
            (&|parts| parts[1].own = vec![0, 5], "own unknowns out of order, out of range"),
            (&|parts| parts[1].own = vec![0, 1], "own unknowns out of order, out of range, or of another part"),
            (&|parts| parts[2].border = vec![1, 3], "has a border that its parent does not know"),
        ];
        for (change, what) in wrong {
            let said = refused(change);
            assert!(said.contains(what), "{said}: {what}");
        }
    }
}
