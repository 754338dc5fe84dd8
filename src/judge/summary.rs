//! The parts of a [`Summary`](crate::estimate::Summary) beside the unknowns: parameters, experiments, outputs, noise, method.

use crate::covariance::point::Point;
use crate::error::Error;
use crate::estimate::{
    CovarianceMethod, ExperimentEstimate, Knowledge, Method, NoiseModel, OutputEstimate, ParameterEstimate, Unknown,
};
use crate::judge::evidence::Evidence;
use crate::layout::Quantity;
use crate::problem::{Noise, Objective, Role, Whitening, noise};
use crate::residuals::reason;

pub(super) fn method(objective: &Objective<'_>, optimizer: String, covariance: CovarianceMethod) -> Method {
    let (settings, sweep) = (&objective.problem.settings, objective.sweep);
    let or = |said: Option<String>, other: &str| said.unwrap_or_else(|| other.to_owned());
    Method {
        optimizer,
        integrator: sweep.integrator(),
        refinement: objective.problem.method,
        predictor: sweep.predictor(),
        engine: sweep.engine(),
        loss: or(settings.loss.as_ref().map(|loss| loss.describe()), "squared"),
        weighting: or(settings.weights.as_ref().map(|weights| weights.describe()), "none"),
        prefilter: or(settings.prefilter.as_ref().map(|filter| filter.describe()), "none"),
        noise: match &settings.noise {
            Noise::Given(_) => NoiseModel::Given,
            Noise::SomeGiven(sigma) => NoiseModel::SomeGiven(sigma.iter().flatten().count()),
            Noise::PerOutput => NoiseModel::PerOutput,
            Noise::Covariance => NoiseModel::Covariance,
            Noise::Predicted => NoiseModel::Predicted,
        },
        covariance,
        version: env!("CARGO_PKG_VERSION").to_owned(),
    }
}

pub(crate) fn parameters(evidence: &Evidence<'_>, unknowns: &[Unknown]) -> Vec<ParameterEstimate> {
    let (problem, x) = (evidence.point.objective.problem, &evidence.point.end.coordinates);
    let first = problem.unknowns.of_experiment(0, x);
    let one = |(j, Quantity { name, unit }): (usize, &Quantity)| ParameterEstimate {
        name: name.clone(),
        unit: unit.clone(),
        value: first.p[j],
        knowledge: unknowns
            .iter()
            .find(|unknown| unknown.role == Role::Parameter(j))
            .map_or(Knowledge::Fixed, |unknown| unknown.knowledge),
        declared: problem.parameters()[j],
    };
    problem.layout().parameters.iter().enumerate().map(one).collect()
}

pub(crate) fn experiments(point: &Point<'_>) -> Vec<ExperimentEstimate> {
    let problem = point.objective.problem;
    let one = |e: usize| {
        let values = point.objective.values_of(e, &point.end.coordinates);
        ExperimentEstimate {
            name: problem.unknowns.labels[e].clone(),
            samples: problem.records[e].len() as u64,
            parameters: values.p,
            initial_state: values.x,
        }
    };
    (0..problem.records.len()).map(one).collect()
}

/// The noise, corrected for the degrees of freedom of the unknowns.
pub(crate) fn noise(evidence: &Evidence<'_>) -> Result<Whitening, Error> {
    let objective = evidence.point.objective;
    // Weights enter the sum of squares, but are not part of the noise.
    if objective.is_weighted() && noise::only_scales(objective) {
        let found = noise::estimate(&objective.unlimited(), &evidence.point.end.coordinates).map_err(reason)?;
        return Ok(found.widened((evidence.residuals.measured as f64 / evidence.point.degrees.max(1.0)).sqrt()));
    }
    // The noise level of errors that are round-off is returned as computed, zero or not.
    let scale = (evidence.point.linear.sum_of_squares() / evidence.point.degrees.max(1.0)).sqrt();
    let widening = if noise::only_scales(objective) { scale } else { evidence.point.widening };
    Ok(match objective.whitening.widened(widening) {
        // What was given is no estimate.
        Whitening::Diagonal(sigma) => {
            let given = |(j, sigma)| objective.problem.settings.noise.given(j).unwrap_or(sigma);
            Whitening::Diagonal(sigma.into_iter().enumerate().map(given).collect())
        }
        full => full,
    })
}

pub(crate) fn outputs(evidence: &Evidence<'_>, noise: &Whitening) -> Vec<OutputEstimate> {
    let predicted = evidence.point.objective.sweep.predicts_variance();
    let outputs = evidence.point.objective.problem.layout().outputs.iter();
    let one = |((quantity, fit), sigma): ((&Quantity, &crate::estimate::OutputFit), f64)| {
        let sigma = if predicted { fit.rmse } else { sigma };
        let fit = crate::estimate::OutputFit { sigma, ..*fit };
        OutputEstimate { name: quantity.name.clone(), unit: quantity.unit.clone(), fit }
    };
    outputs.zip(&evidence.residuals.outputs).zip(noise.sigma()).map(one).collect()
}

/// `-2 ln` of the Gaussian likelihood; `None` with a weighting or a loss.
pub(crate) fn deviance(evidence: &Evidence<'_>) -> Option<f64> {
    let objective = evidence.point.objective;
    if objective.loss().is_some() || objective.is_weighted() {
        return None;
    }
    let (n, priors) =
        (evidence.residuals.measured as f64, objective.problem.unknowns.priors(&evidence.point.end.coordinates));
    let priors: f64 = priors.map(|(_, _, error)| error * error).sum();
    let log_determinant = evidence.residuals.log_determinant;
    let squares = match objective.sweep.predicts_variance() {
        true => 2.0 * evidence.point.linear.cost - log_determinant,
        false => evidence.point.linear.sum_of_squares(),
    };
    // Where the noise only scales the cost, the cost does not include its maximum-likelihood variance yet.
    let variance = if noise::only_scales(objective) { squares / n } else { 1.0 };
    let deviance = n * (std::f64::consts::TAU.ln() + variance.ln()) + log_determinant + (squares - priors) / variance;
    // Without any error the likelihood is unbounded.
    deviance.is_finite().then_some(deviance)
}

/// Half the deviance, with the sign changed; with a loss and predicted variances the errors' losses in place of half their squares.
pub(crate) fn log_likelihood(evidence: &Evidence<'_>) -> Option<f64> {
    let Point { objective, end, linear, .. } = &evidence.point;
    if let Some(deviance) = deviance(evidence) {
        return Some(-0.5 * deviance);
    }
    if objective.is_weighted() || !objective.sweep.predicts_variance() {
        return None;
    }
    let problem = objective.problem;
    let priors: f64 = problem.unknowns.priors(&end.coordinates).map(|(_, _, error)| 0.5 * error * error).sum();
    let (n, log_determinant) = (evidence.residuals.measured as f64, evidence.residuals.log_determinant);
    // The cost has the logarithms of the variances times the mean of `psi(z) z`, with which noise levels are consistent.
    let losses = linear.cost - priors - 0.5 * problem.kappa * log_determinant;
    let found = -losses - 0.5 * log_determinant - 0.5 * n * std::f64::consts::TAU.ln();
    found.is_finite().then_some(found)
}
