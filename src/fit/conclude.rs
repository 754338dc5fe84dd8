//! From where a search ended to what is known.

use super::noise::{Noise, Whitening};
use super::objective::Objective;
use super::reproduce::Reproduced;
use super::search::Found;
use crate::error::Error;
use crate::estimate::{Direction, Knowledge, Quality, Unknown, Warning, student};
use crate::information::{Covariance, SquareMatrix, Undetermined};
use crate::model::Kind;
use crate::optimize::{Linearization, Severity};

/// Singular values below this part of the largest are rounding of a simulation: nothing is known along their directions.
const RANK: f64 = 1e-11;
/// What has less than this share in a direction that is not known is itself known.
const SHARE: f64 = 1e-3;
/// Below so many measurements a covariance that allows for colored errors is less sure than the classical one.
const COLOR_SAMPLES: u64 = 100;
/// Errors below this part of a given noise are no sample of it.
const ROUNDING: f64 = 0.1;

/// What an estimate says, whatever the model. See [`Estimate`](crate::Estimate).
pub(super) struct Conclusion {
    pub unknowns: Vec<Unknown>,
    pub covariance: SquareMatrix,
    /// By which method.
    pub method: String,
    pub noise_covariance: Option<SquareMatrix>,
    pub quality: Vec<Quality>,
    pub directions: Vec<Direction>,
    pub warnings: Vec<Warning>,
    pub cost: f64,
    pub measurements: u64,
    pub deviance: Option<f64>,
}

