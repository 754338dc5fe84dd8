//! The six experiments of the thesis on a simulated robot: `cargo run --release --example experiments -- all`.

mod acceleration;
mod applications;
mod cable;
mod figure;
mod first_axis;
mod ideal;
mod methods;
mod report;
mod sheet;
mod speeds;
mod temperature;
#[path = "../common/terminal.rs"]
mod terminal;
mod tracks;

use clap::Parser;
use std::path::PathBuf;

/// Runs experiments 1 to 6 of M. Tenerz, "Parameter Estimation in a Permanent Magnet Synchronous Motor" (2011).
#[derive(Parser)]
struct Arguments {
    /// Which: 1 to 6, or all.
    #[arg(value_parser = ["1", "2", "3", "4", "5", "6", "all"])]
    experiment: String,
    /// Draw the figures as SVG files into this folder, with a page `index.html` that shows them all.
    #[arg(long)]
    plots: Option<PathBuf>,
    /// Print JSON instead of tables.
    #[arg(long)]
    json: bool,
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments = Arguments::parse();
    let mut reports = Vec::new();
    let stop = terminal::interrupted()?;
    let wanted: Vec<u8> =
        (1..=6).filter(|number| ["all", &number.to_string()].contains(&arguments.experiment.as_str())).collect();
    let bar = terminal::steps(wanted.len(), "experiments");
    for number in wanted.into_iter().take_while(|_| !stop.load(std::sync::atomic::Ordering::Relaxed)) {
        bar.set_message(format!("experiment {number}"));
        let report = match number {
            1 => ideal::torque_step()?,
            2 => ideal::position_step()?,
            3 => speeds::speeds()?,
            4 => temperature::temperature()?,
            5 => acceleration::acceleration()?,
            _ => applications::applications()?,
        };
        if !arguments.json {
            bar.suspend(|| println!("{report}"));
        }
        reports.push(report);
        bar.inc(1);
    }
    bar.finish_and_clear();
    if let Some(folder) = &arguments.plots {
        let figures: Vec<_> = reports.iter_mut().flat_map(|report| std::mem::take(&mut report.figures)).collect();
        sheet::write(folder, "The six experiments: figures", &figures)?;
    }
    if arguments.json {
        println!("{}", serde_json::to_string_pretty(&reports)?);
    }
    Ok(())
}
