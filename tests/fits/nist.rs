//! NIST's Statistical Reference Datasets, nonlinear regression: certified parameters, standard errors and residual standard
//! deviation, from both starts.

#[path = "../../examples/nist/file.rs"]
mod file;
#[path = "../../examples/nist/problems.rs"]
mod problems;

use crate::shared::shared;
use file::{File, Found};
use std::path::{Path, PathBuf};

/// The files of a folder.
fn files(folder: &Path) -> Vec<PathBuf> {
    let paths = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    paths.filter(|path| path.extension().is_some_and(|e| e == "dat")).collect()
}

/// Fits the files from both starts and compares with what is certified.
fn hold_to_the_certified(paths: &[PathBuf]) {
    for path in paths {
        let file = File::read(path).expect("a file of NIST's");
        for found in file.fit().expect("a fit") {
            let Found { name, start, outcome, iterations, parameters, standard_errors, residual } = &found;
            println!(
                "{name:<10} {start} {parameters:>5.1} {standard_errors:>5.1} {residual:>5.1} {iterations:>5} {outcome}"
            );
            assert!(outcome.converged(), "{name}, start {start}: {outcome}");
            // A search stops where no unknown would move by more than 1e-10 of itself.
            assert!(*parameters >= 9.0, "{name}, start {start}: {parameters} digits, {outcome}");
            // Lanczos1's residuals (9e-14) are rounding of its 13-digit data: few digits of them are left in doubles.
            let needed = if name == "Lanczos1" { 2.0 } else { 6.0 };
            assert!(*standard_errors >= needed, "{name}, start {start}: {standard_errors} digits of standard errors");
            // Of `n - p` degrees of freedom; by `n` none of the five in the repository would have two digits.
            assert!(*residual >= needed, "{name}, start {start}: {residual} digits of the residual deviation");
        }
    }
}

#[test]
fn certified_digits_from_both_starts() {
    let paths = files(Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/nist")));
    assert_eq!(paths.len(), 5);
    hold_to_the_certified(&paths);
}

/// More of them, where they are there.
#[test]
fn certified_digits_of_shared_files() {
    if let Some(folder) = shared("nist") {
        hold_to_the_certified(&files(&folder));
    }
}

#[test]
fn a_problem_that_is_not_known_is_named() {
    let file = File { name: "Misra2z".to_owned(), parameters: vec![], residual: 0.0, data: vec![] };
    assert_eq!(file.fit().err().as_deref(), Some("Misra2z: not a known problem"));
}
