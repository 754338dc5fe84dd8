//! Whether what a filter takes for process noise follows from the state or the inputs.

use super::*;
use crate::parameter::free;
use crate::problem::{Free, Noise, Problem, SearchPlan, Settings};
use crate::sweep::Sweep;
use statrs::distribution::{ContinuousCDF, Normal};
use std::sync::Arc;

pub(crate) const MISSING_TERMS: Check = Check::new(
    "disturbances follow from nothing that is known",
    "Of a filter: does the likelihood ask for a term in the derivative (next state) that process noise acts on: a constant, a state, an input, their \
     squares or cubes (score tests, Rao 1948, beside all unknowns)? By how many standard errors would an unknown move with it?",
    &[WarningCode::MissingTerm],
    missing_terms,
)
.costs(&[Pass::Slopes(1)])
.levels(&[
    level("the states of a model that is examined", MOST as f64, "the slopes of a covariance grow by the third power"),
    level("chance of the largest of the terms", LEVEL, "one good record in a thousand"),
    level("chance of one that moves an unknown by two standard errors, from which on care is needed", LIKELY, "one in a hundred"),
    level("standard errors from which on care is needed", CARE, "half of one: intervals of 95 % then cover 92 %"),
    level("standard errors from which on intervals mean nothing", FAR, "two: they cover half"),
]);

const MOST: usize = 6;
const LEVEL: f64 = 1e-3;
const LIKELY: f64 = 1e-2;
const CARE: f64 = 0.5;
const FAR: f64 = 2.0;
/// A term whose slopes are this part beside those of all unknowns, or less, is one of them.
const SAME: f64 = 1e-4;

/// A term that the likelihood asks for.
struct Asked {
    term: usize,
    /// Its factor in standard errors of it.
    errors: f64,
    /// The largest move of an unknown, in its standard errors, and which.
    moves: Option<(f64, usize)>,
}

fn missing_terms(evidence: &Evidence<'_>, intervals: &Intervals) -> Examined {
    let objective = evidence.point.objective;
    if !objective.sweep.predicts_variance() {
        return Examined::from(None);
    }
    let states = &objective.problem.layout().states;
    if states.len() > MOST {
        return Examined::from(None).without(Some("models of more than 6 states"));
    }
    let Some(made) = objective.sweep.with_terms() else {
        return Examined::from(None).without(Some("models that are not read as a graph"));
    };
    if made.terms.is_empty() {
        return Examined::from(None);
    }
    let left_out = (made.left_out > 0).then(|| counted(made.left_out as u64, "term"));
    let asked = strongest(evidence, intervals, made.sweep, made.terms.len());
    let count = made.terms.len() as f64;
    let warning = asked.and_then(|asked| {
        let ((moved, i), chance) = (asked.moves?, 2.0 * Normal::standard().sf(asked.errors) * count);
        let warning = match chance {
            ..LEVEL if moved >= FAR => not_usable,
            ..LEVEL if moved >= CARE => with_care,
            ..LIKELY if moved >= FAR => with_care,
            _ => return None,
        };
        let term = &made.terms[asked.term];
        let text = format!(
            "what is taken for process noise of `{}` follows {} ({} standard errors): its equation may lack such a term, with which `{}` would \
             change by {} standard errors; write the term into the model, with a parameter, or compare with a simulation",
            states[term.state].name,
            term.what,
            number(asked.errors, 2),
            intervals.unknowns[i].name,
            number(moved, 2)
        );
        Some(warning(WarningCode::MissingTerm, text))
    });
    Examined::from(warning).without(left_out)
}

/// The term that the likelihood asks for the most.
fn strongest(
    evidence: &Evidence<'_>,
    intervals: &Intervals,
    sweep: Arc<dyn Sweep + '_>,
    terms: usize,
) -> Option<Asked> {
    let objective = evidence.point.objective;
    let of = objective.problem;
    let first = of.parameters().len();
    let parameters: Vec<_> = of.parameters().iter().copied().chain((0..terms).map(|_| free(0.0))).collect();
    let settings = Settings {
        noise: Noise::Predicted,
        checkpoint: None,
        observers: vec![],
        searches: SearchPlan::Single,
        ..of.settings.clone()
    };
    let problem = Problem::new(sweep, of.records.clone(), &parameters, settings).ok()?;
    // Each unknown of the fit is one of this problem, too; the factors of the terms are zero.
    let same = |a: &Free, b: &Free| a.role == b.role && a.experiment == b.experiment;
    let row = &problem.unknowns.row;
    let from: Vec<Option<usize>> = row.iter().map(|a| of.unknowns.row.iter().position(|b| same(a, b))).collect();
    let coordinates: Vec<f64> = from.iter().map(|i| i.map_or(0.0, |i| evidence.point.end.coordinates[i])).collect();
    let linear = problem.in_units(objective.control).evaluate(&coordinates).ok()?;
    let known = |i: usize| intervals.unknowns[i].knowledge.standard_error();
    let held: Vec<bool> = from.iter().map(|i| i.is_none_or(|i| known(i).is_none())).collect();
    let norms = linear.column_norms();
    let ask = |at: usize| {
        let Role::Parameter(number) = row[at].role else { return None };
        let mut held = held.clone();
        held[at] = false;
        let covariance = linear.covariance(&held)?;
        let error = covariance.standard_error(at);
        if !(error.is_finite() && error * norms[at] * SAME < 1.0) {
            return None;
        }
        let step = linear.step(&vec![0.0; row.len()], &held)?;
        let moved = |(j, i): (usize, &Option<usize>)| {
            let unknown = &intervals.unknowns[(*i)?];
            let change = (step[j] * unknown.transform.slope(unknown.value)).abs();
            Some((change / unknown.knowledge.standard_error()?, (*i)?))
        };
        let moves = from.iter().enumerate().filter_map(moved).max_by(|a, b| a.0.total_cmp(&b.0));
        Some(Asked { term: number.checked_sub(first)?, errors: (step[at] / error).abs(), moves })
    };
    let asked = (0..row.len()).filter(|at| from[*at].is_none()).filter_map(ask);
    asked.filter(|asked| asked.errors.is_finite()).max_by(|a, b| a.errors.total_cmp(&b.errors))
}
