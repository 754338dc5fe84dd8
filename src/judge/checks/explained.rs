//! Warnings about outputs that the model does not explain, and about a given noise that the errors contradict.

use super::*;
use crate::estimate::CovarianceMethod;
use crate::numeral::fit;
use crate::whiteness::chi_squared_tail;
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

pub(crate) const UNEXPLAINED: Check = Check::new(
    "the model explains its outputs",
    "Is the sum of squares smaller than that about the mean of the output, by Fisher's test with as many \
     measurements as are independent?",
    &[WarningCode::Unexplained, WarningCode::Staged],
    |evidence, _| unexplained(evidence).into(),
)
.levels(&[
    level("the probability by chance", LEVEL, "one good output in a thousand"),
    level("the fit (%) that explains nothing, whatever its significance", LITTLE, "5 %"),
]);

pub(crate) const GIVEN_NOISE: Check = Check::new(
    "the given noise is that of the errors",
    "Are the errors of the size that was given, by chi-squared with as many errors as are independent?",
    &[WarningCode::GivenNoise],
    |evidence, intervals| given_noise(evidence, intervals.covariances.method).into(),
)
.levels(&[
    level("the probability by chance", LEVEL, "one good output in a thousand"),
    level("the ratio from which on intervals are too narrow", NARROW, "they cover 90 % or less"),
    level("the ratio of care", DIFFERENT, "twice or half"),
    level("the ratio beyond which intervals mean nothing", FAR, "ten times"),
]);

/// Level of the tests against the mean and of a given noise.
const LEVEL: f64 = 1e-3;
/// A smaller fit (%) explains nothing, whatever its significance.
const LITTLE: f64 = 5.0;
/// A larger part of the variance is explained by chance only where hardly any independent error is left, which is said of
/// the color of the errors.
const MUCH: f64 = 0.5;
/// An output stands at a level, and the model gives that level, if movement and errors are below this part of it.
const LEVEL_PART: f64 = 0.1;
/// Errors of `DIFFERENT` times the given noise, either way, say that it is wrong; beyond `FAR`, or below one in `FAR_BELOW` where the
/// noise is larger than all that the output moves, that intervals mean nothing.
const DIFFERENT: f64 = 2.0;
/// From this ratio on intervals by a noise that was given cover 90 % or less.
const NARROW: f64 = 1.2;
const FAR: f64 = 10.0;
const FAR_BELOW: f64 = 100.0;

/// Sum of squared errors relative to that about the output's mean.
fn relative_errors(evidence: &Evidence<'_>, j: usize) -> Option<f64> {
    let (rmse, (_, moves)) = (evidence.residuals.outputs[j].rmse, evidence.residuals.levels[j]);
    (moves > 0.0 && evidence.residuals.outputs[j].fit_percent.is_some()).then(|| (rmse / moves).powi(2))
}

/// Probability that noise about a mean is explained as well: Fisher's test with as many measurements as are
/// independent.
fn by_chance_of(evidence: &Evidence<'_>, j: usize, relative: f64) -> f64 {
    by_chance(evidence.independent(j), evidence.point.values.len(), relative)
}

/// Whether the errors are no larger than the noise that was given.
fn is_noise(evidence: &Evidence<'_>, j: usize) -> bool {
    let Some(sigma) = evidence.point.objective.problem.settings.noise.given(j) else { return false };
    evidence.residuals.outputs[j].rmse <= sigma * (1.0 + 3.0 / (2.0 * evidence.independent(j)).sqrt())
}

/// Errors below this part of those of the mean are smaller, though it may be by chance.
const CLEARLY: f64 = 0.95;

