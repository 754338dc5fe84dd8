//! The command line.

use clap::{Args, Parser, Subcommand, ValueEnum};
use clap_complete::Shell;
use std::path::PathBuf;

/// Physical parameters, with their intervals, from a model and measured records.
///
/// A model is a file (`greybox new` writes one) or the name of one that ships (`greybox models`). A record is a file with a
/// column for each input and output and one for time: CSV, or, where this build has the features for them, Parquet, Arrow, MATLAB,
/// HDF5 and NumPy archives. Options may stand in a file `greybox.toml` in the current folder, by
/// their long names; then `greybox fit` repeats the fit.
///
/// Exit codes: 0 usable, 2 usable with care, 3 not usable, 1 error.
#[derive(Parser)]
#[command(name = "greybox", version, max_term_width = 80, args_override_self = true)]
pub struct Arguments {
    #[command(subcommand)]
    pub command: Command,
    /// Treat "usable with care" as not usable: exit code 3 instead of 2.
    #[arg(long, global = true)]
    pub strict: bool,
    /// Print results only, no progress and no remarks.
    #[arg(short, long, global = true)]
    pub quiet: bool,
}

#[derive(Subcommand)]
pub enum Command {
    /// Estimate the parameters of a model from records.
    Fit(Fit),
    /// Simulate a model with given parameters and the inputs of a record.
    Simulate(Simulate),
    /// Compare models or estimates on records, on one page.
    Compare(Compare),
    /// Test the residuals of an estimate.
    Residuals(Refit),
    /// Likelihood profiles of parameters: intervals where slopes do not suffice.
    Profile(Profile),
    /// Intervals by refits of resampled records.
    Bootstrap(Bootstrap),
    /// Fit many records, each by itself, into one table.
    Fleet(Fleet),
    /// Check a model and records without a fit: units, columns, gaps, and which unknowns the data determine.
    Check(Check),
    /// Write a record as CSV: the signals of the model, in its units.
    Convert(Convert),
    /// Write a commented model file to begin with.
    New(New),
    /// List the models that ship, or print one.
    Models(Models),
    /// Print a model as TOML, Rust, LaTeX, Markdown or JSON.
    Export(Export),
    /// Print the completions of a shell.
    Completions(Completions),
    /// Print the manual page.
    Man(Man),
}

/// Values that the model is given: all that a simulation takes of its declarations.
#[derive(Args, Clone, Debug, Default)]
pub struct Values {
    /// Give a constant of the model another value.
    #[arg(long, value_name = "NAME=VALUE", value_parser = assignment)]
    pub constant: Vec<(String, String)>,
    /// Start a parameter elsewhere.
    #[arg(long, value_name = "NAME=VALUE", value_parser = assignment)]
    pub set: Vec<(String, String)>,
    /// Keep a parameter at a value.
    #[arg(long, value_name = "NAME=VALUE", value_parser = assignment)]
    pub fix: Vec<(String, String)>,
    /// The state at the first sample: `id=0` known, `id~0` estimated from there; `first` takes all from the first sample,
    /// `steady` those at which the plant rests.
    #[arg(long, value_name = "NAME=VALUE")]
    pub initial: Vec<String>,
}

/// The model and what is changed of its declarations.
#[derive(Args, Clone, Debug, Default)]
pub struct ModelOptions {
    #[command(flatten)]
    pub values: Values,
    /// Estimate a parameter that the model keeps.
    #[arg(long, value_name = "NAME")]
    pub free: Vec<String>,
    /// Keep a parameter within bounds: `rs=0.01..10`; either may be left out.
    #[arg(long, value_name = "NAME=A..B", value_parser = assignment)]
    pub bounds: Vec<(String, String)>,
    /// Add what is known beforehand of a parameter: mean and standard deviation, `rs=0.6,0.05`.
    #[arg(long, value_name = "NAME=MEAN,STD", value_parser = assignment)]
    pub prior: Vec<(String, String)>,
    /// Estimate the logarithm of a parameter.
    #[arg(long, value_name = "NAME")]
    pub log: Vec<String>,
    /// Say that only a positive value of a parameter has a meaning.
    #[arg(long, value_name = "NAME")]
    pub positive: Vec<String>,
    /// Give each record a value of its own of a parameter.
    #[arg(long, value_name = "NAME")]
    pub per_record: Vec<String>,
}

/// What stands first in a date.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum Order {
    Day,
    Month,
}

