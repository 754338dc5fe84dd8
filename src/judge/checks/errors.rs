//! Warnings about errors that are correlated, over time or between outputs, and about errors and standard errors of several sizes.

use super::*;
use crate::covariance::sizes::{SAID, Uneven};
use crate::estimate::CovarianceMethod;
use crate::judge::evidence::color::{LARGE, SMALL, severity};
use crate::parameter::Transform;
use crate::residuals::coupling::{Coupled, LEVEL};
use crate::residuals::whiteness::WHITENESS_LEVEL;

pub(crate) const GROWING: Check = Check::new(
    "standard errors do not grow with their unknown",
    "Where variances are predicted: does the standard error of an unknown, such as a noise level, grow along its \
     interval?",
    &[WarningCode::CurvedInterval],
    |evidence, intervals| {
        let many = intervals.covariances.own.is_empty() && evidence.point.objective.sweep.predicts_variance();
        Examined::unless(many.then_some("more than 12 unknowns beside predicted variances"), || {
            uneven(&intervals.unknowns, &intervals.covariances)
        })
    },
)
.levels(&[level(
    "the change of the logarithm of its variance over a standard error",
    UNEVEN,
    "a relative standard error of 15 %",
)]);

/// Change of the logarithm of an unknown's variance over one standard error of the unknown, from which on a symmetric interval is
/// named. For a noise level the change is twice its relative standard error, so that 0.3 is 15 % (see docs/intervals.md).
const UNEVEN: f64 = 0.3;

/// An unknown, such as a noise level, whose interval should reach further above than below.
fn uneven(unknowns: &[Unknown], covariances: &Covariances) -> Option<Warning> {
    let eligible =
        |i: usize| unknowns[i].transform == Transform::Identity && unknowns[i].knowledge.standard_error().is_some();
    let own = covariances.own.iter().enumerate().filter(|(i, own)| own.is_finite() && eligible(*i));
    let (i, own) = own.max_by(|a, b| a.1.total_cmp(b.1))?;
    if *own <= UNEVEN {
        return None;
    }
    let unknown = &unknowns[i];
    let text = format!(
        "the standard error of `{}` grows with its value, by {} per standard error: its interval is too short above; \
         estimate its logarithm (.log())",
        unknown.name,
        percent(0.5 * own, 2)
    );
    Some(note(WarningCode::CurvedInterval, text))
}

pub(crate) const UNEVEN_ERRORS: Check = Check::new(
    "errors are of one size",
    "Are errors larger, or smaller, where an unknown is determined (White 1980; Koenker 1981)?",
    &[WarningCode::UnevenErrors],
    |_, intervals| uneven_errors(&intervals.unknowns, &intervals.covariances).into(),
)
.costs(&[Pass::Rows])
.levels(&[
    level("the probability by chance, over all unknowns", SAID, "one good record in a hundred"),
    level("the ratio of standard errors of care", NARROW, "intervals cover 90 % or less"),
]);

/// From this ratio of standard errors on, a classical interval is not usable without care: it covers 90 % or less.
const NARROW: f64 = 1.2;

/// Errors that are larger or smaller where an unknown is determined.
fn uneven_errors(unknowns: &[Unknown], covariances: &Covariances) -> Option<Warning> {
    let Uneven { unknown, factor, p_value } = covariances.uneven?;
    let (name, times) = (&unknowns[unknown].name, number(factor, 2));
    let found = format!(
        "the errors are {times} times as large where `{name}` is determined as they are on average ({})",
        crate::numeral::p_value(p_value)
    );
    let classical = covariances.method == CovarianceMethod::Classical;
    let (allowed, severity) = match classical {
        true => (
            format!(
                "its standard error takes them as of one size and would be {times} times as large otherwise; weigh them by \
                 their noise, or by one, with which the intervals allow for it (Fit::weighting)"
            ),
            if factor > NARROW { Severity::UsableWithCare } else { Severity::Usable },
        ),
        false => (
            "the intervals allow for it; weights by their noise would make the estimate better (Fit::weighting)"
                .to_owned(),
            Severity::Usable,
        ),
    };
    Some(Warning { code: WarningCode::UnevenErrors, severity, text: format!("{found}: {allowed}") })
}

