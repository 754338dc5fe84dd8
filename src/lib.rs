//! Nonlinear grey-box parameter estimation.
#![cfg_attr(not(feature = "std"), no_std)]

mod dual;
mod model;
mod parameter;
pub mod pmsm;
mod scalar;
mod signals;

#[cfg(feature = "std")]
mod error;
#[cfg(feature = "std")]
mod experiment;
#[cfg(feature = "std")]
mod integrate;

#[doc(hidden)]
pub use {approx, nalgebra, serde};

pub use dual::Dual;
pub use model::{Kind, Model};
pub use parameter::{Parameter, Prior, Transform, fixed, free};
pub use scalar::Scalar;
pub use signals::{Entry, Nothing, Of, Signals};

#[cfg(feature = "std")]
pub use {
    error::{Error, Failure},
    experiment::{Experiment, ExperimentOf, Hold, Initial, Interval, Sample, Time},
    integrate::{Automatic, Discrete, Integrator, Rk4, Stuck},
};
