//! What is said of an estimate: intervals, diagnostics, comparison, reports.

mod compare;
mod identifiability;
mod reports;
mod residuals;
#[path = "../common/shared.rs"]
mod shared;
mod silent_failures;