/// How files become records.
#[derive(Args, Clone, Debug, Default)]
pub struct RecordOptions {
    /// The column of a signal, or of the time `t`, if it has another name.
    #[arg(long, value_name = "SIGNAL=COLUMN", value_parser = assignment)]
    pub column: Vec<(String, String)>,
    /// The unit that a signal has in the file: `w=rpm`; it is converted.
    #[arg(long, value_name = "SIGNAL=UNIT", value_parser = assignment)]
    pub unit: Vec<(String, String)>,
    /// The column of time.
    #[arg(long, value_name = "COLUMN")]
    pub time: Option<String>,
    /// The unit of time in the file: s, ms, us, ns, min, h.
    #[arg(long, value_name = "UNIT")]
    pub time_unit: Option<String>,
    /// What stands first in dates such as 03/04/2025.
    #[arg(long, value_enum, value_name = "FIRST")]
    pub date_order: Option<Order>,
    /// The zone of dates that have none, such as Europe/Berlin: clocks that are set forward and back are followed.
    #[arg(long, value_name = "ZONE")]
    pub zone: Option<String>,
    /// Time from a constant sample time (s) instead of a column.
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true, conflicts_with_all = ["time", "time_unit", "date_order", "zone"])]
    pub sample_time: Option<f64>,
    /// How an input behaves between samples: `w=first` (a straight line), `ud=zero` (held).
    #[arg(long, value_name = "INPUT=HOLD", value_parser = assignment)]
    pub hold: Vec<(String, String)>,
    /// Fill in an input that has a rate of its own, where its cells are empty, by its hold.
    #[arg(long, value_name = "INPUT")]
    pub fill: Vec<String>,
    /// Use the samples between two times (s) only: `1.5..20`; either may be left out.
    #[arg(long, value_name = "FROM..TO")]
    pub between: Option<String>,
    /// Keep every n-th sample; held inputs become their means in between.
    #[arg(long, value_name = "N")]
    pub every: Option<usize>,
}

/// What is minimized, and how.
#[derive(Args, Clone, Debug, Default)]
pub struct FitOptions {
    /// The standard deviation of the noise of an output; without it, that of the model file, or it is estimated.
    #[arg(long, value_name = "OUTPUT=STD", value_parser = assignment)]
    pub noise: Vec<(String, String)>,
    /// Estimate the covariance of the noise of all outputs.
    #[arg(long, conflicts_with = "noise")]
    pub noise_covariance: bool,
    /// The standard deviation of the noise of an input.
    #[arg(long, value_name = "INPUT=STD", value_parser = assignment)]
    pub input_noise: Vec<(String, String)>,
    /// The loss: squared, huber, soft-l1, cauchy, tukey; with its constant: `huber:2`.
    #[arg(long)]
    pub loss: Option<String>,
    /// The weight of each sample: an expression of time and inputs: `abs(w)`. By outputs their noise biases the estimate.
    #[arg(long, value_name = "EXPRESSION", allow_hyphen_values = true)]
    pub weight: Option<String>,
    /// A filter of the errors: order and cut-off (Hz), `low-pass:4,100`, `high-pass:2,0.5`; in a fleet the sample time (s), too:
    /// `low-pass:4,100,1e-3`.
    #[arg(long, value_name = "FILTER")]
    pub prefilter: Option<String>,
    /// What is predicted: `simulation` (the default), `horizon:5` (samples ahead), `kalman` or `second-order`; the last two with `:stationary` or
    /// `:first-interval` for the covariance at the first sample.
    #[arg(long)]
    pub predictor: Option<String>,
    /// The integrator: automatic, `rk4:4` (steps per sample), `rk45:1e-8`, `esdirk:1e-8`, discrete.
    #[arg(long)]
    pub integrator: Option<String>,
    /// The search: levenberg-marquardt, gauss-newton.
    #[arg(long)]
    pub optimizer: Option<String>,
    /// Search from so many starts.
    #[arg(long, value_name = "COUNT")]
    pub starts: Option<usize>,
    /// Improve each start in stages before the search: fits of predictions that are corrected less in each stage.
    #[arg(long)]
    pub staged: bool,
    /// Improve each start by multiple shooting alone: pieces with initial states of their own, whose gaps are closed step by step.
    #[arg(long, conflicts_with = "staged")]
    pub multiple_shooting: bool,
    /// End after so many seconds with the best so far.
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    pub time_limit: Option<f64>,
    /// Save the search to a file, and go on from it if it is there.
    #[arg(long, value_name = "FILE")]
    pub checkpoint: Option<PathBuf>,
}

