//! Sections that a report has if someone made what they show: findings of tests, and profile curves.

use super::Report;
use crate::optimize::Severity;
use serde::{Deserialize, Serialize};

/// What a test found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Finding {
    /// What was tested.
    pub about: String,
    /// Name of the test.
    pub test: String,
    /// What it found, in numbers.
    pub result: String,
    /// What that means; names stand between backticks.
    pub meaning: String,
    /// What it makes of the estimate.
    pub severity: Severity,
}

/// How the fit worsens as one parameter is moved and the others are estimated anew.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ProfileCurve {
    /// Name of the parameter.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// Its values, increasing.
    pub values: Vec<f64>,
    /// By how much `-2 ln` of the likelihood rises at each value; `None` where the fit failed.
    pub rise: Vec<Option<f64>>,
    /// The rise at the ends of the interval.
    pub level: f64,
}

impl Report {
    /// Adds what tests found; the report is as severe as the worst of it.
    pub fn with_findings(mut self, findings: impl IntoIterator<Item = Finding>) -> Self {
        self.findings.extend(findings);
        self.severity = self.findings.iter().map(|finding| finding.severity).fold(self.severity, Severity::max);
        self
    }

    /// Adds a profile curve.
    pub fn with_profile(mut self, profile: ProfileCurve) -> Self {
        self.profiles.push(profile);
        self
    }
}
