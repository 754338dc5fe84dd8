//! [`Error`]: the cause where a call has no result. A fit that ends badly has a result: its [`Outcome`](crate::optimize::Outcome).

use crate::numeral::Moment;
use crate::unit::{Relation, relation};
use std::path::PathBuf;

/// A call that could not be served, with the thing, the number and the remedy.
#[derive(thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A record without a sample, or with too few for what was asked.
    #[error("experiment `{experiment}` has {samples} sample(s); {needed} or more are needed {purpose}")]
    TooFewSamples {
        /// Name of the experiment.
        experiment: String,
        /// How many there are.
        samples: usize,
        /// How many there must be.
        needed: usize,
        /// The purpose.
        purpose: &'static str,
    },
    /// Two columns of one record differ in length.
    #[error(
        "experiment `{experiment}`: {what} has {found} rows, but {reference} has {expected}; every sample needs both"
    )]
    Lengths {
        /// Name of the experiment.
        experiment: String,
        /// The column.
        what: String,
        /// Its length.
        found: usize,
        /// The column it was compared with.
        reference: String,
        /// That one's length.
        expected: usize,
    },
    /// A time or input that is not a finite number.
    #[error(
        "experiment `{experiment}`: `{signal}` is {} at sample {sample} (t = {time}); only outputs may be missing (NaN){}",
        short(*value), own_rate(signal, *value)
    )]
    NotFinite {
        /// Name of the experiment.
        experiment: String,
        /// Name of the signal; `t` for time.
        signal: String,
        /// The offending value.
        value: f64,
        /// Index of the sample, from zero.
        sample: usize,
        /// Its time.
        time: Moment,
    },
    /// Time that runs backwards, or that no sample is at another instant of.
    #[error(
        "experiment `{experiment}`: time does not increase at sample {sample}: {before} is followed by {time}; sort the record, which may hold several measurements of one instant, but not of one only"
    )]
    TimeOrder {
        /// Name of the experiment.
        experiment: String,
        /// Index of the second of the two samples.
        sample: usize,
        /// Time of the first.
        before: Moment,
        /// Time of the second.
        time: Moment,
    },
    /// Two samples of one instant whose inputs differ.
    #[error(
        "experiment `{experiment}`: samples {} and {sample} are at one instant (t = {time}), where `{input}` is {} and {}; measurements may repeat at an instant, inputs may not: give the samples times of their own", sample - 1, short(*before), short(*value)
    )]
    InputsAtOneInstant {
        /// Name of the experiment.
        experiment: String,
        /// Index of the second of the two samples.
        sample: usize,
        /// Their time.
        time: Moment,
        /// Name of the input.
        input: String,
        /// Its value at the first.
        before: f64,
        /// Its value at the second.
        value: f64,
    },
    /// A sample time, factor or scale that must be a positive finite number.
    #[error("{what} is {}; it must be positive and finite", short(*value))]
    NotPositive {
        /// The quantity.
        what: String,
        /// The offending value.
        value: f64,
    },
    /// No output of a fit was measured at all.
    #[error(
        "experiment `{experiment}`: output `{output}` is missing in every sample; drop it from the model's output or record it"
    )]
    OutputMissing {
        /// Name of the experiment.
        experiment: String,
        /// Name of the output.
        output: String,
    },
    /// A column that the file does not have.
    #[error("{}: no column `{column}`{}; {}", path.display(), wanted_by(signal, column), listed(available, column, signal))]
    MissingColumn {
        /// The file.
        path: PathBuf,
        /// Name of the column looked for.
        column: String,
        /// The signal it was to fill.
        signal: String,
        /// The columns there are.
        available: Vec<String>,
    },
    /// A column that the file has twice.
    #[error("{}: column `{column}` stands twice, in place {first} and {second}; rename one", path.display())]
    AmbiguousColumn {
        /// The file.
        path: PathBuf,
        /// Name of the column.
        column: String,
        /// Its first place, from one.
        first: usize,
        /// Its second place, from one.
        second: usize,
    },
    /// A column whose cells are not what is wanted.
    #[error("{}: column `{column}` holds {kind}, where {wanted} are wanted; convert it where the file is written", path.display())]
    ColumnKind {
        /// The file.
        path: PathBuf,
        /// Name of the column.
        column: String,
        /// What it holds.
        kind: String,
        /// What is wanted.
        wanted: &'static str,
    },
    /// A row with more or fewer cells than there are columns.
    #[error("{}, line {line}: {found} cell(s), but {expected} column(s) have a name", path.display())]
    RowLength {
        /// The file.
        path: PathBuf,
        /// Line, from one.
        line: u64,
        /// Cells in this row.
        found: usize,
        /// Names in the header.
        expected: usize,
    },
    /// An error in a record, with the line of its file.
    #[error("{}, line {line}: {problem}", path.display())]
    AtLine {
        /// The file.
        path: PathBuf,
        /// Line, from one.
        line: u64,
        /// The fault.
        problem: Box<Error>,
    },
    /// A renaming or factor for a signal that the model does not have.
    #[error("the model has no signal `{signal}`; it has: {}", available.join(", "))]
    UnknownSignal {
        /// The name given.
        signal: String,
        /// The names there are.
        available: Vec<String>,
    },
    /// A name that is none of those there are.
    #[error("there is no {what} `{name}`{}; there are: {}", meant(name, available), available.join(", "))]
    Unknown {
        /// The kind of thing that was named.
        what: String,
        /// The name given.
        name: String,
        /// The names there are.
        available: Vec<String>,
    },
    /// A cell that is not a number.
    #[error("{}, line {line}, column `{column}`: `{text}` is not a number{}", path.display(), number_hint(text))]
    NotANumber {
        /// The file.
        path: PathBuf,
        /// Line, from one.
        line: u64,
        /// Name of the column.
        column: String,
        /// The text of the cell.
        text: String,
    },
    /// Dates of a column that cannot be read as times.
    #[error("{}, {}column `{column}`: {problem}", path.display(), place(*line, text))]
    Dates {
        /// The file.
        path: PathBuf,
        /// Line, from one; zero where it is no single one.
        line: u64,
        /// Name of the column.
        column: String,
        /// The text of the cell.
        text: String,
        /// The fault and the remedy.
        problem: String,
    },
    /// A column in another unit than its signal.
    #[error(
        "{}: column `{column}` is in \"{file}\" and signal `{signal}` in \"{model}\"; {}", path.display(), other_unit((file, model), signal, *factor)
    )]
    Unit {
        /// The file.
        path: PathBuf,
        /// Name of the column.
        column: String,
        /// Its unit.
        file: Box<str>,
        /// Name of the signal.
        signal: String,
        /// Its unit.
        model: Box<str>,
        /// The factor from one to the other; none where neither is a multiple of the other.
        factor: Option<f64>,
    },
    /// A file that could not be read or written.
    #[error("{}: {source}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// The system's or the parser's word.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// A guess, bound or prior that makes no sense.
    #[error("parameter `{parameter}`: {problem}")]
    Parameter {
        /// Name of the parameter or initial state.
        parameter: String,
        /// The fault, with the numbers and the remedy.
        problem: String,
    },
    /// A fit in which nothing may move.
    #[error("nothing is free: every parameter and initial state is fixed; declare at least one with free(start)")]
    NothingFree,
    /// A fit without a record.
    #[error("there is no experiment to fit; pass at least one")]
    NoExperiment,
    /// An integrator that does not serve the model's kind.
    #[error(
        "a {model} model cannot be stepped by {integrator}, which serves {serves} models; leave the integrator out or choose one that fits"
    )]
    WrongIntegrator {
        /// The model's kind.
        model: &'static str,
        /// The integrator.
        integrator: String,
        /// The kind that it serves.
        serves: &'static str,
    },
    /// A predictor that asks for slopes with respect to the state, and functions that are neither read as a graph nor affine in the state.
    #[error(
        "{what} is not affine in the state, and cannot be differentiated for {predictor}, because the model is not read as a graph; write it as a Model of arithmetic alone, simulate the record (FreeRun, the default), or predict from measured states (Horizon)"
    )]
    NotAffine {
        /// The equation: a derivative, a next state or an output.
        what: String,
        /// The predictor.
        predictor: String,
    },
    /// A filter that starts from the stationary covariance of a plant that does not come to rest.
    #[error(
        "experiment `{experiment}`: the plant has no stationary covariance where the search starts, because state `{state}` does not come to rest \
         (it grows by {} 1/{per}); start elsewhere, from InitialCovariance::FirstInterval (kalman:first-interval), or give the covariance by \
         Model::initial_noise", short(*rate)
    )]
    NotStationary {
        /// Name of the experiment.
        experiment: String,
        /// Name of the state.
        state: String,
        /// The real part of an eigenvalue of a continuous plant, about; of a discrete one, the logarithm of its magnitude.
        rate: f64,
        /// Unit of the time in which it grows.
        per: String,
    },
    /// A record that begins at rest ([`Initial::Steady`](crate::record::Initial::Steady)) of a plant that does not rest at its first inputs.
    #[error(
        "experiment `{experiment}`: the plant has no state of rest under the inputs of the first sample, near what the outputs suggest: of state \
         `{state}`, {reason}; have the initial state estimated, or give it (Experiment::initial)"
    )]
    NotAtRest {
        /// Name of the experiment.
        experiment: String,
        /// Name of the state.
        state: String,
        /// Why there is none.
        reason: String,
    },
    /// States that were asked for by a predictor other than a filter of the model's noise.
    #[error(
        "states are filtered and smoothed by a Kalman filter, and this is {predictor}; take the predictor Kalman or SecondOrder, with \
         Model::diffusion and Model::noise"
    )]
    NotFiltered {
        /// The predictor.
        predictor: String,
    },
    /// A test of process noise, of a fit without unknown levels of it.
    #[error("there is no process noise to test: {reason}")]
    NotDisturbed {
        /// Why not, and the remedy.
        reason: String,
    },
    /// A fit without process noise, for a test of it, that fails.
    #[error("the fit without process noise fails: {reason}")]
    Undisturbed {
        /// How.
        reason: String,
    },
    /// An initial state, or a restart, that the outputs do not give.
    #[error("experiment `{experiment}`: the state cannot be computed from the outputs ({reason}); {remedy}")]
    StateNotMeasured {
        /// Name of the experiment.
        experiment: String,
        /// Why not.
        reason: String,
        /// The remedy.
        remedy: &'static str,
    },
    /// A record that is thinned for a model of which each sample is a step.
    #[error(
        "experiment `{experiment}`: one of {every} samples (Record::decimate({every})) would be a record of another plant: {why}, which would come \
         less often, by means of the inputs; take all samples, or resample the record yourself and write the model for the longer interval"
    )]
    Thinned {
        /// Name of the experiment.
        experiment: String,
        /// Of how many samples one was to be kept.
        every: usize,
        /// What each sample does.
        why: String,
    },
    /// A simulation that fails where the search was to start.
    #[error("the start cannot be evaluated: {0}")]
    Start(Failure),
    /// A simulation, asked for by itself, that fails.
    #[error("the simulation fails: {0}")]
    Simulation(Failure),
    /// A filter that cannot be made.
    #[error("filter: {0}")]
    Filter(String),
    /// An option that makes no sense.
    #[error("{0}")]
    Option(String),
    /// A checkpoint that belongs to another problem or cannot be understood.
    #[error("checkpoint {}: {problem}", path.display())]
    Checkpoint {
        /// The file.
        path: PathBuf,
        /// The fault and the remedy.
        problem: String,
    },
    /// An optimizer that gave up with an error of its own.
    #[error("optimizer: {0}")]
    Optimizer(String),
}

