//! From the end of a search to a [`Summary`].

use super::checks::examine;
use super::evidence::Evidence;
use super::intervals::Intervals;
use super::summary;
use crate::covariance::point::{Point, SearchEnd};
use crate::error::Error;
use crate::estimate::{Format, Summary, Version};
use crate::information::Covariance;
use crate::optimize::Outcome;
use crate::problem::{Objective, Whitening};
use crate::residuals::{Residuals, reason, residual_pass};

/// The summary at the end of a search; the objective has the whitening that it ended with. Cost, slopes and residuals there are computed
/// whatever the objective's stop conditions. These end every further pass, and a warning tells that something was left out.
pub(crate) fn conclude(objective: &Objective<'_>, end: &SearchEnd, seconds: f64) -> Result<Summary, Error> {
    let residuals = residual_pass(&objective.unlimited(), &end.coordinates)?;
    conclude_from(objective, end, residuals, seconds)
}

/// The same from the residuals there.
pub(crate) fn conclude_from(
    objective: &Objective<'_>,
    end: &SearchEnd,
    residuals: Residuals,
    seconds: f64,
) -> Result<Summary, Error> {
    let exact;
    let end = match end.outcome.converged() && residuals.is_rounding() {
        true => {
            exact = SearchEnd { outcome: Outcome::Exact, ..end.clone() };
            &exact
        }
        false => end,
    };
    let evaluated;
    let linear = match &end.linear {
        Some(linear) => linear,
        None => {
            evaluated = objective.unlimited().evaluate(&end.coordinates).map_err(reason)?;
            &evaluated
        }
    };
    let point = Point::new(objective, end, linear, residuals.measured);
    let evidence = Evidence::new(point, residuals);
    let intervals = Intervals::of(&evidence);
    let (warnings, examined) = examine(&evidence, &intervals);
    let noise = summary::noise(&evidence)?;
    let problem = objective.problem;
    let measurements = evidence.residuals.measured;
    let Intervals { covariances, unknowns, directions, .. } = intervals;
    Ok(Summary {
        format: Format,
        version: Version,
        layout: problem.layout().clone(),
        parameters: summary::parameters(&evidence, &unknowns),
        experiments: summary::experiments(&evidence.point),
        outputs: summary::outputs(&evidence, &noise),
        deviance: summary::deviance(&evidence),
        covariance: covariances.unknowns.unwrap_or_else(|| Covariance::zeros(unknowns.len())),
        unknowns,
        noise_covariance: match noise {
            Whitening::Full { covariance, .. } => Some(covariance),
            Whitening::Diagonal(_) => None,
        },
        directions,
        outcome: end.outcome,
        starts: end.starts.clone(),
        warnings,
        examined,
        cost: linear.cost,
        measurements,
        iterations: end.iterations,
        evaluations: end.evaluations + u64::from(end.linear.is_none()),
        seconds,
        method: summary::method(objective, end.name.clone(), covariances.method),
    })
}
