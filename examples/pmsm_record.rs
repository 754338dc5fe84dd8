//! Resistance, inductance and back-EMF of a motor from a drive's log: `pmsm_record FILE.csv --pole-pairs N`.
//!
//! The voltage of row `k` is held by the inverter until row `k + 1`; held in the stator, it turns against the rotor, and
//! `ud`, `uq` are its values in the middle. The model's exact step knows that. The speed of the interval is the mean of
//! its ends.

use argmin::core::observers::{Observe, ObserverMode};
use argmin::core::{KV, State};
use clap::Parser;
use greybox::optimize::LeastSquaresState;
use greybox::pmsm::{Drive, ExactStep, ExactSurface, HeldIn, Surface, Winding};
use greybox::{CsvFile, Experiment, Fit, free, units};
use indicatif::ProgressBar;
use std::{error::Error, path::PathBuf, process::ExitCode};

/// Estimates rs, ls and ke of a PMSM with surface magnets from a CSV file.
#[derive(Parser)]
struct Arguments {
    /// Columns: t (s), ud, uq (V), omega_m (rad/s, mechanical), id, iq (A), phase peak.
    file: PathBuf,
    /// Pole pairs of the motor.
    #[arg(long)]
    pole_pairs: u32,
    /// Column of the mechanical speed.
    #[arg(long, default_value = "omega_m")]
    speed: String,
    /// The speed is in revolutions per minute.
    #[arg(long)]
    rpm: bool,
    /// Voltage and speed hold in the rotor frame from row to row, as in many simulations, not in the stator as an
    /// inverter's.
    #[arg(long)]
    held: bool,
    /// Another name of a column, such as ud=Vd; any number of times.
    #[arg(long, value_name = "SIGNAL=COLUMN", value_parser = renaming)]
    column: Vec<(String, String)>,
    /// Print the estimate as JSON.
    #[arg(long)]
    json: bool,
}

fn renaming(text: &str) -> Result<(String, String), &'static str> {
    let (signal, column) = text.split_once('=').ok_or("write it as SIGNAL=COLUMN")?;
    Ok((signal.to_owned(), column.to_owned()))
}

/// Shows the search as a moving line.
struct Progress(ProgressBar);

impl Observe<LeastSquaresState> for Progress {
    fn observe_iter(&mut self, state: &LeastSquaresState, _: &KV) -> Result<(), argmin::core::Error> {
        self.0.set_message(format!("iteration {}, cost {:.6e}", state.get_iter(), state.get_cost()));
        self.0.tick();
        Ok(())
    }

    fn observe_final(&mut self, _: &LeastSquaresState) -> Result<(), argmin::core::Error> {
        self.0.finish_and_clear();
        Ok(())
    }
}

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: &Arguments) -> Result<(), Box<dyn Error>> {
    let file = CsvFile::new(&arguments.file).column("w", &arguments.speed);
    let file = if arguments.rpm { file.factor("w", units::RPM) } else { file };
    let file = arguments.column.iter().fold(file, |file, (signal, column)| file.column(signal, column));
    let log = file.read(&Surface::new(arguments.pole_pairs)?)?;
    let held = if arguments.held { HeldIn::Rotor } else { HeldIn::Stationary };
    let model = ExactSurface(ExactStep::new(arguments.pole_pairs, log.sample_time(), held)?);

    let next = log.inputs().skip(1).chain(log.inputs().last());
    let mean = |(u, next): (Drive, Drive)| Drive { w: if arguments.held { u.w } else { (u.w + next.w) / 2.0 }, ..u };
    let inputs = log.inputs().zip(next).map(mean).collect();
    let record =
        Experiment::new(&model, log.times().clone(), inputs, log.outputs().collect())?.named(log.name().to_owned());
    let estimate = Fit::new(&model, &record)
        .parameters(Winding { rs: free(1.0).log(), ls: free(1e-2).log(), ke: free(1.0).log() })
        .observe(Progress(ProgressBar::new_spinner()), ObserverMode::Always)
        .run()?;
    if arguments.json {
        println!("{}", serde_json::to_string_pretty(&estimate)?);
    } else {
        println!("{estimate}");
    }
    Ok(())
}
