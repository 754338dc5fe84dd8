//! Evaluation of the result of a search: noise, covariance, null directions, warnings.

mod aliases;
mod bounds;
mod color;
mod conclude;
mod coupling;
mod covariances;
mod curved;
mod data;
mod data_noise;
mod directions;
mod dropouts;
mod explained;
mod hac;
mod known;
mod largest;
pub(crate) mod noise;
mod outliers;
mod output_sums;
mod predicted;
mod residual_pass;
mod sandwich;
mod shape;
mod shares;
mod starts;
mod step_error;
mod sums;
mod suspects;
mod together;
mod warnings;
mod whiteness;

pub(crate) use aliases::Aliases;
pub(crate) use conclude::{SearchEnd, conclude, conclude_from};
pub(crate) use directions::{in_null_directions, undetermined};
pub(crate) use output_sums::output_fit;
pub(crate) use residual_pass::residuals_together;
pub(crate) use starts::INDISTINGUISHABLE;
