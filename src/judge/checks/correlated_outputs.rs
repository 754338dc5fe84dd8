//! Warnings about errors of several outputs that are correlated at the same sample.

use crate::estimate::{Warning, WarningCode};
use crate::judge::evidence::Evidence;
use crate::judge::evidence::coupling::Coupled;
use crate::numeral::{number, p_value};
use crate::optimize::Severity;

/// The warning about correlated outputs: every covariance but the classical one, which is not taken then, allows for them.
pub(crate) fn correlated_outputs(evidence: &Evidence<'_>) -> Option<Warning> {
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
    Some(Warning { code: WarningCode::CorrelatedOutputs, severity: Severity::Usable, text })
}
