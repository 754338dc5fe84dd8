//! Warnings about what is known of the parameters: standard errors that are none, intervals that hold zero, signs and
//! sizes that are not those of the start.

use super::*;
use crate::estimate::student::quantile;
use crate::judge::covariances::is_error;
use crate::parameter::{Prior, Transform};
use crate::problem::Free;

pub(crate) const NO_ERROR: Check = Check::new(
    "standard errors are numbers",
    "Is a standard error zero, infinite or no number?",
    &[WarningCode::NoStandardError],
    |evidence, intervals| without_error(evidence, &intervals.unknowns, &intervals.covariances).into(),
);

pub(crate) const ZERO: Check = Check::new(
    "parameters are told from zero",
    "Is an interval wider than its value? Not usable where it is so for all parameters.",
    &[WarningCode::HoldsZero],
    |evidence, intervals| near_zero(evidence, &intervals.unknowns).into(),
);

pub(crate) const PRIORS: Check = Check::new(
    "the data agree with the priors",
    "Is the estimate as far from the mean of its prior as chance allows (Hausman 1978)?",
    &[WarningCode::PriorContradicts],
    |evidence, intervals| against_priors(evidence, &intervals.unknowns).into(),
)
.levels(&[
    level("the distance of care, in standard deviations", UNLIKELY, "one in a thousand"),
    level("the distance that is not usable", CONTRADICTS, "one in two million"),
]);

pub(crate) const SIGNS: Check = Check::new(
    "parameters have the sign of their start",
    "Has a parameter that is told from zero the opposite sign of its start?",
    &[WarningCode::SignChanged],
    |_, intervals| opposite(&intervals.unknowns).into(),
);

pub(crate) const SIZES: Check = Check::new(
    "parameters are of the size of their start",
    "Is a parameter so many times its start, or one such part of it, that a unit is another, or that the search \
     ran away along a direction that the data do not determine?",
    &[WarningCode::FarFromStart],
    |_, intervals| far_from_start(&intervals.unknowns).into(),
)
.levels(&[
    level("the ratio", ANOTHER_UNIT, "beyond 360 degrees in a turn, below 1,000"),
    level("the ratio of a parameter that is not determined, which is not usable", RUN_AWAY, "no start is that far off"),
]);

/// A parameter so many times its start, or one such part of it, is in another unit.
const ANOTHER_UNIT: f64 = 400.0;
/// The ratio to its start of a parameter that the data do not determine: the search has run along a direction in which it changes nothing.
const RUN_AWAY: f64 = 1e4;

/// Standard deviations of their difference between estimate and prior mean from which on an estimate is with care (chance exceeds them in
/// 0.1 %), and not usable.
const UNLIKELY: f64 = 3.3;
const CONTRADICTS: f64 = 5.0;
/// The least part of a prior's variance by which the data must lower it for the prior to be tested.
const LITTLE: f64 = 1e-3;

/// Names in backquotes, with commas.
fn listed<'a>(names: impl Iterator<Item = &'a str>) -> String {
    names.map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ")
}

/// Whether an interval is as wide as the value, so that it holds zero (or, of a logarithm, spans as much), whatever bounds say.
fn holds_zero(unknown: &Unknown) -> bool {
    unknown.unbounded().is_some_and(|(lower, upper)| upper - lower >= 2.0 * unknown.value.abs())
}

/// Whether the data tell an unknown from zero without its prior. What they say of it alone follows from both, as precisions add up.
fn told_by_data(unknown: &Unknown, prior: Prior) -> bool {
    let Some(standard_error) = unknown.knowledge.standard_error() else { return false };
    let (both, before) = (standard_error.powi(-2), prior.std.powi(-2));
    let alone = both - before;
    let value = (both * unknown.value - before * prior.mean) / alone;
    let quantile = quantile(0.975, unknown.degrees_of_freedom);
    alone > 0.0 && value.abs() > quantile / alone.sqrt()
}

/// Unknowns whose standard error came out as zero, infinite or not a number.
fn without_error(evidence: &Evidence<'_>, unknowns: &[Unknown], covariances: &Covariances) -> Option<Warning> {
    let covariance = covariances.unknowns.as_ref().filter(|_| evidence.point.degrees > 0.0)?;
    let seen = evidence.point.seen();
    let wrong = |(i, _): &(usize, &Unknown)| seen[*i] && !is_error(covariance.standard_error(*i));
    let wrong: Vec<(usize, &Unknown)> = unknowns.iter().enumerate().filter(wrong).collect();
    let (first, _) = *wrong.first()?;
    let text = format!(
        "the standard error of {} is {}: nothing is known of it; check noise, loss and weighting, and whether the outputs \
         move at all",
        listed(wrong.iter().map(|(_, unknown)| unknown.name.as_str())),
        number(covariance.standard_error(first), 2)
    );
    Some(not_usable(WarningCode::NoStandardError, text))
}

