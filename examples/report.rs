//! Fits a record and writes a report on it: `report FILE.csv --out report.html` (or `.md`, `.json`, `.txt`).
//!
//! The columns of the file choose the model: `t ud uq omega_m id iq` is a drive with a surface-magnet motor of three pole
//! pairs, `t vir qm qg` a linear axis under its position controller, with friction that may differ between the directions.

use clap::Parser;
use greybox::diagnose::profile;
use greybox::models::{ControlledAxisMotion as Motion, ControlledAxisOutput, Reference};
use greybox::pmsm::{Surface, Winding};
use greybox::{CsvFile, ExperimentOf, Fit, Hold, Model, Of, Parameter, Report, Scalar, fixed, free, signals};
use std::{error::Error, fs::File, io::BufRead, io::BufReader, io::IsTerminal, path::PathBuf};

#[derive(Parser)]
struct Arguments {
    /// The record.
    file: PathBuf,
    /// Where the report goes.
    #[arg(long)]
    out: PathBuf,
    /// Adds likelihood profiles, which take many fits.
    #[arg(long)]
    profiles: bool,
}

signals! { pub struct Friction { m: "kg", fv: "N s/m", fcp: "N", fcn: "N", offset: "N" } }

/// The electro-mechanical positioning system of A. Janot, M. Gautier, M. Brunot, *Data set and reference models of EMPS*,
/// 2019, in closed loop; dry friction is `fcp` forwards and `fcn` backwards.
#[derive(Clone)]
struct Axis;

const GTAU: f64 = 35.150_651_88; // N/V
const KP: f64 = 160.18; // 1/s
const KV: f64 = 243.45; // V s/m

impl Axis {
    fn command<S: Scalar>(x: &Motion<S>, u: &Reference<S>) -> S {
        (((u.qg - x.q) * KP - x.vm) * KV).clamp(-10.0, 10.0)
    }
}

impl Model for Axis {
    type State = Motion;
    type Input = Reference;
    type Output = ControlledAxisOutput;
    type Parameters = Friction;

    fn derivative<S: Scalar>(&self, _t: S, x: &Motion<S>, u: &Reference<S>, p: &Friction<S>) -> Motion<S> {
        let forwards = (x.v / 5e-4).tanh() * 0.5 + 0.5;
        let dry = p.fcp * forwards - p.fcn * (-forwards + 1.0);
        let v = (Self::command(x, u) * GTAU - p.fv * x.v - dry - p.offset) / p.m;
        // The controller differentiates the position: what it sees of the speed lags by a sample.
        Motion { q: x.v, v, vm: (x.v - x.vm) / 1e-3 }
    }

    fn output<S: Scalar>(&self, _t: S, x: &Motion<S>, u: &Reference<S>, _p: &Friction<S>) -> ControlledAxisOutput<S> {
        ControlledAxisOutput { qm: x.q, vir: Self::command(x, u) }
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments = Arguments::parse();
    let file = CsvFile::new(&arguments.file);
    let mut header = String::new();
    BufReader::new(File::open(&arguments.file)?).read_line(&mut header)?;
    let has = |name: &str| header.split(',').any(|column| column.trim() == name);
    let report = if has("omega_m") {
        let motor = Surface::new(3)?;
        let record = file.column("w", "omega_m").read(&motor)?;
        report(&motor, &record, Winding { rs: free(1.0), ls: free(0.01), ke: free(1.0) }, arguments.profiles)?
    } else if has("qg") {
        let rest = Motion { q: free(0.0), v: fixed(0.0), vm: fixed(0.0) };
        let record = file.read(&Axis)?.hold(Hold::First).initial(rest);
        let friction = Friction { m: free(50.0), fv: free(100.0), fcp: free(10.0), fcn: free(10.0), offset: free(0.0) };
        report(&Axis, &record, friction, arguments.profiles)?
    } else {
        return Err(format!("no model for the columns {}", header.trim()).into());
    };
    report.save(&arguments.out)?;
    println!("{}", if std::io::stdout().is_terminal() { report.to_colored_text() } else { report.to_string() });
    Ok(())
}

fn report<M: Model + Clone>(
    model: &M,
    record: &ExperimentOf<M>,
    parameters: Of<M::Parameters, Parameter>,
    profiles: bool,
) -> Result<Report, greybox::Error> {
    let problem = Fit::new(model, record).parameters(parameters).problem()?;
    let estimate = problem.run()?;
    let mut report = Report::new(&problem, &estimate)?.titled(format!("Estimate from {}", record.name()));
    for unknown in estimate.unknowns.iter().filter(|_| profiles) {
        report = report.with_profile(profile(&problem, &estimate, &unknown.name, 0.95)?);
    }
    Ok(report)
}