/// The same sentence: it is what a `main` that returns the error shows.
impl core::fmt::Debug for Error {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        core::fmt::Display::fmt(self, f)
    }
}

/// Where and how a simulation failed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("experiment `{experiment}`, sample {sample} (t = {time}): {signal} is {}{hint}", short(*value))]
pub struct Failure {
    /// Name of the experiment.
    pub experiment: String,
    /// Index of the sample, from zero.
    pub sample: usize,
    /// Its time.
    pub time: Moment,
    /// The quantity that failed: `state id`, `output iq`, `slope of output iq with respect to rs`, ...
    pub signal: String,
    /// Its value there.
    pub value: f64,
    /// The usual cause.
    pub hint: &'static str,
}

/// Columns of a file that are listed; of more, those whose names are nearest to the one wanted.
const LISTED: usize = 10;

/// The columns that a file has, with a hint at the probable cause.
fn listed(columns: &[String], wanted: &str, signal: &str) -> String {
    let remedy = match columns {
        [single] if single.contains([';', '\t', '|']) => {
            "set what stands between cells with DataFile::delimiter, or DataFile::decimal_comma where numbers are written as 1,5"
        }
        _ if columns.iter().all(|name| name.parse::<f64>().is_ok()) => "its first line must hold the names",
        _ if signal == "t" => "name another with DataFile::column, or give DataFile::sample_time",
        _ => "name another with DataFile::column",
    };
    if columns.len() <= LISTED {
        return format!("the file has: {}; {remedy}", columns.join(", "));
    }
    let wanted = wanted.to_lowercase();
    // Names that contain the name come first.
    let near = |name: &str| {
        let name = name.to_lowercase();
        strsim::normalized_damerau_levenshtein(&name, &wanted) + if name.contains(&wanted) { 1.0 } else { 0.0 }
    };
    let mut names: Vec<(f64, &str)> = columns.iter().map(|name| (near(name), name.as_str())).collect();
    names.sort_by(|a, b| b.0.total_cmp(&a.0));
    let nearest: Vec<&str> = names[..LISTED].iter().map(|(_, name)| *name).collect();
    format!("of its {} columns these are nearest: {}; {remedy}", columns.len(), nearest.join(", "))
}

