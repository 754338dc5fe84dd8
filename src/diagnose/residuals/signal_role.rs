//! [`SignalRole`]: what a signal is, beside which residuals are examined.

use core::fmt;
use serde::{Deserialize, Serialize};

/// Role of a signal that residuals are compared with; in JSON in small letters with underscores (`measured_output`).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum SignalRole {
    /// An input.
    Input,
    /// An output as it was measured.
    MeasuredOutput,
    /// An output as it was predicted.
    PredictedOutput,
    /// The time.
    Time,
}

impl fmt::Display for SignalRole {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            SignalRole::Input => "input",
            SignalRole::MeasuredOutput => "measured output",
            SignalRole::PredictedOutput => "predicted output",
            SignalRole::Time => "time",
        })
    }
}
