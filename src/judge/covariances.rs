//! The covariance of the unknowns: classical, a sandwich, or HAC, and its degrees of freedom.

use super::color;
use super::conclude::{Judgement, WHITENESS_LEVEL};
use super::hac::hac;
use super::predicted::Dependence;
use super::sandwich::{self, Robust};
use super::shares::Largest;
use super::sizes::{Sizes, Uneven};
use crate::estimate::CovarianceMethod;
use crate::estimate::student::Spread;
use crate::information::Covariance;
use crate::layout::Kind;
use crate::optimize::{Infeasible, Outcome};
use crate::problem::{Noise, Whitening};
use crate::record::Time;

/// Below this number of measurements the covariance is the classical one, whether the errors are autocorrelated, or of one size, or not.
const CORRELATED_SAMPLES: u64 = 12;
/// Records of up to so many measurements are tested for color at this level before their intervals are made: the tests see little
/// there, and white errors that are taken as colored lose nothing (docs/intervals.md).
const SHORT: u64 = 1_000;
const SHORT_LEVEL: f64 = 0.05;

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
    /// The unknown for which noise that was estimated as of one size is of another.
    pub uneven: Option<Uneven>,
}

/// A covariance in coordinates.
struct CoordinateCovariance {
    covariance: Option<Covariance>,
    method: CovarianceMethod,
    factor: f64,
    degrees: Vec<f64>,
    shares: Option<Vec<Largest>>,
    uneven: Option<Uneven>,
}

