//! Directions in the space of the unknowns along which the data say nothing.

use crate::estimate::Direction;
use crate::information::Information;
use crate::optimize::Linearization;
use crate::problem::Unknowns;

/// Singular values below this part of the largest are rounding of a simulation: nothing is known along their directions.
const RANK: f64 = 1e-11;
/// What has less than this part in a direction that is not known is itself known.
const PART: f64 = 1e-3;

/// Which unknowns take part in a direction.
pub(crate) fn takes_part(direction: &[f64]) -> impl Iterator<Item = bool> {
    let largest = direction.iter().fold(0.0f64, |m, d| m.max(d.abs()));
    direction.iter().map(move |d| d.abs() > PART * largest)
}

/// A direction of the scaled unknowns as relative changes by name.
pub(crate) fn named(
    unknowns: &Unknowns,
    direction: &[f64],
    norms: &[f64],
    values: &[f64],
    slopes: &[f64],
) -> Direction {
    let change = |i: usize| {
        let step = direction[i] / if norms[i] > 0.0 { norms[i] } else { 1.0 } * slopes[i];
        if values[i] == 0.0 { step } else { step / values[i].abs() }
    };
    let part = takes_part(direction).enumerate().filter(|(_, part)| *part);
    let mut moves: Vec<(String, f64)> =
        part.map(|(i, _)| (unknowns.row[i].name.clone(), change(i))).collect();
    let unit = moves.iter().map(|(_, by)| *by).fold(0.0, |m: f64, by| if by.abs() > m.abs() { by } else { m });
    moves.iter_mut().for_each(|(_, by)| *by /= unit);
    Direction { moves }
}

/// The unknowns to hold so that the others have a covariance: those in `held`, and one for each direction along which
/// nothing is known.
pub(crate) fn held_or_unseen(linear: &Linearization, mut held: Vec<bool>) -> Vec<bool> {
    let free: Vec<bool> = held.iter().map(|held| !held).collect();
    fix(&unseen(linear, &free, &linear.column_norms()), &mut held);
    held
}

/// Holds one unknown for each direction. To hold all that take part would count what is known of them together as known
/// of each, and intervals of the others, which depend on that, would be too narrow. Which one does not matter to what is
/// known; the largest is the surest to take.
pub(crate) fn fix(unseen: &[Vec<f64>], held: &mut [bool]) {
    let mut rows = unseen.to_vec();
    while let Some(row) = rows.pop() {
        let Some(pivot) = (0..row.len()).max_by(|&i, &j| row[i].abs().total_cmp(&row[j].abs())) else { continue };
        held[pivot] = true;
        for other in &mut rows {
            let factor = other[pivot] / row[pivot];
            other.iter_mut().zip(&row).for_each(|(other, row)| *other -= factor * row);
        }
    }
}

/// Directions in the space of the scaled unknowns along which nothing is known.
pub(crate) fn unseen(linear: &Linearization, free: &[bool], norms: &[f64]) -> Vec<Vec<f64>> {
    let n = free.len();
    let unit = |i: usize| (0..n).map(|j| if i == j { 1.0 } else { 0.0 }).collect::<Vec<f64>>();
    let mut unseen: Vec<Vec<f64>> = (0..n).filter(|&i| free[i] && norms[i] == 0.0).map(unit).collect();
    let seen: Vec<bool> = (0..n).map(|i| free[i] && norms[i] > 0.0).collect();
    let mut look = |information: &Information, unknowns: &[usize]| {
        let kept: Vec<usize> = (0..unknowns.len()).filter(|&c| seen[unknowns[c]]).collect();
        let scales: Vec<f64> = kept.iter().map(|&c| 1.0 / norms[unknowns[c]]).collect();
        if let Ok(spectrum) = information.select(&kept).decomposition(&scales) {
            for null in spectrum.null_directions(RANK) {
                let mut direction = vec![0.0; n];
                kept.iter().zip(null).for_each(|(&c, d)| direction[unknowns[c]] = *d);
                unseen.push(direction);
            }
        }
    };
    match linear.blocks() {
        // One block holds everything.
        [block] => {
            let columns: Vec<usize> = linear.columns().flat_map(|(_, columns)| columns).collect();
            look(block, &columns);
        }
        blocks => {
            for (block, columns) in blocks.iter().zip(linear.columns().map(|(_, columns)| columns)) {
                let own = columns.len() - linear.shared();
                look(&block.select(&(0..own).collect::<Vec<_>>()), &columns[..own]);
            }
            look(&linear.shared_information(), &(0..linear.shared()).collect::<Vec<_>>());
        }
    }
    unseen
}