/// What intervals as wide as their values mean: zero may be in them, and a logarithm is known to a factor.
fn wide(unknowns: &[&Unknown]) -> String {
    let names = |transform: Transform| {
        let of = unknowns.iter().filter(|unknown| unknown.transform == transform);
        listed(of.map(|unknown| unknown.name.as_str()))
    };
    let factor = |unknown: &&Unknown| unknown.unbounded().map_or(1.0, |(lower, upper)| (upper / lower).sqrt());
    let logarithms = unknowns.iter().filter(|unknown| unknown.transform == Transform::Log);
    let factors: Vec<String> = logarithms.map(factor).map(|factor| number(factor, 2).to_string()).collect();
    let known = match &factors[..] {
        [] => String::new(),
        [one] => format!("is known to a factor of {one} only"),
        several => format!("are known to factors of {} only", several.join(", ")),
    };
    let said = [
        (names(Transform::Identity), "cannot be told from zero: an interval is wider than its value".to_owned()),
        (names(Transform::Log), known),
    ];
    let said = said.into_iter().filter(|(names, _)| !names.is_empty()).map(|(names, what)| format!("{names} {what}"));
    said.collect::<Vec<_>>().join(", and ")
}

/// Parameters that cannot be told from zero, or are known to a factor only.
fn near_zero(evidence: &Evidence<'_>, unknowns: &[Unknown]) -> Option<Warning> {
    let rows = &evidence.point.objective.problem.unknowns.row;
    let parameters = || unknowns.iter().zip(rows).filter(|(unknown, _)| matches!(unknown.role, Role::Parameter(_)));
    let without_prior = parameters().filter(|(_, row)| row.parameter.prior.is_none()).map(|(unknown, _)| unknown);
    let unknown: Vec<&Unknown> = without_prior.filter(|unknown| holds_zero(unknown)).collect();
    if unknown.is_empty() {
        return None;
    }
    let all = parameters().all(|(unknown, row)| match row.parameter.prior {
        Some(prior) => !told_by_data(unknown, prior),
        None => holds_zero(unknown) || unknown.knowledge == Knowledge::Unidentified,
    });
    let text = match all {
        false => format!("{}; excite what depends on it, or fix it", wide(&unknown)),
        true => format!(
            "no parameter is known: {}; vary {} more, or measure longer",
            wide(&unknown),
            match evidence.point.objective.problem.layout().inputs.as_slice() {
                [] => "the initial state".to_owned(),
                inputs => listed(inputs.iter().map(|input| input.name.as_str())),
            }
        ),
    };
    let severity = if all { Severity::NotUsable } else { Severity::UsableWithCare };
    Some(Warning::new(WarningCode::HoldsZero, severity, text))
}

/// Unknowns whose estimate differs from the mean of their prior by more than chance.
fn against_priors(evidence: &Evidence<'_>, unknowns: &[Unknown]) -> Vec<Warning> {
    let rows = evidence.point.objective.problem.unknowns.row.iter().zip(unknowns).enumerate();
    let one = |(i, (row, unknown)): (usize, (&Free, &Unknown))| {
        let prior = row.parameter.prior?;
        let by_weights = evidence.unit()?.standard_error(i) * unknown.transform.slope(unknown.value);
        let distance = distance(unknown, prior, by_weights).filter(|distance| *distance > UNLIKELY)?;
        let (Unknown { name, value, .. }, Prior { mean, std }) = (unknown, prior);
        let unit = unit_after(&unknown.unit);
        let text = format!(
            "the data contradict the prior of `{name}`, {} +- {}{unit}: with it `{name}` is {}{unit}, {} standard deviations of \
             that difference from its mean; check prior, model and units, or leave the prior out",
            exact(mean),
            exact(std),
            number(*value, 4),
            number(distance, 2)
        );
        let severity = if distance > CONTRADICTS { Severity::NotUsable } else { Severity::UsableWithCare };
        Some(Warning::new(WarningCode::PriorContradicts, severity, text).about(About::Unknown(i)))
    };
    rows.filter_map(one).collect()
}

