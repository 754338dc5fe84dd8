//! The verdict on the end of a search: which covariance it gets, what is known of each unknown, and the checks.

mod check;
mod checks;
mod conclude;
mod covariances;
mod evidence;
mod intervals;
mod summary;
#[cfg(test)]
mod tests;

pub(crate) use checks::{Aliases, INDISTINGUISHABLE};
pub(crate) use conclude::{conclude, conclude_together};
