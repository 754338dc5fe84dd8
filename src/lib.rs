//! Nonlinear grey-box parameter estimation.
#![cfg_attr(not(feature = "std"), no_std)]

mod dual;
#[cfg(feature = "std")]
mod information;
mod model;
mod parameter;
mod scalar;
mod signals;

#[doc(hidden)]
pub use {approx, nalgebra, serde};

pub use dual::Dual;
#[cfg(feature = "std")]
pub use information::{Block, Information, NoSpectrum, RankDeficient, Spectrum, SquareMatrix};
pub use model::{Kind, Model};
pub use parameter::{Parameter, Prior, Transform, fixed, free};
pub use scalar::Scalar;
pub use signals::{Entry, Nothing, Of, Signals};
