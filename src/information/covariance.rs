//! [`Covariance`]: of unknowns in a tree, without the dense matrix.

mod stored;

use super::SquareMatrix;
use serde::{Deserialize, Serialize};

/// Covariance of the unknowns of an [`Elimination`](super::Elimination), for each pair of them, in memory that is linear
/// in their number: each piece holds how its own unknowns follow its border, and how they vary beyond that. Unknowns that
/// were held have zero rows and columns.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "stored::Stored", into = "stored::Stored")]
pub struct Covariance {
    /// Of each unknown; rows and columns are multiplied by it.
    scales: Vec<f64>,
    /// The shared unknowns first, then the pieces, parents before children.
    parts: Vec<Part>,
    /// The part that each unknown belongs to, the first for those that were held.
    part_of: Vec<usize>,
}

/// How the free unknowns `x` of one piece vary: `x = z - gain border`, where `z` depends on this piece and those below it
/// alone.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Part {
    /// The shared unknowns are their own parent.
    pub parent: usize,
    /// Numbers of the unknowns, ascending.
    pub own: Vec<usize>,
    pub border: Vec<usize>,
    /// A row for each own unknown, a column for each of the border.
    #[serde(with = "crate::real")]
    pub gain: Vec<f64>,
    /// Covariance of `z`, a row for each own unknown.
    #[serde(with = "crate::real")]
    pub variance: Vec<f64>,
    /// Of a sandwich only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scores: Option<Scores>,
}

/// Further parts of a sandwich covariance: there `z` is correlated with the border.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Scores {
    /// From the scores of the own unknowns to `z`, a row for each.
    #[serde(with = "crate::real")]
    pub response: Vec<f64>,
    /// Covariance of `z` (rows) with the scores that are passed on to the border (columns).
    #[serde(with = "crate::real")]
    pub passed: Vec<f64>,
}

/// Composition of one unknown: the weight of each part's `z`, from its own part up to the shared unknowns.
struct Path(Vec<(usize, Vec<f64>)>);

impl Covariance {
    /// Of `size` unknowns none of which has a variance.
    pub fn zeros(size: usize) -> Self {
        Self::of_parts(vec![1.0; size], vec![Part::default()])
    }

    pub(super) fn of_parts(scales: Vec<f64>, parts: Vec<Part>) -> Self {
        let mut part_of = vec![0; scales.len()];
        for (number, part) in parts.iter().enumerate() {
            part.own.iter().for_each(|&unknown| part_of[unknown] = number);
        }
        Covariance { scales, parts, part_of }
    }

    /// Number of unknowns.
    pub fn size(&self) -> usize {
        self.scales.len()
    }

    /// Covariance of two unknowns; zero where one was held, or does not exist.
    pub fn get(&self, i: usize, j: usize) -> f64 {
        let (Some(a), Some(b)) = (self.path(i), self.path(j)) else { return 0.0 };
        self.scales[i] * self.scales[j] * self.product(&a, &b)
    }

    /// Standard error of an unknown, the root of its variance; zero where it was held, or does not exist.
    pub fn standard_error(&self, i: usize) -> f64 {
        let Some(path) = self.path(i) else { return 0.0 };
        // Rounding may leave a variance next to zero on the other side of it.
        self.scales[i].abs() * self.product(&path, &path).max(0.0).sqrt()
    }

    /// The variances of all unknowns.
    pub fn diagonal(&self) -> Vec<f64> {
        (0..self.size()).map(|i| self.get(i, i)).collect()
    }

    /// The matrix of some unknowns, in this order.
    pub fn dense(&self, unknowns: &[usize]) -> SquareMatrix {
        let paths: Vec<Option<Path>> = unknowns.iter().map(|&i| self.path(i)).collect();
        let mut matrix = SquareMatrix::zeros(unknowns.len());
        for (a, (&i, from)) in unknowns.iter().zip(&paths).enumerate() {
            for (b, (&j, to)) in unknowns.iter().zip(&paths).enumerate().skip(a) {
                if let (Some(from), Some(to)) = (from, to) {
                    let value = self.scales[i] * self.scales[j] * self.product(from, to);
                    (matrix[(a, b)], matrix[(b, a)]) = (value, value);
                }
            }
        }
        matrix
    }

    /// With row and column `i` multiplied by `factors[i]`: a change of units, or of what counts as known (zero). Missing
    /// factors are one.
    pub fn scaled(mut self, factors: &[f64]) -> Self {
        self.scales.iter_mut().zip(factors).for_each(|(scale, factor)| *scale *= factor);
        self
    }

