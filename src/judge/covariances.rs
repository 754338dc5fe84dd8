//! The covariance of the unknowns: classical, a sandwich, or HAC, and its degrees of freedom.

use crate::covariance::clusters::{Cluster, Clusters, clusters};
use crate::covariance::hac::hac;
use crate::covariance::point::Point;
use crate::covariance::predicted::{Dependence, dependence_of_variances};
use crate::covariance::sandwich::{Robust, sandwich};
use crate::covariance::shares::Largest;
use crate::covariance::sizes::{Sizes, Uneven};
use crate::estimate::CovarianceMethod;
use crate::estimate::student::Spread;
use crate::information::Covariance;
use crate::judge::evidence::Evidence;
use crate::judge::evidence::color;
use crate::problem::{Noise, Whitening};
use crate::record::Time;
use crate::whiteness::chi_squared_tail;

/// Levels at which the variance by records as clusters is certainly larger than that by the errors: of colored errors, where the records
/// have [`FEW`] degrees of freedom or more, and of white ones, or with fewer.
const CLUSTERED: f64 = 0.05;
const DIFFERENT: f64 = 1e-3;
const FEW: f64 = 4.0;
/// Colored errors of records with fewer measurements than this, on average, are taken by clusters if these have [`FEW`] degrees of freedom.
const SHORT_RECORD: u64 = 100;

/// The covariance of the unknowns in their own units, and how it was made.
pub(crate) struct Covariances {
    pub unknowns: Option<Covariance>,
    pub method: CovarianceMethod,
    /// Degrees of freedom of the variance of each unknown.
    pub degrees: Vec<f64>,
    /// Where variances are predicted: by how much the logarithm of that of each unknown grows along one of its standard errors.
    pub own: Vec<f64>,
    /// The largest shares of measurements in the variances, if they were summed on the way.
    pub shares: Option<Vec<Largest>>,
    /// The unknown for which noise that was estimated as of one size is of another.
    pub uneven: Option<Uneven>,
    /// The unknown of which records say more different things than their errors do, if any.
    pub differing: Option<Differing>,
}

/// An unknown that records share, and what they say of it differently than their errors explain.
pub(crate) struct Differing {
    pub unknown: usize,
    pub records: usize,
    /// The probability that errors alone make as much.
    pub chance: f64,
    /// The variance by the records relative to that by the errors.
    pub ratio: f64,
    /// As many equal records would tell as much.
    pub equal: f64,
}

