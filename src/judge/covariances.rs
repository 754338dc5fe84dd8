//! The covariance of the unknowns: classical, a sandwich, or HAC, and its degrees of freedom.

use super::conclude::{Judgement, WHITENESS_LEVEL};
use super::hac::hac;
use super::predicted::Dependence;
use super::sandwich;
use super::shares::Largest;
use crate::estimate::CovarianceMethod;
use crate::information::Covariance;
use crate::layout::Kind;
use crate::problem::{Noise, Whitening};
use crate::record::Time;

/// Below this number of measurements the covariance is the classical one, whether the errors are autocorrelated or not.
const CORRELATED_SAMPLES: u64 = 12;
/// Records of up to so many measurements are tested for color at this level before their intervals are made: the tests see little
/// there, and white errors that are taken as colored lose nothing (docs/intervals.md).
const SHORT: u64 = 1_000;
const SHORT_LEVEL: f64 = 0.05;
/// Below this number of measurements errors are not tested for changing size.
const SIZED_SAMPLES: u64 = 100;
/// Level of the test for errors of changing size, over all outputs.
const LIKE_SIZES_LEVEL: f64 = 0.01;

/// The covariance of the unknowns in their own units, how it was made, and that of unit noise in coordinates.
pub(super) struct Covariances {
    pub unknowns: Option<Covariance>,
    pub method: CovarianceMethod,
    pub unit: Option<Covariance>,
    /// Degrees of freedom of the variance of each unknown.
    pub degrees: Vec<f64>,
    /// Where variances are predicted: by how much the logarithm of that of each unknown grows along one of its standard errors.
    pub own: Vec<f64>,
    /// The largest shares of measurements in the variances, if they were summed on the way.
    pub shares: Option<Vec<Largest>>,
}

/// A covariance in coordinates.
struct CoordinateCovariance {
    covariance: Option<Covariance>,
    method: CovarianceMethod,
    factor: f64,
    degrees: Vec<f64>,
    shares: Option<Vec<Largest>>,
}

impl Judgement<'_> {
    pub(super) fn covariances(&self) -> Covariances {
        let unit = self.linear.covariance(&self.exact);
        let found = self.takes_color().then(|| self.for_colored_errors(unit.as_ref()?)).flatten();
        let CoordinateCovariance { covariance, method, factor, degrees, shares } =
            found.unwrap_or_else(|| self.for_white_errors(&unit));
        let seen = self.seen().into_iter().zip(&self.slopes);
        let in_units: Vec<f64> = seen.map(|(seen, slope)| if seen { *slope } else { 0.0 }).collect();
        let unknowns = covariance.map(|covariance| covariance.times(factor).scaled(&in_units));
        let dependence = unit.as_ref().and_then(|unit| self.dependence_of_variances(unit));
        let Some(Dependence { degrees: most, own }) = dependence else {
            return Covariances { unknowns, method, unit, degrees, own: vec![], shares };
        };
        let degrees = degrees.iter().zip(most).map(|(degrees, most)| degrees.min(most)).collect();
        Covariances { unknowns, method, unit, degrees, own, shares }
    }

    /// Whether the intervals allow for colored errors.
    fn takes_color(&self) -> bool {
        let level = match self.residuals.measured {
            ..CORRELATED_SAMPLES => return false,
            CORRELATED_SAMPLES..=SHORT => SHORT_LEVEL,
            _ => WHITENESS_LEVEL,
        };
        self.objective.problem.layout().kind != Kind::Static && self.autocorrelated_at(level).is_some()
    }

    fn for_colored_errors(&self, unit: &Covariance) -> Option<CoordinateCovariance> {
        let hac = hac(self.objective, &self.end.coordinates, self.linear, (&self.exact, unit))?;
        let degrees = hac.degrees(self.objective, unit);
        let covariance = Some(hac.covariance(&self.exact, &degrees, self.coupled().is_some())?);
        let degrees = degrees.into_iter().map(|degrees| degrees.min(self.degrees));
        let method = CovarianceMethod::Hac { lags: hac.lags as u64 };
        Some(CoordinateCovariance { covariance, method, factor: 1.0, degrees: degrees.collect(), shares: hac.shares })
    }

    fn for_white_errors(&self, unit: &Option<Covariance>) -> CoordinateCovariance {
        let (objective, x) = (self.objective, &self.end.coordinates);
        let (weights, degrees) = self.estimated_weights();
        let degrees = vec![degrees; self.slopes.len()];
        if sandwich::is_needed(objective) || self.coupled().is_some() || self.changes_size() || self.spans_differ() {
            let filtered = objective.problem.settings.prefilter.is_some();
            let method = if filtered { CovarianceMethod::FilteredSandwich } else { CovarianceMethod::Sandwich };
            let found = sandwich::sandwich(objective, x, &self.exact).ok().flatten();
            let (covariance, shares) = found.map_or((None, None), |(covariance, shares)| (Some(covariance), shares));
            return CoordinateCovariance { covariance, method, factor: weights, degrees, shares };
        }
        let method = CovarianceMethod::Classical;
        // The widening applies to the errors, not to the priors.
        if self.widening != 1.0 && objective.problem.unknowns.priors(x).next().is_some() {
            let widened = objective.with(objective.whitening.widened(self.widening));
            let covariance = widened.evaluate(x).ok().and_then(|linear| linear.covariance(&self.exact));
            return CoordinateCovariance { covariance, method, factor: weights, degrees, shares: None };
        }
        CoordinateCovariance {
            covariance: unit.clone(),
            method,
            factor: weights * self.widening * self.widening,
            degrees,
            shares: None,
        }
    }

    /// Whether noise that is estimated changes in size along the record: the classical covariance takes it to be of one variance. Where
    /// there are no states, the order of the samples means nothing.
    fn changes_size(&self) -> bool {
        let (whiteness, problem) = (&self.residuals.whiteness, self.objective.problem);
        let tested = matches!(problem.settings.noise, Noise::PerOutput) && problem.layout().kind != Kind::Static;
        let least = whiteness.iter().map(|white| white.like_sizes).fold(1.0, f64::min);
        tested && self.residuals.measured >= SIZED_SAMPLES && least * (whiteness.len() as f64) < LIKE_SIZES_LEVEL
    }

    /// Whether errors are those of predictions ahead over intervals that are not equal: what disturbs the plant grows with them.
    fn spans_differ(&self) -> bool {
        let problem = self.objective.problem;
        let uneven = problem.records.iter().any(|record| matches!(record.times(), Time::Stamps(_)));
        matches!(problem.settings.noise, Noise::PerOutput) && uneven && self.objective.sweep.restarts().is_some()
    }

    /// The factor by which weights between outputs that were estimated themselves, as a full noise covariance, widen the
    /// covariance, and the degrees of freedom that they leave: exact for the mean of Gaussian vectors (Rao, Biometrika 54
    /// (1967) 259), with `degrees` per output for the number of samples less one.
    fn estimated_weights(&self) -> (f64, f64) {
        let Whitening::Full { covariance, .. } = &self.objective.whitening else { return (1.0, self.degrees) };
        let outputs = covariance.size() as f64;
        let degrees = self.degrees / outputs;
        let left = (degrees - outputs).max(1.0);
        (degrees / (left + 1.0) * (degrees - 1.0) / left, left + 1.0)
    }
}