/// Where a name stands among those there are.
///
/// # Errors
/// [`Error::Unknown`], with the names that are nearest.
pub(crate) fn find(what: &str, names: &[&str], name: &str) -> Result<usize, Error> {
    names.iter().position(|known| *known == name).ok_or_else(|| Error::Unknown {
        what: what.to_owned(),
        name: name.to_owned(),
        available: names.iter().map(|&name| name.to_owned()).collect(),
    })
}

/// Names at least so similar, from zero to one, may have been meant.
const SIMILAR: f64 = 0.6;

/// The name that was probably meant.
fn meant(name: &str, available: &[String]) -> String {
    let name = name.to_lowercase();
    let similar = |known: &String| strsim::normalized_damerau_levenshtein(&known.to_lowercase(), &name);
    let nearest = available.iter().max_by(|a, b| similar(a).total_cmp(&similar(b)));
    match nearest.filter(|nearest| similar(nearest) >= SIMILAR) {
        Some(nearest) => format!(" (`{nearest}` is near)"),
        None => String::new(),
    }
}

/// A number without the hundreds of zeros that a large or small one would be printed with.
pub(crate) fn short(value: f64) -> String {
    let plain = value == 0.0 || !value.is_finite() || (1e-4..1e7).contains(&value.abs());
    if plain { value.to_string() } else { format!("{value:e}") }
}

