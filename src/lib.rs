//! Nonlinear grey-box parameter estimation.
#![cfg_attr(not(feature = "std"), no_std)]

mod covariance;
mod dual;
mod lanes;
#[cfg(feature = "std")]
mod information;
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

pub use covariance::{Covariance, Gain};
pub use dual::Dual;
#[cfg(feature = "std")]
pub use information::{Block, Information, NoSpectrum, RankDeficient, Spectrum, SquareMatrix};
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
    experiment::{Experiment, ExperimentOf, Hold, Initial, Interval, Sample, Time},
    integrate::{Automatic, Discrete, Integrator, Rk4, Stuck},
    loss::{Cauchy, Expectations, Huber, Loss, SoftL1, Squared, Tukey, expectations},
    prefilter::{Butterworth, FilterState, Linear, Pass, zero_phase},
    weighting::{BySignal, Law, Weighting},
};
#[cfg(feature = "std")]
mod predict;
