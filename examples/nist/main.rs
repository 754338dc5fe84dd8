//! Fits files of NIST's Statistical Reference Datasets (nonlinear regression, www.itl.nist.gov/div898/strd) from both of
//! their starts, and counts the digits that agree with the certified values: `nist FILE.dat...`

mod file;
mod problems;

use file::File;
use std::error::Error;
use std::path::Path;

fn main() -> Result<(), Box<dyn Error>> {
    let paths: Vec<String> = std::env::args().skip(1).collect();
    if paths.is_empty() {
        return Err("usage: nist FILE.dat...".into());
    }
    println!("problem   start  digits of: parameters  standard errors  residual deviation  steps  outcome");
    for path in paths {
        for found in File::read(Path::new(&path))?.fit()? {
            let outcome = found.outcome.to_string();
            // The numbers in brackets, where it ended well, are beyond the edge of a terminal.
            let outcome = if found.outcome.converged() { "converged" } else { &outcome };
            println!(
                "{:<10}    {} {:>22.1} {:>16.1} {:>19.1} {:>6}  {}",
                found.name,
                found.start,
                found.parameters,
                found.standard_errors,
                found.residual,
                found.iterations,
                outcome
            );
        }
    }
    Ok(())
}
