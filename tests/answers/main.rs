//! What is said of an estimate: intervals, diagnostics, comparison, reports.

mod colored;
mod compare;
mod identifiability;
mod intervals;
mod random;
mod reports;
mod residuals;
#[path = "../common/shared.rs"]
mod shared;
mod silent_failures;
