//! Sentences of a report on the estimate as a whole, shared by all its formats. Names stand between backticks.

use super::Report;
use crate::estimate::Knowledge;
use crate::severity::Severity;

/// The verdict in a word or three.
pub(super) fn verdict(severity: Severity) -> &'static str {
    match severity {
        Severity::Usable => "Usable",
        Severity::UsableWithCare => "Usable with care",
        Severity::NotUsable => "Not usable",
    }
}

/// A sign that goes with the verdict, for those who do not see its color.
pub(super) fn sign(severity: Severity) -> &'static str {
    match severity {
        Severity::Usable => "✓",
        Severity::UsableWithCare => "!",
        Severity::NotUsable => "✗",
    }
}

/// A sign that goes with a reason; a note has none of a verdict.
pub(super) fn sign_of_reason(severity: Severity) -> &'static str {
    match severity {
        Severity::Usable => "·",
        worse => sign(worse),
    }
}

/// How the search ended, and what to do about it if it ended badly.
pub(super) fn search(report: &Report) -> String {
    let estimate = &report.estimate;
    let mut text = format!("Search: {}; {}.", estimate.outcome, estimate.searches());
    if !estimate.outcome.converged() {
        text = format!("{text} {}", estimate.outcome.advice());
    }
    let unknown = estimate.unknowns.iter().filter(|unknown| unknown.knowledge == Knowledge::Unidentified).count();
    match unknown {
        0 => text,
        _ => format!("The data do not determine {unknown} of the {} unknowns. {text}", estimate.unknowns.len()),
    }
}

/// Pieces of a sentence: plain text and, between backticks, names.
pub(super) fn pieces(text: &str) -> impl Iterator<Item = (bool, &str)> {
    text.split('`').enumerate().map(|(i, piece)| (i % 2 == 1, piece))
}
