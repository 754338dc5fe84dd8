//! Nonlinear grey-box parameter estimation: from the equations of a physical system and a record of it to its
//! parameters, and to what is known of them.
//!
//! # The problem
//!
//! ```text
//! dx/dt = f(t, x, u; p)      y = g(t, x, u; p) + noise      find p, and say how well it is known
//! ```
//!
//! The states `x` are not all measured, the inputs `u` are, the outputs `y` with noise; `f` and `g` are known from
//! physics, their parameters `p` are not. The estimate is the `p` whose predictions miss the record by least:
//!
//! ```text
//! V(p) = sum over samples and outputs of  weight * rho((y - y_hat(p)) / sigma)
//! ```
//!
//! with `rho(z) = z^2 / 2`, or a loss that limits the influence of outliers. `y_hat` is what the model predicts: simulated from the
//! initial state ([`FreeRun`]), or predicted a few samples ahead of a measured state ([`Horizon`]). See L. Ljung,
//! *System Identification: Theory for the User*, 2nd ed., 1999, chapters 7, 9 and 10.
//!
//! # The result
//!
//! ```
//! use greybox::{Fit, Model, Scalar, Time, free, signals, simulate};
//!
//! signals! {
//!     pub struct Level { h: "m" }
//!     pub struct Inflow { q: "m^3/s" }
//!     pub struct Tank { area: "m^2", outlet: "m^2" }
//! }
//!
//! struct Draining;
//!
//! impl Model for Draining {
//!     type State = Level;
//!     type Input = Inflow;
//!     type Output = Level;
//!     type Parameters = Tank;
//!
//!     fn derivative<S: Scalar>(&self, _t: S, x: &Level<S>, u: &Inflow<S>, p: &Tank<S>) -> Level<S> {
//!         Level { h: (u.q - p.outlet * (x.h * 19.62).sqrt()) / p.area }
//!     }
//!     fn output<S: Scalar>(&self, _t: S, x: &Level<S>, _u: &Inflow<S>, _p: &Tank<S>) -> Level<S> {
//!         *x
//!     }
//! }
//!
//! # fn main() -> Result<(), greybox::Error> {
//! // A record: here simulated, from a known tank, with a millimeter of noise.
//! let time = Time::Uniform { start: 0.0, step: 1.0 };
//! let inflow: Vec<Inflow> = (0..300).map(|k| Inflow { q: if k < 150 { 1e-3 } else { 3e-3 } }).collect();
//! let run = simulate(&Draining, &Tank { area: 0.5, outlet: 4e-4 }, &Level { h: 1.0 }, time, &inflow)?;
//! let record = run.with_noise(Level { h: 1e-3 }, 1).experiment(&Draining)?;
//!
//! // The fit, from a start that is far off.
//! let estimate =
//!     Fit::new(&Draining, &record).parameters(Tank { area: free(1.0), outlet: free(1e-4).within(0.0, 1.0) }).run()?;
//! println!("{estimate}");
//! assert!(estimate.outcome.converged());
//! assert!((estimate.parameters.area / 0.5 - 1.0).abs() < 0.01);
//! # Ok(())
//! # }
//! ```
//!
//! The report leads with a verdict. Each quantity is *known* (with an interval), *fixed*, *held* at a bound, or
//! *unidentified* ([`Knowledge`]): nothing is reported as known that the data do not say, and parameters that the
//! record cannot tell apart are named with the direction in which they may move together. A search that did not
//! converge is an [`Outcome`](optimize::Outcome) with advice, not an error; an [`Error`] names the thing, the number
//! and the remedy.
//!
//! # Where to find what
//!
//! The [`guide`] has short chapters, from a first fit to writing an integrator.
//!
//! | to | see |
//! |---|---|
//! | write a model | [`Model`], [`signals!`], [`Scalar`], [`Table`]; [`Numeric`] for functions over `f64`; [`models`] and [`pmsm`] for those that ship |
//! | read a record | [`Experiment`], [`DataFile`], [`Time`], [`Hold`], [`units`] |
//! | simulate | [`simulate()`], [`Simulator`] |
//! | declare parameters | [`free`], [`fixed`], [`Parameter`], [`Prior`] |
//! | fit one record or several together | [`Fit`] |
//! | fit many records, each by itself | [`Fleet`] |
//! | fit equations that are made at run time or read from a file | [`equations`], [`graph`], [`Fit`] |
//! | write a model as a text file, or read one | [`text`] |
//! | fit from a shell, without Rust | the command `greybox`: [`guide::chapter_17_command`] |
//! | choose an integrator | [`Automatic`], [`Rk4`], [`Rk45`], [`Esdirk`], [`Discrete`] |
//! | choose what is predicted | [`FreeRun`], [`Horizon`], [`Kalman`], [`SecondOrder`], [`InitialCovariance`], [`predict`] |
//! | weigh or filter errors, limit outliers | [`weighting`], [`loss`], [`Butterworth`] |
//! | choose a search | [`optimize`]; argmin's solvers by [`Problem::objective`] |
//! | read the result | [`Estimate`], [`Severity`], [`Knowledge`], [`Warning`], [`WarningCode`], [`Summary`], [`estimate`] |
//! | judge it | [`diagnose`], [`Report`] |
//! | test a model | [`check`] |
//! | estimate online | [`online`] |
//! | fit what is linear in its parameters | [`regress`] |
//!
//! How the library is built is described in `ARCHITECTURE.md`, beside its `README.md`.
//!
//! # Features
//!
//! `std`, `csv`, `npy`, `jit` (machine code for models that can be traced), `parallel` and `text` are on by default. Without `std`
//! there are numbers, signals, models, integrators and [`online`] observers, without `alloc` too.
#![cfg_attr(not(feature = "std"), no_std)]

