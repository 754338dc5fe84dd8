//! The sections that every report has, made of its plain values.

mod checks;
mod data;
mod identifiability;
mod outputs;
mod parameters;
mod records;
mod reproduce;
mod residuals;
mod starts;
mod states;

use super::facts::Facts;
use crate::section::Section;

/// They come after whatever is added to a report.
pub(super) const LAST: [&str; 3] = ["checks", "data", "reproduce"];

pub(super) fn all(facts: &Facts) -> Vec<Section> {
    let mut sections = vec![parameters::section(facts), outputs::section(facts)];
    sections.extend(records::sections(facts));
    sections.extend(facts.process_noise.as_ref().map(Section::from));
    sections.extend(residuals::section(facts));
    sections.push(identifiability::section(facts));
    sections.extend(starts::section(facts));
    sections.extend([checks::section(facts), data::section(facts), reproduce::section(facts)]);
    sections
}

/// Something called by a user, as a name in a sentence.
fn quoted(name: &str) -> String {
    format!("`{}`", name.replace('`', "'"))
}
