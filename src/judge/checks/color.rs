//! Warnings about errors that are correlated over time.

use crate::estimate::{CovarianceMethod, Warning, WarningCode};
use crate::judge::check::{Check, Level};
use crate::judge::covariances::Covariances;
use crate::judge::evidence::Evidence;
use crate::judge::evidence::color::{LARGE, SMALL, severity};
use crate::judge::evidence::whiteness::WHITENESS_LEVEL;
use crate::numeral::{counted, number, p_value, percent};

pub(crate) const COLOR: Check = Check {
    name: "errors are white",
    asks: "Are errors autocorrelated (portmanteau tests over 3 and 20 lags, and of neighbors), and how much of the output is that?",
    codes: &[WarningCode::ColoredErrors],
    costs: &[],
    levels: &[
        Level {
            of: "the probability by chance, over all outputs",
            value: WHITENESS_LEVEL,
            source: "one good record in a hundred, a note",
        },
        Level { of: "the part of what an output moves of care", value: SMALL, source: "no parameter moves by more" },
        Level { of: "the part that is not usable", value: LARGE, source: "a half" },
    ],
    examine: |evidence, intervals| autocorrelation(evidence, &intervals.covariances).into(),
};

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