/// Whether a number can be a standard error.
pub(crate) fn is_error(error: f64) -> bool {
    error > 0.0 && error.is_finite()
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

impl CoordinateCovariance {
    /// With the standard errors and degrees of freedom by records as clusters, of the unknowns where they say more by the level, or where the
    /// correlation over time is told by fewer degrees of freedom than records have; and the unknown that differs most.
    fn by_records(mut self, clusters: &Clusters, level: f64, short: bool) -> (Self, Option<Differing>) {
        let Some(found) = self.covariance.take() else { return (self, None) };
        let colored = matches!(self.method, CovarianceMethod::Hac { .. });
        let mut factors = vec![1.0; clusters.of.len()];
        let mut most: Option<Differing> = None;
        for (i, cluster) in clusters.of.iter().enumerate() {
            let Some(Cluster { standard_error, degrees }) = *cluster else { continue };
            let own = found.standard_error(i) * self.factor.sqrt();
            let ratio = (standard_error / own).powi(2);
            if !(ratio.is_finite() && ratio > 0.0) {
                continue;
            }
            let chance = chi_squared_tail(ratio * degrees, degrees);
            let level = if degrees >= FEW { level } else { DIFFERENT };
            let better = colored && (short && degrees >= FEW || degrees >= self.degrees[i]);
            if chance < level || better {
                (factors[i], self.degrees[i]) = (standard_error / own, degrees);
                self.method = CovarianceMethod::Clusters { records: clusters.records as u64 };
            }
            if chance < DIFFERENT && most.as_ref().is_none_or(|most| chance < most.chance) {
                let (records, equal) = (clusters.records, degrees + 1.0);
                most = Some(Differing { unknown: i, records, chance, ratio, equal });
            }
        }
        (CoordinateCovariance { covariance: Some(found.scaled(&factors)), ..self }, most)
    }
}

pub(crate) fn covariances(evidence: &Evidence<'_>) -> Covariances {
    let unit = evidence.unit();
    let colored = evidence.uses_hac().then(|| for_colored_errors(evidence, unit?)).flatten();
    let level = if colored.is_some() { CLUSTERED } else { DIFFERENT };
    let found = colored.unwrap_or_else(|| for_white_errors(evidence, unit, None));
    let (found, differing) = match clusters(&evidence.point, || evidence.bread()) {
        Some(clusters) => found.by_records(&clusters, level, has_short_records(evidence)),
        None => (found, None),
    };
    let CoordinateCovariance { covariance, method, factor, degrees, shares, uneven } = found;
    let seen = evidence.point.seen().into_iter().zip(&evidence.point.slopes);
    let in_units: Vec<f64> = seen.map(|(seen, slope)| if seen { *slope } else { 0.0 }).collect();
    let unknowns = covariance.map(|covariance| covariance.times(factor).scaled(&in_units));
    let dependence = unit.and_then(|unit| dependence_of_variances(&evidence.point, unit));
    let Some(Dependence { degrees: most, own }) = dependence else {
        return Covariances { unknowns, method, degrees, own: vec![], shares, uneven, differing };
    };
    let degrees = degrees.iter().zip(most).map(|(degrees, most)| degrees.min(most)).collect();
    Covariances { unknowns, method, degrees, own, shares, uneven, differing }
}

/// Whether records are too short for the correlation of errors over time to be estimated in each.
fn has_short_records(evidence: &Evidence<'_>) -> bool {
    evidence.residuals.measured < SHORT_RECORD * evidence.point.objective.experiments() as u64
}

fn for_colored_errors(evidence: &Evidence<'_>, unit: &Covariance) -> Option<CoordinateCovariance> {
    let Point { objective, held_for_covariance: held, .. } = &evidence.point;
    let (frames, first) = evidence.rows().colored.as_ref()?;
    let certain = evidence.autocorrelated_at(color::CERTAIN).is_some();
    let shares = evidence.rows().shares.as_ref();
    let differ = evidence.takes_one_size() && shares.is_some_and(|(_, sizes)| sizes.differ(held));
    let alone = certain && !differ;
    // The scores of independent errors on the way.
    let robust = !alone && !objective.needs_sandwich() && takes_sandwich(evidence);
    let mut hac = hac(&evidence.point, evidence.bread()?, (frames, first), robust.then_some(unit))?;
    let degrees = hac.degrees(objective, unit);
    let covariance = hac.covariance(&degrees, evidence.coupled().is_some());
    let degrees = degrees.into_iter().map(|degrees| degrees.min(evidence.point.degrees)).collect();
    let method = CovarianceMethod::Hac { lags: hac.lags as u64 };
    let shares = shares.map(|(largest, _)| largest.clone());
    let covariance = Some(covariance);
    let found = CoordinateCovariance { covariance, method, factor: 1.0, degrees, shares, uneven: None };
    if alone {
        return Some(found);
    }
    let white = for_white_errors(evidence, Some(unit), hac.robust.take());
    // The squares of colored errors are correlated, which the test of their sizes does not allow for.
    let uneven = white.uneven.filter(|_| !certain);
    Some(CoordinateCovariance { uneven, ..no_shorter(found, white) })
}

/// The shares of the measurements and the sizes of their errors, where the classical covariance takes these to be of one size.
fn tested<'e>(evidence: &'e Evidence<'_>) -> Option<&'e (Vec<Largest>, Sizes)> {
    evidence.takes_one_size().then(|| evidence.rows().shares.as_ref()).flatten()
}

/// Whether white errors take a sandwich. Of models without states it is only said that their errors are of several sizes: classical standard
/// errors are what certified ones are compared with. A noise that was given is replaced only where the errors certainly are of another size.
fn takes_sandwich(evidence: &Evidence<'_>) -> bool {
    let Point { objective, held_for_covariance: held, .. } = &evidence.point;
    let given = matches!(objective.problem.settings.noise, Noise::Given(_));
    let differ =
        |(_, sizes): &(Vec<Largest>, Sizes)| if given { sizes.uneven(held).is_some() } else { sizes.differ(held) };
    let sized = || !evidence.point.is_static() && tested(evidence).is_some_and(differ);
    objective.needs_sandwich() || evidence.coupled().is_some() || sized() || spans_differ(evidence)
}

/// The covariance for white errors, by a sandwich that was made on the way, if there is one.
fn for_white_errors(
    evidence: &Evidence<'_>,
    unit: Option<&Covariance>,
    robust: Option<Robust>,
) -> CoordinateCovariance {
    let Point { objective, end, held_for_covariance: held, widening, .. } = &evidence.point;
    let x = &end.coordinates;
    let (factor, degrees) = estimated_weights(evidence);
    let degrees = vec![degrees; evidence.point.slopes.len()];
    let uneven = tested(evidence).and_then(|(_, sizes)| match evidence.point.is_static() {
        true => sizes.too_short(held).or_else(|| sizes.uneven(held)),
        false => sizes.uneven(held),
    });
    let shares = tested(evidence).map(|(shares, _)| shares.clone());
    // Where stop conditions ended a pass, the classical covariance, which needs none, takes its place.
    let stopped = || objective.control.stops();
    if takes_sandwich(evidence) {
        let filtered = objective.problem.settings.prefilter.is_some();
        let method = if filtered { CovarianceMethod::FilteredSandwich } else { CovarianceMethod::Sandwich };
        match robust.or_else(|| sandwich(&evidence.point, evidence.bread()?)) {
            Some(Robust { covariance, shares, degrees: own }) => {
                let degrees = degrees.iter().zip(own).map(|(most, own)| own.min(*most)).collect();
                return CoordinateCovariance { covariance, method, factor, degrees, shares, uneven };
            }
            None if !stopped() => {
                return CoordinateCovariance { covariance: None, method, factor, degrees, shares: None, uneven };
            }
            None => {}
        }
    }
    let method = CovarianceMethod::Classical;
    // The widening applies to the errors, not to the priors.
    if *widening != 1.0 && objective.problem.unknowns.priors(x).next().is_some() {
        let linear = objective.with(objective.whitening.widened(*widening)).evaluate(x).ok();
        if linear.is_some() || !stopped() {
            let covariance = linear.and_then(|linear| linear.covariance(held));
            return CoordinateCovariance { covariance, method, factor, degrees, shares, uneven };
        }
    }
    let factor = factor * widening * widening;
    CoordinateCovariance { covariance: unit.cloned(), method, factor, degrees, shares, uneven }
}

/// Whether errors are those of predictions ahead over intervals that are not equal: what disturbs the plant grows with them.
fn spans_differ(evidence: &Evidence<'_>) -> bool {
    let problem = evidence.point.objective.problem;
    let uneven = problem.records.iter().any(|record| matches!(record.times(), Time::Stamps(_)));
    matches!(problem.settings.noise, Noise::PerOutput | Noise::SomeGiven(_))
        && uneven
        && evidence.point.objective.sweep.restarts().is_some()
}

/// The factor by which weights between outputs that were estimated themselves, as a full noise covariance, widen the
/// covariance, and the degrees of freedom that they leave: exact for the mean of Gaussian vectors (Rao, Biometrika 54
/// (1967) 259), with `degrees` per output for the number of samples less one.
fn estimated_weights(evidence: &Evidence<'_>) -> (f64, f64) {
    let Whitening::Full { covariance, .. } = &evidence.point.objective.whitening else {
        return (1.0, evidence.point.degrees);
    };
    let outputs = covariance.size() as f64;
    let degrees = evidence.point.degrees / outputs;
    let left = (degrees - outputs).max(1.0);
    (degrees / (left + 1.0) * (degrees - 1.0) / left, left + 1.0)
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
