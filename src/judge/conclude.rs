//! From the end of a search to a [`Summary`].

use super::checks::examine;
use super::evidence::Evidence;
use super::intervals::Intervals;
use super::summary;
use crate::covariance::point::{Point, SearchEnd};
use crate::error::Error;
use crate::estimate::{Format, Summary, Version};
use crate::information::Covariance;
use crate::optimize::{Linearization, Outcome};
use crate::problem::{At, Objective, Whitening};
use crate::residuals::{Residuals, reason, residual_pass, residuals_together};
use std::borrow::Cow;

/// The summary at the end of a search; the objective has the whitening that it ended with. Cost, slopes and residuals there are computed
/// whatever the objective's stop conditions. These end every further pass, and a warning tells that something was left out.
pub(crate) fn conclude(objective: &Objective<'_>, end: &SearchEnd, seconds: f64) -> Result<Summary, Error> {
    let residuals = residual_pass(&objective.unlimited(), &end.coordinates)?;
    let ended = Ended::new(objective, end, &residuals)?;
    summary_of(&ended.evidence(residuals), seconds)
}

/// The summaries of several searches over one record each, whose passes run in parallel lanes.
pub(crate) fn conclude_together(ends: &[(&Objective<'_>, &SearchEnd)], seconds: f64) -> Vec<Result<Summary, Error>> {
    let points: Vec<At<'_>> = ends.iter().map(|(objective, end)| (*objective, &end.coordinates[..])).collect();
    let residuals = residuals_together(&points);
    let ended = residuals
        .iter()
        .zip(ends)
        .map(|(residuals, (objective, end))| Ended::new(objective, end, residuals.as_ref()?).ok());
    let ended: Vec<Option<Ended<'_>>> = ended.collect();
    let evidence = ended.iter().zip(residuals).map(|(ended, residuals)| Some(ended.as_ref()?.evidence(residuals?)));
    let evidence: Vec<Option<Evidence<'_>>> = evidence.collect();
    Evidence::pass_together(&evidence.iter().flatten().collect::<Vec<_>>());
    // One that fails here is concluded alone, which tells why.
    let summaries = evidence.iter().zip(ends).map(|(evidence, (objective, end))| match evidence {
        Some(evidence) => summary_of(evidence, seconds),
        None => conclude(objective, end, seconds),
    });
    summaries.collect()
}

/// The end of a search, with its slopes.
struct Ended<'e> {
    objective: &'e Objective<'e>,
    end: Cow<'e, SearchEnd>,
    linear: Cow<'e, Linearization>,
}

impl<'e> Ended<'e> {
    fn new(objective: &'e Objective<'e>, end: &'e SearchEnd, residuals: &Residuals) -> Result<Self, Error> {
        let linear = match &end.linear {
            Some(linear) => Cow::Borrowed(linear),
            None => Cow::Owned(objective.unlimited().evaluate(&end.coordinates).map_err(reason)?),
        };
        let exact = end.outcome.converged() && residuals.is_rounding();
        let end = match exact {
            true => Cow::Owned(SearchEnd { outcome: Outcome::Exact, ..end.clone() }),
            false => Cow::Borrowed(end),
        };
        Ok(Ended { objective, end, linear })
    }

    fn evidence(&self, residuals: Residuals) -> Evidence<'_> {
        Evidence::new(Point::new(self.objective, &self.end, &self.linear, residuals.measured), residuals)
    }
}

fn summary_of(evidence: &Evidence<'_>, seconds: f64) -> Result<Summary, Error> {
    let Point { objective, end, linear, .. } = &evidence.point;
    let intervals = Intervals::of(evidence);
    let (warnings, examined) = examine(evidence, &intervals);
    let noise = summary::noise(evidence)?;
    let problem = objective.problem;
    let measurements = evidence.residuals.measured;
    let Intervals { covariances, unknowns, directions, .. } = intervals;
    Ok(Summary {
        format: Format,
        version: Version,
        layout: problem.layout().clone(),
        parameters: summary::parameters(evidence, &unknowns),
        experiments: summary::experiments(&evidence.point),
        outputs: summary::outputs(evidence, &noise),
        deviance: summary::deviance(evidence),
        log_likelihood: summary::log_likelihood(evidence),
        covariance: covariances.unknowns.unwrap_or_else(|| Covariance::zeros(unknowns.len())),
        unknowns,
        noise_covariance: match noise {
            Whitening::Full { covariance, .. } => Some(covariance),
            Whitening::Diagonal(_) => None,
        },
        directions,
        derived: vec![],
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
