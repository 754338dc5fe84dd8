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
    println!("Digits that agree with the certified values");
    println!("problem   start  parameters  std. errors  std. deviation  steps  outcome");
    for path in paths {
        for found in File::read(Path::new(&path))?.fit()? {
            let (converged, why) = (found.outcome.converged(), found.outcome.to_string());
            let numbers =
                format!("{:>10.1} {:>12.1} {:>15.1}", found.parameters, found.standard_errors, found.residual);
            let outcome = if converged { "converged" } else { "not converged" };
            println!("{:<10} {:>4}  {numbers} {:>6}  {outcome}", found.name, found.start, found.iterations);
            if !converged {
                println!("  {why}");
            }
        }
    }
    Ok(())
}
