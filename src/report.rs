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
//!     .with(diagnose::profile(&problem, &estimate, "k", 0.95)?); // what costs many fits is asked for
//! report.save(&path)?; // .html, .md, .json or .txt
//! println!("{report}");
//! # std::fs::remove_file(path).unwrap();
//! # Ok::<(), greybox::Error>(())
//! ```
//!
//! A report knows nothing of the model's types: it is a value that can be stored, compared and drawn long after the program
//! that fitted is gone. It consists of the estimate's numbers and of [`Section`]s, which text, Markdown, HTML and JSON show
//! alike. Records enter it as drawings of bounded size, so its own does not grow with theirs.
//!
//! # JSON
//!
//! `schema/report.schema.json` describes it. JSON has no value for what is not finite: a number that is not a number
//! (a standard error without a degree of freedom) is null, and the infinities are the texts `"Infinity"` and `"-Infinity"`.
//! The same holds for estimates, experiments and all else that is stored. Drawings are left out unless asked for.

mod chart;
mod facts;
mod file;
mod format;
mod gather;
mod html;
mod json;
mod markdown;
mod markup;
mod origin;
mod picture;
mod sections;
mod text;
mod words;

pub use crate::section::{Axis, Cell, Layer, Plot, Section, Style, Table};
pub use origin::Origin;

use crate::error::Error;
use crate::estimate::Summary;
use crate::severity::Severity;
use core::fmt;
use facts::Facts;
use format::{Format, Version};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// A report on an estimate, for readers.
///
/// It leads with the [`severity`](Report::severity), and holds all that is needed to judge the fit and to repeat it. It is
/// made by [`Report::new`], which makes the diagnoses that cost little; others are added by [`with`](Report::with). It is
/// kept as JSON ([`to_json`](Report::to_json), [`from_json`](Report::from_json)) and shown as text, Markdown or one
/// self-contained HTML page; [`save`](Report::save) writes any of them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Report {
    /// Format of its JSON.
    pub format: Format,
    /// Which version of it.
    pub version: Version,
    /// The heading.
    pub title: String,
    /// That of the estimate, and of what was added ([`with`](Report::with)) if that is worse.
    pub severity: Severity,
    /// The estimate, for programs.
    pub estimate: Summary,
    /// Its sections.
    pub sections: Vec<Section>,
}

impl Report {
    /// The report that these values make.
    fn of(facts: &Facts) -> Report {
        Report {
            format: Format,
            version: Version,
            title: "Parameter estimation".to_owned(),
            severity: facts.estimate.severity(),
            estimate: facts.estimate.clone(),
            sections: sections::all(facts),
        }
    }

    /// Puts a title above it; without one it is "Parameter estimation".
    pub fn titled(mut self, title: impl Into<String>) -> Self {
        self.title = title.into();
        self
    }

    /// Adds a section: a diagnosis ([`Profile`](crate::diagnose::Profile), [`Bootstrap`](crate::diagnose::Bootstrap),
    /// [`Compared`](crate::diagnose::Compared) records, ...) or one's own. The
    /// report is then at least as severe. What a section of the same `id` says is added to the one that is there.
    pub fn with(mut self, section: impl Into<Section>) -> Self {
        let section = section.into();
        self.severity = self.severity.max(section.severity);
        if let Some(there) = self.sections.iter_mut().find(|there| there.id == section.id) {
            there.extend(section);
            return self;
        }
        let last = self.sections.iter().position(|there| sections::LAST.contains(&there.id.as_str()));
        self.sections.insert(last.unwrap_or(self.sections.len()), section);
        self
    }

    /// Why the estimate is not simply usable, the worst first: how bad each reason is, and what it is.
    pub fn reasons(&self) -> Vec<(Severity, &str)> {
        let mut reasons: Vec<(Severity, &str)> = vec![];
        for reason in self.sections.iter().flat_map(Section::all_reasons) {
            // A reason that two sections give appears once.
            if !reasons.iter().any(|other| other.1 == reason.1) {
                reasons.push(reason);
            }
        }
        reasons.sort_by_key(|(severity, _)| core::cmp::Reverse(*severity));
        reasons
    }

    /// The plots of all sections that have their drawing.
    pub fn plots(&self) -> Vec<&Plot> {
        let plots = self.sections.iter().flat_map(Section::all_plots);
        plots.filter(|plot| plot.drawing.is_some()).collect()
    }

    /// The report as Markdown with tables (GitHub's flavor).
    pub fn to_markdown(&self) -> String {
        markdown::page(self)
    }

    /// The report as one HTML page, with nothing in it that is fetched from elsewhere. It adapts to narrow and wide screens,
    /// to light and dark, and to paper; a script in it lets a reader zoom, and it reads as well without.
    pub fn to_html(&self) -> String {
        html::page(self)
    }

    /// The report as text for a terminal of 80 columns, in color. Its `Display` is the same without. Whether a terminal
    /// wants color is for the caller to ask (`NO_COLOR`, `std::io::IsTerminal`).
    pub fn to_colored_text(&self) -> String {
        text::page(self, true)
    }

    /// Writes the report to a file: a page, Markdown, JSON without drawings or text, as the path ends in `.html`, `.md`,
    /// `.json` or `.txt`. It is written beside first and then renamed, so that there is never half a file.
    ///
    /// # Errors
    /// Another ending, or a path that cannot be written to; nothing is left behind.
    pub fn save(&self, path: impl AsRef<Path>) -> Result<(), Error> {
        self.save_in_words(path, str::to_owned)
    }

    /// [`save`](Report::save) with the text passed through `words`, by which a front end names its own options
    /// (`text::renamed`). JSON stays as it is.
    ///
    /// # Errors
    /// As [`save`](Report::save).
    pub fn save_in_words(&self, path: impl AsRef<Path>, words: impl Fn(&str) -> String) -> Result<(), Error> {
        let path = path.as_ref();
        let text = match path.extension().and_then(|ending| ending.to_str()) {
            Some("html") => words(&self.to_html()),
            Some("md") => words(&self.to_markdown()),
            Some("json") => self.to_json()?,
            Some("txt") => words(&self.to_string()),
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
