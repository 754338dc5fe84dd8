//! The starts of the searches: a Latin hypercube in the scale of each unknown.

use crate::optimize::{LeastSquares, Linearization};
use crate::parameter::{Parameter, Prior, Transform};
use crate::problem::{Objective, Role};
use crate::random::Random;
use statrs::distribution::{ContinuousCDF, Normal};

/// How far a start without bounds or prior is drawn to either side, as a factor.
const REACH: f64 = 10.0;
/// Bounds of one sign whose ratio is at least this are a range of magnitudes.
const DECADE: f64 = 10.0;
const SEED: u64 = 0x5354_4152_5453;

/// The coordinates of `count` starts, the declared one first.
pub(super) fn starts(plain: &Objective<'_>, count: usize) -> Vec<Vec<f64>> {
    let unknowns = &plain.problem.unknowns;
    let declared = unknowns.start();
    let others = count - 1;
    let mut starts = vec![declared.clone(); count];
    let sizes = sizes(plain, &declared);
    for (i, (unknown, bounds)) in unknowns.row.iter().zip(unknowns.bounds()).enumerate() {
        let Parameter { lower, upper, prior, transform, .. } = unknown.parameter;
        let open = !(lower.is_finite() && upper.is_finite());
        if matches!(unknown.role, Role::InitialState(_)) && prior.is_none() && open {
            continue;
        }
        let mut random = Random::stream(SEED, i as u64);
        for (start, part) in starts[1..].iter_mut().zip(strata(others, &mut random)) {
            let value = drawn(&unknown.parameter, part, sizes[i]);
            start[i] = transform.to_coordinate(value).max(bounds.0).min(bounds.1);
        }
    }
    starts
}

/// One number of each of `n` strata of zero to one, in random order.
fn strata(n: usize, random: &mut Random) -> Vec<f64> {
    let mut order: Vec<usize> = (0..n).collect();
    for i in (1..n).rev() {
        order.swap(i, random.below(i + 1));
    }
    order.into_iter().map(|stratum| (stratum as f64 + random.uniform()) / n as f64).collect()
}

/// The change of each unknown that alone changes the prediction by the errors at the declared start; looked at only where an
/// unknown starts at zero.
fn sizes(plain: &Objective<'_>, declared: &[f64]) -> Vec<f64> {
    let size = |linear: &Linearization| {
        let left = linear.sum_of_squares().sqrt();
        let size = |norm: f64| if norm > 0.0 { left / norm } else { 0.0 };
        linear.column_norms().into_iter().map(size).collect::<Vec<f64>>()
    };
    let found = declared.contains(&0.0).then(|| plain.linearize(declared).ok()).flatten();
    found.as_ref().map_or(vec![0.0; declared.len()], size)
}

/// The value at a part (0 to 1) of what is known of a parameter.
fn drawn(parameter: &Parameter, part: f64, size: f64) -> f64 {
    let Parameter { start, upper, prior, transform, .. } = *parameter;
    let is_log = transform == Transform::Log;
    let lower = if is_log || parameter.positive { parameter.lower.max(0.0) } else { parameter.lower };
    let between = |low: f64, high: f64| low + part * (high - low);
    let geometric = |low: f64, high: f64| low * (high / low).powf(part);
    let whole = lower.is_finite() && upper.is_finite();
    let spans = |small: f64, large: f64| small > 0.0 && (is_log || large / small >= DECADE);
    if let Some(prior) = prior {
        return quantile(prior, lower, upper, part).unwrap_or(start);
    }
    if whole && spans(lower, upper) {
        geometric(lower, upper)
    } else if whole && spans(-upper, -lower) {
        -geometric(-lower, -upper)
    } else if whole && !is_log {
        between(lower, upper)
    } else if start > 0.0 {
        geometric((start / REACH).max(lower), (start * REACH).min(upper))
    } else if start < 0.0 {
        -geometric((-start / REACH).max(-upper), (-start * REACH).min(-lower))
    } else {
        between(lower.max(-size), upper.min(size))
    }
}

/// The quantile of a prior that is cut off at bounds; `None` where they leave next to nothing of it.
fn quantile(prior: Prior, lower: f64, upper: f64, part: f64) -> Option<f64> {
    let normal = Normal::new(prior.mean, prior.std).ok()?;
    let (below, above) = (normal.cdf(lower), normal.cdf(upper));
    let value = normal.inverse_cdf(below + part * (above - below));
    (above - below > 1e-12 && value.is_finite()).then_some(value)
}
