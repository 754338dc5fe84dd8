//! Whether an equation lacks a term in the state or the inputs: what a filter takes for process noise, a simulation for noise of measurements.

use super::*;
use crate::parameter::free;
use crate::problem::{Accumulate, Free, Problem};
use crate::sweep::{Sweep, Window};
use statrs::distribution::{ContinuousCDF, Normal};
use std::collections::HashMap;
use std::sync::Arc;

pub(crate) const MISSING_TERMS: Check = Check::new(
    "equations lack no term",
    "Does the likelihood ask for a term in a derivative (next state): a constant, a state, an input, their squares or cubes, in a simulation their \
     signs (score tests, Rao 1948, beside all unknowns)? Of a filter in what process noise acts on; of a simulation where a parameter stands (32 terms at \
     the most), if its errors are correlated over time or with the prediction. By how many standard errors would an unknown move with it?",
    &[WarningCode::MissingTerm],
    missing_terms,
)
.costs(&[Pass::Slopes(2)])
.levels(&[
    level("chance of such a correlation of a simulation's errors", REASON, "a tenth: the pass has many columns"),
    level("the same of up to 1,000 measurements", REASON_OF_SHORT, "other tests see less there, and the pass takes a millisecond"),
    level("the states of a model that is examined", MOST as f64, "the slopes of a covariance grow by the third power"),
    level("chance of the largest of the terms", LEVEL, "one good record in a thousand"),
    level("chance of one that moves an unknown by two standard errors, from which on care is needed", LIKELY, "one in a hundred"),
    level("standard errors from which on care is needed", CARE, "half of one: intervals of 95 % then cover 92 %"),
    level("standard errors from which on intervals mean nothing", FAR, "two: they cover half"),
    level("the part of an unknown of a simulation that has to move, too", PART, "a quarter"),
]);

const REASON: f64 = 0.1;
/// Up to so many measurements are few.
const SHORT: u64 = 1_000;
const REASON_OF_SHORT: f64 = 0.3;

const MOST: usize = 6;
const LEVEL: f64 = 1e-3;
const LIKELY: f64 = 1e-2;
const CARE: f64 = 0.5;
const FAR: f64 = 2.0;
const PART: f64 = 0.25;
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
    /// By which part of itself it moves.
    part: f64,
    /// By how much each unknown moves beside a factor of one.
    beside: Vec<f64>,
}

impl Asked {
    /// What it means, beside so many others.
    fn severity(&self, terms: usize, filtered: bool) -> Severity {
        match 2.0 * Normal::standard().sf(self.errors) * terms as f64 {
            ..LEVEL if self.moved >= FAR && (filtered || self.part >= PART) => Severity::NotUsable,
            ..LEVEL if self.moved >= CARE => Severity::UsableWithCare,
            ..LIKELY if self.moved >= FAR => Severity::UsableWithCare,
            _ => Severity::Usable,
        }
    }
}

