//! Warnings about errors that are larger or smaller where an unknown is determined.

use crate::estimate::{CovarianceMethod, Unknown, Warning, WarningCode};
use crate::judge::check::{Check, Level, Pass};
use crate::judge::covariances::Covariances;
use crate::judge::evidence::sizes::{SAID, Uneven};
use crate::numeral::number;
use crate::optimize::Severity;

pub(crate) const UNEVEN_ERRORS: Check = Check {
    name: "errors are of one size",
    asks: "Are errors larger, or smaller, where an unknown is determined (White 1980; Koenker 1981)?",
    codes: &[WarningCode::UnevenErrors],
    costs: &[Pass::Rows],
    levels: &[
        Level {
            of: "the probability by chance, over all unknowns",
            value: SAID,
            source: "one good record in a hundred",
        },
        Level { of: "the ratio of standard errors of care", value: NARROW, source: "intervals cover 90 % or less" },
    ],
    examine: |_, intervals| uneven_errors(&intervals.unknowns, &intervals.covariances).into(),
};

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
