//! The log of a drive: its columns, and what has to be known of it besides.
//!
//! The voltage of a row holds until the next one: in the stator, where an inverter holds it and it turns against the rotor,
//! or in the rotor frame, as in many simulations. To mistake one for the other biases the resistance. So both are tried, and
//! the one that reproduces the currents better is taken and said; the pole pairs likewise, unless they are given.

use crate::terminal;
use greybox::pmsm::{Drive, ExactStep, ExactSurface, HeldIn, Surface, Winding};
use greybox::report::{Cell, Section, Table};
use greybox::{DataFile, Experiment, ExperimentOf, Fit, Parameter, free, units};
use std::sync::atomic::AtomicBool;
use std::{error::Error, path::Path, sync::Arc};

#[derive(clap::Args)]
pub struct Settings {
    /// Pole pairs of the motor; found from the record, if it tells them.
    #[arg(long)]
    pole_pairs: Option<u32>,
    /// The speed is in revolutions per minute.
    #[arg(long)]
    rpm: bool,
    /// Where the voltage stands still between two rows: in the stator or in the rotor; the better, if not given.
    #[arg(long, value_name = "stator|rotor", value_parser = frame)]
    held_in: Option<HeldIn>,
    /// Another name of a column, such as ud=Vd; any number of times.
    #[arg(long, value_name = "SIGNAL=COLUMN", value_parser = renaming)]
    column: Vec<(String, String)>,
}

fn frame(text: &str) -> Result<HeldIn, &'static str> {
    [("stator", HeldIn::Stationary), ("rotor", HeldIn::Rotor)]
        .into_iter()
        .find(|(name, _)| *name == text)
        .map(|(_, frame)| frame)
        .ok_or("say stator or rotor")
}

fn renaming(text: &str) -> Result<(String, String), &'static str> {
    let (signal, column) = text.split_once('=').ok_or("write it as SIGNAL=COLUMN")?;
    Ok((signal.to_owned(), column.to_owned()))
}

/// Names that logs use for the signals, their own first.
const NAMES: [(&str, &[&str]); 6] = [
    ("t", &["t", "time", "Time"]),
    ("ud", &["ud", "u_d", "vd", "Vd"]),
    ("uq", &["uq", "u_q", "vq", "Vq"]),
    ("w", &["w", "omega_m", "omega", "speed"]),
    ("id", &["id", "i_d", "Id"]),
    ("iq", &["iq", "i_q", "Iq"]),
];

/// Where the searches start.
pub fn start() -> Winding<Parameter> {
    Winding { rs: free(1.0).log(), ls: free(1e-2).log(), ke: free(1.0).log() }
}

/// A drive's record, the model that reproduces it best, and what was tried.
pub struct Found {
    pub model: ExactSurface,
    pub record: ExperimentOf<ExactSurface>,
    pub assumed: Section,
}

struct Tried {
    pole_pairs: u32,
    held_in: HeldIn,
    /// Root of the mean squared error of both currents (A).
    error: f64,
}

pub fn found(path: &Path, columns: &[&str], said: &Settings, stop: &Arc<AtomicBool>) -> Result<Found, Box<dyn Error>> {
    let file = NAMES.iter().fold(DataFile::new(path), |file, (signal, names)| {
        let there = names.iter().find(|name| columns.contains(name));
        there.map_or(file.clone(), |name| file.column(signal, name))
    });
    let file = if said.rpm { file.factor("w", units::RPM) } else { file };
    let file = said.column.iter().fold(file, |file, (signal, column)| file.column(signal, column));
    let log = file.read(&Surface::new(1)?)?;
    let pairs: Vec<u32> = said.pole_pairs.map_or((1..=10).collect(), |given| vec![given]);
    let frames = said.held_in.map_or(vec![HeldIn::Stationary, HeldIn::Rotor], |given| vec![given]);
    let bar = terminal::steps(pairs.len() * frames.len(), "pole pairs and hold");
    let mut tried = vec![];
    for (pole_pairs, held_in) in pairs.iter().flat_map(|&pairs| frames.iter().map(move |&frame| (pairs, frame))) {
        let (model, record) = stepped(&log, pole_pairs, held_in)?;
        let estimate = Fit::new(&model, &record).parameters(start()).cancel(stop.clone()).run()?;
        let error = estimate.quality.id.rmse.hypot(estimate.quality.iq.rmse);
        tried.push(Tried { pole_pairs, held_in, error });
        bar.inc(1);
    }
    bar.finish_and_clear();
    tried.sort_by(|a, b| a.error.total_cmp(&b.error));
    let best = &tried[0];
    let other = tried.iter().find(|other| other.pole_pairs != best.pole_pairs);
    if other.is_some_and(|other| other.error < 1.05 * best.error) {
        return Err("the record does not tell the pole pairs of the motor; give them by --pole-pairs".into());
    }
    let (model, record) = stepped(&log, best.pole_pairs, best.held_in)?;
    Ok(Found { model, record, assumed: assumed(&tried) })
}

/// The model in exact steps, and the record with the speed of the interval that it expects.
fn stepped(
    log: &ExperimentOf<Surface>,
    pole_pairs: u32,
    held_in: HeldIn,
) -> Result<(ExactSurface, ExperimentOf<ExactSurface>), Box<dyn Error>> {
    let model = ExactSurface(ExactStep::new(pole_pairs, log.sample_time(), held_in)?);
    let next = log.inputs().skip(1).chain(log.inputs().last());
    let speed = |(u, next): (Drive, Drive)| match held_in {
        HeldIn::Rotor => u,
        HeldIn::Stationary => Drive { w: (u.w + next.w) / 2.0, ..u },
    };
    let inputs = log.inputs().zip(next).map(speed).collect();
    let record = Experiment::new(&model, log.times().clone(), inputs, log.outputs().collect())?;
    Ok((model, record.named(log.name().to_owned())))
}

/// What was taken, and what the alternatives would give.
fn assumed(tried: &[Tried]) -> Section {
    let frame = |held_in| if held_in == HeldIn::Rotor { "in the rotor frame" } else { "in the stator" };
    let Tried { pole_pairs, held_in, .. } = &tried[0];
    let text = format!("{pole_pairs} pole pairs; the voltage of a row holds {} until the next.", frame(*held_in));
    let row = |tried: &Tried| -> [Cell; 3] {
        [u64::from(tried.pole_pairs).into(), frame(tried.held_in).into(), Cell::number(tried.error, 3)]
    };
    let table = Table::new("Errors of the alternatives", ["pole pairs", "voltage held", "rms error (A)"]);
    Section::new("drive", "Pole pairs and hold of the drive")
        .says(text)
        .table(table.rows(tried.iter().map(row)).at_most(6))
}
