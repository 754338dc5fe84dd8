//! Evaluation of the result of a search: noise, covariance, null directions, warnings.

mod bounds;
mod check;
mod checks;
mod conclude;
mod covariances;
mod directions;
mod evidence;
mod intervals;
mod leverage;
mod point;
mod summary;
#[cfg(test)]
mod tests;

pub(crate) use checks::{Aliases, INDISTINGUISHABLE};
pub(crate) use conclude::{conclude, conclude_from};
pub(crate) use directions::{in_null_directions, undetermined};
pub(crate) use evidence::output_sums::output_fit;
pub(crate) use evidence::residual_pass::residuals_together;
pub(crate) use point::SearchEnd;
