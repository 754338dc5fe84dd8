//! Evaluation of the result of a search: noise, covariance, null directions, warnings.

mod conclude;
mod directions;
mod hac;
pub(crate) mod noise;
mod residual_pass;
mod sandwich;
mod starts;
mod warnings;

pub(crate) use conclude::{SearchEnd, conclude, conclude_from};
pub(crate) use directions::undetermined;
pub(crate) use residual_pass::{output_fit, residuals_together};
