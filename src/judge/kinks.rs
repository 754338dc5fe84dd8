//! Whether the cost rises as its slopes say, out to the ends of the intervals of unknowns that decide a choice of the model: a limit
//! that few samples reach, or none, is known by those few only, and its cost is flat beyond them.

use super::conclude::Judgement;
use super::covariances::Covariances;
use super::curved::{QUANTILE, along};
use super::directions;
use crate::estimate::{Unknown, Warning, WarningCode};
use crate::numeral::percent;
use crate::optimize::{Outcome, Severity};
use crate::problem::Role;

/// Half widths of the interval at which the cost is compared.
const PLACES: [f64; 4] = [-2.0, -1.0, 1.0, 2.0];
/// A cost that rises by less than this part of what it should makes the interval too short.
const LITTLE: f64 = 0.5;

/// The unknown whose cost rises least.
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
        "the interval of `{}` is too short {}: it decides a choice of the model (an `if`, a limit, an absolute value, a table), and the \
         cost rises by {} of what its slopes say; few samples tell where; take diagnose::profile, or excite it beyond its limit",
        unknowns[i].name,
        if place > 0.0 { "above" } else { "below" },
        percent(part.max(0.0), 2)
    );
    Some(Warning { code: WarningCode::CurvedInterval, severity: Severity::UsableWithCare, text })
}

/// By which part of what the slopes say the cost rises, so many standard errors along the profile of an unknown, where the others follow by
/// the slopes here or by those there, whichever is less; `None` beyond bounds, or where there is no prediction.
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
