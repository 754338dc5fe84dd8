//! Directions of the unknowns that the data do not determine.

use super::Elimination;
use super::reduce::{Reduced, Space, Terms};
use crate::information::Information;

/// Directions in the space of the unknowns that the data do not determine.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Undetermined {
    /// Each direction as unknowns and components, all others being zero: of unit length in unknowns that are scaled by the
    /// norms of their columns. Unknowns without influence come first, each a direction by itself; then directions that
    /// involve shared unknowns, then those of each piece alone.
    pub directions: Vec<Vec<(usize, f64)>>,
    /// Which unknowns to hold so that the others are determined: those that were held, and one for each direction. To hold
    /// all that take part would count what is known of them together as known of each.
    pub held: Vec<bool>,
}

impl Elimination {
    /// The directions of the unknowns that are not held and that the data do not determine: those whose singular values, the
    /// columns scaled to unit norm, are at most `tolerance`, or at most that part of the largest.
    ///
    /// Each piece's own unknowns are examined given its border, with what the pieces below say of them; what is not
    /// determined there is held before the others are examined.
    pub fn undetermined(&self, held: &[bool], tolerance: f64) -> Undetermined {
        let norms = &self.norms;
        let mut held: Vec<bool> = (0..self.unknowns()).map(|i| held.get(i).copied().unwrap_or(false)).collect();
        let idle: Vec<usize> = (0..self.unknowns()).filter(|&i| !held[i] && norms[i] == 0.0).collect();
        idle.iter().for_each(|&i| held[i] = true);
        if self.is_plainly_determined(tolerance) {
            return Undetermined { directions: vec![], held };
        }
        let mut space = Space::new(self.unknowns());
        let mut done: Vec<Reduced<'_>> = Vec::with_capacity(self.pieces.len());
        // Of each piece, the last first.
        let mut local = vec![];
        for number in (0..self.pieces.len()).rev() {
            let mut piece = self.reduce_piece(number, &done, Terms { held: &held, ..Terms::default() }, &mut space);
            let found = null_directions(&piece, norms, tolerance);
            if !found.is_empty() {
                fix(&found, &mut held);
                piece = self.reduce_piece(number, &done, Terms { held: &held, ..Terms::default() }, &mut space);
            }
            done.push(piece);
            local.extend(found.into_iter().rev().map(|direction| (Some(number), direction)));
        }
        let total = self.reduce_shared(&done, Terms { held: &held, ..Terms::default() }, &mut space);
        let found = null_directions(&total, norms, tolerance);
        fix(&found, &mut held);
        local.extend(found.into_iter().rev().map(|direction| (None, direction)));

        done.reverse();
        let mut change = vec![0.0; self.unknowns()];
        let mut directions: Vec<Vec<(usize, f64)>> = idle.into_iter().map(|i| vec![(i, 1.0)]).collect();
        for (number, direction) in local.into_iter().rev() {
            directions.push(self.with_those_below(number, direction, &done, &mut change));
        }
        Undetermined { directions, held }
    }

    /// Whether there is one piece, of all unknowns, and its triangle as a whole is far from singular: so are its parts, then.
    fn is_plainly_determined(&self, tolerance: f64) -> bool {
        let [piece] = self.pieces.as_slice() else { return false };
        let n = piece.columns.len();
        let scales = || piece.columns.iter().map(|&i| self.norms[i].recip()).collect::<Vec<f64>>();
        n == self.unknowns() && smallest_at_least(&piece.triangle, &scales()) > tolerance * (n as f64).sqrt()
    }

