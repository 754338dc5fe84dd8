//! Warnings about errors of several outputs that are correlated at the same sample.

use crate::estimate::{Warning, WarningCode};
use crate::judge::check::{Check, Level};
use crate::judge::evidence::Evidence;
use crate::judge::evidence::coupling::{Coupled, LEVEL};
use crate::numeral::{number, p_value};
use crate::optimize::Severity;

pub(crate) const COUPLED: Check = Check {
    name: "errors of outputs are independent",
    asks: "Are the errors of two outputs correlated at the same sample?",
    codes: &[WarningCode::CorrelatedOutputs],
    costs: &[],
    levels: &[Level {
        of: "the probability by chance, over all pairs",
        value: LEVEL,
        source: "one good record in a hundred, a note",
    }],
    examine: |evidence, _| correlated_outputs(evidence).into(),
};

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
    Some(Warning { code: WarningCode::CorrelatedOutputs, severity: Severity::Usable, text })
}
