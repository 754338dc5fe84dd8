//! The six experiments of the thesis on a simulated robot: `cargo run --release --example experiments -- all`.

mod ideal;
mod report;
mod robot;
#[path = "../common/terminal.rs"]
mod terminal;

use clap::Parser;
use std::path::PathBuf;

/// Runs experiments 1 to 6 of M. Tenerz, "Parameter Estimation in a Permanent Magnet Synchronous Motor" (2011).
#[derive(Parser)]
struct Arguments {
    /// Which: 1 to 6, or all.
    #[arg(value_parser = ["1", "2", "3", "4", "5", "6", "all"])]
    experiment: String,
    /// Draw the figures as SVG files into this folder.
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
    let bar = terminal::spinner("experiments");
    for number in (1..=6u8).take_while(|_| !stop.load(std::sync::atomic::Ordering::Relaxed)) {
        if arguments.experiment != "all" && arguments.experiment != number.to_string() {
            continue;
        }
        bar.set_message(format!("experiment {number}"));
        let report = match number {
            1 => ideal::torque_step()?,
            2 => ideal::position_step()?,
            3 => robot::speeds()?,
            4 => robot::temperature()?,
            5 => robot::acceleration()?,
            _ => robot::applications()?,
        };
        if !arguments.json {
            bar.suspend(|| println!("{report}"));
        }
        if let Some(folder) = &arguments.plots {
            std::fs::create_dir_all(folder)?;
            for figure in &report.figures {
                figure.draw(folder)?;
            }
        }
        reports.push(report);
    }
    bar.finish_and_clear();
    if arguments.json {
        println!("{}", serde_json::to_string_pretty(&reports)?);
    }
    Ok(())
}
