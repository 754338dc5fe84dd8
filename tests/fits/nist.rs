//! NIST's Statistical Reference Datasets, nonlinear regression: certified parameters and standard errors, from both starts.

#[path = "../../examples/nist/file.rs"]
mod file;
#[path = "../../examples/nist/problems.rs"]
mod problems;

use crate::shared::shared;
use file::{File, Found};
use std::path::PathBuf;

/// The files, if they are there.
fn files() -> Vec<PathBuf> {
    let Some(folder) = shared("nist") else { return vec![] };
    std::fs::read_dir(folder)
        .unwrap()
        .flatten()
        .map(|entry| entry.path())
        .filter(|path| path.extension().is_some_and(|e| e == "dat"))
        .collect()
}

#[test]
fn certified_digits_from_both_starts() {
    for path in files() {
        let file = File::read(&path).expect("a file of NIST's");
        for found in file.fit().expect("a fit") {
            let Found { name, start, outcome, iterations, parameters, standard_errors } = &found;
            println!("{name:<10} {start} {parameters:>5.1} {standard_errors:>5.1} {iterations:>5} {outcome}");
            assert!(outcome.converged(), "{name}, start {start}: {outcome}");
            // A search stops where no unknown would move by more than 1e-10 of itself.
            assert!(*parameters >= 9.0, "{name}, start {start}: {parameters} digits, {outcome}");
            // Lanczos1's residuals (9e-14) are rounding of its 13-digit data: few digits of them are left in doubles.
            let needed = if name == "Lanczos1" { 2.0 } else { 6.0 };
            assert!(*standard_errors >= needed, "{name}, start {start}: {standard_errors} digits of standard errors");
        }
    }
}

#[test]
fn a_problem_that_is_not_known_is_named() {
    let file = File { name: "Misra2z".to_owned(), parameters: vec![], data: vec![] };
    assert_eq!(file.fit().err().as_deref(), Some("Misra2z: not a known problem"));
}