    /// The direction of a piece's own unknowns with the response of the unknowns below it. `change` is zeros before and
    /// after.
    fn with_those_below(
        &self,
        number: Option<usize>,
        mut direction: Vec<(usize, f64)>,
        reduced: &[Reduced<'_>],
        change: &mut [f64],
    ) -> Vec<(usize, f64)> {
        direction.iter().for_each(|&(i, d)| change[i] = d / self.norms[i]);
        let mut open: Vec<usize> = self.children(number).iter().rev().copied().collect();
        while let Some(next) = open.pop() {
            let piece = &reduced[next];
            for i in (0..piece.own).rev() {
                let (_, row) = piece.triangle.row(i);
                let known: f64 = row.iter().zip(&piece.columns[i..]).skip(1).map(|(r, &j)| r * change[j]).sum();
                let unknown = piece.columns[i];
                change[unknown] = -known / row[0];
                if change[unknown] != 0.0 {
                    direction.push((unknown, change[unknown] * self.norms[unknown]));
                }
            }
            open.extend(self.children(Some(next)).iter().rev());
        }
        direction.iter().for_each(|&(i, _)| change[i] = 0.0);
        direction.sort_unstable_by_key(|&(i, _)| i);
        let length = direction.iter().fold(0.0, |length: f64, (_, d)| length.hypot(*d));
        direction.iter_mut().for_each(|(_, d)| *d /= length);
        direction
    }
}

/// Directions of a piece's own unknowns, scaled by their norms, that its triangle does not determine.
fn null_directions(piece: &Reduced<'_>, norms: &[f64], tolerance: f64) -> Vec<Vec<(usize, f64)>> {
    let own = &piece.columns[..piece.own];
    let scales: Vec<f64> = own.iter().map(|&i| norms[i].recip()).collect();
    // Unit columns: the largest singular value is at most the root of their number.
    if smallest_at_least(&piece.triangle, &scales) > tolerance * (own.len() as f64).sqrt() {
        return vec![];
    }
    let Ok(spectrum) = piece.triangle.leading(own.len()).decomposition(&scales) else { return vec![] };
    let largest = spectrum.values.first().copied().unwrap_or(0.0);
    let nothing = spectrum.values.iter().map(|&value| value <= tolerance * largest.max(1.0));
    let null = spectrum.directions.iter().zip(nothing).filter(|(_, nothing)| *nothing);
    null.map(|(direction, _)| own.iter().copied().zip(direction.iter().copied()).collect()).collect()
}

/// A number that the smallest singular value of the scaled first columns is not below: one over the Frobenius norm of the
/// inverse of their triangle. Zero where a pivot is zero; infinite for no columns.
fn smallest_at_least(triangle: &Information, scales: &[f64]) -> f64 {
    let n = scales.len();
    let mut squares = 0.0;
    let mut column = vec![0.0; n];
    for j in 0..n {
        column[j] = 1.0 / (triangle.at(j, j) * scales[j]);
        for i in (0..j).rev() {
            let known: f64 = (i + 1..=j).map(|k| triangle.at(i, k) * scales[k] * column[k]).sum();
            column[i] = -known / (triangle.at(i, i) * scales[i]);
        }
        squares += column[..=j].iter().map(|x| x * x).sum::<f64>();
    }
    if squares.is_nan() { 0.0 } else { squares.sqrt().recip() }
}

/// Holds one unknown for each direction; the largest is the surest to take.
fn fix(directions: &[Vec<(usize, f64)>], held: &mut [bool]) {
    let mut rows = directions.to_vec();
    while let Some(row) = rows.pop() {
        let largest = (0..row.len()).max_by(|&a, &b| row[a].1.abs().total_cmp(&row[b].1.abs()));
        let Some(pivot) = largest.filter(|&c| row[c].1 != 0.0) else { continue };
        held[row[pivot].0] = true;
        for other in &mut rows {
            let factor = other[pivot].1 / row[pivot].1;
            other.iter_mut().zip(&row).for_each(|(other, row)| other.1 -= factor * row.1);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{fix, smallest_at_least};
    use crate::information::Information;

    /// The scaled triangle is `[[1, -0.5, 2], [0, 4, 1], [0, 0, 2]]`; its inverse by hand.
    #[test]
    fn a_bound_of_the_smallest_singular_value() {
        let mut triangle = Information::new(3);
        for row in [[2.0, -2.0, 0.5], [0.0, 16.0, 0.25], [0.0, 0.0, 0.5]] {
            triangle.absorb_row(&row, 0.0);
        }
        let inverse = [1.0, 0.125, -1.0625, 0.25, -0.125, 0.5f64];
        let expected = inverse.iter().map(|x| x * x).sum::<f64>().sqrt().recip();
        let found = smallest_at_least(&triangle, &[0.5, 0.25, 4.0]);
        assert!((found - expected).abs() < 1e-15, "{found} {expected}");
        assert_eq!(smallest_at_least(&Information::new(1), &[1.0]), 0.0);
        assert_eq!(smallest_at_least(&triangle, &[]), f64::INFINITY);
    }

    /// Both directions are largest in the first unknown: after it was held for one, the other moves the second alone.
    #[test]
    fn directions_with_the_same_largest_unknown_hold_two() {
        let mut held = [false; 3];
        fix(&[vec![(0, 0.8), (2, 0.6)], vec![(0, 0.9), (2, -0.4)]], &mut held);
        assert_eq!(held, [true, false, true]);
    }
}
