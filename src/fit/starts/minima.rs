//! Which ends of searches are the same minimum, and which is the best.

use super::NoEnd;
use crate::covariance::{SearchEnd, in_null_directions};
use crate::estimate::{FailedStart, Minimum, Starts};
use crate::optimize::{LeastSquares, Linearization, Outcome};
use crate::problem::{Noise, Objective, each, noise};

/// Costs that differ by less than this part are the same.
const SAME_COST: f64 = 1e-6;
/// Unknowns that differ by less than this part of a standard error are the same, or by less than this part of themselves.
const SAME_ERRORS: f64 = 0.1;
const SAME_DIGITS: f64 = 1e-6;

/// How the costs of ends with different noise levels compare.
pub(super) struct Comparison {
    /// Sets of outputs measured together, and at how many samples; where noise levels are estimated.
    measured: Vec<(Vec<usize>, f64)>,
    /// Measurements where costs are logarithms of likelihoods; `None` where they are sums.
    likelihood: Option<f64>,
}

impl Comparison {
    pub fn new(plain: &Objective<'_>) -> Self {
        let records = &plain.problem.records;
        let here = |e: usize, k: usize| -> Vec<usize> {
            (0..plain.outputs()).filter(|&j| !records[e].outputs()[j].values[k].is_nan()).collect()
        };
        let predicted = plain.problem.settings.noise == Noise::Predicted;
        let mut measured: Vec<(Vec<usize>, f64)> = vec![];
        if predicted || noise::is_estimated(plain) {
            let samples = (0..records.len()).flat_map(|e| (0..records[e].len()).map(move |k| (e, k)));
            for (e, k) in samples.filter(|&(e, k)| plain.weight(e, k) > 0.0) {
                let outputs = here(e, k);
                match measured.iter_mut().find(|(set, _)| *set == outputs) {
                    Some((_, count)) => *count += 1.0,
                    None => measured.push((outputs, 1.0)),
                }
            }
        }
        let count = measured.iter().map(|(outputs, count)| outputs.len() as f64 * count).sum::<f64>();
        let likelihood = (!measured.is_empty()).then_some(count.max(1.0));
        if predicted {
            measured.clear();
        }
        Comparison { measured, likelihood }
    }

    /// The cost of this objective, with the logarithm of its noise levels.
    pub fn level(&self, objective: &Objective<'_>, cost: f64) -> f64 {
        let sets = self.measured.iter();
        cost + sets.map(|(here, count)| 0.5 * count * objective.whitening.log_determinant(here)).sum::<f64>()
    }

    /// How large one level is relative to another; at most `f64::MAX`.
    pub fn ratio(&self, level: f64, best: f64) -> f64 {
        let ratio = match self.likelihood {
            Some(count) => (2.0 * (level - best) / count).exp(),
            None if level == best => 1.0,
            None => level / best,
        };
        ratio.min(f64::MAX)
    }
}

/// The end of a search, with slopes and comparable cost there.
pub(super) struct End<'s> {
    pub search: &'s SearchEnd,
    linear: Linearization,
    pub level: f64,
}

impl<'s> End<'s> {
    pub fn new(plain: &Objective<'_>, comparison: &Comparison, search: &'s SearchEnd) -> Option<Self> {
        let objective = plain.with(search.whitening.clone());
        let linear = search.linear.clone().or_else(|| objective.linearize(&search.coordinates).ok())?;
        let level = comparison.level(&objective, linear.cost);
        level.is_finite().then_some(End { search, linear, level })
    }

    fn is_minimum(&self) -> bool {
        self.search.outcome.converged()
    }

    /// By how much costs at this end may differ from what they would be without rounding and tolerances, as a part.
    fn tolerance(&self) -> f64 {
        match self.search.outcome {
            Outcome::Rough { noise, .. } => noise.max(SAME_COST),
            _ => SAME_COST,
        }
    }

