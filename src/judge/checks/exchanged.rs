//! Two parameters of one unit whose values may be exchanged: two lags in series, absorption and elimination.
//!
//! The cost has two minima then, at which the data are explained alike. The slopes at one of them do not show the other.

use super::rise::{is_inside, lower};
use super::search::INDISTINGUISHABLE;
use super::*;
use crate::covariance::directions;
use crate::parameter::Parameter;

pub(crate) const EXCHANGED: Check = Check::new(
    "no two parameters can be exchanged",
    "With the values of two parameters of one unit exchanged and held, and the others moved to the least cost there: are the data explained as \
     well?",
    &[WarningCode::RivalMinimum],
    |evidence, _| match evidence.point.objective.problem.runs_in_lanes() {
        true => Examined::from(exchanged(evidence)).without(left_out(evidence)),
        // Simulated with each other's values, stiff equations may take minutes.
        false => Examined::from(None).without(pairs(evidence).next().map(|_| "simulations that are not run as programs of fixed steps")),
    },
)
.unless(&[Unless::RoundOff, Unless::NoMinimum, Unless::ManyUnknowns])
.of_usable()
.costs(&[Pass::Slopes(MOST * (1 + STEPS))])
.levels(&[
    level("pairs that are examined", MOST as f64, "four parameters of one unit"),
    level("the difference of deviances that tells two minima apart", INDISTINGUISHABLE, "one of 150 records"),
    level("the difference by the slopes from which on it is another minimum", APART, "twice that"),
]);

const MOST: usize = 6;
const APART: f64 = 2.0 * INDISTINGUISHABLE;
/// Steps of the other unknowns at the most, and the part of the difference in cost that the next one has to gain.
const STEPS: usize = 8;
const SETTLED: f64 = 0.05;

/// The pairs, as far as they are examined.
fn left_out(evidence: &Evidence<'_>) -> Option<&'static str> {
    (pairs(evidence).count() > MOST).then_some("further pairs of parameters of one unit")
}

/// Pairs of parameters that all records share, of which each may have the other's value, by unit and bounds, and is known to differ from it.
fn pairs<'e>(evidence: &'e Evidence<'_>) -> impl Iterator<Item = (usize, usize)> + use<'e> {
    let (point, unknowns) = (&evidence.point, &evidence.point.objective.problem.unknowns);
    let units = &evidence.point.objective.problem.layout().parameters;
    let unit = |i: usize| match unknowns.row[i].role {
        Role::Parameter(place) => Some(units[place].unit.as_str()),
        Role::InitialState(_) => None,
    };
    let of = move |i: usize| -> (Option<&str>, &Parameter) { (unit(i), &unknowns.row[i].parameter) };
    let takes = |parameter: &Parameter, value: f64| {
        (parameter.lower..=parameter.upper).contains(&value) && !(parameter.positive && value <= 0.0)
    };
    let can = move |&(i, j): &(usize, usize)| {
        let ((unit, one), (other_unit, other)) = (of(i), of(j));
        let (a, b) = (point.values[i], point.values[j]);
        let held = point.held_for_covariance[i] || point.held_for_covariance[j];
        let alike = unit.is_some() && unit == other_unit && one.transform == other.transform && !held;
        alike && takes(one, b) && takes(other, a) && by_slopes(evidence, i, j).is_some_and(|rise| rise > APART)
    };
    (0..unknowns.shared()).flat_map(|j| (0..j).map(move |i| (i, j))).filter(can)
}

/// The changes of the coordinates of two unknowns when their values are exchanged.
fn exchange(evidence: &Evidence<'_>, i: usize, j: usize) -> [f64; 2] {
    let to = |i: usize, j: usize| {
        let transform = evidence.point.objective.problem.unknowns.row[i].parameter.transform;
        transform.to_coordinate(evidence.point.values[j]) - evidence.point.end.coordinates[i]
    };
    [to(i, j), to(j, i)]
}

/// The difference of deviances by the slopes at the estimate, where the others follow.
fn by_slopes(evidence: &Evidence<'_>, i: usize, j: usize) -> Option<f64> {
    let (unit, [a, b]) = (evidence.unit()?, exchange(evidence, i, j));
    let (aa, ab, bb) = (unit.get(i, i), unit.get(i, j), unit.get(j, j));
    let form = (a * a * bb - 2.0 * a * b * ab + b * b * aa) / (aa * bb - ab * ab);
    Some(form / evidence.point.widening.powi(2)).filter(|rise| rise.is_finite())
}

/// The pair with which the data are explained best.
fn exchanged(evidence: &Evidence<'_>) -> Option<Warning> {
    let found = pairs(evidence).take(MOST).filter_map(|(i, j)| Some((i, j, least(evidence, i, j)?)));
    let (i, j, (place, difference)) = found.min_by(|a, b| a.2.1.total_cmp(&b.2.1))?;
    let objective = evidence.point.objective;
    let (names, values) = (objective.names(), objective.problem.unknowns.values(&place));
    let shown = (0..objective.problem.unknowns.shared()).map(|k| format!("`{}` = {}", names[k], number(values[k], 5)));
    let text = format!(
        "with the values of `{}` and `{}` exchanged the data are explained as well (-2 ln of the likelihood differs by {}), at {}: a bound or a \
         prior must tell which one is meant",
        names[i],
        names[j],
        number(difference.abs(), 2),
        shown.collect::<Vec<_>>().join(", ")
    );
    Some(with_care(WarningCode::RivalMinimum, text).about(About::Minimum))
}

/// The place of the least cost with a pair exchanged, and the difference of deviances there; `None` where the cost stays higher.
fn least(evidence: &Evidence<'_>, i: usize, j: usize) -> Option<(Vec<f64>, f64)> {
    let (point, objective) = (&evidence.point, evidence.point.objective);
    let deviance = |cost: f64| 2.0 * (cost - point.linear.cost) / point.widening.powi(2);
    let mut held = point.held_for_covariance.clone();
    (held[i], held[j]) = (true, true);
    let ([a, b], mut place) = (exchange(evidence, i, j), point.end.coordinates.clone());
    place[i] += a;
    place[j] += b;
    if !is_inside(objective, &place) {
        return None;
    }
    let mut there = objective.evaluate(&place).ok()?;
    for _ in 0..STEPS {
        let held = directions::undetermined(&there, &held).held;
        let step = there.step(&vec![0.0; held.len()], &held)?;
        if there.predicted_reduction(&step) <= SETTLED * (there.cost - point.linear.cost).max(0.0) {
            break;
        }
        let Some(next) = lower(objective, &place, there.cost, &step) else { break };
        there = objective.evaluate(&next).ok()?;
        place = next;
    }
    Some((place, deviance(there.cost))).filter(|(_, difference)| difference.abs() < INDISTINGUISHABLE)
}
