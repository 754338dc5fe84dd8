//! A report as JSON.

use super::{Format, Report, Version};
use crate::error::Error;
use crate::section::{Plot, Section};

impl Report {
    /// The report as JSON, numbers to the last bit, without drawings.
    ///
    /// # Errors
    /// None for a report that this library made.
    pub fn to_json(&self) -> Result<String, Error> {
        let sections = self.sections.iter().map(undrawn).collect();
        let (title, estimate) = (self.title.clone(), self.estimate.clone());
        Report { title, estimate, sections, ..*self }.to_json_with_drawings()
    }

    /// JSON with the numbers of all drawings, which take some megabytes.
    ///
    /// # Errors
    /// None for a report that this library made.
    pub fn to_json_with_drawings(&self) -> Result<String, Error> {
        serde_json::to_string_pretty(self).map_err(|error| Error::Option(format!("the report as JSON: {error}")))
    }

    /// A report from its JSON.
    ///
    /// # Errors
    /// A text that is no report, or one of another version; with its line and column.
    pub fn from_json(text: &str) -> Result<Self, Error> {
        let report: Report = crate::format::read::<Format, Version, _>(text)
            .map_err(|error| Error::Option(format!("no report: {error}")))?;
        report.estimate.check()?;
        Ok(report)
    }
}

/// A section without its drawings.
fn undrawn(section: &Section) -> Section {
    let plot = |plot: &Plot| Plot {
        name: plot.name.clone(),
        title: plot.title.clone(),
        caption: plot.caption.clone(),
        drawing: None,
    };
    Section {
        id: section.id.clone(),
        title: section.title.clone(),
        severity: section.severity,
        folded: section.folded,
        reasons: section.reasons.clone(),
        sentences: section.sentences.clone(),
        tables: section.tables.clone(),
        plots: section.plots.iter().map(plot).collect(),
        parts: section.parts.iter().map(undrawn).collect(),
    }
}
