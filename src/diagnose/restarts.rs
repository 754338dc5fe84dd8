//! Restarts: whether a search from elsewhere ends in a better minimum.

use super::{Pinned, check_complete, minimize};
use crate::error::Error;
use crate::estimate::Summary;
use crate::optimize::{LeastSquares, Severity};
use crate::parameter::Transform;
use crate::problem::{Problem, each};
use crate::random::Random;
use serde::{Deserialize, Serialize};
use std::time::Instant;

/// What searches from other starts found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Restarts {
    /// Searches started.
    pub tried: u64,
    /// Those that could not be simulated at their start or did not end.
    pub failed: u64,
    /// Those that came back to the estimate's cost.
    pub same: u64,
    /// Those that ended in a worse minimum.
    pub worse: u64,
    /// The best of those that ended in a better one.
    pub better: Option<Better>,
    /// How bad it is.
    pub severity: Severity,
    /// What it means.
    pub meaning: String,
}

/// A minimum better than the estimate's.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Better {
    /// Its sum of squares as a part of the estimate's.
    pub cost_ratio: f64,
    /// Names and values of the unknowns there.
    pub unknowns: Vec<(String, f64)>,
}

/// Costs that differ by less than this part are one minimum.
const SAME: f64 = 1e-6;

/// Searches again from `count` random places: within its bounds, if both are finite, else within a factor of `reach`
/// (above one) of the estimate, either sign kept; zero is moved by ten standard errors.
///
/// # Errors
/// A reach that is not above one, an estimate of another problem; a time limit or a flag that stops it.
pub fn restarts(
    problem: &Problem<'_>,
    estimate: &Summary,
    count: usize,
    reach: f64,
    seed: u64,
) -> Result<Restarts, Error> {
    if !(reach > 1.0 && reach.is_finite()) {
        return Err(Error::Option(format!("the reach of restarts is {reach}; it is a factor above one")));
    }
    let control = problem.control(Instant::now());
    let (objective, best) = problem.at_within(estimate, &control)?;
    let cost = objective.linearize(&best).map_err(|error| Error::Optimizer(error.to_string()))?.cost;
    let bounds = objective.bounds();
    let start = |attempt: usize| -> Vec<f64> {
        let mut random = Random::stream(seed, attempt as u64);
        estimate
            .unknowns
            .iter()
            .zip(&bounds)
            .zip(&best)
            .map(|((unknown, &(lower, upper)), &c)| {
                let part = random.uniform();
                let factor = reach.powf(2.0 * part - 1.0);
                let place = if lower.is_finite() && upper.is_finite() {
                    lower + part * (upper - lower)
                } else if unknown.transform == Transform::Log {
                    c + factor.ln()
                } else if c == 0.0 {
                    unknown.knowledge.standard_error().unwrap_or(1.0) * 20.0 * (part - 0.5)
                } else {
                    c * factor
                };
                place.clamp(lower, upper)
            })
            .collect()
    };
    let found = each(count, |attempt| minimize(Pinned { problem: &objective, bounds: bounds.clone() }, start(attempt)));
    check_complete(problem, &control, "the search from other starts")?;
    let mut result = Restarts {
        tried: count as u64,
        failed: 0,
        same: 0,
        worse: 0,
        better: None,
        severity: Severity::Usable,
        meaning: String::new(),
    };
    let mut lowest = cost * (1.0 - SAME);
    for end in found {
        match end {
            None => result.failed += 1,
            Some((place, found)) if found < lowest => {
                lowest = found;
                let named = |(u, &c): (&crate::estimate::Unknown, &f64)| (u.name.clone(), u.transform.to_value(c));
                let unknowns = estimate.unknowns.iter().zip(&place).map(named).collect();
                result.better = Some(Better { cost_ratio: found / cost, unknowns });
            }
            Some((_, found)) if found > cost * (1.0 + SAME) => result.worse += 1,
            Some(_) => result.same += 1,
        }
    }
    result.meaning = match &result.better {
        Some(better) => {
            result.severity = Severity::NotUsable;
            let places: Vec<String> =
                better.unknowns.iter().map(|(name, value)| format!("{name} = {value:.6}")).collect();
            format!(
                "the estimate is a wrong minimum: from another start the cost is {:.4} times as large, at {}; start there",
                better.cost_ratio,
                places.join(", ")
            )
        }
        None if result.same == 0 => {
            result.severity = Severity::UsableWithCare;
            "no other start came back to the estimate: it depends on where the search begins; start closer by, predict over \
             a shorter horizon, or give bounds"
                .to_owned()
        }
        None => {
            format!("{} of {count} searches from elsewhere came back to the estimate, none found better", result.same)
        }
    };
    Ok(result)
}
