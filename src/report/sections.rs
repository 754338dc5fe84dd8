//! Sections that a report has if someone made what they show: tests, profiles, refits and restarts.

use super::Report;
use crate::diagnose::{Bootstrap, Profile, Restarts, Test};
use crate::optimize::Severity;
use serde::{Deserialize, Serialize};

/// A test, and what was put to it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Finding {
    /// What was tested.
    pub about: String,
    /// The test and its result.
    pub test: Test,
}

impl Report {
    /// Adds tests of something (nested models, drift); where one fails, the estimate is to be used with care.
    pub fn with_tests(mut self, about: impl Into<String>, tests: impl IntoIterator<Item = Test>) -> Self {
        let about = about.into();
        for test in tests {
            let severity = if test.passed { Severity::Usable } else { Severity::UsableWithCare };
            self.severity = self.severity.max(severity);
            self.findings.push(Finding { about: about.clone(), test });
        }
        self
    }

    /// Adds the profile of an unknown; where it met a better minimum, the estimate is not usable.
    pub fn with_profile(mut self, profile: Profile) -> Self {
        self.severity = self.severity.max(profile.severity);
        self.profiles.push(profile);
        self
    }

    /// Adds refits of resampled records.
    pub fn with_bootstrap(self, bootstrap: Bootstrap) -> Self {
        Report { bootstrap: Some(bootstrap), ..self }
    }

    /// Adds searches from elsewhere; where one met a better minimum, the estimate is not usable.
    pub fn with_restarts(self, restarts: Restarts) -> Self {
        Report { severity: self.severity.max(restarts.severity), restarts: Some(restarts), ..self }
    }
}
