//! [`RegressionError`]: why the rows do not give the parameters.

use crate::information::Information;
use crate::signals::Signals;

/// Why there is no solution.
#[derive(Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RegressionError {
    /// A row with an entry that is not a finite number.
    #[error("row {row}: `{name}` is {value}; leave rows without a measurement out")]
    NotFinite {
        /// Index of the row, from zero.
        row: usize,
        /// The parameter whose regressor it is, or `y`, or `weight`.
        name: &'static str,
        /// The offending value.
        value: f64,
    },
    /// A weight below zero.
    #[error("row {row}: the weight is {weight}; a weight multiplies the squared residual and must not be negative")]
    NegativeWeight {
        /// Index of the row, from zero.
        row: usize,
        /// The weight.
        weight: f64,
    },
    /// No residual would be left.
    #[error(
        "{rows} row(s) with a weight for {parameters} parameter(s): at least {} are needed; add rows or parameters known beforehand as part of y",
        parameters + 1
    )]
    TooFewRows {
        /// Rows whose weight is not zero.
        rows: usize,
        /// How many parameters there are.
        parameters: usize,
    },
    /// Two regressions whose rows are not those of the same experiment.
    #[error(
        "{rows} and {later} row(s) with a weight do not go together pair by pair; take two records of the same motion, of the same length and with the same rows left out"
    )]
    NotPaired {
        /// Rows of the earlier one whose weight is not zero.
        rows: usize,
        /// Number of rows of the later one.
        later: usize,
    },
    /// Directions in which the parameters may move without any effect on the rows.
    #[error(
        "the rows do not determine the parameters: {}; take rows that tell them apart or drop one of each",
        listed(directions)
    )]
    NotIdentifiable {
        /// One per missing piece of information: parameters and their changes, each in its own unit, the first by one.
        directions: Vec<Vec<(&'static str, f64)>>,
    },
    /// Numbers beyond the range of floating point.
    #[error("a parameter or its variance is beyond the range of floating point; scale its regressor, nearer to y")]
    OutOfRange,
}

/// The same sentence: it is what a `main` that returns the error shows.
impl core::fmt::Debug for RegressionError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        core::fmt::Display::fmt(self, f)
    }
}

/// A change of parameters that no row notices, by name, the first by one.
type Change = Vec<(&'static str, f64)>;

fn sentence(change: &Change) -> String {
    match change.split_last() {
        None => String::new(),
        Some(((name, _), [])) => format!("`{name}` is not identifiable, its column is zero"),
        Some((last, first)) => {
            let names: Vec<String> = first.iter().map(|(name, _)| format!("`{name}`")).collect();
            let changes: Vec<String> = change.iter().map(|(name, change)| format!("{name} {change:+.4e}")).collect();
            let (names, changes) = (names.join(", "), changes.join(", "));
            format!("{names} and `{}` are known only in combination ({changes} changes nothing)", last.0)
        }
    }
}

fn listed(directions: &[Change]) -> String {
    directions.iter().map(sentence).collect::<Vec<_>>().join("; ")
}

/// Parts of a null direction below this are rounding (of the singular vectors, whose gap is wide).
const PART: f64 = 1e-6;

/// Condition number of the columns scaled to unit norm, if none of them depends on others.
pub(super) fn identifiable<P: Signals>(information: &Information) -> Result<f64, RegressionError> {
    let norms = information.column_norms();
    let scales: Vec<f64> = norms.iter().map(|&norm| if norm > 0.0 { 1.0 / norm } else { 1.0 }).collect();
    let spectrum = information.decomposition(&scales).map_err(|_| RegressionError::OutOfRange)?;
    let null = spectrum.null_directions(information.tolerance());
    if null.is_empty() {
        return Ok(spectrum.condition());
    }
    let names = |i: usize| P::NAMES[i];
    Err(RegressionError::NotIdentifiable { directions: directions(null.to_vec(), &scales, names) })
}

/// Directions from vectors of unknowns that are scaled by `scales`.
pub(super) fn directions(null: Vec<Vec<f64>>, scales: &[f64], name: impl Fn(usize) -> &'static str) -> Vec<Change> {
    let direction = |(pivot, vector): (usize, Vec<f64>)| {
        let change = |i: usize| vector[i] * scales[i] / scales[pivot];
        let others = (0..vector.len()).filter(|&i| i != pivot && vector[i].abs() > PART);
        [pivot].into_iter().chain(others).map(|i| (name(i), change(i))).collect()
    };
    echelon(null).into_iter().map(direction).collect()
}

/// The same space spanned by vectors that each have a pivot entry of one, where all others are zero: it separates what
/// the decomposition mixes. The pivot is the largest entry left.
fn echelon(mut vectors: Vec<Vec<f64>>) -> Vec<(usize, Vec<f64>)> {
    let mut pivots = Vec::new();
    for k in 0..vectors.len() {
        let largest = |v: &Vec<f64>| (0..v.len()).max_by(|&a, &b| v[a].abs().total_cmp(&v[b].abs())).unwrap_or(0);
        let next = (k..vectors.len())
            .max_by(|&a, &b| {
                let size = |r: usize| vectors[r].get(largest(&vectors[r])).map_or(0.0, |v| v.abs());
                size(a).total_cmp(&size(b))
            })
            .unwrap_or(k);
        vectors.swap(k, next);
        let pivot = largest(&vectors[k]);
        let by = vectors[k][pivot];
        vectors[k].iter_mut().for_each(|entry| *entry /= by);
        let row = vectors[k].clone();
        for (_, other) in vectors.iter_mut().enumerate().filter(|(r, _)| *r != k) {
            let factor = other[pivot];
            other.iter_mut().zip(&row).for_each(|(entry, r)| *entry -= factor * r);
        }
        pivots.push(pivot);
    }
    pivots.into_iter().zip(vectors).collect()
}
