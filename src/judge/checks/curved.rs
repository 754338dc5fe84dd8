//! Whether the model is close enough to linear over the width of the intervals.
//!
//! Along the profile of an unknown, prediction moves by `t v + t^2/2 a` in units of its own tangent space, with `v` the
//! direction of one standard error and `a` the second derivative of the predictions along it, projected onto their
//! slopes (the parameter-effects curvature of Bates and Watts, J. Royal Statistical Society B 42 (1980) 1, in that
//! direction). The ends of the profile's interval solve `t + t^2/2 a_i / s_i = -+z`; those of the linear one are `-+z`.

use super::*;
use crate::judge::checks::rise::{Place, least_rise};
use crate::parameter::Transform;
use crate::sweep::Coupling;

pub(crate) const CURVED: Check = Check::new(
    "intervals may be symmetric",
    "Of unknowns of which curvature is expected: by how much do the ends of the interval move by the curvature \
     along it (Bates and Watts 1980), and does the cost rise towards them as the slopes say?",
    &[WarningCode::CurvedInterval],
    |evidence, intervals| {
        let long = (evidence.residuals.measured > LONGEST).then_some("more than 200,000 measurements");
        Examined::unless(long, || curved(evidence, &intervals.unknowns, &intervals.covariances))
    },
)
.unless(&[Unless::RoundOff, Unless::Variances])
.of_usable()
.costs(&[Pass::EachUnknown(1)])
.levels(&[
    level("the expected curvature of an unknown that is examined", SMALL, "a standard error of 15 %"),
    level("the part of the half width by which an end moves", ASYMMETRY, "a quarter"),
    level(
        "the rise of the cost at the end, in what the slopes say",
        FLAT[0].1,
        "an interval by the likelihood is longer by the root of two",
    ),
]);

/// Unknowns of which a smaller curvature is to be expected are not examined: two passes over the data each. It is reached by a standard
/// error of 15 % of an unknown that no other replaces, and by smaller ones of unknowns that replace each other.
const SMALL: f64 = 0.075;
/// Records of more measurements are not examined: the predictions at two more points are kept in memory.
const LONGEST: u64 = 200_000;
/// At most so many unknowns are examined, those with the largest curvature to be expected.
const MOST: usize = 8;
/// Part of the half width by which an end may move without a warning.
const ASYMMETRY: f64 = 0.25;
/// Half widths of an interval at which the cost is looked at, and the part of the rise which slopes say that is little there: an interval
/// by the likelihood is longer by the root of two or more, or reaches at least as far.
const FLAT: [(f64, f64); 4] = [(-1.0, 0.5), (1.0, 0.5), (-2.0, 0.25), (2.0, 0.25)];
/// Quantile of the normal distribution for an interval of 95 %.
pub(crate) const QUANTILE: f64 = 1.96;

/// The unknown whose interval is bent most, if that matters.
fn curved(evidence: &Evidence<'_>, unknowns: &[Unknown], covariances: &Covariances) -> Examined {
    let expected = |i: usize| {
        unknowns[i].knowledge.standard_error().filter(|error| error.is_finite())?;
        Some((expected_curvature(evidence, i, unknowns, covariances)?, i)).filter(|(curvature, _)| *curvature > SMALL)
    };
    let mut examined: Vec<(f64, usize)> = (0..unknowns.len()).filter_map(expected).collect();
    // Where predictions are affine in the initial state, only parameters make them curved. Along the profile of an initial state
    // no parameter changes by more than its own standard error, which is small for all of them.
    let is_state = |i: usize| matches!(unknowns[i].role, Role::InitialState(_));
    if evidence.point.objective.sweep.coupling() == Coupling::Affine && examined.iter().all(|(_, i)| is_state(*i)) {
        return vec![].into();
    }
    let without = (examined.len() > MOST).then_some("unknowns beyond the 8 of the largest expected curvature");
    examined.sort_by(|a, b| b.0.total_cmp(&a.0));
    examined.truncate(MOST);
    let examined: Vec<usize> = examined.into_iter().map(|(_, i)| i).collect();
    let found =
        bent(evidence, unknowns, &examined, covariances).or_else(|| flat(evidence, unknowns, &examined, covariances));
    let warning = |(i, text)| with_care(WarningCode::CurvedInterval, text).about(About::Unknown(i));
    Examined::from(found.map(warning)).without(without)
}

/// The unknown whose interval the curvature at the estimate moves most.
fn bent(
    evidence: &Evidence<'_>,
    unknowns: &[Unknown],
    examined: &[usize],
    covariances: &Covariances,
) -> Option<(usize, String)> {
    let of = |&i: &usize| Some((i, asymmetry(evidence, i, covariances)?));
    let (i, asymmetry) = examined.iter().filter_map(of).max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))?;
    if asymmetry.abs() <= ASYMMETRY {
        return None;
    }
    let unknown = &unknowns[i];
    let (by_logarithm, side) = (by_logarithm(unknown.transform, unknown.value), side(asymmetry));
    let text = format!(
        "the interval of `{}` is linear where the model is not: by its curvature it should reach {} further {side} than \
         it says ({} standard errors of curvature); {by_logarithm}take diagnose::profile",
        unknown.name,
        percent(asymmetry.abs(), 2),
        number(2.0 * asymmetry.abs() / QUANTILE, 2)
    );
    Some((i, text))
}