    /// Times a number that is not negative.
    pub fn times(self, factor: f64) -> Self {
        let root = vec![factor.sqrt(); self.size()];
        self.scaled(&root)
    }

    /// Whether all its numbers are finite.
    pub(super) fn is_finite(&self) -> bool {
        let passed = |part: &Part| part.scores.iter().flat_map(|scores| &scores.passed).all(|x| x.is_finite());
        let part = |part: &Part| part.variance.iter().chain(&part.gain).all(|x| x.is_finite()) && passed(part);
        self.parts.iter().all(part)
    }

    /// `None` for an unknown that has no variance.
    fn path(&self, unknown: usize) -> Option<Path> {
        let mut number = *self.part_of.get(unknown)?;
        let at = self.parts[number].own.binary_search(&unknown).ok()?;
        if self.scales[unknown] == 0.0 {
            return None;
        }
        let mut own = vec![0.0; self.parts[number].own.len()];
        own[at] = 1.0;
        let mut border = vec![0.0; self.parts[number].border.len()];
        let mut path = Vec::with_capacity(2);
        loop {
            let part = &self.parts[number];
            part.follow(&own, &mut border);
            path.push((number, own));
            if number == part.parent {
                return Some(Path(path));
            }
            (own, border) = self.parts[part.parent].take_up(&part.border, &border);
            number = part.parent;
        }
    }

    /// Covariance of two unknowns before scaling.
    fn product(&self, a: &Path, b: &Path) -> f64 {
        let common = a.0.iter().filter_map(|(number, weights)| Some((number, weights, b.at(*number)?)));
        let direct: f64 = common.map(|(number, a, b)| form(&self.parts[*number].variance, a, b)).sum();
        direct + self.passed(a, b) + self.passed(b, a)
    }

    /// Covariance of what `a` has from below a part with what `b` has from that part, over all parts: through the scores
    /// that are passed on.
    fn passed(&self, a: &Path, b: &Path) -> f64 {
        let mut total = 0.0;
        // Covariances of what `a` has from below with the scores of a part's own unknowns and of its border.
        let (mut own, mut border): (Vec<f64>, Vec<f64>) = (vec![], vec![]);
        for (step, (number, weights)) in a.0.iter().enumerate() {
            let part = &self.parts[*number];
            let Some(scores) = &part.scores else { return 0.0 };
            border.resize(part.border.len(), 0.0);
            if step > 0 {
                total += b.at(*number).map_or(0.0, |b| form(&scores.response, &own, b));
                part.follow(&own, &mut border);
            }
            for (w, row) in weights.iter().zip(rows(&scores.passed, part.border.len())) {
                border.iter_mut().zip(row).for_each(|(border, passed)| *border += w * passed);
            }
            (own, border) = self.parts[part.parent].take_up(&part.border, &border);
        }
        total
    }
}

impl Path {
    /// The weights at one part. Parts are numbered downwards along a path.
    fn at(&self, number: usize) -> Option<&[f64]> {
        let at = self.0.binary_search_by(|(other, _)| number.cmp(other)).ok()?;
        Some(&self.0[at].1)
    }
}

impl Part {
    /// Adds to the weights of the border what those of the own unknowns make of it: `-own gain`.
    fn follow(&self, own: &[f64], border: &mut [f64]) {
        for (w, row) in own.iter().zip(rows(&self.gain, self.border.len())) {
            border.iter_mut().zip(row).for_each(|(border, gain)| *border -= w * gain);
        }
    }

    /// Weights of a child's border as weights of the own unknowns and of the border here.
    fn take_up(&self, unknowns: &[usize], weights: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let (mut own, mut border) = (vec![0.0; self.own.len()], vec![0.0; self.border.len()]);
        for (unknown, w) in unknowns.iter().zip(weights) {
            if let Ok(at) = self.own.binary_search(unknown) {
                own[at] += w;
            } else if let Some(at) = self.border.iter().position(|other| other == unknown) {
                border[at] += w;
            }
        }
        (own, border)
    }
}

/// Rows of a matrix with this many columns.
fn rows(matrix: &[f64], columns: usize) -> impl Iterator<Item = &[f64]> {
    // Chunks of zero entries are not allowed, and such a matrix has none.
    matrix.chunks_exact(columns.max(1))
}

/// `a' matrix b`.
fn form(matrix: &[f64], a: &[f64], b: &[f64]) -> f64 {
    let row = |(row, a): (&[f64], &f64)| row.iter().zip(b).map(|(m, b)| m * b).sum::<f64>() * a;
    rows(matrix, b.len()).zip(a).map(row).sum()
}