    /// Whether another end, not a better one, has the same cost.
    fn costs_as_much_as(&self, other: &End<'_>, comparison: &Comparison) -> bool {
        other.cost_ratio(self, comparison) <= 1.0 + self.tolerance().max(other.tolerance())
    }

    /// Ratio of its cost to that of another end; one where both costs are rounding.
    fn cost_ratio(&self, to: &End<'_>, comparison: &Comparison) -> f64 {
        let are_rounding = [self, to].iter().all(|end| end.search.outcome == Outcome::Exact);
        if are_rounding { 1.0 } else { comparison.ratio(self.level, to.level) }
    }

    /// Whether another end of the same cost is at the same place, along what the data determine to first order; the unknowns
    /// that they leave undetermined may be anywhere.
    fn is_at(&self, other: &End<'_>, undetermined: &[usize]) -> bool {
        let (x, other) = (&self.search.coordinates, &other.search.coordinates);
        let mut step: Vec<f64> = other.iter().zip(x).map(|(b, a)| b - a).collect();
        undetermined.iter().for_each(|&j| step[j] = 0.0);
        let slope: f64 = self.linear.gradient().iter().zip(&step).map(|(g, d)| g * d).sum();
        // Norm of the change of the predictions.
        let change = (-2.0 * (slope + self.linear.predicted_reduction(&step))).max(0.0).sqrt();
        let sigma = (self.linear.sum_of_squares() / self.linear.rows().max(1) as f64).sqrt();
        let digits: f64 = self.linear.column_norms().iter().zip(x).map(|(norm, x)| norm * x.abs()).sum();
        is_small(change, sigma, digits)
    }
}

/// Whether a change of the predictions is no more than the same place found twice: against a standard deviation of the errors,
/// and against what the digits of the unknowns move the predictions by.
fn is_small(change: f64, sigma: f64, digits: f64) -> bool {
    change <= SAME_ERRORS * sigma + SAME_DIGITS * digits
}

/// Whether values differ by more than their last digits.
fn differ(values: impl Iterator<Item = f64>) -> bool {
    let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
    high - low > SAME_DIGITS * low.abs().max(high.abs())
}

/// Ends that are one minimum.
struct Kind<'e> {
    /// Which searches; that of the lowest cost first, at last that of the first start.
    searches: Vec<usize>,
    first: &'e End<'e>,
    /// The unknowns that the data do not determine at the first end.
    undetermined: Vec<usize>,
}

impl Kind<'_> {
    /// Whether an end of no lower cost is this minimum. Undetermined unknowns are not compared: along a curve of equal cost,
    /// such as that of a constant product, a first-order comparison would call each end another minimum.
    fn holds(&self, end: &End<'_>, comparison: &Comparison) -> bool {
        self.first.costs_as_much_as(end, comparison) && self.first.is_at(end, &self.undetermined)
    }

    /// The undetermined unknowns whose values differ between the ends.
    fn differing(&self, found: &[Option<End<'_>>], values: impl Fn(&[f64]) -> Vec<f64>) -> Vec<usize> {
        let ends = self.searches.iter().filter_map(|&i| found[i].as_ref());
        let values: Vec<Vec<f64>> = ends.map(|end| values(&end.search.coordinates)).collect();
        let differs = |j: &usize| differ(values.iter().map(|values| values[*j]));
        self.undetermined.iter().copied().filter(differs).collect()
    }
}

/// The minima among ends in this order of their costs.
fn kinds<'e>(comparison: &Comparison, ends: impl Iterator<Item = (usize, &'e End<'e>)>) -> Vec<Kind<'e>> {
    let mut kinds: Vec<Kind<'e>> = vec![];
    for (i, end) in ends {
        match kinds.iter_mut().find(|kind| kind.holds(end, comparison)) {
            Some(kind) => kind.searches.push(i),
            None => kinds.push(Kind { searches: vec![i], first: end, undetermined: in_null_directions(&end.linear) }),
        }
    }
    // The end reported for a minimum is that of its lowest numbered start, so that of the declared start where it ended there.
    kinds.iter_mut().for_each(|kind| kind.searches.sort_unstable());
    kinds
}

