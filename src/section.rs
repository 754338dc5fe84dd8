//! [`Section`]: a part of a report as one plain value, which text, Markdown, HTML and JSON show alike.

mod plain;
mod plot;
mod table;
mod timeline;

pub(crate) use plain::{WIDTH, visible, wrapped};
pub use plot::{Axis, Layer, Plot, Style};
pub(crate) use plot::{Curves, Drawing, Forest, Heat, Interval};
pub use table::{Cell, Table};
pub(crate) use timeline::{Keep, Line, Panel, PanelKind, Samples, Stretch, Timeline, Trace};

use crate::severity::Severity;
use serde::{Deserialize, Serialize};

/// One part of a report: what it says, and the tables and plots that it rests on.
///
/// Names in sentences stand between backticks. Every diagnosis turns into a section (`Section::from`), and so may
/// anything that a user wants to add:
///
/// ```
/// use greybox::report::{Section, Table};
/// let section = Section::new("bench", "The bench")
///     .says("The winding was at room temperature: `Rs` is the cold one.")
///     .table(Table::new("Sensors", ["sensor", "type", "range (A)"]).row(["iq".into(), "LEM".into(), 50u64.into()]));
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Section {
    /// A short name for programs and links, letters, digits and `-`; one section of a report has it.
    pub id: String,
    /// The heading.
    pub title: String,
    /// The worst that this section says of the estimate.
    pub severity: Severity,
    /// Whether it is a detail: a page shows it closed at first, and a terminal not at all.
    pub folded: bool,
    /// Why the estimate is not simply usable; a report gathers them at its head.
    pub(crate) reasons: Vec<Reason>,
    /// Its paragraphs.
    pub sentences: Vec<String>,
    /// Its tables.
    pub tables: Vec<Table>,
    /// Its plots.
    pub plots: Vec<Plot>,
    /// Sections within it.
    pub parts: Vec<Section>,
}

/// Something that the reader of an estimate must know.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Reason {
    /// How bad it is; [`Severity::Usable`] is a note.
    pub severity: Severity,
    /// The reason, with the numbers and the remedy.
    pub text: String,
}

impl Section {
    /// An empty section of this name. In the name, what is no letter or digit becomes `-`.
    pub fn new(id: impl AsRef<str>, title: impl Into<String>) -> Section {
        Section {
            id: identifier(id.as_ref()),
            title: title.into(),
            severity: Severity::Usable,
            folded: false,
            reasons: vec![],
            sentences: vec![],
            tables: vec![],
            plots: vec![],
            parts: vec![],
        }
    }

    /// Adds a paragraph.
    pub fn says(mut self, text: impl Into<String>) -> Self {
        self.sentences.push(text.into());
        self
    }

    /// Adds a reason; one worse than a note makes the section as bad.
    pub fn because(mut self, severity: Severity, text: impl Into<String>) -> Self {
        self.severity = self.severity.max(severity);
        self.reasons.push(Reason { severity, text: text.into() });
        self
    }

    /// Adds a table, if it has a row.
    pub fn table(mut self, table: Table) -> Self {
        self.tables.extend(Some(table).filter(|table| !table.rows.is_empty()));
        self
    }

    /// Adds a plot.
    pub fn plot(mut self, plot: impl Into<Option<Plot>>) -> Self {
        self.plots.extend(plot.into());
        self
    }

    /// Adds a section within this one, which is then as bad as the other.
    pub fn part(mut self, part: impl Into<Option<Section>>) -> Self {
        if let Some(part) = part.into() {
            self.severity = self.severity.max(part.severity);
            self.parts.push(part);
        }
        self
    }

    /// Makes it a detail: a page shows it closed at first, and a terminal not at all.
    pub fn folded(self) -> Self {
        Section { folded: true, ..self }
    }

    /// Adds what another section says: its sentences, unless they are said, and its tables, to those of the same caption
    /// and columns as further rows.
    pub(crate) fn extend(&mut self, other: Section) {
        self.severity = self.severity.max(other.severity);
        self.reasons.extend(other.reasons);
        for text in other.sentences {
            if !self.sentences.contains(&text) {
                self.sentences.push(text);
            }
        }
        for table in other.tables {
            let same = |mine: &&mut Table| mine.caption == table.caption && mine.columns == table.columns;
            match self.tables.iter_mut().find(same) {
                Some(mine) => {
                    mine.rows.extend(table.rows);
                    mine.omitted += table.omitted;
                }
                None => self.tables.push(table),
            }
        }
        self.plots.extend(other.plots);
        self.parts.extend(other.parts);
    }

    /// Whether there is nothing to read in it.
    pub fn is_empty(&self) -> bool {
        self.sentences.is_empty() && self.tables.is_empty() && self.plots.is_empty() && self.parts.is_empty()
    }

    /// The reasons given here and within: how bad each is ([`Severity::Usable`] is a note), and what it is, with the numbers and the
    /// remedy.
    pub fn all_reasons(&self) -> Vec<(Severity, &str)> {
        let here = self.reasons.iter().map(|reason| (reason.severity, reason.text.as_str()));
        here.chain(self.parts.iter().flat_map(Section::all_reasons)).collect()
    }

    /// The plots shown here and within.
    pub fn all_plots(&self) -> Vec<&Plot> {
        self.plots.iter().chain(self.parts.iter().flat_map(Section::all_plots)).collect()
    }
}

/// A name fit for a file and an anchor.
pub(crate) fn identifier(text: &str) -> String {
    text.chars().map(|letter| if letter.is_alphanumeric() { letter } else { '-' }).collect()
}
