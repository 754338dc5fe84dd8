//! How well the data determine the unknowns at the end of a search: null directions, what is known at bounds, and covariances of several
//! kinds. Nothing here decides which of them an estimate gets.

mod bounds;
pub(crate) mod clusters;
pub(crate) mod directions;
pub(crate) mod hac;
pub(crate) mod leverage;
pub(crate) mod point;
pub(crate) mod predicted;
pub(crate) mod sandwich;
pub(crate) mod shares;
pub(crate) mod sizes;

pub(crate) use directions::{in_null_directions, undetermined};
pub(crate) use point::SearchEnd;
