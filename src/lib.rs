//! Nonlinear grey-box parameter estimation.
#![cfg_attr(not(feature = "std"), no_std)]

mod dual;
mod model;
mod parameter;
pub mod pmsm;
mod scalar;
mod signals;

#[doc(hidden)]
pub use {approx, nalgebra, serde};

pub use dual::Dual;
pub use model::{Kind, Model};
pub use parameter::{Parameter, Prior, Transform, fixed, free};
pub use scalar::Scalar;
pub use signals::{Entry, Nothing, Of, Signals};
