//! Nonlinear grey-box parameter estimation.
#![cfg_attr(not(feature = "std"), no_std)]

mod dual;
mod model;
mod parameter;
mod scalar;
mod signals;

#[cfg(feature = "std")]
mod error;
#[cfg(feature = "std")]
mod experiment;
#[cfg(feature = "std")]
mod integrate;
#[cfg(feature = "std")]
mod loss;
#[cfg(feature = "std")]
mod prefilter;
#[cfg(feature = "std")]
mod weighting;

#[cfg(feature = "std")]
pub mod check;

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
    loss::{Cauchy, Expectations, Huber, Loss, SoftL1, Squared, Tukey, expectations},
    prefilter::{Butterworth, FilterState, Linear, Pass, zero_phase},
    weighting::{BySignal, Law, Weighting},
};
