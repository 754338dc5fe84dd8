//! The questions that the verdict asks of an estimate.

mod aliases;
mod color;
mod conditions;
mod correlated_outputs;
mod curved;
mod data;
mod data_noise;
mod dropouts;
mod explained;
mod feedback;
mod few;
mod growing_errors;
mod inputs_before;
mod known;
mod not_examined;
mod outliers;
mod parts;
mod rise;
mod sensors;
mod shape;
mod starts;
pub(crate) mod step;
mod step_accumulation;
mod uneven_errors;
mod within_loss;

pub(crate) use aliases::Aliases;
pub(crate) use starts::INDISTINGUISHABLE;
