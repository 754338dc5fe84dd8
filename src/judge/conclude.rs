//! From the end of a search to a [`Summary`].

use super::covariances::Covariances;
use super::known::is_error;
use super::noise;
use super::residual_pass::{Residuals, reason, residual_pass};
use super::{bounds, directions};
use crate::error::Error;
use crate::estimate::student::Spread;
use crate::estimate::{
    CovarianceMethod, ExperimentEstimate, Format, Knowledge, Method, NoiseModel, OutputEstimate, ParameterEstimate,
    Starts, Summary, Unknown, Version,
};
use crate::information::{Covariance, Undetermined};
use crate::layout::Quantity;
use crate::optimize::{LeastSquares, Linearization, Outcome, is_negligible};
use crate::parameter::Transform;
use crate::problem::{Memory, Noise, Objective, Role, Whitening};

/// Errors below this fraction of a given noise are round-off: no whiteness test, no HAC.
const ROUNDING: f64 = 0.1;
/// Significance level of the whiteness test.
pub(super) const WHITENESS_LEVEL: f64 = 0.01;

/// Whether the cost rises as the slopes of a logarithm say when its quantity grows from next to zero until it changes the errors by one
/// standard deviation, to half of that rise. Not so where the quantity enters as a square, as noise levels do: slopes next to zero then
/// say nothing of its size.
fn is_proportional(objective: &Objective<'_>, coordinates: &[f64], linear: &Linearization, i: usize) -> bool {
    let (norm, gradient) = (linear.column_norms()[i], linear.gradient()[i]);
    let times = (linear.sum_of_squares() / linear.rows().max(1) as f64).sqrt() / norm;
    let rise = times * (gradient + 0.5 * norm * norm * times);
    let mut grown = coordinates.to_vec();
    grown[i] += times.ln_1p();
    let costs = objective.cost_at(coordinates).ok().zip(objective.cost_at(&grown).ok());
    costs.is_some_and(|(here, there)| (there - here - rise).abs() <= 0.5 * rise)
}

/// The end of a search.
#[derive(Clone)]
pub(crate) struct SearchEnd {
    pub coordinates: Vec<f64>,
    pub whitening: Whitening,
    /// The slopes there, if they are still those of this whitening.
    pub linear: Option<Linearization>,
    pub outcome: Outcome,
    pub iterations: u64,
    pub evaluations: u64,
    /// The search's name.
    pub name: String,
    /// The last error in writing a checkpoint.
    pub write_error: Option<String>,
    /// Carries at the begins of the segments there.
    pub memory: Memory,
    /// Results of searches from other starts, if there were any.
    pub starts: Option<Starts>,
}

/// The end of a search, and the quantities derived from it.
pub(super) struct Judgement<'j> {
    pub objective: &'j Objective<'j>,
    pub end: &'j SearchEnd,
    pub linear: &'j Linearization,
    pub residuals: Residuals,
    /// Values of the unknowns, and the derivative of each with respect to its coordinate.
    pub values: Vec<f64>,
    pub slopes: Vec<f64>,
    pub norms: Vec<f64>,
    /// The bound that each unknown is held at.
    pub held_at: Vec<Option<f64>>,
    /// Null directions of the scaled unknowns; and the unknowns held for the covariance: at a bound, or one for each
    /// null direction.
    pub undetermined: Undetermined,
    /// Which unknowns the covariance takes as exact: those that are held, without those released, and one for each null
    /// direction.
    pub exact: Vec<bool>,
    /// From the estimate to that without the bounds of the released unknowns.
    pub release: Vec<f64>,
    /// Degrees of freedom: measurements minus estimated unknowns, at least zero.
    pub degrees: f64,
    /// Estimated noise level relative to that by which the errors were divided.
    pub widening: f64,
    /// Which outputs have errors that are round-off: nothing beside their measurements, or far below a given noise; and whether all have.
    pub rounded: Vec<bool>,
    pub rounding: bool,
}