/// Model, records, and all options of a fit: what several commands do first.
#[derive(Args, Clone)]
pub struct Fitting {
    /// A model file, or the name of a model that ships.
    pub model: Option<String>,
    /// Records.
    pub records: Vec<PathBuf>,
    #[command(flatten, next_help_heading = "Model")]
    pub of_model: ModelOptions,
    #[command(flatten, next_help_heading = "Records")]
    pub of_records: RecordOptions,
    #[command(flatten, next_help_heading = "Fit")]
    pub of_fit: FitOptions,
}

#[derive(Args)]
pub struct Fit {
    #[command(flatten)]
    pub fitting: Fitting,
    /// Add a quantity computed from parameters, with its interval: `tau=ls/rs`.
    #[arg(long, value_name = "NAME=EXPRESSION", value_parser = assignment)]
    pub derived: Vec<(String, String)>,
    /// Write a report: .html, .md, .json or .txt.
    #[arg(long, value_name = "FILE")]
    pub report: Option<PathBuf>,
    /// Write the estimate as JSON, for programs and for `compare` and `simulate`.
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
    /// Draw measured and predicted outputs: .svg, or .png where this build has the feature `png`.
    #[arg(long, value_name = "FILE")]
    pub plot: Option<PathBuf>,
    /// Print the whole report instead of the estimate.
    #[arg(long)]
    pub full: bool,
}

/// A command that fits, or takes an estimate, and goes on from there.
#[derive(Args)]
pub struct Refit {
    #[command(flatten)]
    pub fitting: Fitting,
    /// An estimate of the same model and records (`fit --json`), instead of a fit.
    #[arg(long, value_name = "FILE")]
    pub estimate: Option<PathBuf>,
    /// Write a report: .html, .md, .json or .txt.
    #[arg(long, value_name = "FILE")]
    pub report: Option<PathBuf>,
}

#[derive(Args)]
pub struct Simulate {
    /// A model file, or the name of a model that ships.
    pub model: Option<String>,
    /// A file with the inputs and the time.
    pub records: Vec<PathBuf>,
    #[command(flatten, next_help_heading = "Model")]
    pub of_model: Values,
    #[command(flatten, next_help_heading = "Records")]
    pub of_records: RecordOptions,
    /// Take the parameters from an estimate (`fit --json`).
    #[arg(long, value_name = "FILE")]
    pub estimate: Option<PathBuf>,
    /// The integrator: automatic, `rk4:4` (steps per sample), `rk45:1e-8`, `esdirk:1e-8`, discrete.
    #[arg(long)]
    pub integrator: Option<String>,
    /// Simulate with the noise of the model: process noise (`diffusion`), and `noise` of the outputs that `--noise` does not name.
    #[arg(long)]
    pub noisy: bool,
    /// Add white noise to an output.
    #[arg(long, value_name = "OUTPUT=STD", value_parser = assignment)]
    pub noise: Vec<(String, String)>,
    /// The seed of the random numbers.
    #[arg(long, value_name = "NUMBER", default_value_t = 1)]
    pub seed: u64,
    /// Where the record goes, a .csv file; without it, to standard output.
    #[arg(short, long, value_name = "FILE")]
    pub out: Option<PathBuf>,
}

#[derive(Args)]
pub struct Compare {
    /// A model file or name, with the estimate to take its parameters from: `pmsm.toml`, `pmsm.toml:estimate.json`.
    #[arg(long = "model", value_name = "MODEL[:ESTIMATE]", required = true)]
    pub models: Vec<String>,
    /// Records; those before `--validation` are fitted.
    pub records: Vec<PathBuf>,
    /// Records that are predicted, not fitted.
    #[arg(long, value_name = "FILE", num_args = 1..)]
    pub validation: Vec<PathBuf>,
    #[command(flatten, next_help_heading = "Model")]
    pub of_model: ModelOptions,
    #[command(flatten, next_help_heading = "Records")]
    pub of_records: RecordOptions,
    #[command(flatten, next_help_heading = "Fit")]
    pub of_fit: FitOptions,
    /// Write a report: .html, .md, .json or .txt.
    #[arg(long, value_name = "FILE")]
    pub report: Option<PathBuf>,
}

#[derive(Args)]
pub struct Profile {
    #[command(flatten)]
    pub refit: Refit,
    /// The unknowns to profile; without it, all.
    #[arg(long = "of", value_name = "NAME")]
    pub names: Vec<String>,
    /// The probability of the interval.
    #[arg(long, value_name = "PART", default_value_t = 0.95)]
    pub probability: f64,
}

