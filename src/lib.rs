//! Nonlinear grey-box parameter estimation.
#![cfg_attr(not(feature = "std"), no_std)]

mod covariance;
mod dual;
mod integrate;
mod interval;
mod lanes;
mod model;
pub mod online;
mod parameter;
pub mod pmsm;
mod scalar;
mod signals;

#[cfg(feature = "std")]
pub mod check;
#[cfg(feature = "std")]
mod error;
#[cfg(feature = "std")]
mod experiment;
#[cfg(feature = "std")]
mod information;
#[cfg(feature = "std")]
mod loss;
#[cfg(feature = "std")]
pub mod optimize;
#[cfg(feature = "std")]
mod outliers;
#[cfg(feature = "std")]
mod predict;
#[cfg(feature = "std")]
mod prefilter;
#[cfg(feature = "std")]
mod regress;
#[cfg(feature = "std")]
mod scaling;
#[cfg(feature = "std")]
mod weighting;

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
    information::{Block, Information, NoSpectrum, RankDeficient, Spectrum, SquareMatrix},
    loss::{Cauchy, Expectations, Huber, Loss, SoftL1, Squared, Tukey, expectations},
    outliers::hampel,
    predict::{FreeRun, Predictor, Walk},
    prefilter::{Butterworth, FilterState, Linear, Pass, zero_phase},
    regress::{Equations, Regression, all_free},
    scaling::{JacobianColumns, Nominal, Scaling, Unscaled},
    weighting::{BySignal, Law, Weighting},
};