/// Outputs that the model explains no better than their mean does.
fn unexplained(evidence: &Evidence<'_>) -> Vec<Warning> {
    let count = evidence.point.objective.outputs();
    let relative: Vec<Option<f64>> = (0..count).map(|j| relative_errors(evidence, j)).collect();
    let chance: Vec<f64> =
        (0..count).map(|j| relative[j].map_or(1.0, |relative| by_chance_of(evidence, j, relative))).collect();
    let explained = |j: usize| chance[j] < LEVEL && evidence.residuals.outputs[j].fit_percent > Some(LITTLE);
    let another = |j: usize| (0..count).any(|i| i != j && explained(i));
    // With a pre-filter, a weighting or a robust loss the fit did not have to explain all errors.
    let settings = &evidence.point.objective.problem.settings;
    let partly =
        settings.prefilter.is_some() || evidence.point.objective.is_weighted() || evidence.point.objective.is_robust();
    let mut warnings = vec![];
    for j in (0..count).filter(|&j| !explained(j) && !is_noise(evidence, j)) {
        let (Some(relative), (level, moves)) = (relative[j], evidence.residuals.levels[j]) else { continue };
        if relative < 1.0 - MUCH {
            continue;
        }
        let fit_percent = evidence.residuals.outputs[j].fit_percent.unwrap_or(0.0);
        let worse = is_worse(relative, evidence.independent(j));
        let rmse = evidence.residuals.outputs[j].rmse;
        let at_level = moves.max(rmse) < LEVEL_PART * level.abs();
        let Some(severity) = unexplained_severity(another(j), at_level, worse, partly) else { continue };
        let output = &evidence.point.objective.problem.layout().outputs[j].name;
        let than = match relative {
            _ if worse => "worse than",
            relative if relative < CLEARLY => "not certainly better than",
            _ => "no better than",
        };
        let text = format!(
            "the model explains `{output}` {than} its mean does (fit {} %): check signals, signs, units and the start \
             (Fit::starts searches from more), or excite the plant; if noise is all that is left, give its size",
            fit(fit_percent)
        );
        warnings.push(Warning::new(WarningCode::Unexplained, severity, text).about(About::Output(j)));
    }
    warnings
}

/// Noise that was given, and errors of another size; noise that a predictor of variances leaves out.
fn given_noise(evidence: &Evidence<'_>, method: CovarianceMethod) -> Vec<Warning> {
    let left_out = evidence.point.objective.problem.leaves_noise_out.then(|| {
        let text = format!(
            "noise that was asked for is left out: {} predicts the variance of each error by the noise of the model (Model::noise)",
            evidence.point.objective.sweep.predictor()
        );
        note(WarningCode::GivenNoise, text)
    });
    if evidence.point.objective.problem.settings.prefilter.is_some() || evidence.point.objective.is_weighted() {
        return left_out.into_iter().collect();
    }
    let outputs = evidence.point.objective.problem.layout().outputs.iter().enumerate();
    let one = |(j, output): (usize, &crate::layout::Quantity)| {
        let found = &evidence.residuals.outputs[j];
        let sigma = evidence.point.objective.problem.settings.noise.given(j)?;
        let ratio = found.rmse / sigma;
        if !contradicts(ratio, evidence.independent(j), evidence.point.values.len())
            || ratio > 1.0 && evidence.point.objective.is_robust()
        {
            return None;
        }
        let (_, moves) = evidence.residuals.levels[j];
        let narrow = method == CovarianceMethod::Classical && ratio > NARROW;
        let severity = noise_severity(ratio, sigma > moves, narrow);
        let intervals = match method {
            CovarianceMethod::Classical if ratio > 1.0 => "intervals are too narrow",
            CovarianceMethod::Classical => "intervals are too wide",
            _ => "intervals are by the errors",
        };
        let text = format!(
            "the noise of `{}` was given as {}{unit}, but the errors are {}{unit} (rms): {intervals}; leave the noise out to \
             have it estimated",
            output.name,
            number(sigma, 3),
            number(found.rmse, 3),
            unit = unit_after(&output.unit)
        );
        Some(Warning::new(WarningCode::GivenNoise, severity, text).about(About::Output(j)))
    };
    outputs.filter_map(one).chain(left_out).collect()
}

/// Probability that so many unknowns leave at most this part of the squares of as many independent errors about their mean
/// (Fisher's distribution).
fn by_chance(independent: f64, unknowns: usize, relative: f64) -> f64 {
    let unknowns = unknowns.max(1) as f64;
    let free = (independent - unknowns - 1.0).max(1.0);
    let statistic = (1.0 - relative) / unknowns / (relative / free).max(f64::MIN_POSITIVE);
    let distribution = FisherSnedecor::new(unknowns, free);
    if relative < 1.0 { distribution.map_or(1.0, |distribution| distribution.sf(statistic)) } else { 1.0 }
}

/// Whether squares of errors, relative to those about the mean, are more than rounding and three standard deviations of as many
/// independent ones above one.
fn is_worse(relative: f64, independent: f64) -> bool {
    relative > 1.02 + 3.0 * (2.0 / independent).sqrt()
}

/// How severe it is that an output is not explained: whether another is, whether this one stands at a level that the model
/// gives, whether its mean is better than the model, and whether the fit was to explain only a part of it.
fn unexplained_severity(another: bool, at_level: bool, worse: bool, partly: bool) -> Option<Severity> {
    match another {
        // Held by a controller, and given by the model.
        true if at_level && !worse => None,
        true if at_level || !worse => Some(Severity::UsableWithCare),
        _ if partly => Some(Severity::UsableWithCare),
        _ => Some(Severity::NotUsable),
    }
}