// Tests beside the code name the public list as users do.
#[cfg(test)]
extern crate self as greybox;
#[cfg(test)]
mod tests;

mod dual;
pub mod integrate;
mod interval;
mod lanes;
pub mod layout;
mod model;
pub mod models;
pub mod online;
mod parameter;
pub mod pmsm;
mod real;
pub mod scalar;
mod signals;
pub mod units;

#[cfg(feature = "std")]
mod aligned;
#[cfg(feature = "std")]
mod by_name;
#[cfg(feature = "std")]
pub mod check;
#[cfg(feature = "std")]
mod covariance;
#[cfg(feature = "std")]
pub mod diagnose;
#[cfg(feature = "std")]
mod engine;
#[cfg(feature = "std")]
pub mod equations;
#[cfg(feature = "std")]
mod error;
#[cfg(feature = "std")]
pub mod estimate;
#[cfg(feature = "std")]
mod experiment;
#[cfg(feature = "std")]
mod fit;
#[cfg(feature = "std")]
mod format;
#[cfg(feature = "std")]
mod functions;
#[cfg(feature = "std")]
mod fused;
#[cfg(feature = "std")]
pub mod graph;
#[cfg(feature = "csv")]
pub mod guide;
#[cfg(feature = "std")]
mod hash;
#[cfg(feature = "std")]
pub mod information;
#[cfg(feature = "std")]
mod judge;
#[cfg(feature = "std")]
pub mod loss;
#[cfg(feature = "std")]
mod moments;
#[cfg(feature = "std")]
mod numeral;
#[cfg(feature = "std")]
mod numeric;
#[cfg(feature = "std")]
pub mod optimize;
#[cfg(feature = "std")]
mod outliers;
#[cfg(feature = "std")]
pub mod predict;
#[cfg(feature = "std")]
mod prefilter;
#[cfg(feature = "std")]
pub mod problem;
#[cfg(feature = "std")]
mod random;
#[cfg(feature = "std")]
pub mod record;
#[cfg(feature = "std")]
mod recurrence;
#[cfg(feature = "std")]
pub mod regress;
#[cfg(feature = "std")]
pub mod report;
#[cfg(feature = "std")]
mod residuals;
#[cfg(feature = "std")]
mod rows;
#[cfg(feature = "std")]
mod scaling;
#[cfg(feature = "std")]
mod section;
#[cfg(feature = "std")]
mod severity;
#[cfg(feature = "std")]
mod simulate;
#[cfg(feature = "std")]
pub mod sweep;
#[cfg(feature = "text")]
pub mod text;
#[cfg(feature = "std")]
mod transition;
#[cfg(feature = "std")]
#[cfg_attr(not(feature = "text"), allow(dead_code, reason = "columns of files and their errors need a part of it"))]
mod unit;
#[cfg(feature = "std")]
pub mod weighting;
#[cfg(feature = "std")]
mod whiteness;
#[cfg(feature = "std")]
mod wide;

#[doc(hidden)]
pub use {approx, nalgebra, serde};

pub use dual::Dual;
pub use integrate::{Automatic, Discrete, Esdirk, Rk4, Rk45};
pub use interval::{Hold, Interval};
pub use layout::Kind;
pub use model::Model;
pub use parameter::{Parameter, Prior, Transform, fixed, free};
pub use scalar::Scalar;
pub use signals::{Entry, Nothing, Of, Signals};

#[cfg(feature = "csv")]
pub use record::{DataFile, DateOrder, FileFormat, Reading, TimeSource};
#[cfg(feature = "std")]
pub use {
    error::{Error, Failure},
    estimate::{Estimate, Knowledge, Summary, Warning, WarningCode},
    experiment::{Experiment, ExperimentOf, Sample},
    fit::{Fit, Fittable, Fleet, Records},
    loss::{Huber, Loss},
    numeral::{Moment, TimeUnit},
    numeric::Numeric,
    outliers::hampel,
    predict::{FreeRun, Horizon, InitialCovariance, Kalman, SecondOrder},
    prefilter::Butterworth,
    problem::{Problem, Search},
    record::{Initial, Time},
    report::Report,
    scalar::Table,
    severity::Severity,
    simulate::{Simulation, Simulator, simulate},
    weighting::Weighting,
};

/// The README's code, compiled and run.
#[cfg(all(doctest, feature = "csv"))]
#[doc = include_str!("../README.md")]
pub struct Readme;
