//! [`Report`]: an estimate as something to read, to send and to keep.
//!
//! ```
//! # use greybox::{Experiment, Fit, Kind, Model, Nothing, Report, Scalar, Time, diagnose, free, signals};
//! # signals! { pub struct Load { f: "N" } pub struct Length { y: "m" } pub struct Spring { k: "N/m", rest: "m" } }
//! # #[derive(Clone)]
//! # struct Hooke;
//! # impl Model for Hooke {
//! #     type State = Nothing; type Input = Load; type Output = Length; type Parameters = Spring;
//! #     const KIND: Kind = Kind::Static;
//! #     fn output<S: Scalar>(&self, _: S, _: &Nothing, u: &Load<S>, p: &Spring<S>) -> Length<S> {
//! #         Length { y: u.f / p.k + p.rest }
//! #     }
//! # }
//! # let loads: Vec<Load> = (0..60).map(|k| Load { f: f64::from(k % 7) }).collect();
//! # let length = |(k, u): (usize, &Load)| Length { y: u.f / 20.0 + 0.1 + 1e-3 * (k as f64 * 2.4).sin() };
//! # let lengths = loads.iter().enumerate().map(length).collect();
//! # let record = Experiment::new(&Hooke, Time::Uniform { start: 0.0, step: 1.0 }, loads, lengths)?;
//! # let path = std::env::temp_dir().join(format!("greybox_spring_{}.html", std::process::id()));
//! # let (model, parameters) = (Hooke, Spring { k: free(10.0), rest: free(0.0) });
//! let problem = Fit::new(&model, &record).parameters(parameters).problem()?;
//! let estimate = problem.run()?;
//! let report = Report::new(&problem, &estimate)? // with tests of the residuals, identifiability and bands
//!     .titled("Spring of bench 3")
//!     .with_profile(diagnose::profile(&problem, &estimate, "k", 0.95)?); // what costs many fits is asked for
//! report.save(&path)?; // .html, .md, .json or .txt
//! println!("{report}");
//! # std::fs::remove_file(path).unwrap();
//! # Ok::<(), greybox::Error>(())
//! ```
//!
//! A report knows nothing of the model's types any more: it is a value that can be stored, compared and drawn long after the
//! program that fitted is gone. Records enter it as drawings of a few thousand columns and a few numbers each, so its size
//! does not grow with theirs.

mod chart;
mod file;
mod format;
mod gather;
mod histogram;
mod html;
mod markdown;
mod markup;
mod plots;
mod sections;
mod tables;
mod text;
mod trace;
mod words;

pub use format::Format;
pub use histogram::Histogram;
pub use plots::Plot;
pub use sections::Finding;
pub use trace::{Band, Trace};

use crate::diagnose::{Bootstrap, Identifiability, Profile, Restarts, residuals::Residuals};
use crate::error::Error;
use crate::estimate::{Direction, Method, OutputFit as Fitted, Unknown, Warning};
use crate::information::SquareMatrix;
use crate::optimize::{Outcome, Severity};
use crate::parameter::Parameter;
use core::fmt;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// What an estimate is worth, for a reader.
///
/// It leads with the [`severity`](Report::severity), and holds all that is needed to judge the fit and to repeat it. It is
/// made by [`Report::new`], which makes the diagnoses that cost little; others are added. It is kept as JSON ([`to_json`](Report::to_json), [`from_json`](Report::from_json)) and shown as text,
/// Markdown or one self-contained HTML page; [`save`](Report::save) writes any of them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Report {
    /// The schema, so that a file says what it is.
    pub format: Format,
    /// What stands above it.
    pub title: String,
    /// The worst that is said of the estimate.
    pub severity: Severity,
    /// How the search ended.
    pub outcome: Outcome,
    /// What the reader must know.
    pub warnings: Vec<Warning>,
    /// Every free quantity of the fit.
    pub unknowns: Vec<Unknown>,
    /// What was declared of each parameter, fixed ones included.
    pub declared: Vec<Declared>,
    /// Correlation of the unknowns, in their order.
    pub correlation: SquareMatrix,
    /// What the data cannot tell apart.
    pub directions: Vec<Direction>,
    /// How well each output is reproduced over all records.
    pub outputs: Vec<Output>,
    /// The records of the fit.
    pub records: Vec<Record>,
    /// What the records can tell of the unknowns.
    pub identifiability: Identifiability,
    /// Likelihood profiles, if any were made.
    pub profiles: Vec<Profile>,
    /// Refits of resampled records, if any were made.
    pub bootstrap: Option<Bootstrap>,
    /// Searches from elsewhere, if any were made.
    pub restarts: Option<Restarts>,
    /// Further tests that someone made; those of the residuals stand with their output.
    pub findings: Vec<Finding>,
    /// Sums and criteria of the fit.
    pub figures: Figures,
    /// How it was made.
    pub method: Method,
}

/// A parameter as it was declared.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Declared {
    /// Name.
    pub name: String,
    /// Unit.
    pub unit: String,
    /// Start, bounds, prior, transform.
    pub parameter: Parameter,
}

/// How well an output is reproduced.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Output {
    /// Name.
    pub name: String,
    /// Unit.
    pub unit: String,
    /// The numbers.
    pub quality: Fitted,
}

