//! [`Key`]: what a program depends on.

use crate::engine::Sampling;
use crate::record::Holds;
use crate::sweep::Seed;

/// Properties that a program depends on besides the recurrence.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Key {
    pub holds: Holds,
    pub sampling: Sampling,
    pub seeds: Vec<Seed>,
    pub purpose: Purpose,
    /// Whether records begin at rest.
    pub at_rest: bool,
}

/// The functions that a program computes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Purpose {
    /// Rows of many trajectories.
    Rows,
    /// The carry of one, without rows.
    Carry,
}
