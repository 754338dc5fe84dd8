//! Null directions: directions of the unknowns that the data do not determine.

use crate::estimate::Direction;
use crate::information::Undetermined;
use crate::optimize::Linearization;
use crate::problem::Unknowns;

/// Singular values below this fraction of the largest are round-off of a simulation: their directions are null
/// directions.
const RANK: f64 = 1e-11;
/// Unknowns with a smaller entry than this in a null direction are not part of it.
const PART: f64 = 1e-3;

/// Directions that the data do not determine, with these unknowns held.
pub(crate) fn undetermined(linear: &Linearization, held: &[bool]) -> Undetermined {
    linear.undetermined(held, RANK)
}

/// The entries of the unknowns that take part in a direction.
pub(crate) fn taking_part(direction: &[(usize, f64)]) -> impl Iterator<Item = (usize, f64)> {
    let largest = direction.iter().fold(0.0f64, |m, (_, d)| m.max(d.abs()));
    direction.iter().copied().filter(move |(_, d)| d.abs() > PART * largest)
}

/// The unknowns that take part in any null direction.
pub(crate) fn in_null_directions(linear: &Linearization) -> Vec<usize> {
    let directions = undetermined(linear, &[]).directions;
    let mut found: Vec<usize> =
        directions.iter().flat_map(|direction| taking_part(direction)).map(|(i, _)| i).collect();
    found.sort_unstable();
    found.dedup();
    found
}

/// A direction of the scaled unknowns as relative changes by name.
pub(crate) fn named(
    unknowns: &Unknowns,
    direction: &[(usize, f64)],
    norms: &[f64],
    values: &[f64],
    slopes: &[f64],
) -> Direction {
    let change = |i: usize, d: f64| {
        let step = d / if norms[i] > 0.0 { norms[i] } else { 1.0 } * slopes[i];
        if values[i] == 0.0 { step } else { step / values[i] }
    };
    let mut moves: Vec<(String, f64)> =
        taking_part(direction).map(|(i, d)| (unknowns.row[i].name.clone(), change(i, d))).collect();
    let unit = moves.iter().map(|(_, by)| *by).fold(0.0, |m: f64, by| if by.abs() > m.abs() { by } else { m });
    moves.iter_mut().for_each(|(_, by)| *by /= unit);
    Direction { moves }
}

#[cfg(test)]
mod tests {
    use super::taking_part;

    /// A thousandth of the largest entry, whatever its size.
    #[test]
    fn small_entries_take_no_part() {
        for size in [1e-3, 1.0, 1e3] {
            let direction = [(0, 0.99e-3 * size), (1, -size), (2, 1.01e-3 * size), (3, 0.0)];
            let found: Vec<(usize, f64)> = taking_part(&direction).collect();
            assert_eq!(found, [(1, -size), (2, 1.01e-3 * size)]);
        }
    }
}
