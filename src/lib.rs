//! Nonlinear grey-box parameter estimation.
#![cfg_attr(not(feature = "std"), no_std)]

mod covariance;
mod dual;
mod integrate;
mod interval;
mod model;
pub mod online;
mod parameter;
pub mod pmsm;
mod scalar;
mod signals;

#[cfg(feature = "std")]
mod error;
#[cfg(feature = "std")]
mod experiment;

#[doc(hidden)]
pub use {approx, nalgebra, serde};

pub use covariance::{Covariance, Gain};
pub use dual::Dual;
pub use integrate::{Automatic, Discrete, Integrator, Rk4, Stuck};
pub use interval::{Hold, Interval};
pub use model::{Kind, Model};
pub use parameter::{Parameter, Prior, Transform, fixed, free};
pub use scalar::Scalar;
pub use signals::{Entry, Nothing, Of, Signals};

#[cfg(feature = "std")]
pub use {
    error::{Error, Failure},
    experiment::{Experiment, ExperimentOf, Initial, Sample, Time},
};
