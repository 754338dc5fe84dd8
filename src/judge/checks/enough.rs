//! Warnings about too few measurements.

use crate::estimate::{Knowledge, Unknown, Warning, WarningCode};
use crate::judge::check::Check;
use crate::judge::evidence::Evidence;
use crate::optimize::Severity;

pub(crate) const ENOUGH: Check = Check {
    name: "measurements determine the unknowns",
    asks: "Are there more measurements than unknowns, and does one unknown at least have an interval?",
    codes: &[WarningCode::TooFewMeasurements, WarningCode::NothingDetermined],
    costs: &[],
    levels: &[],
    examine: |evidence, intervals| of_the_data(evidence, &intervals.unknowns).into(),
};

/// Whether there are too few measurements, or none that determine an unknown.
fn of_the_data(evidence: &Evidence<'_>, unknowns: &[Unknown]) -> Option<Warning> {
    let (measured, severity) = (evidence.residuals.measured, Severity::NotUsable);
    if measured <= unknowns.len() as u64 {
        let text = format!(
            "{measured} measurement(s) for {} unknown(s) leave nothing to tell the accuracy by; fix some, or record more",
            unknowns.len()
        );
        return Some(Warning { code: WarningCode::TooFewMeasurements, severity, text });
    }
    let none = unknowns.iter().all(|row| row.knowledge == Knowledge::Unidentified);
    none.then(|| Warning {
        code: WarningCode::NothingDetermined,
        severity,
        text: "the data determine none of the unknowns".to_owned(),
    })
}
