//! How the cost rises away from the minimum, against what the slopes at the minimum say.

use super::*;
use crate::covariance::directions;

/// Steps of the other unknowns; each takes two passes over the data. Where a model is close to linear none is taken.
const STEPS: usize = 10;
/// A step that promises less than this part of the expected rise is not taken.
const SETTLED: f64 = 0.05;
/// Parts of a step that are tried.
const PARTS: [f64; 4] = [1.0, 0.5, 0.25, 0.125];

/// Where the rise of the cost is looked at.
#[derive(Clone, Copy)]
pub(crate) struct Place {
    pub unknown: usize,
    /// Standard errors from the estimate.
    pub standard_errors: f64,
    /// The part of the rise that slopes say, below which the rise is little.
    pub little: f64,
}

/// The place of these where the rise of the cost is least, of those where it is little, and the part that it is of what the slopes say.
pub(crate) fn least_rise(
    evidence: &Evidence<'_>,
    places: impl Iterator<Item = Place>,
    covariances: &Covariances,
) -> Option<(Place, f64)> {
    let of = |place: Place| Some((place, rise(evidence, place, covariances)?));
    let little = places.filter_map(of).filter(|(place, part)| *part < place.little);
    little.min_by(|a, b| (a.1 / a.0.little).total_cmp(&(b.1 / b.0.little)))
}

/// The rise of the cost at a place of one unknown, relative to what the slopes say. The other unknowns
/// are moved by the slopes at the estimate, then towards the least cost there, as far as that tells a little rise from another. `None`
/// outside of bounds, or where there is no prediction.
fn rise(evidence: &Evidence<'_>, at: Place, covariances: &Covariances) -> Option<f64> {
    let Place { unknown: i, standard_errors, little } = at;
    let objective = evidence.point.objective;
    // The others follow by the curvature of the cost, not by a covariance that counts colored errors.
    let unit = evidence.unit()?;
    let shift = standard_errors * covariances.unknowns.as_ref()?.standard_error(i) / evidence.point.slopes[i];
    let along =
        |j: usize| if evidence.point.held_for_covariance[j] { 0.0 } else { shift * unit.get(j, i) / unit.get(i, i) };
    let step: Vec<f64> = (0..evidence.point.slopes.len()).map(along).collect();
    let expected = -evidence.point.linear.predicted_reduction(&step);
    let mut held = evidence.point.held_for_covariance.clone();
    held[i] = true;
    let mut place = moved(&evidence.point.end.coordinates, &step, 1.0);
    if !is_inside(objective, &place) {
        return None;
    }
    let mut there = objective.evaluate(&place).ok()?;
    for _ in 0..STEPS {
        let held = directions::undetermined(&there, &held).held;
        let step = there.step(&vec![0.0; held.len()], &held);
        let gains = |step: &Vec<f64>| there.predicted_reduction(step) > SETTLED * expected;
        let is_little = there.cost - evidence.point.linear.cost < little * expected;
        let Some(step) = step.filter(|step| !is_little && gains(step)) else { break };
        let Some(lower) = lower(objective, &place, there.cost, &step) else { break };
        there = objective.evaluate(&lower).ok()?;
        place = lower;
    }
    Some((there.cost - evidence.point.linear.cost) / expected).filter(|part| part.is_finite() && expected > 0.0)
}

/// A place along a step where the cost is lower.
pub(super) fn lower(objective: &Objective<'_>, from: &[f64], cost: f64, step: &[f64]) -> Option<Vec<f64>> {
    let places = PARTS.into_iter().map(|part| moved(from, step, part));
    let is_lower = |place: &Vec<f64>| is_inside(objective, place) && objective.cost_at(place).is_ok_and(|at| at < cost);
    places.into_iter().find(is_lower)
}

fn moved(from: &[f64], step: &[f64], part: f64) -> Vec<f64> {
    from.iter().zip(step).map(|(x, step)| x + part * step).collect()
}

pub(super) fn is_inside(objective: &Objective<'_>, place: &[f64]) -> bool {
    objective.problem.unknowns.bounds().iter().zip(place).all(|((lower, upper), x)| (*lower..=*upper).contains(x))
}
