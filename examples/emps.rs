//! A linear axis under its controller, from the record of the EMPS benchmark (nonlinearbenchmark.org), whose columns are
//! `t,vir,qm,qg`: `cargo run --release --example emps -- emps.csv`.
//!
//! In an open loop this record leads a simulation from poor parameters into wrong minima: position is the second integral
//! of a force that dry friction nearly balances. So the recorded controller becomes a part of the model: it is given the
//! reference, as on the bench, and position and command are compared.

use clap::Parser;
use greybox::models::{AxisParameters, PositioningLoop};
use greybox::{Experiment, Fit, Signals, free};
use std::{path::PathBuf, process::ExitCode};

/// Estimates mass and friction of the EMPS axis in a closed loop.
#[derive(Parser)]
struct Arguments {
    /// The record, a CSV file with the columns t (s), vir (V), qm (m), qg (m).
    file: PathBuf,
}

/// Janot, Gautier, Brunot 2019: inverse-dynamics least squares on the same record.
const PUBLISHED: AxisParameters = AxisParameters { m: 95.1089, fv: 203.5034, fc: 20.3935, offset: -3.1648 };

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: &Arguments) -> Result<(), greybox::Error> {
    let model = PositioningLoop::EMPS;
    let record = Experiment::from_file(&model, &arguments.file)?.named("EMPS");
    let estimate = Fit::new(&model, &record)
        .parameters(AxisParameters { m: free(80.0), fv: free(150.0), fc: free(15.0), offset: free(0.0) })
        .run()?;
    println!("{estimate}\n");

    println!("{:<10} {:>10} {:>10} {:>10}", "", "published", "here", "difference");
    let (here, published) = (AxisParameters::into_array(estimate.parameters), AxisParameters::into_array(PUBLISHED));
    for ((name, here), published) in AxisParameters::NAMES.iter().zip(here).zip(published) {
        println!("{name:<10} {published:>10.4} {here:>10.4} {:>8.2} %", 100.0 * (here / published - 1.0));
    }

    // As the benchmark's cross-test has it: the command that the simulated loop needs against the one recorded. The force
    // is gtau times either, so that the ratio is that of the forces.
    let simulated = estimate.predict(&model, &record)?;
    let norm = |values: &mut dyn Iterator<Item = f64>| values.map(|v| v * v).sum::<f64>().sqrt();
    let error = norm(&mut simulated.residuals.iter().map(|e| e.vir)) / norm(&mut record.outputs().map(|y| y.vir));
    println!("\nRelative force error of the closed-loop simulation: {:.2} %", 100.0 * error);
    Ok(())
}