impl Judgement<'_> {
    pub(super) fn covariances(&self) -> Covariances {
        let unit = self.linear.covariance(&self.exact);
        let found = self.takes_color().then(|| self.for_colored_errors(unit.as_ref()?)).flatten();
        let CoordinateCovariance { covariance, method, factor, degrees, shares, uneven } =
            found.unwrap_or_else(|| self.for_white_errors(&unit));
        let seen = self.seen().into_iter().zip(&self.slopes);
        let in_units: Vec<f64> = seen.map(|(seen, slope)| if seen { *slope } else { 0.0 }).collect();
        let unknowns = covariance.map(|covariance| covariance.times(factor).scaled(&in_units));
        let dependence = unit.as_ref().and_then(|unit| self.dependence_of_variances(unit));
        let Some(Dependence { degrees: most, own }) = dependence else {
            return Covariances { unknowns, method, unit, degrees, own: vec![], shares, uneven };
        };
        let degrees = degrees.iter().zip(most).map(|(degrees, most)| degrees.min(most)).collect();
        Covariances { unknowns, method, unit, degrees, own, shares, uneven }
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
        let covariance = hac.covariance(&self.exact, &degrees, self.coupled().is_some())?;
        let degrees = degrees.into_iter().map(|degrees| degrees.min(self.degrees)).collect();
        let method = CovarianceMethod::Hac { lags: hac.lags as u64 };
        let found = CoordinateCovariance {
            covariance: Some(covariance),
            method,
            factor: 1.0,
            degrees,
            shares: hac.shares,
            uneven: None,
        };
        let differ = hac.sizes.as_ref().is_some_and(|sizes| self.takes_one_size() && sizes.differ(&self.exact));
        let certain = self.autocorrelated_at(color::CERTAIN).is_some();
        if certain && !differ {
            return Some(found);
        }
        let white = self.for_white_errors(&Some(unit.clone()));
        // The squares of colored errors are correlated, which the test of their sizes does not allow for.
        let uneven = white.uneven.filter(|_| !certain);
        Some(CoordinateCovariance { uneven, ..no_shorter(found, white) })
    }

    fn for_white_errors(&self, unit: &Option<Covariance>) -> CoordinateCovariance {
        let (objective, x) = (self.objective, &self.end.coordinates);
        let (factor, degrees) = self.estimated_weights();
        let degrees = vec![degrees; self.slopes.len()];
        let tested = unit.as_ref().filter(|_| self.takes_one_size()).and_then(|unit| self.shares(unit));
        let uneven = tested.as_ref().and_then(|(_, sizes)| sizes.uneven(&self.exact));
        // Of models without states it is only said: classical standard errors are what certified ones are compared with. A noise that was
        // given is replaced only where the errors certainly are of another size.
        let given = matches!(objective.problem.settings.noise, Noise::Given(_));
        let differ =
            |(_, sizes): &(Vec<Largest>, Sizes)| if given { uneven.is_some() } else { sizes.differ(&self.exact) };
        let sized = objective.problem.layout().kind != Kind::Static && tested.as_ref().is_some_and(differ);
        let shares = tested.map(|(shares, _)| shares);
        if sandwich::is_needed(objective) || self.coupled().is_some() || sized || self.spans_differ() {
            let filtered = objective.problem.settings.prefilter.is_some();
            let method = if filtered { CovarianceMethod::FilteredSandwich } else { CovarianceMethod::Sandwich };
            let none = Robust { covariance: None, shares: None, degrees: vec![f64::INFINITY; degrees.len()] };
            if let Some(found) = unless_stopped(sandwich::sandwich(objective, x, &self.exact)) {
                let found = found.unwrap_or(none);
                let degrees = degrees.iter().zip(found.degrees).map(|(most, own)| own.min(*most)).collect();
                let Robust { covariance, shares, .. } = found;
                return CoordinateCovariance { covariance, method, factor, degrees, shares, uneven };
            }
        }
        let method = CovarianceMethod::Classical;
        // The widening applies to the errors, not to the priors.
        if self.widening != 1.0 && objective.problem.unknowns.priors(x).next().is_some() {
            let widened = objective.with(objective.whitening.widened(self.widening));
            if let Some(linear) = unless_stopped(widened.evaluate(x)) {
                let covariance = linear.and_then(|linear| linear.covariance(&self.exact));
                return CoordinateCovariance { covariance, method, factor, degrees, shares, uneven };
            }
        }
        let factor = factor * self.widening * self.widening;
        CoordinateCovariance { covariance: unit.clone(), method, factor, degrees, shares, uneven }
    }

    /// Whether the classical covariance takes noise, estimated or given, to be of one size per output.
    fn takes_one_size(&self) -> bool {
        let objective = self.objective;
        let predicted = matches!(objective.problem.settings.noise, Noise::Predicted);
        let exact = self.rounding || self.end.outcome == Outcome::Exact || !self.has_noise();
        !predicted && !exact && !sandwich::is_needed(objective) && self.residuals.measured >= CORRELATED_SAMPLES
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

/// The result of a pass, if it has one; `None` where stop conditions ended it: the classical covariance, which needs no pass, then takes its
/// place.
fn unless_stopped<T>(found: Result<T, Infeasible>) -> Option<Option<T>> {
    match found {
        Err(Infeasible::Cancelled) => None,
        found => Some(found.ok()),
    }
}

/// Probability by which the lengths of intervals are compared.
const LEVEL: f64 = 0.95;

/// The covariance for colored errors, with intervals that are no shorter than those for white errors. Residuals of white errors have
/// negative correlations, since the fit removes their slow part; and standard errors of stationary errors are too small where the
/// errors are larger, while the variance of moving sums is seldom certain enough to be taken.
fn no_shorter(mut colored: CoordinateCovariance, white: CoordinateCovariance) -> CoordinateCovariance {
    let (Some(found), Some(least)) = (colored.covariance.take(), white.covariance) else { return colored };
    let of = |covariance: &Covariance, i: usize, factor: f64, degrees: &[f64]| Spread {
        standard_error: covariance.standard_error(i) * factor.sqrt(),
        degrees: degrees[i],
    };
    let mut factors = vec![1.0; colored.degrees.len()];
    for (i, factor) in factors.iter_mut().enumerate() {
        let own = of(&least, i, white.factor, &white.degrees);
        let by_color = of(&found, i, colored.factor, &colored.degrees);
        if own.reach(LEVEL) > by_color.reach(LEVEL) && by_color.standard_error > 0.0 {
            (*factor, colored.degrees[i]) = (own.standard_error / by_color.standard_error, own.degrees);
        }
    }
    CoordinateCovariance { covariance: Some(found.scaled(&factors)), ..colored }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::information::Information;
    use crate::optimize::Linearization;

    /// Of independent unknowns with these standard errors.
    fn of(errors: &[f64], factor: f64, degrees: f64) -> CoordinateCovariance {
        let mut triangle = Information::new(errors.len());
        for (i, error) in errors.iter().enumerate() {
            let row: Vec<f64> = (0..errors.len()).map(|j| if i == j { 1.0 / error } else { 0.0 }).collect();
            triangle.absorb_row(&row, 0.0);
        }
        let linear = Linearization::new(0.0, errors.len(), vec![triangle]);
        let covariance = linear.covariance(&vec![false; errors.len()]);
        let (method, degrees) = (CovarianceMethod::Classical, vec![degrees; errors.len()]);
        CoordinateCovariance { covariance, method, factor, degrees, shares: None, uneven: None }
    }

    /// Standard errors of 1 and 3 for colored errors, of 2 each for white ones, with a factor of four for the variance of unit
    /// noise: the first takes that of white errors with its degrees of freedom, the second stays. Few degrees of freedom make the
    /// interval for colored errors the longer one.
    #[test]
    fn the_longer_interval_is_taken() {
        let found = no_shorter(of(&[1.0, 3.0], 1.0, 50.0), of(&[1.0, 1.0], 4.0, 90.0));
        let covariance = found.covariance.unwrap();
        let errors = [covariance.standard_error(0), covariance.standard_error(1)];
        assert!((errors[0] - 2.0).abs() < 1e-14 && (errors[1] - 3.0).abs() < 1e-14, "{errors:?}");
        assert_eq!(found.degrees, [90.0, 50.0]);
        let few = no_shorter(of(&[1.0], 1.0, 1.0), of(&[2.0], 1.0, 90.0));
        assert!((few.covariance.unwrap().standard_error(0) - 1.0).abs() < 1e-14 && few.degrees == [1.0]);
    }
}
