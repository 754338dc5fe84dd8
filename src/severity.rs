//! [`Severity`]: how far an estimate is to be trusted.

use core::fmt;
use serde::{Deserialize, Serialize};

/// How far an estimate is to be trusted, by one warning or by all.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Severity {
    /// No check contradicts it.
    Usable,
    /// Read the warnings first.
    UsableWithCare,
    /// Do not use the numbers.
    NotUsable,
}

impl fmt::Display for Severity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Severity::Usable => "usable",
            Severity::UsableWithCare => "usable with care",
            Severity::NotUsable => "not usable",
        })
    }
}
