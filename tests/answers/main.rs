//! What is said of an estimate: identifiability, diagnostics, comparison, reports.

#[path = "../common/mod.rs"]
mod common;
mod compare;
mod filters;
mod gallery;
mod identifiability;
mod json;
mod one_verdict;
mod pages;
#[path = "../common/random.rs"]
mod random;
mod reports;
mod residuals;
mod scales;
#[path = "../common/shared.rs"]
mod shared;
mod silent_failures;
mod states;
mod stops;
mod told_apart;
