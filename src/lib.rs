//! Nonlinear grey-box parameter estimation.
#![cfg_attr(not(feature = "std"), no_std)]

mod covariance;
#[cfg(feature = "std")]
mod dispatch;
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
pub mod units;

#[cfg(feature = "std")]
mod by_name;
#[cfg(feature = "std")]
pub mod check;
#[cfg(feature = "std")]
pub mod diagnose;
#[cfg(feature = "std")]
mod error;
#[cfg(feature = "std")]
mod estimate;
#[cfg(feature = "std")]
mod experiment;
#[cfg(feature = "std")]
mod fit;
#[cfg(feature = "std")]
mod information;
#[cfg(feature = "std")]
mod loss;
#[cfg(feature = "std")]
pub mod numeric;
#[cfg(feature = "std")]
pub mod optimize;
#[cfg(feature = "std")]
mod predict;
#[cfg(feature = "std")]
mod prefilter;
#[cfg(feature = "std")]
mod random;
#[cfg(feature = "std")]
pub mod regress;
#[cfg(feature = "std")]
mod scaling;
#[cfg(feature = "std")]
mod weighting;
#[cfg(feature = "std")]
mod whiteness;

#[doc(hidden)]
pub use {approx, nalgebra, serde};

pub use covariance::{Covariance, Gain};
pub use dual::Dual;
pub use integrate::{Automatic, Discrete, Esdirk, Integrator, Rk4, Rk45, Stuck};
pub use interval::{Hold, Interval};
pub use model::{Kind, Model};
pub use parameter::{Parameter, Prior, Transform, fixed, free};
pub use scalar::Scalar;
pub use signals::{Entry, Nothing, Of, Signals};

#[cfg(feature = "csv")]
pub use experiment::CsvFile;
#[cfg(feature = "std")]
pub use {
    error::{Error, Failure},
    estimate::{Direction, Estimate, Knowledge, Method, Prediction, Quality, Share, Unknown, Warning},
    experiment::{Experiment, ExperimentOf, Gap, Initial, Sample, Time},
    fit::{Fit, FitProblem, Objective, Records, Search},
    information::{Block, Information, NoSpectrum, RankDeficient, Spectrum, SquareMatrix},
    loss::{Cauchy, Expectations, Huber, Loss, SoftL1, Squared, Tukey, expectations},
    numeric::Numeric,
    predict::{FreeRun, Horizon, Predictor, Walk},
    prefilter::{Butterworth, FilterState, Linear, Pass, zero_phase},
    regress::{Assumption, LinearEstimate, Regression, RegressionError},
    scaling::{JacobianColumns, Nominal, Scaling, Unscaled},
    weighting::{BySignal, Law, Weighting},
};