/// What to do about a column in another unit than its signal.
fn other_unit((column, model): (&str, &str), signal: &str, factor: Option<f64>) -> String {
    let taken = format!("DataFile::factor(\"{signal}\", 1) if the file's unit is wrong");
    match (factor, relation(column, model)) {
        (Some(factor), _) => {
            format!("give DataFile::factor(\"{signal}\", {factor}), or 1 if the file's unit is wrong")
        }
        (None, Relation::OtherZero { .. }) => {
            format!(
                "their zeros differ: give DataFile::unit(\"{signal}\", \"{column}\"), which converts it, or {taken}"
            )
        }
        (None, Relation::Ambiguous { revolutions, radians }) => {
            format!(
                "give DataFile::factor(\"{signal}\", {revolutions}) if it counts revolutions, or DataFile::factor(\"{signal}\", {radians}) if radians"
            )
        }
        (None, Relation::Unknown) => {
            format!("how they are related is not known: give DataFile::factor(\"{signal}\", ..)")
        }
        (None, _) => format!("neither is a multiple of the other: convert the column, or give {taken}"),
    }
}

/// What to do about an input that is missing.
fn own_rate(signal: &str, value: f64) -> &'static str {
    match value.is_nan() && signal != "t" && !signal.starts_with("time of") {
        true => "; fill in an input that has a rate of its own (DataFile::fill, Record::from_series)",
        false => "",
    }
}

/// The line and the text of a cell.
fn place(line: u64, text: &str) -> String {
    if line == 0 { String::new() } else { format!("line {line}, `{text}`, ") }
}

/// A hint at the probable cause, from a text that is not a number.
fn number_hint(text: &str) -> &'static str {
    let only = |letters: &str| text.chars().all(|letter| letter.is_ascii_digit() || letters.contains(letter));
    if text.replacen(',', ".", 1).parse::<f64>().is_ok() {
        "; for decimal commas there is DataFile::decimal_comma"
    } else if !text.contains(|letter: char| letter.is_ascii_digit()) {
        "; a row of units is skipped by DataFile::units_row, and an output that is missing is empty, NaN, NA or null"
    } else if only("+-.,' ") {
        "; numbers have no separators of thousands"
    } else if only("-/.:TZ+ ") {
        "; times are seconds, ISO 8601, 20.03.2025 14:05:00, 03/20/2025 2:05:00 PM or 14:05:00: convert it, or give DataFile::sample_time"
    } else {
        ""
    }
}

fn wanted_by(signal: &str, column: &str) -> String {
    if signal == column { String::new() } else { format!(" for `{signal}`") }
}
