//! Files of records.

use crate::Failure;
use crate::arguments::{Order, RecordOptions};
use crate::fitting::{expanded, initial, number, range};
use crate::terminal::Terminal;
use greybox::layout::Layout;
use greybox::record::{Channel, Initial, Record};
use greybox::text::{self, Model};
use greybox::{DataFile, DateOrder, Hold};
use std::path::{Path, PathBuf};

/// The part of an input's variance that thinning may remove without a remark: a tenth of its deviation.
const LOST: f64 = 0.01;

/// Reads the records of a model, with the holds and the initial state that the model and the command line say.
pub fn all(
    paths: &[PathBuf],
    model: &Model,
    options: &RecordOptions,
    of_initial: &[String],
    terminal: &Terminal,
) -> Result<Vec<Record>, Failure> {
    expanded(paths)?.iter().map(|path| one(path, model, options, of_initial, terminal)).collect()
}

/// Reads one record.
pub fn one(
    path: &Path,
    model: &Model,
    options: &RecordOptions,
    of_initial: &[String],
    terminal: &Terminal,
) -> Result<Record, Failure> {
    let layout = model.equations().layout();
    prepared(read(path, model, layout, options, terminal)?, model, options, of_initial, Some(terminal))
}

/// Reads the inputs alone, of a model that has any, and, if `measured`, outputs from whose first sample the initial state is to be taken.
pub fn inputs(
    path: &Path,
    model: &Model,
    options: &RecordOptions,
    of_initial: &[String],
    measured: bool,
    terminal: &Terminal,
) -> Result<Record, Failure> {
    let mut layout = model.equations().layout().clone();
    if !layout.inputs.is_empty() {
        layout.outputs = vec![];
    }
    let inputs = prepared(read(path, model, &layout, options, terminal)?, model, options, of_initial, Some(terminal))?;
    match inputs.initial_state() {
        Initial::FirstSample if measured && layout.outputs.is_empty() => {
            one(path, model, options, of_initial, terminal)
        }
        _ => Ok(inputs),
    }
}

/// The record with what is declared of its inputs and of the initial state, and the part of it that is used.
fn prepared(
    record: Record,
    model: &Model,
    options: &RecordOptions,
    of_initial: &[String],
    terminal: Option<&Terminal>,
) -> Result<Record, Failure> {
    let layout = model.equations().layout();
    let record = model.prepare(record)?;
    let said = initial(layout, of_initial, record.initial_state())?;
    let mut record = match said {
        Some(said) => record.initial(said)?,
        None => record,
    };
    for (input, text) in &options.hold {
        record = record.hold_of(input, hold(input, text)?)?;
    }
    if let Some(text) = &options.between {
        let (from, to) = range("--between", text)?;
        if let (Some(from), Some(to)) = (from, to)
            && from > to
        {
            return Err(format!("--between {text}: the second time is before the first; write {to}..{from}").into());
        }
        record = record.between(from.unwrap_or(f64::NEG_INFINITY)..to.unwrap_or(f64::INFINITY))?;
    }
    Ok(match options.every {
        Some(n) => {
            let thinned = model.thinned(&record, n)?;
            if let Some(terminal) = terminal {
                say_lost(&record, &thinned, n, terminal);
            }
            thinned
        }
        None => record,
    })
}

/// Says which inputs change between the samples that are kept, by the part of their variance that their means have not.
fn say_lost(record: &Record, thinned: &Record, n: usize, terminal: &Terminal) {
    let variance = |values: &[f64]| {
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / values.len() as f64
    };
    let lost = |(before, after): (&Channel, &Channel)| {
        let part = 1.0 - variance(&after.values) / variance(&before.values);
        (part > LOST).then(|| format!("`{}` {:.0} %", before.name, 100.0 * part))
    };
    let lost: Vec<String> = record.inputs().iter().zip(thinned.inputs()).filter_map(lost).collect();
    if !lost.is_empty() {
        terminal.remark(format_args!(
            "--every {n}: inputs change between the samples that are kept, and lose a part of their variance ({}): what is fast in the plant is \
             biased, which no interval allows for; keep more samples",
            lost.join(", ")
        ));
    }
}

