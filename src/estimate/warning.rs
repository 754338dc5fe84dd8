//! [`Warning`]: something the reader of an estimate must know.

use crate::optimize::Severity;
use serde::{Deserialize, Serialize};

/// Something the reader of an estimate must know.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Warning {
    /// What it is, for programs: the words of `text` may change, the code does not.
    pub code: WarningCode,
    /// How bad it is.
    pub severity: Severity,
    /// What it is, with the numbers and the remedy.
    pub text: String,
}

/// What a [`Warning`] is about; in JSON in small letters with underscores (`held_at_bound`).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum WarningCode {
    /// No more measurements than unknowns.
    TooFewMeasurements,
    /// The data determine none of the unknowns.
    NothingDetermined,
    /// A predicted variance goes to zero, and the likelihood to infinity.
    UnboundedLikelihood,
    /// Time jumps within a record.
    TimeGaps,
    /// An unknown is held at a bound.
    HeldAtBound,
    /// A parameter that was declared positive is not.
    NotPositive,
    /// Unknowns that the data cannot tell apart.
    Unidentified,
    /// A finer step would move an unknown.
    CoarseStep,
    /// Intervals of a search that did not end at a minimum.
    NotAtMinimum,
    /// One of several starts led to the estimate.
    MinimumFoundOnce,
    /// Another minimum explains the data as well.
    RivalMinimum,
    /// The declared start leads to another minimum.
    DeclaredStartElsewhere,
    /// The checkpoint could not be written.
    CheckpointNotWritten,
    /// The errors are autocorrelated.
    ColoredErrors,
}
