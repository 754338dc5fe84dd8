//! [`Intervals`]: how well each unknown is known.

use crate::covariance::directions;
use crate::covariance::point::Point;
use crate::estimate::quantities::within;
use crate::estimate::student::Spread;
use crate::estimate::{Direction, Knowledge, Unknown};
use crate::information::Covariance;
use crate::judge::covariances::{Covariances, covariances, is_error};
use crate::judge::evidence::Evidence;
use crate::parameter::Transform;

/// What is known of the unknowns.
pub(crate) struct Intervals {
    pub covariances: Covariances,
    pub unknowns: Vec<Unknown>,
    /// Directions that the data do not determine.
    pub directions: Vec<Direction>,
    /// Whether stop conditions ended passes before these were complete.
    pub stopped: bool,
}

impl Intervals {
    pub fn of(evidence: &Evidence<'_>) -> Self {
        let covariances = covariances(evidence);
        let (unknowns, directions) = (unknowns(evidence, &covariances), directions(&evidence.point));
        let stopped = evidence.point.objective.control.stops();
        Intervals { covariances, unknowns, directions, stopped }
    }
}

fn unknowns(evidence: &Evidence<'_>, covariances: &Covariances) -> Vec<Unknown> {
    let free = &evidence.point.objective.problem.unknowns.row;
    let root = evidence.point.linear.sum_of_squares().sqrt();
    let one = |i: usize| {
        let (unknown, value) = (&free[i], evidence.point.values[i]);
        let transform = unknown.parameter.transform;
        let bounds = (unknown.parameter.lower, unknown.parameter.upper);
        // The standard errors of unknowns that are not seen are zero.
        let known = |covariance: &Covariance| Some(covariance.standard_error(i)).filter(|error| is_error(*error));
        let error = covariances.unknowns.as_ref().filter(|_| evidence.has_noise()).and_then(known);
        let degrees_of_freedom = covariances.degrees[i];
        let knowledge = match (evidence.point.held_at[i], error) {
            (Some(bound), None) => Knowledge::Held { bound, end: None },
            (None, None) => Knowledge::Unidentified,
            (held, Some(standard_error)) => {
                // Next to zero, where a logarithm has no width, in the unknown's own unit.
                let (center, unit, transform) = match held {
                    Some(0.0) => (value, 1.0, Transform::Identity),
                    _ => (evidence.point.end.coordinates[i], evidence.point.slopes[i], transform),
                };
                let spread = Spread { standard_error: standard_error / unit, degrees: degrees_of_freedom };
                let release = evidence.point.unbounded_step[i] * evidence.point.slopes[i] / unit;
                let unbounded = spread.interval(center + release, transform, 0.95);
                let (lower, upper) = within(bounds, unbounded);
                match held {
                    Some(bound) => {
                        let end = if bound == unknown.parameter.upper { lower } else { upper };
                        Knowledge::Held { bound, end: Some(end).filter(|end| end.is_finite()) }
                    }
                    None if !has_ends(unbounded, transform) => Knowledge::Unidentified,
                    None => Knowledge::Known { standard_error, lower, upper },
                }
            }
        };
        let index = |change: f64| {
            let percent = 100.0 * (root * change * evidence.point.slopes[i] / value).abs();
            (error.is_some() && percent.is_finite()).then_some(percent)
        };
        Unknown {
            name: unknown.name.clone(),
            unit: unknown.unit.clone(),
            role: unknown.role,
            experiment: unknown.experiment,
            value,
            start: unknown.parameter.start,
            bounds,
            knowledge,
            error_index: evidence.unit().and_then(|unit| index(unit.standard_error(i))),
            error_index_held: index(1.0 / evidence.point.norms[i]),
            transform,
            degrees_of_freedom,
        }
    };
    (0..free.len()).map(one).collect()
}

/// Null directions by the names of the unknowns.
fn directions(point: &Point<'_>) -> Vec<Direction> {
    let unknowns = &point.objective.problem.unknowns;
    let named = |d: &Vec<(usize, f64)>| directions::named(unknowns, d, &point.norms, &point.values, &point.slopes);
    point.undetermined.directions.iter().map(named).collect()
}

/// Whether an interval ends at numbers. Beyond the largest or below the smallest number nothing is known of a logarithm.
fn has_ends((lower, upper): (f64, f64), transform: Transform) -> bool {
    lower.is_finite() && upper.is_finite() && !(transform == Transform::Log && upper == 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_interval_ends_at_numbers() {
        use Transform::{Identity, Log};
        assert!(has_ends((-1.0, 0.0), Identity) && has_ends((0.0, 1.0), Log) && has_ends((-1.0, 1.0), Identity));
        assert!(!has_ends((0.0, 0.0), Log) && !has_ends((0.0, f64::INFINITY), Log));
        assert!(!has_ends((f64::NEG_INFINITY, 1.0), Identity) && !has_ends((f64::NAN, 1.0), Identity));
    }
}