/// How far an estimate is from the mean of its prior, in standard deviations of that distance. `by_weights` is its standard error if the weights of the
/// data are the inverse of their variance. The estimate takes a part `w = 1 - by_weights^2 / std^2` of its value from the data, whatever their
/// noise, so that the variance of the distance is `error^2 + (2 w - 1) std^2`; with right weights `std^2 - error^2` (Hausman, Econometrica 46 (1978) 1251).
fn distance(unknown: &Unknown, prior: Prior, by_weights: f64) -> Option<f64> {
    let error = unknown.knowledge.standard_error()?;
    let variance = error * error + prior.std * prior.std - 2.0 * by_weights * by_weights;
    // An estimate that is hardly better than its prior says nothing of it.
    (variance > LITTLE * prior.std * prior.std).then(|| (unknown.value - prior.mean).abs() / variance.sqrt())
}

/// An unknown, its place, and the ratio of its value to its start.
type Started<'u> = (usize, &'u Unknown, f64);

/// The parameters that a start was given for.
fn all_started(unknowns: &[Unknown]) -> impl Iterator<Item = Started<'_>> {
    let started = |(_, unknown): &(usize, &Unknown)| matches!(unknown.role, Role::Parameter(_)) && unknown.start != 0.0;
    unknowns.iter().enumerate().filter(started).map(|(i, unknown)| (i, unknown, unknown.value / unknown.start))
}

/// Those of them that are known.
fn started(unknowns: &[Unknown]) -> impl Iterator<Item = Started<'_>> {
    all_started(unknowns).filter(|(_, unknown, _)| unknown.knowledge.standard_error().is_some())
}

/// Parameters of the opposite sign than their start.
fn opposite(unknowns: &[Unknown]) -> Vec<Warning> {
    let turned = started(unknowns).filter(|(_, unknown, ratio)| ratio.is_sign_negative() && !holds_zero(unknown));
    let one = |(i, unknown, _): Started<'_>| {
        let (Unknown { name, value, start, .. }, unit) = (unknown, unit_after(&unknown.unit));
        let text = format!(
            "`{name}` is {}{unit}, but its start was {}: the sign has changed; check the signs of the signals, or give a \
             bound",
            number(*value, 4),
            exact(*start)
        );
        with_care(WarningCode::SignChanged, text).about(About::Unknown(i))
    };
    turned.map(one).collect()
}