#[derive(Args)]
pub struct Bootstrap {
    #[command(flatten)]
    pub refit: Refit,
    /// How many refits.
    #[arg(long, value_name = "COUNT", default_value_t = 200)]
    pub refits: usize,
    /// Resample blocks of so many samples (0: chosen) instead of single residuals.
    #[arg(long, value_name = "SAMPLES")]
    pub blocks: Option<usize>,
    /// The seed of the random numbers.
    #[arg(long, value_name = "NUMBER", default_value_t = 1)]
    pub seed: u64,
}

// What has no meaning where each record is fitted by itself is refused, and not offered.
#[derive(Args)]
#[command(mut_arg("per_record", |option| option.hide(true)), mut_arg("checkpoint", |option| option.hide(true)))]
pub struct Fleet {
    /// A model file, or the name of a model that ships.
    pub model: Option<String>,
    /// Records; patterns such as 'data/*.csv' are expanded.
    pub records: Vec<PathBuf>,
    /// A column that tells the records of one file apart: their rows have a text or whole number of their own there.
    #[arg(long, value_name = "COLUMN")]
    pub by: Option<String>,
    #[command(flatten, next_help_heading = "Model")]
    pub of_model: ModelOptions,
    #[command(flatten, next_help_heading = "Records")]
    pub of_records: RecordOptions,
    #[command(flatten, next_help_heading = "Fit")]
    pub of_fit: FitOptions,
    /// The table, .csv or .parquet: one row for each record. Records that are in it, or in the journal of an interrupted run,
    /// are not fitted again, but for those that failed and those of files that were written since. A file beside it, with
    /// `.run` at the end of its name, has the model and the options that made it; rows of others are not added.
    #[arg(short, long, value_name = "FILE")]
    pub out: Option<PathBuf>,
}

#[derive(Args)]
pub struct Check {
    /// A model file, or the name of a model that ships.
    pub model: Option<String>,
    /// Records.
    pub records: Vec<PathBuf>,
    #[command(flatten, next_help_heading = "Model")]
    pub of_model: ModelOptions,
    #[command(flatten, next_help_heading = "Records")]
    pub of_records: RecordOptions,
}

#[derive(Args)]
pub struct Convert {
    /// A model file, or the name of a model that ships: it says which columns there are.
    pub model: Option<String>,
    /// The record.
    pub records: Vec<PathBuf>,
    #[command(flatten, next_help_heading = "Records")]
    pub of_records: RecordOptions,
    /// Where it goes, a .csv file; without it, to standard output.
    #[arg(short, long, value_name = "FILE")]
    pub out: Option<PathBuf>,
}

#[derive(Args)]
pub struct New {
    /// The file to write: `motor.toml`.
    pub file: Option<PathBuf>,
    /// Begin with a model that ships instead of an example.
    #[arg(long, value_name = "NAME")]
    pub from: Option<String>,
    /// Ask for the quantities at the terminal.
    #[arg(long, conflicts_with = "from")]
    pub ask: bool,
    /// Write over a file that is there.
    #[arg(long)]
    pub force: bool,
}

#[derive(Args)]
pub struct Models {
    /// Print the text of this one.
    pub name: Option<String>,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum Language {
    Toml,
    Rust,
    Latex,
    Markdown,
    Json,
}

#[derive(Args)]
pub struct Export {
    /// A model file, or the name of a model that ships.
    pub model: Option<String>,
    /// Give a constant of the model another value.
    #[arg(long, value_name = "NAME=VALUE", value_parser = assignment)]
    pub constant: Vec<(String, String)>,
    /// The language.
    #[arg(long, value_enum, default_value = "toml")]
    pub language: Language,
    /// Where it goes; without it, to standard output.
    #[arg(short, long, value_name = "FILE")]
    pub out: Option<PathBuf>,
}

#[derive(Args)]
pub struct Completions {
    /// The shell.
    pub shell: Shell,
}

#[derive(Args)]
pub struct Man {
    /// Write a page for each command into this folder instead of the main one to standard output.
    #[arg(long, value_name = "FOLDER")]
    pub folder: Option<PathBuf>,
}

/// `name=value`
fn assignment(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some((name, value)) if !name.trim().is_empty() && !value.trim().is_empty() => {
            Ok((name.trim().to_owned(), value.trim().to_owned()))
        }
        _ => Err("write a name, an equals sign and a value".to_owned()),
    }
}