/// The unknown towards whose end the cost rises too little. The curvature at the estimate may be small where that further on is not, and its
/// part along the other unknowns moves these instead of the ends.
fn flat(
    evidence: &Evidence<'_>,
    unknowns: &[Unknown],
    examined: &[usize],
    covariances: &Covariances,
) -> Option<(usize, String)> {
    let place = |unknown, (halves, little)| Place { unknown, standard_errors: halves * QUANTILE, little };
    let places = examined.iter().flat_map(|&i| FLAT.map(|at| place(i, at)));
    let (place, part) = least_rise(evidence, places, covariances)?;
    let unknown = &unknowns[place.unknown];
    let text = format!(
        "the interval of `{}` is too short {}: {} the cost rises by {} of what the slopes at the estimate say; {}take \
         diagnose::profile",
        unknown.name,
        if place.standard_errors > 0.0 { "above" } else { "below" },
        if place.standard_errors.abs() > QUANTILE { "twice as far" } else { "at its end" },
        percent(part.max(0.0), 2),
        by_logarithm(unknown.transform, unknown.value)
    );
    Some((place.unknown, text))
}

/// The change of all coordinates along the profile of an unknown, by one standard error of it.
fn along(evidence: &Evidence<'_>, i: usize, covariances: &Covariances) -> Option<Vec<f64>> {
    let covariance = covariances.unknowns.as_ref()?;
    let error = covariance.standard_error(i);
    let of = |j: usize| {
        if evidence.point.held_for_covariance[j] {
            0.0
        } else {
            covariance.get(j, i) / (error * evidence.point.slopes[j])
        }
    };
    Some((0..evidence.point.slopes.len()).map(of).collect())
}

/// The expected curvature of the predictions along the profile of an unknown, by one standard error of it, in standard deviations of the
/// noise, if predictions depend on each unknown exponentially: half the square of its relative change, times what its logarithm moves
/// them by. What unknowns that replace each other move cancels to first order only.
fn expected_curvature(
    evidence: &Evidence<'_>,
    i: usize,
    unknowns: &[Unknown],
    covariances: &Covariances,
) -> Option<f64> {
    let bent = |(j, along): (usize, &f64)| {
        let unit = if unknowns[j].transform == Transform::Log { 1.0 } else { evidence.point.end.coordinates[j].abs() };
        let squares = along * along * evidence.point.norms[j];
        // An initial state next to zero says nothing of others, nor does an unknown that does not change.
        let counts = squares > 0.0 && (i == j || !matches!(unknowns[j].role, Role::InitialState(_)));
        if counts { 0.5 * squares / (unit * evidence.point.widening) } else { 0.0 }
    };
    Some(along(evidence, i, covariances)?.iter().enumerate().map(bent).sum())
}

/// By which part of its half width the ends of an interval move where the curvature is counted, positive where they
/// move down.
fn asymmetry(evidence: &Evidence<'_>, i: usize, covariances: &Covariances) -> Option<f64> {
    let error = covariances.unknowns.as_ref()?.standard_error(i);
    let along = along(evidence, i, covariances)?;
    let second = evidence.point.objective.second_along(&evidence.point.end.coordinates, &along).ok()?;
    // The errors are bent against the predictions.
    let bend =
        -second.step(&vec![0.0; along.len()], &evidence.point.held_for_covariance)?[i] * evidence.point.slopes[i];
    Some(0.5 * QUANTILE * bend / error).filter(|asymmetry| asymmetry.is_finite())
}

/// A remedy for an unknown of this value, if it has one.
fn by_logarithm(transform: Transform, value: f64) -> &'static str {
    match transform {
        Transform::Identity if value > 0.0 => "estimate its logarithm (.log()), or ",
        _ => "",
    }
}

/// The side on which an interval should reach further by its asymmetry.
fn side(asymmetry: f64) -> &'static str {
    if asymmetry > 0.0 { "below" } else { "above" }
}

#[cfg(test)]
mod tests {
    use super::{by_logarithm, side};
    use crate::parameter::Transform::{Identity, Log};

    #[test]
    fn an_interval_reaches_further_to_the_side_of_its_asymmetry() {
        assert_eq!([side(0.3), side(-0.3)], ["below", "above"]);
    }

    #[test]
    fn a_logarithm_that_exists_and_is_not_taken_yet() {
        assert!(by_logarithm(Identity, 2.0).contains("logarithm"));
        assert_eq!([(Identity, 0.0), (Identity, -2.0), (Log, 2.0)].map(|(of, value)| by_logarithm(of, value)), [""; 3]);
    }
}
