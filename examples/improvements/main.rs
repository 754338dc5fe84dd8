//! What goes beyond the thesis, before and after, on the same records: `cargo run --release --example improvements`.

#[path = "../experiments/figure.rs"]
mod figure;
#[path = "../experiments/methods.rs"]
mod methods;
mod offline;
mod online;
mod others;
mod pooled;
#[path = "../experiments/report.rs"]
mod report;
#[path = "../experiments/sheet.rs"]
mod sheet;
#[path = "../common/terminal.rs"]
mod terminal;

use clap::Parser;
use greybox::pmsm::drive::Simulation;
use greybox::pmsm::program::Program;
use greybox::pmsm::robot::RobotAxis;
use methods::{Result, run};
use report::Report;
use std::path::PathBuf;
use std::sync::atomic::Ordering;

/// Compares the methods of the thesis with what this library adds.
#[derive(Parser)]
struct Arguments {
    /// Draw the figures as SVG files into this folder, with a page `index.html` that shows them all.
    #[arg(long)]
    plots: Option<PathBuf>,
}

fn main() -> Result<()> {
    let arguments = Arguments::parse();
    let mut report = Report::new("Beyond the thesis: the same records, before and after");
    let (mut offline, mut online) = (offline::Offline::default(), online::Online::default());
    let stop = terminal::interrupted()?;
    let bar = terminal::steps(9, "axes");
    let going = || !stop.load(Ordering::Relaxed);
    for number in (1..=6).take_while(|_| going()) {
        let axis = RobotAxis::reference(number)?;
        let simulation = Simulation::new(axis)?;
        let cycles = run(simulation, Program::speed_cycles(&axis, 20, 1.0)?);
        let water = run(simulation, Program::water_cutting(&axis, 6)?);
        offline.compare(&cycles)?;
        online.compare(&cycles, &water)?;
        bar.inc(1);
    }
    bar.set_message("axis 1, variants");
    offline.report(&mut report);
    online.report(&mut report);
    for variant in [others::injection, others::switching, others::outliers].iter().take_while(|_| going()) {
        variant(&mut report)?;
        bar.inc(1);
    }
    bar.finish_and_clear();
    if let Some(folder) = &arguments.plots {
        sheet::write(folder, "Beyond the thesis: figures", &report.figures)?;
    }
    println!("{report}");
    Ok(())
}