impl Objective<'_> {
    /// `self` has the whitening that the search ended with.
    pub(super) fn conclude(&self, noise: &Noise, found: &Found) -> Result<Conclusion, Error> {
        let Found { coordinates, linear, outcome, trouble, .. } = found;
        let coordinates = coordinates.as_slice();
        let (unknowns, whitening) = (self.unknowns, &self.whitening);
        let linear = match linear {
            Some(linear) => linear,
            None => &self.evaluate(coordinates).map_err(|error| Error::Optimizer(error.to_string()))?,
        };
        let n = unknowns.row.len();
        let Reproduced { quality, measured, log_determinant, step_error, color } = self.reproduce(coordinates)?;

        // What is held or not determined has no interval.
        let (gradient, norms) = (linear.gradient(), linear.column_norms());
        let bounds = unknowns.bounds();
        let at_bound = |i: usize| {
            let ((lower, upper), x) = (bounds[i], coordinates[i]);
            if x <= lower && gradient[i] >= 0.0 {
                Some(unknowns.row[i].parameter.lower)
            } else if x >= upper && gradient[i] <= 0.0 {
                Some(unknowns.row[i].parameter.upper)
            } else {
                None
            }
        };
        let values = unknowns.values(coordinates);
        let slopes: Vec<f64> = (0..n).map(|i| unknowns.row[i].parameter.transform.slope(values[i])).collect();
        let held_at: Vec<Option<f64>> = (0..n).map(at_bound).collect();
        let mut free: Vec<bool> = held_at.iter().map(Option::is_none).collect();
        let at_bounds: Vec<bool> = held_at.iter().map(Option::is_some).collect();
        let Undetermined { directions: unseen, held } = linear.undetermined(&at_bounds, RANK);
        let mut unidentified = vec![false; n];
        for direction in &unseen {
            let largest = direction.iter().fold(0.0f64, |m, (_, d)| m.max(d.abs()));
            for &(i, d) in direction {
                unidentified[i] |= d.abs() > SHARE * largest;
            }
        }
        (0..n).for_each(|i| free[i] &= !unidentified[i]);
        let directions: Vec<Direction> = unseen.iter().map(|d| self.direction(d, &norms, &values, &slopes)).collect();

        // The covariance in the optimizer's coordinates, then in the unknowns' own units.
        let estimated = held.iter().filter(|held| !**held).count() as f64;
        // With no more measurements than unknowns nothing is left to tell the noise from.
        let degrees = if measured <= n as u64 { 0.0 } else { measured as f64 - estimated };
        let sum_of_squares = linear.sum_of_squares();
        let widening = match noise {
            Noise::Given(_) => 1.0,
            _ if self.noise_is_no_matter(noise) => (sum_of_squares / degrees.max(1.0)).sqrt(),
            _ => (measured as f64 / degrees.max(1.0)).sqrt(),
        };
        let unit = linear.covariance(&held);
        let sandwich = self.needs_sandwich();
        let priors: f64 = unknowns.priors(coordinates).map(|(_, _, error)| error * error).sum();
        let small_sample = measured as f64 / degrees.max(1.0);
        // Errors far below a given noise are rounding: their color says nothing, and their size would promise too much.
        let sigma = whitening.sigma();
        let given = matches!(noise, Noise::Given(_));
        let rounding = given && quality.iter().zip(&sigma).all(|(quality, sigma)| quality.rmse < ROUNDING * sigma);
        let color = color.filter(|_| !rounding);
        let colored = color.as_ref().filter(|_| self.source.kind() != Kind::Static && measured >= COLOR_SAMPLES);
        let colored = colored.and_then(|_| self.colored(coordinates, linear, &held));
        let colored = colored.and_then(|found| Some((found.sandwich.covariance(&held)?, found.lags)));
        let (covariance, factor) = match (&colored, sandwich) {
            (Some((covariance, _)), _) => (Some(covariance.clone()), small_sample),
            (None, true) => (self.sandwich(coordinates, &held).ok().flatten(), 1.0),
            // The noise is wider than the errors, the priors are not.
            (None, false) if widening != 1.0 && unknowns.priors(coordinates).next().is_some() => {
                let widened = self.with(whitening.widened(widening));
                (widened.evaluate(coordinates).ok().and_then(|linear| linear.covariance(&held)), 1.0)
            }
            (None, false) => (unit.clone(), widening * widening),
        };
        let singular = covariance.is_none();
        let covariance = covariance.unwrap_or_else(|| Covariance::zeros(n));
        let known = |i: usize| free[i] && !singular && degrees > 0.0;
        let in_units: Vec<f64> = (0..n).map(|i| if free[i] { slopes[i] } else { 0.0 }).collect();
        let covariance = covariance.times(factor).scaled(&in_units).dense(&(0..n).collect::<Vec<_>>());

        let rows: Vec<Unknown> = (0..n)
            .map(|i| {
                let (unknown, value) = (&unknowns.row[i], values[i]);
                let transform = unknown.parameter.transform;
                let knowledge = match held_at[i] {
                    Some(bound) => Knowledge::Held { bound },
                    None if !known(i) => Knowledge::Unidentified,
                    None => {
                        let standard_error = covariance[(i, i)].sqrt();
                        let (lower, upper) = student::interval(value, standard_error, transform, 0.95, degrees);
                        Knowledge::Known { standard_error, lower, upper }
                    }
                };
                let index = |change: f64| {
                    let percent = 100.0 * (sum_of_squares.sqrt() * change * slopes[i] / value).abs();
                    (known(i) && percent.is_finite()).then_some(percent)
                };
                Unknown {
                    name: unknown.name.clone(),
                    unit: unknown.unit.to_owned(),
                    value,
                    start: unknown.parameter.start,
                    knowledge,
                    error_index: unit.as_ref().and_then(|unit| index(unit.standard_error(i))),
                    error_index_held: index(1.0 / norms[i]),
                    transform,
                }
            })
            .collect();
        // The noise, where the errors were not divided by it.
        let step_error = step_error / widening;
        let mut warnings = self.warnings(coordinates, &rows, &directions, measured, step_error);
        if !outcome.converged() && rows.iter().any(|row| row.knowledge.standard_error().is_some()) {
            let text =
                "standard errors and intervals are those of a minimum, where the search did not arrive".to_owned();
            warnings.push(Warning { severity: Severity::NotUsable, text });
        }
        if let Some(trouble) = trouble {
            let text = format!("the checkpoint could not be written ({trouble}); the search went on without it");
            warnings.push(Warning { severity: Severity::Usable, text });
        }
        if let Some(color) = color {
            let white = |i: usize| unit.as_ref().map(|unit| unit.standard_error(i) * widening * slopes[i].abs());
            let widened = |i: usize| Some(covariance[(i, i)].sqrt() / white(i).filter(|error| *error > 0.0)?);
            let widest = (0..n).filter_map(widened).fold(0.0, f64::max);
            warnings.push(color.warning(colored.as_ref().map(|(_, lags)| (*lags, widest))));
        }
        let widened = match noise {
            // Weights are in the sum of squares, but no part of the noise.
            Noise::PerOutput | Noise::Covariance if self.source.is_weighted() && self.noise_is_no_matter(noise) => self
                .estimate_noise(coordinates, noise)
                .map_err(|error| Error::Optimizer(error.to_string()))?
                .widened((measured as f64 / degrees.max(1.0)).sqrt()),
            _ => whitening.widened(widening),
        };
        let deviance = self.deviance(noise, measured, log_determinant, sum_of_squares, priors);
        let sigma = widened.sigma();
        let quality = quality.into_iter().zip(sigma).map(|(quality, sigma)| Quality { sigma, ..quality }).collect();
        let covariance_of = match (colored, sandwich, self.prefilter) {
            (Some((_, lags)), _, _) => format!("HAC (Newey-West over {lags} lag(s), prewhitened, for colored errors)"),
            (None, false, _) => "classical (white errors)".to_owned(),
            (None, true, None) => "sandwich (errors independent from sample to sample)".to_owned(),
            (None, true, Some(_)) => "sandwich (white errors before the pre-filter)".to_owned(),
        };
        Ok(Conclusion {
            unknowns: rows,
            covariance,
            method: covariance_of,
            noise_covariance: match &widened {
                Whitening::Full { covariance, .. } => Some(covariance.clone()),
                Whitening::Diagonal(_) => None,
            },
            quality,
            directions,
            warnings,
            cost: linear.cost,
            measurements: measured,
            deviance,
        })
    }

    /// `-2 ln` of the Gaussian likelihood, if weights and losses leave it one.
    fn deviance(&self, noise: &Noise, measured: u64, log_det: f64, sum_of_squares: f64, priors: f64) -> Option<f64> {
        if self.loss.is_some() || self.source.is_weighted() {
            return None;
        }
        let n = measured as f64;
        // Where the noise was no matter to the search, its most likely variance is still to be put in.
        let variance = if self.noise_is_no_matter(noise) { sum_of_squares / n } else { 1.0 };
        let deviance =
            n * (std::f64::consts::TAU.ln() + variance.ln()) + log_det + (sum_of_squares - priors) / variance;
        // Without any error the likelihood has no bound.
        deviance.is_finite().then_some(deviance)
    }

    /// A direction of the scaled unknowns as relative changes by name.
    fn direction(&self, direction: &[(usize, f64)], norms: &[f64], values: &[f64], slopes: &[f64]) -> Direction {
        let change = |i: usize, d: f64| {
            let step = d / if norms[i] > 0.0 { norms[i] } else { 1.0 } * slopes[i];
            if values[i] == 0.0 { step } else { step / values[i].abs() }
        };
        let largest = direction.iter().fold(0.0f64, |m, (_, d)| m.max(d.abs()));
        let large = direction.iter().filter(|(_, d)| d.abs() > SHARE * largest);
        let mut moves: Vec<(String, f64)> =
            large.map(|&(i, d)| (self.unknowns.row[i].name.clone(), change(i, d))).collect();
        let unit = moves.iter().map(|(_, by)| *by).fold(0.0, |m: f64, by| if by.abs() > m.abs() { by } else { m });
        moves.iter_mut().for_each(|(_, by)| *by /= unit);
        Direction { moves }
    }
}

/// The unknowns to hold so that the others have a covariance: those in `held`, and one for each direction along which
/// nothing is known.
pub(crate) fn held_or_unseen(linear: &Linearization, held: &[bool]) -> Vec<bool> {
    linear.undetermined(held, RANK).held
}
