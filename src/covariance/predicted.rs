//! Degrees of freedom where noise levels are among the unknowns.
//!
//! The variance of an unknown then depends on levels that the record tells no better than its number of independent stretches
//! allows. By Satterthwaite's rule (Biometrics Bulletin 2 (1946) 110) the variance `v` has `2 v^2 / var(v)` degrees of freedom,
//! with `var(v)` by the slopes of `v` along the unknowns, weighed by their covariance (Fai and Cornelius, J. Statistical
//! Computation and Simulation 54 (1996) 363).

use crate::covariance::point::Point;
use crate::information::Covariance;
use crate::parameter::{Parameter, Transform};
use nalgebra::{Cholesky, DMatrix};

/// With more unknowns than this the degrees of freedom are those of the measurements: each unknown takes two passes over the data.
const MOST: usize = 12;
/// Standard errors from the estimate at which the variances are compared, to either side.
const APART: f64 = 0.5;
/// The fewest degrees of freedom: below this the approximation is too rough.
const FEWEST: f64 = 2.0;

/// How the variances of the unknowns depend on the unknowns.
pub(crate) struct Dependence {
    /// Degrees of freedom of the variance of each unknown.
    pub degrees: Vec<f64>,
    /// By how much the logarithm of the variance of each unknown grows along one of its own standard errors.
    pub own: Vec<f64>,
}

/// Dependence of the predicted variances; `unit` is the covariance of the unknowns in coordinates.
pub(crate) fn dependence_of_variances(point: &Point<'_>, unit: &Covariance) -> Option<Dependence> {
    let n = point.slopes.len();
    let kept: Vec<usize> = (0..n).filter(|&i| !point.held_for_covariance[i]).collect();
    if !point.objective.sweep.predicts_variance() || kept.len() > MOST {
        return None;
    }
    let covariance = unit.dense(&kept);
    let covariance = DMatrix::from_fn(kept.len(), kept.len(), |i, j| covariance[(i, j)]);
    let directions = Cholesky::new(covariance)?.unpack();
    let (mut squares, mut own) = (vec![0.0; n], vec![0.0; n]);
    let here = logarithms(unit, n);
    for direction in directions.column_iter() {
        let apart = apart(point, &kept, direction.iter().copied());
        let beside = |sign: f64| {
            let mut place = point.end.coordinates.clone();
            kept.iter().zip(direction.iter()).for_each(|(&i, along)| place[i] += sign * apart * along);
            logarithms_of_variances(point, &place)
        };
        let (above, below) = (beside(1.0), beside(-1.0));
        for (row, &i) in kept.iter().enumerate() {
            let of = |place: &Option<Vec<f64>>| place.as_ref().map(|logarithms| logarithms[i]);
            let slope = slope(of(&above), here[i], of(&below), apart);
            squares[i] += slope * slope;
            own[i] += slope * direction[row] / unit.standard_error(i);
        }
    }
    // Places that were not evaluated because of the time say nothing.
    if point.objective.control.stops() {
        return None;
    }
    let most = point.degrees.max(FEWEST);
    let degrees = |square: f64| if square.is_finite() { (2.0 / square).clamp(FEWEST, most) } else { FEWEST };
    Some(Dependence { degrees: squares.into_iter().map(degrees).collect(), own })
}

/// How far to go along a direction: nine tenths of the way to the nearest bound at most.
fn apart(point: &Point<'_>, kept: &[usize], direction: impl Iterator<Item = f64>) -> f64 {
    let least = |apart: f64, (&i, along): (&usize, f64)| {
        let parameter = &point.objective.problem.unknowns.row[i].parameter;
        shortened(apart, bounds(parameter), point.end.coordinates[i], along)
    };
    kept.iter().zip(direction).fold(APART, least)
}

fn logarithms_of_variances(point: &Point<'_>, place: &[f64]) -> Option<Vec<f64>> {
    let covariance = point.objective.evaluate(place).ok()?.covariance(&point.held_for_covariance)?;
    Some(logarithms(&covariance, place.len()))
}

/// The logarithms of the variances of so many unknowns.
fn logarithms(covariance: &Covariance, unknowns: usize) -> Vec<f64> {
    (0..unknowns).map(|i| 2.0 * covariance.standard_error(i).ln()).collect()
}

/// The bounds of the coordinate of a parameter, as far as a distance is shortened by them: those of logarithms do not count.
fn bounds(parameter: &Parameter) -> (f64, f64) {
    match parameter.transform {
        Transform::Log => (f64::NEG_INFINITY, f64::INFINITY),
        Transform::Identity if parameter.positive => (parameter.lower.max(0.0), parameter.upper),
        Transform::Identity => (parameter.lower, parameter.upper),
    }
}

/// The slope of a number along a direction by what it is at a distance above, here, and at the same distance below, where the
/// filter may fail; infinite where it fails on both sides: the fewest degrees of freedom.
fn slope(above: Option<f64>, here: f64, below: Option<f64>, apart: f64) -> f64 {
    match (above, below) {
        (Some(above), Some(below)) => (above - below) / (2.0 * apart),
        (Some(above), None) => (above - here) / apart,
        (None, Some(below)) => (here - below) / apart,
        (None, None) => f64::INFINITY,
    }
}

/// A distance along which an unknown at this place moves by `along`, so short that it comes no further than nine tenths of the way
/// to its bounds; as it is where the place is on one of them.
fn shortened(apart: f64, (lower, upper): (f64, f64), place: f64, along: f64) -> f64 {
    const PART: f64 = 0.9;
    let room = (place - lower).min(upper - place);
    if room > 0.0 { apart.min(PART * room / along.abs()) } else { apart }
}

#[cfg(test)]
mod tests {
    use super::{bounds, shortened, slope};
    use crate::free;

    /// Of `3 x` at 1: 3 by either side, and by both.
    #[test]
    fn slopes_by_one_side_and_by_both() {
        let found = [(Some(6.0), Some(0.0)), (Some(6.0), None), (None, Some(0.0))].map(|(a, b)| slope(a, 3.0, b, 1.0));
        assert_eq!(found, [3.0; 3]);
        let half = [(Some(4.5), Some(1.5)), (Some(4.5), None), (None, Some(1.5))].map(|(a, b)| slope(a, 3.0, b, 0.5));
        assert_eq!(half, [3.0; 3]);
        assert_eq!(slope(None, 3.0, None, 0.5), f64::INFINITY);
    }

    #[test]
    fn bounds_of_coordinates() {
        let free = free(2.0).within(-1.0, 9.0);
        assert_eq!([bounds(&free), bounds(&free.positive())], [(-1.0, 9.0), (0.0, 9.0)]);
        assert_eq!(bounds(&free.log()), (f64::NEG_INFINITY, f64::INFINITY));
    }

    #[test]
    fn a_distance_ends_inside_the_bounds() {
        assert_eq!(shortened(0.5, (1.0, 9.0), 3.0, -18.0), 0.1);
        assert_eq!(shortened(0.5, (1.0, 9.0), 7.0, 18.0), 0.1);
        assert_eq!([shortened(0.5, (1.0, 9.0), 3.0, 1.0), shortened(0.5, (1.0, 9.0), 1.0, 18.0)], [0.5, 0.5]);
    }
}