/// The summary at the end of a search; the objective has the whitening that it ended with.
pub(crate) fn conclude(objective: &Objective<'_>, end: &SearchEnd, seconds: f64) -> Result<Summary, Error> {
    let residuals = residual_pass(objective, &end.coordinates)?;
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
            evaluated = objective.evaluate(&end.coordinates).map_err(reason)?;
            &evaluated
        }
    };
    let judgement = Judgement::new(objective, end, linear, residuals)?;
    let covariances = judgement.covariances();
    let unknowns = judgement.unknowns(&covariances);
    let directions = judgement.directions();
    let warnings = judgement.warnings(&unknowns, &directions, &covariances);
    let noise = judgement.noise()?;
    let problem = objective.problem;
    let measurements = judgement.residuals.measured;
    Ok(Summary {
        format: Format,
        version: Version,
        layout: problem.layout().clone(),
        parameters: judgement.parameters(&unknowns),
        experiments: judgement.experiments(),
        outputs: judgement.outputs(&noise),
        deviance: judgement.deviance(),
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
        cost: linear.cost,
        measurements,
        iterations: end.iterations,
        evaluations: end.evaluations + u64::from(end.linear.is_none()),
        seconds,
        method: method(objective, end.name.clone(), covariances.method),
    })
}

fn method(objective: &Objective<'_>, optimizer: String, covariance: CovarianceMethod) -> Method {
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

impl<'j> Judgement<'j> {
    fn new(
        objective: &'j Objective<'j>,
        end: &'j SearchEnd,
        linear: &'j Linearization,
        residuals: Residuals,
    ) -> Result<Self, Error> {
        let (unknowns, coordinates) = (&objective.problem.unknowns, &end.coordinates);
        let n = unknowns.row.len();
        let (gradient, norms, bounds) = (linear.gradient(), linear.column_norms(), unknowns.bounds());
        let at_bound = |i: usize| {
            let ((lower, upper), x) = (bounds[i], coordinates[i]);
            let parameter = unknowns.row[i].parameter;
            let low = (x <= lower && gradient[i] >= 0.0).then_some(parameter.lower);
            low.or((x >= upper && gradient[i] <= 0.0).then_some(parameter.upper))
        };
        let residual = linear.sum_of_squares().sqrt();
        let (starts, logarithms) = (unknowns.start(), objective.logarithms());
        let negligible =
            |i: usize| logarithms[i] && coordinates[i] < starts[i] && is_negligible(norms[i], gradient[i], residual);
        let held_at: Vec<Option<f64>> = (0..n).map(|i| at_bound(i).or(negligible(i).then_some(0.0))).collect();
        let flat = |i: usize| norms[i] == 0.0 || negligible(i) && !is_proportional(objective, coordinates, linear, i);
        let at_bounds: Vec<bool> = held_at.iter().map(Option::is_some).collect();
        let undetermined = directions::undetermined(linear, &at_bounds);
        let values = unknowns.values(coordinates);
        let slopes = (0..n).map(|i| unknowns.row[i].parameter.transform.slope(values[i])).collect();
        let estimated = undetermined.held.iter().filter(|held| !**held).count() as f64;
        let measured = residuals.measured;
        // With no more measurements than unknowns there are no degrees of freedom to estimate the noise from.
        let degrees = if measured <= n as u64 { 0.0 } else { measured as f64 - estimated };
        let noise = &objective.problem.settings.noise;
        let widening = match noise {
            Noise::Given(_) | Noise::Predicted => 1.0,
            _ if noise::only_scales(objective) => {
                (linear.sum_of_squares() / degrees.max(1.0)).sqrt().max(noise::rounding(objective))
            }
            _ => (measured as f64 / degrees.max(1.0)).sqrt(),
        };
        let flat: Vec<bool> = (0..n).map(flat).collect();
        let (exact, release) =
            bounds::released(linear, &undetermined, &at_bounds, &flat, Spread { standard_error: widening, degrees });
        let sigma = objective.whitening.sigma();
        let (exact_end, given) = (end.outcome == Outcome::Exact, matches!(noise, Noise::Given(_)));
        let rounded = |(j, sigma): (usize, &f64)| {
            let rmse = residuals.outputs[j].rmse;
            exact_end || given && rmse < ROUNDING * sigma || residuals.is_rounding_of(j)
        };
        let rounded: Vec<bool> = sigma.iter().enumerate().map(rounded).collect();
        let rounding = rounded.iter().all(|rounded| *rounded);
        Ok(Judgement {
            objective,
            end,
            linear,
            residuals,
            values,
            slopes,
            norms,
            held_at,
            undetermined,
            exact,
            release,
            degrees,
            widening,
            rounded,
            rounding,
        })
    }

    /// Whether an unknown is neither held at a bound, without being released, nor part of a null direction.
    pub(super) fn seen(&self) -> Vec<bool> {
        let mut seen: Vec<bool> =
            self.held_at.iter().zip(&self.exact).map(|(at, exact)| at.is_none() || !exact).collect();
        for direction in &self.undetermined.directions {
            directions::taking_part(direction).for_each(|(i, _)| seen[i] = false);
        }
        seen
    }

    /// The errors' autocorrelation; not computed where residuals are round-off.
    pub(super) fn autocorrelated(&self) -> Option<(usize, super::whiteness::Whiteness)> {
        self.autocorrelated_at(WHITENESS_LEVEL)
    }

    /// The same at another level.
    pub(super) fn autocorrelated_at(&self, level: f64) -> Option<(usize, super::whiteness::Whiteness)> {
        super::whiteness::least_white(&self.tested()).filter(|(_, white)| white.p_value < level)
    }

    /// The outputs whose errors are tested for whiteness, all but those that are round-off.
    pub(super) fn tested(&self) -> Vec<(usize, super::whiteness::Whiteness)> {
        let whiteness = self.residuals.whiteness.iter().copied().enumerate();
        whiteness.filter(|(j, _)| !self.rounded[*j]).collect()
    }

    /// Whether there is noise to tell the accuracy by: given, or measured. Where no output moves, errors are numbers next to the smallest.
    pub(super) fn has_noise(&self) -> bool {
        let given = matches!(self.objective.problem.settings.noise, Noise::Given(_) | Noise::Predicted);
        self.degrees > 0.0 && (given || self.residuals.levels.iter().any(|(_, moves)| *moves > 0.0))
    }

    fn unknowns(&self, covariances: &Covariances) -> Vec<Unknown> {
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

    fn directions(&self) -> Vec<crate::estimate::Direction> {
        let unknowns = &self.objective.problem.unknowns;
        let named = |d: &Vec<(usize, f64)>| directions::named(unknowns, d, &self.norms, &self.values, &self.slopes);
        self.undetermined.directions.iter().map(named).collect()
    }

    fn parameters(&self, unknowns: &[Unknown]) -> Vec<ParameterEstimate> {
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

    fn experiments(&self) -> Vec<ExperimentEstimate> {
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
    fn noise(&self) -> Result<Whitening, Error> {
        let objective = self.objective;
        // Weights enter the sum of squares, but are not part of the noise.
        if objective.is_weighted() && noise::only_scales(objective) {
            let found = noise::estimate(objective, &self.end.coordinates).map_err(reason)?;
            return Ok(found.widened((self.residuals.measured as f64 / self.degrees.max(1.0)).sqrt()));
        }
        // The noise level of errors that are round-off is returned as computed, zero or not.
        let scale = (self.linear.sum_of_squares() / self.degrees.max(1.0)).sqrt();
        Ok(objective.whitening.widened(if noise::only_scales(objective) { scale } else { self.widening }))
    }

    fn outputs(&self, noise: &Whitening) -> Vec<OutputEstimate> {
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
    fn deviance(&self) -> Option<f64> {
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
