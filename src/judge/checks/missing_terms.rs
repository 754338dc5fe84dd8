//! Whether what a filter takes for process noise follows from the state or the inputs.

use super::*;
use crate::parameter::free;
use crate::problem::{Free, Noise, Problem};
use crate::sweep::Sweep;
use statrs::distribution::{ContinuousCDF, Normal};
use std::collections::HashMap;
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
/// Where the slopes of all unknowns explain those of a term but for this part or less, the data do not tell the two apart.
const SAME: f64 = 1e-4;

/// With terms, equations that else are crossed exactly go by steps: where these change `-ln` of the likelihood by more, they are too coarse.
const STEPPED: f64 = 0.1;

/// A term that the likelihood is asked about.
struct Asked {
    term: usize,
    /// Its factor in standard errors of it.
    errors: f64,
    /// The largest move of an unknown, in its standard errors, and which.
    moved: f64,
    unknown: usize,
}

impl Asked {
    /// What it means, beside so many others.
    fn severity(&self, terms: usize) -> Severity {
        match 2.0 * Normal::standard().sf(self.errors) * terms as f64 {
            ..LEVEL if self.moved >= FAR => Severity::NotUsable,
            ..LEVEL if self.moved >= CARE => Severity::UsableWithCare,
            ..LIKELY if self.moved >= FAR => Severity::UsableWithCare,
            _ => Severity::Usable,
        }
    }
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
    if objective.is_weighted() {
        return Examined::from(None).without(Some("weighted measurements"));
    }
    let left_out = (made.left_out > 0).then(|| counted(made.left_out as u64, "term"));
    let count = made.terms.len();
    let Some(asked) = asked(evidence, intervals, made.sweep, count) else {
        return Examined::from(None).without(Some("models that take more than four steps per sample"));
    };
    let asked = asked.into_iter().map(|asked| (asked.severity(count), asked));
    let told = asked.filter(|(severity, _)| *severity > Severity::Usable);
    let worst = told.max_by(|(a, one), (b, other)| a.cmp(b).then(one.errors.total_cmp(&other.errors)));
    let warning = worst.map(|(severity, asked)| {
        let term = &made.terms[asked.term];
        let text = format!(
            "what is taken for process noise of `{}` follows {} ({} standard errors): its equation may lack such a term, with which `{}` would \
             change by {} standard errors; write the term into the model, with a parameter, or compare with a simulation",
            states[term.state].name,
            term.what,
            number(asked.errors, 2),
            intervals.unknowns[asked.unknown].name,
            number(asked.moved, 2)
        );
        Warning::new(WarningCode::MissingTerm, severity, text).about(About::Unknown(asked.unknown))
    });
    Examined::from(warning).without(left_out)
}

/// What the likelihood says of each term that is told from the unknowns; `None` where it cannot be evaluated with these terms.
fn asked(
    evidence: &Evidence<'_>,
    intervals: &Intervals,
    sweep: Arc<dyn Sweep + '_>,
    terms: usize,
) -> Option<Vec<Asked>> {
    let objective = evidence.point.objective;
    let of = objective.problem;
    let first = of.parameters().len();
    let parameters: Vec<_> = of.parameters().iter().copied().chain((0..terms).map(|_| free(0.0))).collect();
    let settings = of.settings.beside(Noise::Predicted);
    let problem = Problem::new(sweep, of.records.clone(), &parameters, settings).ok()?;
    // Each unknown of the fit is one of this problem, too; the factors of the terms are zero.
    let key = |free: &Free| (free.role, free.experiment);
    let known: HashMap<_, usize> = of.unknowns.row.iter().enumerate().map(|(i, free)| (key(free), i)).collect();
    let row = &problem.unknowns.row;
    let from: Vec<Option<usize>> = row.iter().map(|free| known.get(&key(free)).copied()).collect();
    let coordinates: Vec<f64> = from.iter().map(|i| i.map_or(0.0, |i| evidence.point.end.coordinates[i])).collect();
    let linear = problem.in_units(objective.control).evaluate(&coordinates).ok()?;
    let same = (linear.cost - evidence.point.linear.cost).abs() <= STEPPED;
    if !same {
        return None;
    }
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
        let (moved, unknown) = from.iter().enumerate().filter_map(moved).max_by(|a, b| a.0.total_cmp(&b.0))?;
        Some(Asked { term: number.checked_sub(first)?, errors: (step[at] / error).abs(), moved, unknown })
    };
    let asked = (0..row.len()).filter(|at| from[*at].is_none()).filter_map(ask);
    Some(asked.filter(|asked| asked.errors.is_finite() && asked.moved.is_finite()).collect())
}