/// One record of the fit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Record {
    /// Name.
    pub name: String,
    /// Number of samples.
    pub samples: u64,
    /// Time of the first sample (s).
    pub begin: f64,
    /// Time of the last sample (s).
    pub end: f64,
    /// Median time from sample to sample (s).
    pub sample_time: f64,
    /// Places where samples are lost.
    pub gaps: u64,
    /// The inputs and the measured outputs.
    pub signals: Vec<Signal>,
    /// What the model made of each output.
    pub fits: Vec<OutputFit>,
}

/// A column of a record.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Signal {
    /// Name.
    pub name: String,
    /// Unit.
    pub unit: String,
    /// Whether it drives the model or is to be reproduced.
    pub role: Role,
    /// Samples that were not measured.
    pub missing: u64,
    /// Least value; `None` if nothing was measured.
    pub min: Option<f64>,
    /// Mean of the values.
    pub mean: Option<f64>,
    /// Greatest value.
    pub max: Option<f64>,
}

/// What a column is to the model.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Role {
    /// It drives the model.
    Input,
    /// The model is to reproduce it.
    Output,
}

/// One output of one record beside what the model predicted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OutputFit {
    /// Name.
    pub name: String,
    /// Unit.
    pub unit: String,
    /// Fit (%) as in [`OutputFit`](crate::OutputFit).
    pub fit_percent: Option<f64>,
    /// Samples for which the method has no prediction; they are drawn as gaps.
    pub unpredicted: u64,
    /// What is left unexplained, and what it was tested for.
    pub residuals: Residuals,
    /// The largest residual in size, with its sign.
    pub largest: f64,
    /// Its time (s).
    pub largest_at: f64,
    /// How often which residual occurs.
    pub histogram: Histogram,
    /// Measured, predicted and residual, as a drawing of the whole record; `None` where too many records are to be drawn.
    pub overview: Option<Trace>,
    /// The samples about the largest residual, one by one, where the overview cannot show them.
    pub closeup: Option<Trace>,
}

/// Sums and criteria of a fit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Figures {
    /// The minimized cost.
    pub cost: f64,
    /// Measurements used.
    pub measurements: u64,
    /// Measurements less unknowns.
    pub degrees_of_freedom: f64,
    /// `-2 ln` of the likelihood, where it is defined.
    pub deviance: Option<f64>,
    /// Akaike's information criterion.
    pub aic: Option<f64>,
    /// The same, corrected for short records.
    pub aicc: Option<f64>,
    /// Bayes' information criterion.
    pub bic: Option<f64>,
    /// Akaike's final prediction error.
    pub fpe: Option<f64>,
    /// Trial steps of the search.
    pub iterations: u64,
    /// Passes over the data with slopes.
    pub evaluations: u64,
    /// Time taken (s).
    pub seconds: f64,
}

impl Report {
    /// Puts a title above it; without one it is "Parameter estimation".
    pub fn titled(self, title: impl Into<String>) -> Self {
        Report { title: title.into(), ..self }
    }

    /// The report as JSON, numbers to the last bit.
    ///
    /// # Errors
    /// None for a report that this library made.
    pub fn to_json(&self) -> Result<String, Error> {
        serde_json::to_string_pretty(self).map_err(|error| Error::Option(format!("the report as JSON: {error}")))
    }

    /// A report from its JSON.
    ///
    /// # Errors
    /// A text that is no report, or one of another schema; with its line and column.
    pub fn from_json(text: &str) -> Result<Self, Error> {
        serde_json::from_str(text).map_err(|error| Error::Option(format!("no report: {error}")))
    }

    /// The report as Markdown with tables (GitHub's flavor).
    pub fn to_markdown(&self) -> String {
        markdown::page(self)
    }

    /// The report as one HTML page, with nothing in it that is fetched from elsewhere. It adapts to narrow and wide screens,
    /// to light and dark, and to paper; a few lines of script in it let a reader zoom, and it reads as well without.
    pub fn to_html(&self) -> String {
        html::page(self)
    }

    /// The report as text for a terminal, in color. Its `Display` is the same without.
    pub fn to_colored_text(&self) -> String {
        text::page(self, true)
    }

    /// The pictures of the report.
    pub fn plots(&self) -> Vec<Plot<'_>> {
        plots::all(self)
    }

    /// Writes the report to a file: a page, Markdown, JSON or text, as the path ends in `.html`, `.md`, `.json` or `.txt`.
    /// It is written beside first and then renamed, so that there is never half a file.
    ///
    /// # Errors
    /// Another ending, or a path that cannot be written to; nothing is left behind.
    pub fn save(&self, path: impl AsRef<Path>) -> Result<(), Error> {
        let path = path.as_ref();
        let text = match path.extension().and_then(|ending| ending.to_str()) {
            Some("html") => self.to_html(),
            Some("md") => self.to_markdown(),
            Some("json") => self.to_json()?,
            Some("txt") => self.to_string(),
            _ => {
                let path = path.display();
                return Err(Error::Option(format!(
                    "{path}: a report is written as .html, .md, .json or .txt; give the path one of these endings"
                )));
            }
        };
        file::write(path, text.as_bytes())
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&text::page(self, false))
    }
}
