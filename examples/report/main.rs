//! Fits a record and says what the estimate is worth: `report FILE.csv`, and with `--out report.html` as a page (or as
//! `.md`, `.json`, `.txt`).
//!
//! The columns of the file choose the model: `t ud uq w id iq` is the log of a drive with a surface-magnet motor,
//! `t vir qm qg` a linear axis under its position controller. `examples/data/pmsm.csv` is a record to begin with.

use argmin::core::observers::ObserverMode;
use clap::Parser;
use greybox::diagnose::{Convergence, Resampling, bootstrap, profile};
use greybox::models::{AxisParameters, PositioningLoop};
use greybox::report::{Origin, Section};
use greybox::{DataFile, ExperimentOf, Fit, Model, Of, Parameter, Report, free};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::{error::Error, fs::File, io::BufRead, io::BufReader, path::PathBuf, process::ExitCode, sync::Arc};

mod drive;
#[path = "../common/terminal.rs"]
mod terminal;

/// Estimates the parameters of a drive or an axis from a CSV file, and reports on them.
#[derive(Parser)]
struct Arguments {
    /// The record.
    file: PathBuf,
    /// Where the report goes; without it, to the terminal only.
    #[arg(long)]
    out: Option<PathBuf>,
    #[command(flatten)]
    drive: drive::Settings,
    /// Adds likelihood profiles, which take many fits.
    #[arg(long)]
    profiles: bool,
    /// Adds so many refits of resampled records.
    #[arg(long, value_name = "REFITS")]
    bootstrap: Option<usize>,
    /// Searches from so many starts.
    #[arg(long, value_name = "SEARCHES", default_value_t = 1)]
    starts: usize,
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
    let stop = terminal::interrupted()?;
    let mut lines =
        BufReader::new(File::open(&arguments.file).map_err(|error| format!("{}: {error}", arguments.file.display()))?)
            .lines();
    let header = lines.next().transpose()?.unwrap_or_default();
    let columns: Vec<&str> = header.split(',').map(str::trim).collect();
    let report = if ["qg", "vir"].iter().all(|name| columns.contains(name)) {
        let model = PositioningLoop::EMPS;
        let record = DataFile::new(&arguments.file).read(&model)?;
        let axis = AxisParameters { m: free(80.0), fv: free(150.0), fc: free(15.0), offset: free(0.0) };
        reported(&model, &record, axis, arguments, &stop, None)?
    } else {
        let drive = drive::found(&arguments.file, &columns, &arguments.drive, &stop)?;
        reported(&drive.model, &drive.record, drive::start(), arguments, &stop, Some(drive.assumed))?
    };
    let origin = Origin::new().file(&arguments.file)?.command(std::env::args()).at(std::time::SystemTime::now());
    let report = report.made_from(origin);
    println!("{}", if terminal::colored() { report.to_colored_text() } else { report.to_string() });
    Ok(arguments.out.as_ref().map_or(Ok(()), |path| report.save(path))?)
}

fn reported<M: Model + Clone>(
    model: &M,
    record: &ExperimentOf<M>,
    start: Of<M::Parameters, Parameter>,
    arguments: &Arguments,
    stop: &Arc<AtomicBool>,
    assumed: Option<Section>,
) -> Result<Report, greybox::Error> {
    let (convergence, counter) = (Convergence::default(), Arc::new(AtomicU64::new(0)));
    let problem = Fit::new(model, record)
        .parameters(start)
        .starts(arguments.starts)
        .cancel(stop.clone())
        .counter(counter.clone())
        .observe(terminal::Search(terminal::spinner("fit")), ObserverMode::Always)
        .observe(convergence.clone(), ObserverMode::Always)
        .problem()?;
    let estimate = problem.run()?;
    let report = Report::new(&problem, &estimate)?.titled(format!("Estimate from {}", record.name()));
    let mut report = assumed.into_iter().fold(report, Report::with).with(convergence);
    let going = || !stop.load(Ordering::Relaxed);
    // What Ctrl-C ended is left out.
    let with = |report: Report, section: Result<Section, greybox::Error>| match section {
        Err(_) if !going() => Ok(report),
        section => section.map(|section| report.with(section)),
    };
    let wanted: Vec<_> = estimate.unknowns.iter().filter(|_| arguments.profiles).collect();
    let bar = terminal::steps(wanted.len(), "profiles");
    for unknown in wanted.iter().take_while(|_| going()) {
        report = with(report, profile(&problem, &estimate, &unknown.name, 0.95).map(Section::from))?;
        bar.inc(1);
    }
    bar.finish_and_clear();
    if let Some(refits) = arguments.bootstrap.filter(|_| going()) {
        let bar = terminal::counted(refits, "refits of resampled records", &counter);
        report = with(report, bootstrap(&problem, &estimate, Resampling::Blocks(0), refits, 1).map(Section::from))?;
        bar.finish_and_clear();
    }
    Ok(report)
}
