//! Parameters in a condition of the model: whether the cost rises towards the ends of an interval as its slopes say, and whether one without
//! slope changes the cost all the same. A limit that few samples reach is determined by those few; where it is beyond them all, the cost does
//! not depend on it. The time of a switch changes the cost in steps.

use super::*;
use crate::judge::checks::curved::QUANTILE;
use crate::judge::checks::rise::{Place, least_rise};

pub(crate) const CONDITIONS: Check = Check::new(
    "intervals do not end at a condition",
    "For parameters in a condition of the model: does the cost rise towards the ends of the interval as the \
     slopes say?",
    &[WarningCode::CurvedInterval],
    |evidence, intervals| {
        let long = evidence.residuals.measured > LONGEST && evidence.point.objective.sweep.choosing().is_none();
        let long = long.then_some("more than 5,000 measurements of a model that is not read as a graph");
        Examined::unless(long, || kinked(evidence, &intervals.unknowns, &intervals.covariances))
    },
)
.unless(&[Unless::RoundOff])
.costs(&[Pass::EachUnknown(4)])
.levels(&[level(
    "the rise of the cost, in what the slopes say",
    LITTLE,
    "an interval by the likelihood is longer by the root of two",
)]);

/// Half widths of the interval at which the cost is compared: at its ends, and as far again, where a limit is beyond the few samples that
/// reach it though an end is not.
const PLACES: [f64; 4] = [-2.0, -1.0, 1.0, 2.0];
/// Models that are not read as a graph are examined with at most so many measurements: four passes with slopes for each parameter.
const LONGEST: u64 = 5_000;
/// A cost that rises by less than this part of what its slopes say: an interval by the likelihood is longer by the root of two or more.
const LITTLE: f64 = 0.5;
/// Factors of a parameter's value at which the cost is compared.
const FACTORS: [f64; 4] = [0.5, 2.0, 0.8, 1.25];
/// A cost that changes by more than this part of itself is another one.
const CHANGED: f64 = 1e-9;

/// The parameter along which the cost rises least, relative to what its slopes say.
fn kinked(evidence: &Evidence<'_>, unknowns: &[Unknown], covariances: &Covariances) -> Option<Warning> {
    let choosing = evidence.point.objective.sweep.choosing();
    // Of a model that is not read as a graph any parameter may be in a condition.
    let any = evidence.residuals.measured <= LONGEST;
    let chooses = |i: &usize| matches!(unknowns[*i].role, Role::Parameter(p) if choosing.map_or(any, |choosing| choosing.contains(&p)));
    let known = (0..unknowns.len()).filter(chooses).filter(|&i| unknowns[i].knowledge.standard_error().is_some());
    let place = |unknown, place: f64| Place { unknown, standard_errors: place * QUANTILE, little: LITTLE };
    let places = known.flat_map(|i| PLACES.map(|at| place(i, at)));
    let (place, part) = least_rise(evidence, places, covariances)?;
    let text = format!(
        "the interval of `{}` is too short {}: a condition of the model {} on it (an `if`, a limit, an absolute value, a table), few \
         samples are near, and the cost rises by {} of what its slopes say; take diagnose::profile, or record more on both sides of the \
         condition",
        unknowns[place.unknown].name,
        if place.standard_errors > 0.0 { "above" } else { "below" },
        if choosing.is_some() { "depends" } else { "may depend" },
        percent(part.max(0.0), 2)
    );
    Some(with_care(WarningCode::CurvedInterval, text).about(About::Unknown(place.unknown)))
}

/// Why an unknown has no slope that stands in the noise or in conditions of the model: `None` where it stands elsewhere, or no condition of a model
/// that is not read as a graph was found to depend on it.
pub(crate) fn without_slope(evidence: &Evidence<'_>, i: usize) -> Option<&'static str> {
    let objective = evidence.point.objective;
    let Role::Parameter(p) = objective.problem.unknowns.row[i].role else { return None };
    if evidence.point.norms[i] == 0.0 && objective.sweep.levels().contains(&p) && !objective.sweep.predicts_variance() {
        return Some(
            "stands in the noise of the model alone (Model::noise, Model::diffusion), which this prediction does not use: take the predictor \
             Kalman, which does, or fix it",
        );
    }
    let choosing = objective.sweep.choosing();
    if evidence.point.norms[i] != 0.0 || choosing.is_some_and(|choosing| !choosing.contains(&p)) {
        return None;
    }
    match (changes_in_steps(evidence, i), choosing) {
        (true, Some(_)) => Some(
            "stands only in conditions of the model (an `if`, a comparison): the cost changes with it in steps and has no slope, so that \
             the search cannot move it; write the condition in a smooth form (a ramp or a `tanh` over about a sample), or search by values \
             (bounds, and Fit::starts)",
        ),
        (true, None) => Some(
            "changes the cost, but without a slope: it stands only in conditions of the model (an `if`, a comparison), or where the model \
             takes its value(), and the search cannot move it; write it in a smooth form, or search by values (bounds, and Fit::starts)",
        ),
        (false, Some(_)) => Some(
            "has no influence on the outputs: the conditions of the model that depend on it (an `if`, a limit, a table) come out the same at \
             every sample; fix it, or record where they do not",
        ),
        (false, None) => None,
    }
}

/// Whether the cost is another one at other values of an unknown, without a slope there.
fn changes_in_steps(evidence: &Evidence<'_>, i: usize) -> bool {
    let parameter = evidence.point.objective.problem.unknowns.row[i].parameter;
    let value = evidence.point.values[i];
    let near = if value == 0.0 { [-1.0, 1.0, -0.1, 0.1] } else { FACTORS.map(|factor| factor * value) };
    let inside = |at: &f64| at.is_finite() && (parameter.lower..=parameter.upper).contains(at);
    let places = near.into_iter().chain([parameter.lower, parameter.upper]).filter(inside);
    let mut costs = places.filter_map(|at| {
        let mut place = evidence.point.end.coordinates.clone();
        place[i] = parameter.transform.to_coordinate(at);
        evidence.point.objective.evaluate(&place).ok().filter(|there| there.column_norms()[i] == 0.0)
    });
    let cost = evidence.point.linear.cost;
    costs.any(|there| (there.cost - cost).abs() > CHANGED * cost.abs())
}