/// Results of the searches: the ends in the order of the starts, each a search or why there is none.
pub(super) fn found(
    plain: &Objective<'_>,
    starts: &[Vec<f64>],
    ends: &[Result<SearchEnd, NoEnd>],
) -> Option<(usize, Starts)> {
    let comparison = Comparison::new(plain);
    let ended = |i: usize| End::new(plain, &comparison, ends[i].as_ref().ok()?);
    let found: Vec<Option<End<'_>>> = each(ends.len(), ended);
    let mut order: Vec<usize> = (0..ends.len()).filter(|&i| found[i].is_some()).collect();
    let level = |i: usize| found[i].as_ref().map_or(f64::INFINITY, |end| end.level);
    order.sort_by(|&a, &b| level(a).total_cmp(&level(b)));
    let minimum = |i: &usize| found[*i].as_ref().is_some_and(End::is_minimum);
    let lowest = *order.first()?;
    // A search that found no minimum is the best only if it is lower by more than rounding.
    let best =
        order.iter().copied().find(minimum).filter(|&i| comparison.ratio(level(i), level(lowest)) <= 1.0 + SAME_COST);
    let mut best = best.unwrap_or(lowest);
    let ended = order.iter().filter(|i| minimum(i)).filter_map(|&i| Some((i, found[i].as_ref()?)));
    let mut kinds = kinds(&comparison, ended);
    let (names, values) = (plain.names(), |x: &[f64]| plain.problem.unknowns.values(x));
    // Of minima with the same cost, such as mirror images, one whose values have the signs that were declared comes first, and of these that to which the
    // declared start leads.
    let has_signs = |kind: &Kind<'_>| {
        let end = found[kind.searches[0]].as_ref();
        end.is_some_and(|end| plain.problem.unknowns.have_declared_signs(values(&end.search.coordinates)))
    };
    let as_good = |kind: &Kind<'_>| kind.first.cost_ratio(kinds[0].first, &comparison) <= 1.0 + SAME_COST;
    let rank = |kind: &Kind<'_>| (!has_signs(kind), !kind.searches.contains(&0));
    let places = kinds.iter().enumerate().filter(|(_, kind)| as_good(kind));
    if let Some((place, _)) = places.min_by_key(|(_, kind)| rank(kind))
        && kinds[0].searches.contains(&best)
    {
        kinds[..=place].rotate_right(1);
        best = kinds[0].searches[0];
    }
    let of_best = kinds.iter().find(|kind| kind.searches.contains(&best));
    let best = of_best.map_or(best, |kind| kind.searches[0]);
    let agreed = of_best.map_or(0, |kind| kind.searches.len()) as u64;
    let named = |x: &[f64]| names.iter().cloned().zip(values(x)).collect::<Vec<_>>();
    let minima = kinds.iter().filter_map(|kind| {
        let end = found[kind.searches[0]].as_ref()?;
        Some(Minimum {
            cost_ratio: end.cost_ratio(found[best].as_ref()?, &comparison),
            searches: kind.searches.len() as u64,
            undetermined: kind.differing(&found, values).into_iter().map(|j| names[j].clone()).collect(),
            unknowns: named(&end.search.coordinates),
        })
    });
    let failed = starts.iter().zip(ends).filter_map(|(start, end)| {
        let NoEnd { evaluated, reason } = match end {
            Ok(end) if end.outcome.converged() => return None,
            Ok(end) => NoEnd::new(true, end.outcome.to_string()),
            Err(none) => none.clone(),
        };
        Some(FailedStart { start: named(start), evaluated, reason })
    });
    let evaluations = ends.iter().flatten().map(|end| end.evaluations).sum();
    let declared = kinds.iter().position(|kind| kind.searches.contains(&0));
    let starts = Starts {
        tried: starts.len() as u64,
        agreed,
        minima: minima.collect(),
        declared,
        failed: failed.collect(),
        evaluations,
    };
    Some((best, starts))
}

#[cfg(test)]
mod tests;