pub(crate) const COLOR: Check = Check::new(
    "errors are white",
    "Are errors autocorrelated (portmanteau tests over 3 and 20 lags, and of neighbors), and how much of the \
     output is that?",
    &[WarningCode::ColoredErrors],
    |evidence, intervals| autocorrelation(evidence, &intervals.covariances).into(),
)
.levels(&[
    level("the probability by chance, over all outputs", WHITENESS_LEVEL, "one good record in a hundred, a note"),
    level("the part of what an output moves of care", SMALL, "no parameter moves by more"),
    level("the part that is not usable", LARGE, "a half"),
]);

/// Whether the errors are autocorrelated, how much of the output that is, and what of it the intervals allow for.
fn autocorrelation(evidence: &Evidence<'_>, covariances: &Covariances) -> Option<Warning> {
    let (output, white) = evidence.autocorrelated()?;
    let part = evidence.colored_part();
    let severity = severity(part);
    let output = &evidence.point.objective.problem.layout().outputs[output].name;
    let (probability, first) = (p_value(white.p_value.min(1.0)), number(white.correlations[0], 2));
    let mut text = format!(
        "the errors of `{output}` are not white ({probability}, correlation with the error before \
         {first}): the model misses a part, or the noise is colored"
    );
    if part > SMALL {
        text += &format!("; the colored part is {} of what an output moves", percent(part, 2));
    }
    let by = match covariances.method {
        CovarianceMethod::Hac { lags: 0 } => "colored noise (an autoregression of the errors)".to_owned(),
        CovarianceMethod::Hac { lags } => format!("colored noise (HAC over {}, prewhitened)", counted(lags, "lag")),
        CovarianceMethod::Clusters { records } => format!("errors of any color ({records} records as clusters)"),
        _ => {
            text += "; the intervals take them as white and are too narrow if the order of the samples matters";
            return Some(Warning { code: WarningCode::ColoredErrors, severity, text });
        }
    };
    let white = |i: usize| {
        let unit = evidence.unit()?;
        Some(unit.standard_error(i) * evidence.point.widening * evidence.point.slopes[i].abs())
            .filter(|error| *error > 0.0)
    };
    let widened = |i: usize| Some(covariances.unknowns.as_ref()?.standard_error(i) / white(i)?);
    let widest = (0..evidence.point.slopes.len()).filter_map(widened).fold(0.0, f64::max);
    text += &format!("; the intervals allow for {by}, not for a wrong model");
    if widest > 1.0 {
        text += &format!("; they are up to {} times as wide as for white errors", number(widest, 3));
    }
    Some(Warning { code: WarningCode::ColoredErrors, severity, text })
}

pub(crate) const COUPLED: Check = Check::new(
    "errors of outputs are independent",
    "Are the errors of two outputs correlated at the same sample?",
    &[WarningCode::CorrelatedOutputs],
    |evidence, _| correlated_outputs(evidence).into(),
)
.levels(&[level("the probability by chance, over all pairs", LEVEL, "one good record in a hundred, a note")]);

/// The warning about correlated outputs: every covariance but the classical one, which is not taken then, allows for them.
fn correlated_outputs(evidence: &Evidence<'_>) -> Option<Warning> {
    let Coupled { outputs: (i, j), correlation, p_value: chance } = evidence.coupled()?;
    let outputs = &evidence.point.objective.problem.layout().outputs;
    let text = format!(
        "the errors of `{}` and `{}` are correlated at the same sample ({}, {}); the estimate does not allow for it, the intervals \
         do; a full noise covariance (Fit::noise_covariance) weighs them right",
        outputs[i].name,
        outputs[j].name,
        number(correlation, 2),
        p_value(chance)
    );
    Some(note(WarningCode::CorrelatedOutputs, text))
}
