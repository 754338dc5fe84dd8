//! From the end of a search to a [`Summary`].

use super::residual_pass::{Residuals, reason, residual_pass};
use super::summary::method;
use super::{bounds, directions};
use crate::error::Error;
use crate::estimate::student::Spread;
use crate::estimate::{Format, Starts, Summary, Version};
use crate::information::{Covariance, Undetermined};
use crate::optimize::{LeastSquares, Linearization, Outcome, is_negligible};
use crate::problem::{Memory, Noise, Objective, Whitening, noise};

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
}