/// Whether errors of this size, relative to the noise given, are no chance with so many independent ones (chi-squared).
fn contradicts(ratio: f64, independent: f64, unknowns: usize) -> bool {
    let degrees = (independent - unknowns as f64).max(1.0);
    let above = chi_squared_tail(independent * ratio * ratio, degrees);
    above.min(1.0 - above) <= LEVEL / 2.0
}

/// How severe it is that errors are off the noise given by this ratio; `beyond` says that the noise is larger than all that the
/// output moves, `narrow` that intervals are too narrow by that.
fn noise_severity(ratio: f64, beyond: bool, narrow: bool) -> Severity {
    match ratio {
        ratio if ratio > FAR || ratio < FAR_BELOW.recip() && beyond => Severity::NotUsable,
        ratio if narrow || ratio > DIFFERENT || ratio < DIFFERENT.recip() => Severity::UsableWithCare,
        _ => Severity::Usable,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use Severity::{NotUsable, Usable, UsableWithCare};

    /// The 95 % points of Fisher's distribution: 4.9646 for (1, 10), 4.1028 for (2, 10) degrees of freedom; what is left is
    /// `1 / (1 + F m / n)`. Tables have five digits.
    #[test]
    fn explained_by_chance_as_tables_say() {
        assert!((by_chance(12.0, 1, 1.0 / (1.0 + 4.9646 / 10.0)) - 0.05).abs() < 1e-5);
        assert!((by_chance(13.0, 2, 1.0 / (1.0 + 4.1028 * 2.0 / 10.0)) - 0.05).abs() < 1e-5);
        // Without unknowns as with one; without degrees of freedom as with one: F(1, 1) = 161.45.
        assert!((by_chance(12.0, 0, 1.0 / (1.0 + 4.9646 / 10.0)) - 0.05).abs() < 1e-5);
        assert!((by_chance(1.0, 1, 1.0 / (1.0 + 161.45)) - 0.05).abs() < 1e-5);
        assert_eq!([by_chance(12.0, 1, 0.0), by_chance(12.0, 1, 1.0), by_chance(12.0, 1, 2.0)], [0.0, 1.0, 1.0]);
    }

    /// A variance of 50 errors has a standard deviation of a fifth of itself.
    #[test]
    fn errors_worse_than_the_mean() {
        assert!(is_worse(1.63, 50.0) && !is_worse(1.61, 50.0) && !is_worse(1.02, f64::INFINITY));
    }

    #[test]
    fn outputs_that_nothing_explains() {
        // (another is explained, at its level, worse than the mean, fitted in part)
        let cases = [
            ((true, true, false, false), None),
            ((true, true, false, true), None),
            ((true, true, true, false), Some(UsableWithCare)),
            ((true, false, false, false), Some(UsableWithCare)),
            ((true, false, true, false), Some(NotUsable)),
            ((true, false, true, true), Some(UsableWithCare)),
            ((false, true, false, false), Some(NotUsable)),
            ((false, true, false, true), Some(UsableWithCare)),
            ((false, false, true, false), Some(NotUsable)),
        ];
        for ((another, at_level, worse, partly), severity) in cases {
            assert_eq!(
                unexplained_severity(another, at_level, worse, partly),
                severity,
                "{another} {at_level} {worse} {partly}"
            );
        }
    }

    /// The 0.05 % and 99.95 % points of chi-squared with 10 degrees of freedom are 1.2650 and 31.420 (tables; five digits), here
    /// of twelve errors and two unknowns.
    #[test]
    fn a_noise_is_contradicted_beyond_its_points() {
        let ratio = |squares: f64| (squares / 12.0f64).sqrt();
        assert!(contradicts(ratio(31.43), 12.0, 2) && !contradicts(ratio(31.41), 12.0, 2));
        assert!(contradicts(ratio(1.2645), 12.0, 2) && !contradicts(ratio(1.2655), 12.0, 2));
        // 12.116 with one degree of freedom, which is the least.
        assert!(contradicts(12.12f64.sqrt(), 1.0, 1) && !contradicts(12.11f64.sqrt(), 1.0, 1));
    }

    #[test]
    fn how_far_errors_are_off_their_noise() {
        let severities =
            [10.1, 10.0, 2.01, 2.0, 0.5, 0.49, 0.0101, 0.0099].map(|ratio| noise_severity(ratio, true, false));
        let care = UsableWithCare;
        assert_eq!(severities, [NotUsable, care, care, Usable, Usable, care, care, NotUsable]);
        assert_eq!(
            [
                noise_severity(0.0099, false, false),
                noise_severity(10.1, false, false),
                noise_severity(1.3, false, true)
            ],
            [care, NotUsable, care]
        );
    }
}