fn missing_terms(evidence: &Evidence<'_>, intervals: &Intervals) -> Examined {
    let objective = evidence.point.objective;
    let (states, filtered) = (&objective.problem.layout().states, objective.sweep.predicts_variance());
    if states.is_empty() || objective.sweep.restarts().is_some() {
        return Examined::from(None);
    }
    if !filtered && let Some(reason) = evidence.ruled_out(OF_SIMULATIONS) {
        return Examined::from(None).without(Some(reason));
    }
    if !filtered && !gives_reason(evidence) {
        return Examined::from(None);
    }
    if states.len() > MOST {
        return Examined::from(None).without(Some("models of more than 6 states"));
    }
    if !filtered && !objective.problem.runs_in_lanes() {
        return Examined::from(None).without(Some("simulations that are not run as programs of fixed steps"));
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
    let asked = asked.into_iter().map(|asked| (asked.severity(count, filtered), asked));
    let told = asked.filter(|(severity, _)| *severity > Severity::Usable);
    let worst = told.max_by(|(a, one), (b, other)| a.cmp(b).then(one.errors.total_cmp(&other.errors)));
    let warning = worst.map(|(severity, asked)| {
        let term = &made.terms[asked.term];
        let (state, by, compare) = match filtered {
            true => ("what is taken for process noise of `", "follows", ", or compare with a simulation"),
            false => ("the errors contain what a term would make that is missing in the equation of `", "and follows", ""),
        };
        let part = if asked.part.is_finite() { format!(" ({} of itself)", percent(asked.part, 2)) } else { String::new() };
        let text = format!(
            "{state}{}` {by} {} ({} standard errors): its equation may lack such a term, with which `{}` would change by {} standard \
             errors{part}; write the term into the model, with a parameter{compare}",
            states[term.state].name,
            term.what,
            number(asked.errors, 2),
            intervals.unknowns[asked.unknown].name,
            number(asked.moved, 2)
        );
        Warning::new(WarningCode::MissingTerm, severity, text).about(About::Unknown(asked.unknown))
    });
    Examined::from(warning).without(left_out.filter(|_| filtered))
}

/// What rules out a simulation.
const OF_SIMULATIONS: &[Unless] = &[Unless::RoundOff, Unless::Prefilter, Unless::Weighed, Unless::NoMinimum];

/// Whether the errors of a simulation may be correlated with the prediction, or over time.
fn gives_reason(evidence: &Evidence<'_>) -> bool {
    let (residuals, outputs) = (&evidence.residuals, evidence.point.objective.outputs() as f64);
    let reason = if residuals.measured > SHORT { REASON } else { REASON_OF_SHORT };
    let follows = residuals.shape.iter().any(|chance| chance * outputs < reason);
    follows || evidence.autocorrelated_at(reason).is_some()
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
    let settings = of.settings.beside(of.settings.noise.clone());
    let problem = Problem::new(sweep, of.records.clone(), &parameters, settings).ok()?;
    // Each unknown of the fit is one of this problem, too; the factors of the terms are zero.
    let key = |free: &Free| (free.role, free.experiment);
    let known: HashMap<_, usize> = of.unknowns.row.iter().enumerate().map(|(i, free)| (key(free), i)).collect();
    let row = &problem.unknowns.row;
    let from: Vec<Option<usize>> = row.iter().map(|free| known.get(&key(free)).copied()).collect();
    let coordinates: Vec<f64> = from.iter().map(|i| i.map_or(0.0, |i| evidence.point.end.coordinates[i])).collect();
    let linear = objective.of(&problem, &*problem.sweep).evaluate(&coordinates).ok()?;
    let widening = evidence.point.widening;
    let same = (linear.cost - evidence.point.linear.cost).abs() <= STEPPED * widening * widening;
    if !same {
        return None;
    }
    let known = |i: usize| intervals.unknowns[i].knowledge.standard_error();
    let held: Vec<bool> = from.iter().map(|i| i.is_none_or(|i| known(i).is_none())).collect();
    let norms = linear.column_norms();
    let without = linear.step(&vec![0.0; row.len()], &held)?;
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
            Some((change / unknown.knowledge.standard_error()?, (*i)?, change / unknown.value.abs()))
        };
        let (moved, unknown, part) = from.iter().enumerate().filter_map(moved).max_by(|a, b| a.0.total_cmp(&b.0))?;
        Some(Asked {
            term: number.checked_sub(first)?,
            errors: (step[at] / (error * widening)).abs(),
            moved,
            unknown,
            part,
            beside: step.iter().zip(&without).map(|(with, without)| (with - without) / step[at]).collect(),
        })
    };
    let asked = (0..row.len()).filter(|at| from[*at].is_none()).filter_map(ask);
    let asked = asked.filter(|asked| asked.errors.is_finite() && asked.moved.is_finite());
    if evidence.point.objective.sweep.predicts_variance() {
        return Some(asked.collect());
    }
    let told = asked.filter(|asked| asked.severity(terms, false) > Severity::Usable).collect();
    by_sizes(evidence, &objective.of(&problem, &*problem.sweep), &coordinates, told)
}

/// The terms of a simulation, with larger standard errors where its errors are larger at the samples where the term acts (White, Econometrica 48
/// (1980) 817), or are colored. It takes one more pass with slopes, if there is a term.
fn by_sizes(
    evidence: &Evidence<'_>,
    objective: &Objective<'_>,
    coordinates: &[f64],
    mut told: Vec<Asked>,
) -> Option<Vec<Asked>> {
    if told.is_empty() {
        return Some(told);
    }
    let of = |e: usize, beside: &[f64]| objective.problem.unknowns.columns(e).map(|i| beside[i]).collect();
    let make = |e: usize| Sizes { of: told.iter().map(|one| (of(e, &one.beside), [0.0; 4])).collect() };
    let mut all = objective.gather(coordinates, true, make).ok()?.into_iter();
    let mut sums = all.next()?;
    all.for_each(|one| sums.append(one));
    let inflation = if evidence.uses_hac() { evidence.most_inflation() } else { 1.0 };
    for (asked, (_, [products, squares, errors, count])) in told.iter_mut().zip(sums.of) {
        let larger = products * count / (squares * errors);
        asked.errors /= (larger.max(1.0) * inflation).sqrt();
    }
    Some(told)
}

/// For each term: the coefficients of all columns that give the part `z` of its column which is orthogonal to the unknowns, and the sums over all
/// measurements of `e^2 z^2`, `z^2`, `e^2` and 1, of errors `e`.
struct Sizes {
    of: Vec<(Vec<f64>, [f64; 4])>,
}

impl Accumulate for Sizes {
    fn add(&mut self, window: &Window, lane: usize) {
        for (k, j) in (0..window.samples[lane]).flat_map(|k| (0..window.outputs()).map(move |j| (k, j))) {
            if !window.is_measured(k, j, lane) {
                continue;
            }
            let error = window.error(k, j, lane).powi(2);
            for (factors, sums) in &mut self.of {
                let z: f64 = factors.iter().enumerate().map(|(c, factor)| factor * window.at(k, j, c, lane)).sum();
                let terms = [error * z * z, z * z, error, 1.0];
                sums.iter_mut().zip(terms).for_each(|(sum, term)| *sum += term);
            }
        }
    }

    fn append(&mut self, later: Self) {
        for ((_, sums), (_, later)) in self.of.iter_mut().zip(later.of) {
            sums.iter_mut().zip(later).for_each(|(sum, later)| *sum += later);
        }
    }
}
