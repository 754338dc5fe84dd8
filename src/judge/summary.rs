//! The parts of a [`Summary`](crate::estimate::Summary): unknowns and how well they are known, parameters, experiments, outputs, method.

use super::conclude::Judgement;
use super::covariances::Covariances;
use super::directions;
use super::known::is_error;
use super::residual_pass::reason;
use crate::error::Error;
use crate::estimate::student::Spread;
use crate::estimate::{
    CovarianceMethod, ExperimentEstimate, Knowledge, Method, NoiseModel, OutputEstimate, ParameterEstimate, Unknown,
};
use crate::information::Covariance;
use crate::layout::Quantity;
use crate::parameter::Transform;
use crate::problem::{Noise, Objective, Role, Whitening, noise};

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
        noise: match settings.noise {
            Noise::Given(_) => NoiseModel::Given,
            Noise::PerOutput => NoiseModel::PerOutput,
            Noise::Covariance => NoiseModel::Covariance,
            Noise::Predicted => NoiseModel::Predicted,
        },
        covariance,
        version: env!("CARGO_PKG_VERSION").to_owned(),
    }
}

impl Judgement<'_> {
    pub(super) fn unknowns(&self, covariances: &Covariances) -> Vec<Unknown> {
        let free = &self.objective.problem.unknowns.row;
        let root = self.linear.sum_of_squares().sqrt();
        let one = |i: usize| {
            let (unknown, value) = (&free[i], self.values[i]);
            let transform = unknown.parameter.transform;
            // The standard errors of unknowns that are not seen are zero.
            let known = |covariance: &Covariance| Some(covariance.standard_error(i)).filter(|error| is_error(*error));
            let error = covariances.unknowns.as_ref().filter(|_| self.has_noise()).and_then(known);
            let degrees_of_freedom = covariances.degrees[i];
            let knowledge = match (self.held_at[i], error) {
                (Some(bound), None) => Knowledge::Held { bound, end: None },
                (None, None) => Knowledge::Unidentified,
                (held, Some(standard_error)) => {
                    // Next to zero, where a logarithm has no width, in the unknown's own unit.
                    let (center, unit, transform) = match held {
                        Some(0.0) => (value, 1.0, Transform::Identity),
                        _ => (self.end.coordinates[i], self.slopes[i], transform),
                    };
                    let spread = Spread { standard_error: standard_error / unit, degrees: degrees_of_freedom };
                    let release = self.release[i] * self.slopes[i] / unit;
                    let (lower, upper) = spread.interval(center + release, transform, 0.95);
                    match held {
                        Some(bound) => {
                            let end = if bound == unknown.parameter.upper { lower } else { upper };
                            Knowledge::Held { bound, end: Some(end).filter(|end| end.is_finite()) }
                        }
                        None if !has_ends((lower, upper), transform) => Knowledge::Unidentified,
                        None => Knowledge::Known { standard_error, lower, upper },
                    }
                }
            };
            let index = |change: f64| {
                let percent = 100.0 * (root * change * self.slopes[i] / value).abs();
                (error.is_some() && percent.is_finite()).then_some(percent)
            };
            Unknown {
                name: unknown.name.clone(),
                unit: unknown.unit.clone(),
                role: unknown.role,
                experiment: unknown.experiment,
                value,
                start: unknown.parameter.start,
                knowledge,
                error_index: covariances.unit.as_ref().and_then(|unit| index(unit.standard_error(i))),
                error_index_held: index(1.0 / self.norms[i]),
                transform,
                degrees_of_freedom,
            }
        };
        (0..free.len()).map(one).collect()
    }

    pub(super) fn directions(&self) -> Vec<crate::estimate::Direction> {
        let unknowns = &self.objective.problem.unknowns;
        let named = |d: &Vec<(usize, f64)>| directions::named(unknowns, d, &self.norms, &self.values, &self.slopes);
        self.undetermined.directions.iter().map(named).collect()
    }

    pub(super) fn parameters(&self, unknowns: &[Unknown]) -> Vec<ParameterEstimate> {
        let (problem, x) = (self.objective.problem, &self.end.coordinates);
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

    pub(super) fn experiments(&self) -> Vec<ExperimentEstimate> {
        let problem = self.objective.problem;
        let one = |e: usize| {
            let values = problem.unknowns.of_experiment(e, &self.end.coordinates);
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
    pub(super) fn noise(&self) -> Result<Whitening, Error> {
        let objective = self.objective;
        // Weights enter the sum of squares, but are not part of the noise.
        if objective.is_weighted() && noise::only_scales(objective) {
            let found = noise::estimate(&objective.unlimited(), &self.end.coordinates).map_err(reason)?;
            return Ok(found.widened((self.residuals.measured as f64 / self.degrees.max(1.0)).sqrt()));
        }
        // The noise level of errors that are round-off is returned as computed, zero or not.
        let scale = (self.linear.sum_of_squares() / self.degrees.max(1.0)).sqrt();
        Ok(objective.whitening.widened(if noise::only_scales(objective) { scale } else { self.widening }))
    }

    pub(super) fn outputs(&self, noise: &Whitening) -> Vec<OutputEstimate> {
        let predicted = self.objective.sweep.predicts_variance();
        let outputs = self.objective.problem.layout().outputs.iter();
        let one = |((quantity, fit), sigma): ((&Quantity, &crate::estimate::OutputFit), f64)| {
            let sigma = if predicted { fit.rmse } else { sigma };
            let fit = crate::estimate::OutputFit { sigma, ..*fit };
            OutputEstimate { name: quantity.name.clone(), unit: quantity.unit.clone(), fit }
        };
        outputs.zip(&self.residuals.outputs).zip(noise.sigma()).map(one).collect()
    }

    /// `-2 ln` of the Gaussian likelihood; `None` with a weighting or a loss.
    pub(super) fn deviance(&self) -> Option<f64> {
        let objective = self.objective;
        if objective.loss().is_some() || objective.is_weighted() {
            return None;
        }
        let (n, priors) = (self.residuals.measured as f64, objective.problem.unknowns.priors(&self.end.coordinates));
        let priors: f64 = priors.map(|(_, _, error)| error * error).sum();
        let log_determinant = self.residuals.log_determinant;
        let squares = match objective.sweep.predicts_variance() {
            true => 2.0 * self.linear.cost - log_determinant,
            false => self.linear.sum_of_squares(),
        };
        // Where the noise only scales the cost, the cost does not include its maximum-likelihood variance yet.
        let variance = if noise::only_scales(objective) { squares / n } else { 1.0 };
        let deviance =
            n * (std::f64::consts::TAU.ln() + variance.ln()) + log_determinant + (squares - priors) / variance;
        // Without any error the likelihood is unbounded.
        deviance.is_finite().then_some(deviance)
    }
}

/// Whether an interval ends at numbers. Beyond the largest or below the smallest number nothing is known of a logarithm.
fn has_ends((lower, upper): (f64, f64), transform: Transform) -> bool {
    lower.is_finite() && upper.is_finite() && !(transform == Transform::Log && upper == 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_interval_ends_at_numbers() {
        use Transform::{Identity, Log};
        assert!(has_ends((-1.0, 0.0), Identity) && has_ends((0.0, 1.0), Log) && has_ends((-1.0, 1.0), Identity));
        assert!(!has_ends((0.0, 0.0), Log) && !has_ends((0.0, f64::INFINITY), Log));
        assert!(!has_ends((f64::NEG_INFINITY, 1.0), Identity) && !has_ends((f64::NAN, 1.0), Identity));
    }
}