/// Parameters of another order of magnitude than their start.
fn far_from_start(unknowns: &[Unknown]) -> Vec<Warning> {
    let far = started(unknowns).filter(|(_, unknown, ratio)| {
        let size = ratio.abs();
        !holds_zero(unknown) && (size > ANOTHER_UNIT || size < ANOTHER_UNIT.recip())
    });
    let one = |(i, unknown, ratio): Started<'_>| {
        let (Unknown { name, value, start, .. }, unit) = (unknown, unit_after(&unknown.unit));
        let text = format!(
            "`{name}` is {}{unit}, {} times its start {}: check the units of signals and time",
            number(*value, 4),
            number(ratio, 2),
            exact(*start)
        );
        with_care(WarningCode::FarFromStart, text).about(About::Unknown(i))
    };
    let ran = all_started(unknowns).filter(|(_, unknown, ratio)| {
        let size = ratio.abs();
        unknown.knowledge == Knowledge::Unidentified && (size > RUN_AWAY || size < RUN_AWAY.recip())
    });
    let away = |(i, unknown, ratio): Started<'_>| {
        let (Unknown { name, value, start, .. }, unit) = (unknown, unit_after(&unknown.unit));
        let text = format!(
            "`{name}` is {}{unit}, {} times its start {}, and the data do not determine it: the search has run along a direction that \
             changes nothing; check signals and units, fix it, or give it a bound or a prior",
            number(*value, 4),
            number(ratio, 2),
            exact(*start)
        );
        not_usable(WarningCode::FarFromStart, text).about(About::Unknown(i))
    };
    far.map(one).chain(ran.map(away)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unknown(value: f64, start: f64, width: f64) -> Unknown {
        Unknown {
            name: "a".to_owned(),
            unit: "V".to_owned(),
            role: Role::Parameter(0),
            experiment: None,
            value,
            start,
            bounds: (f64::NEG_INFINITY, f64::INFINITY),
            knowledge: Knowledge::Known {
                standard_error: width / 2.0 / quantile(0.975, 10.0),
                lower: value - width / 2.0,
                upper: value + width / 2.0,
            },
            error_index: None,
            error_index_held: None,
            transform: Transform::Identity,
            degrees_of_freedom: 10.0,
        }
    }

    /// An interval of twice the value's size reaches zero, and then nothing is said of the start.
    #[test]
    fn intervals_that_hold_zero() {
        for sign in [-1.0, 1.0] {
            assert!(holds_zero(&unknown(sign * 2.0, 1.0, 4.0)) && !holds_zero(&unknown(sign * 2.0, 1.0, 3.9)));
        }
        assert!(!holds_zero(&Unknown { knowledge: Knowledge::Unidentified, ..unknown(2.0, 1.0, 4.0) }));
        assert!(
            opposite(&[unknown(-2.0, 1.0, 4.0)]).is_empty() && far_from_start(&[unknown(2e3, 1.0, 4e3)]).is_empty()
        );
    }

    /// Prior 3 +- 1 and data 2 +- 0.5 make 2.2 +- 0.447: the data alone tell it from zero where Student's quantile is below 4, which is
    /// 3.18 with three degrees of freedom and 4.30 with two. Errors no smaller than the prior's are the prior's.
    #[test]
    fn what_the_data_say_without_the_prior() {
        let error = 0.2f64.sqrt();
        let told = |degrees_of_freedom: f64, error: f64| {
            let knowledge = Knowledge::Known { standard_error: error, lower: 2.0, upper: 2.4 };
            let unknown = Unknown { knowledge, degrees_of_freedom, ..unknown(2.2, 1.0, 1.0) };
            told_by_data(&unknown, Prior { mean: 3.0, std: 1.0 })
        };
        assert!(told(3.0, error) && !told(2.0, error));
        assert!(!told(1e9, 1.0) && !told(1e9, 1.1));
    }

    /// More than 400 times the start or less than a 400th of it; not for a start of zero, nor for a value that is not known.
    #[test]
    fn values_far_from_their_start() {
        let said = |value: f64, start: f64| far_from_start(&[unknown(value, start, 1e-3 * value.abs())]).len();
        assert_eq!(
            [said(400.0, 1.0), said(401.0, 1.0), said(-401.0, 1.0), said(1.0, 400.0), said(1.0, 401.0)],
            [0, 1, 1, 0, 1]
        );
        assert_eq!([said(401.0, 0.0), said(1.0, -500.0)], [0, 1]);
        assert!(
            far_from_start(&[Unknown { knowledge: Knowledge::Unidentified, ..unknown(401.0, 1.0, 1.0) }]).is_empty()
        );
        let lost = |value: f64| Unknown { knowledge: Knowledge::Unidentified, ..unknown(value, 1.0, 1.0) };
        let severities = |value: f64| far_from_start(&[lost(value)]).iter().map(|one| one.severity).collect::<Vec<_>>();
        assert_eq!([severities(-1.01e4), severities(0.99e-4)], [[Severity::NotUsable], [Severity::NotUsable]]);
        assert!(severities(0.99e4).is_empty() && severities(1.01e-4).is_empty());
        let state = Unknown { role: Role::InitialState(0), ..unknown(-401.0, 1.0, 1.0) };
        assert!(far_from_start(std::slice::from_ref(&state)).is_empty() && opposite(&[state]).is_empty());
        let text = &far_from_start(&[unknown(500.0, 1.0, 1.0)])[0].text;
        assert_eq!(text, "`a` is 500 V, 500 times its start 1: check the units of signals and time");
        let ratio = Unknown { unit: "1".to_owned(), ..unknown(500.0, 1.0, 1.0) };
        assert!(far_from_start(&[ratio])[0].text.starts_with("`a` is 500, 500 times its start 1"));
    }

    #[test]
    fn values_of_the_other_sign() {
        let said = |value: f64, start: f64| opposite(&[unknown(value, start, 1e-3)]).len();
        assert_eq!(
            [said(1.0, 1.0), said(-1.0, 1.0), said(1.0, -1.0), said(-1.0, -1.0), said(-1.0, 0.0)],
            [0, 1, 1, 0, 0]
        );
        let text = &opposite(&[unknown(-2.0, 1.0, 1.0)])[0].text;
        assert!(text.starts_with("`a` is -2 V, but its start was 1: the sign has changed"), "{text}");
    }

    #[test]
    fn standard_errors_are_positive_numbers() {
        let errors = [0.0, f64::MIN_POSITIVE, 1.0, -1.0, f64::INFINITY, f64::NAN];
        assert_eq!(errors.map(is_error), [false, true, true, false, false, false]);
    }
}