fn hold(input: &str, text: &str) -> Result<Hold, Failure> {
    match text {
        "zero" => Ok(Hold::Zero),
        "first" => Ok(Hold::First),
        other => Err(format!("--hold {input}: `{other}` is none; there are zero and first").into()),
    }
}

/// The name of a record of a file, and the record or why there is none.
pub type Group = (String, Result<Record, String>);

/// Reads the records of a file, which a column tells apart.
pub fn groups(
    path: &Path,
    model: &Model,
    options: &RecordOptions,
    of_initial: &[String],
    by: &str,
) -> Result<Vec<Group>, Failure> {
    let layout = model.equations().layout();
    let record = |record: Result<Record, greybox::Error>| {
        prepared(record.map_err(|error| error.to_string())?, model, options, of_initial, None)
            .map_err(|error| error.to_string())
    };
    let groups = file(path, model, layout, options)?.read_groups(layout, by)?;
    Ok(groups.into_iter().map(|(name, found)| (name, record(found))).collect())
}

/// Reads the columns of a layout.
fn read(
    path: &Path,
    model: &Model,
    layout: &Layout,
    options: &RecordOptions,
    terminal: &Terminal,
) -> Result<Record, Failure> {
    let record = file(path, model, layout, options)?.read_record(layout)?;
    if let Some(reading) = record.reading() {
        terminal.remark(format_args!("{}: {reading}", path.display()));
    }
    Ok(record)
}

/// A file with what the command line says of it.
fn file(path: &Path, model: &Model, layout: &Layout, options: &RecordOptions) -> Result<DataFile, Failure> {
    let mut file = DataFile::new(path);
    for input in &options.fill {
        let said = options.hold.iter().rfind(|(name, _)| name == input).map(|(name, text)| hold(name, text));
        let at = layout.inputs.iter().position(|quantity| quantity.name == *input);
        let declared = at.and_then(|at| model.holds()[at]);
        file = file.fill(input, said.transpose()?.or(declared).unwrap_or_default());
    }
    // What is said of outputs that are not read.
    let is_of = |all: &Layout, signal: &str| all.outputs.iter().any(|output| output.name == signal);
    let is_left_out = |signal: &str| is_of(model.equations().layout(), signal) && !is_of(layout, signal);
    for (signal, column) in options.column.iter().filter(|(signal, _)| !is_left_out(signal)) {
        file = file.column(signal, column);
    }
    if let Some(column) = &options.time {
        file = file.column("t", column);
    }
    for (signal, unit) in options.unit.iter().filter(|(signal, _)| !is_left_out(signal)) {
        file = in_unit(file, signal, unit, layout)?;
    }
    if let Some(unit) = &options.time_unit {
        file = file.factor("t", text::factor(unit, "s")?);
    }
    if let Some(step) = options.sample_time {
        for (option, said) in [("column", &options.column), ("unit", &options.unit)] {
            if let Some((_, text)) = said.iter().find(|(signal, _)| signal == "t") {
                let both = format!("--sample-time {step} and --{option} t={text}");
                return Err(format!("{both}: the time is from one of them; leave the other out").into());
            }
        }
        file = file.sample_time(step);
    }
    if let Some(order) = options.date_order {
        file = file.dates(match order {
            Order::Day => DateOrder::DayFirst,
            Order::Month => DateOrder::MonthFirst,
        });
    }
    if let Some(zone) = &options.zone {
        file = file.zone(zone);
    }
    Ok(file)
}

/// A file whose column of a signal has this unit, or is to be multiplied by this number.
fn in_unit(file: DataFile, signal: &str, unit: &str, layout: &Layout) -> Result<DataFile, Failure> {
    if let Ok(factor) = number("", unit) {
        return Ok(file.factor(signal, factor));
    }
    let mut all = layout.inputs.iter().chain(&layout.outputs);
    if let Some(quantity) = all.find(|quantity| quantity.name == signal) {
        // The error names what is wrong with the unit.
        text::factor(unit, &quantity.unit)?;
    }
    Ok(file.unit(signal, unit))
}
