//! Whether the cost rises towards the ends of an interval as its slopes say, for parameters in a condition of the model. A limit that few
//! samples reach is determined by those few; where it is beyond them all, the cost does not depend on it.

use super::conclude::Judgement;
use super::covariances::Covariances;
use super::curved::{QUANTILE, along};
use super::directions;
use crate::estimate::{Unknown, Warning, WarningCode};
use crate::numeral::percent;
use crate::optimize::{Outcome, Severity};
use crate::problem::Role;

/// Half widths of the interval at which the cost is compared: at its ends, and as far again, where a limit is beyond the few samples that
/// reach it though an end is not.
const PLACES: [f64; 4] = [-2.0, -1.0, 1.0, 2.0];
/// A cost that rises by less than this part of what its slopes say: an interval by the likelihood is longer by the root of two or more.
const LITTLE: f64 = 0.5;

/// The parameter along which the cost rises least, relative to what its slopes say.
pub(super) fn kinked(judgement: &Judgement<'_>, unknowns: &[Unknown], covariances: &Covariances) -> Option<Warning> {
    let choosing = judgement.objective.sweep.choosing();
    if choosing.is_empty() || judgement.rounding || judgement.end.outcome == Outcome::Exact {
        return None;
    }
    let chooses = |i: &usize| matches!(unknowns[*i].role, Role::Parameter(p) if choosing.contains(&p));
    let known = (0..unknowns.len()).filter(chooses).filter(|&i| unknowns[i].knowledge.standard_error().is_some());
    let places = known.flat_map(|i| PLACES.map(|place| (i, place)));
    let of = |(i, place)| Some((i, place, rise(judgement, i, place * QUANTILE, covariances)?));
    let (i, place, part) =
        places.filter_map(of).min_by(|a, b| a.2.total_cmp(&b.2)).filter(|(.., part)| *part < LITTLE)?;
    let text = format!(
        "the interval of `{}` is too short {}: a condition of the model depends on it (an `if`, a limit, an absolute value, a table), few \
         samples are near, and the cost rises by {} of what its slopes say; take diagnose::profile, or record more on both sides of the \
         condition",
        unknowns[i].name,
        if place > 0.0 { "above" } else { "below" },
        percent(part.max(0.0), 2)
    );
    Some(Warning { code: WarningCode::CurvedInterval, severity: Severity::UsableWithCare, text })
}

/// The rise of the cost so many standard errors away from the estimate of one unknown, relative to what the slopes say. The other unknowns
/// are moved by the slopes at the estimate, then by one step with those at the new place; the smaller cost of both counts. `None`
/// outside of bounds, or where there is no prediction.
fn rise(judgement: &Judgement<'_>, i: usize, standard_errors: f64, covariances: &Covariances) -> Option<f64> {
    let objective = judgement.objective;
    let step: Vec<f64> = along(judgement, i, covariances)?.iter().map(|along| standard_errors * along).collect();
    let moved = |from: &[f64], step: &[f64]| from.iter().zip(step).map(|(x, step)| x + step).collect::<Vec<f64>>();
    let bounds = objective.problem.unknowns.bounds();
    let inside = |place: &[f64]| bounds.iter().zip(place).all(|((lower, upper), x)| (*lower..=*upper).contains(x));
    let place = moved(&judgement.end.coordinates, &step);
    if !inside(&place) {
        return None;
    }
    let there = objective.evaluate(&place).ok()?;
    let mut held = judgement.exact.clone();
    held[i] = true;
    let held = directions::undetermined(&there, &held).held;
    let again = there.step(&vec![0.0; held.len()], &held).map(|step| moved(&place, &step));
    let least = again.filter(|place| inside(place)).and_then(|place| objective.cost_at(&place).ok());
    let rise = least.map_or(there.cost, |least| least.min(there.cost)) - judgement.linear.cost;
    let expected = -judgement.linear.predicted_reduction(&step);
    Some(rise / expected).filter(|part| part.is_finite() && expected > 0.0)
}
