//! The permanent magnet synchronous motor (PMSM) and its drive.
//!
//! Conventions, the same everywhere in this module:
//!
//! | quantity | convention |
//! |---|---|
//! | speed `w`, angle `theta` | mechanical, rad/s and rad; electrical ones are `np` times as large and called `we`, `theta_e` |
//! | dq frame | d axis on the magnet flux, q 90 electrical degrees ahead |
//! | dq amplitude | currents and voltages are phase *peak* values |
//! | `rs`, `ls`, `ld`, `lq` | phase resistance (ohm), dq inductances (H) |
//! | `ke` | line-to-line *rms* back-EMF per mechanical speed (V s/rad): the phase-peak EMF is `sqrt(2/3) ke w` |
//! | `kt` | torque per ampere of peak `iq`: `sqrt(3/2) ke` (N m/A) |
//!
//! Where data come in another convention, [`units`] and [`frames`] hold a named conversion for each; a bare factor in
//! user code is the most common bug in this field.
//!
//! | file | holds | builds on |
//! |---|---|---|
//! | [`frames`] | Park and Clarke transforms | |
//! | [`units`] | line-line and phase, rms and peak, terminals, Ke, Kt, flux, rpm, cable | |
//! | [`motor`] | constants from geometry | units |
//! | [`temperature`] | winding and magnet laws, temperatures read back from estimates | |
//! | [`Surface`], [`Salient`], [`Saturated`], [`Shaft`] | the equations, each a [`Model`](crate::Model) | frames |
//! | `FluxMapped` | a motor with a measured flux map (with `std`) | look-up tables |
//! | [`ExactSurface`], [`ExactSalient`] | the currents' equation in exact steps | |
//! | [`InverterFed`], [`Compensated`], [`Cabled`], [`Misaligned`], [`EmfHarmonic`], [`FluxLinkage`] | what stands around a motor, each around any [`MotorModel`] | |
//! | [`MotorLaw`] and its parts | adaptation laws for the motor's [`Mras`](crate::online::Mras) | |
//! | [`Injection`] | d current that makes the resistance visible | |
//! | [`control`], [`inverter`], [`sensors`] | the parts of a drive | frames |
//! | [`robot`] | the axes of the reference robot | temperature |
//! | [`Plant`] | a motor and its load as they really are | inverter, robot |
//! | `program`, `drive` | motion programs; the whole drive in simulation, and its log (with `std`) | all of these |
//! | `adaptive` | a drive that uses its observer (with `std`) | control, `Machine` |
//! | `offline` | least squares on a record (with `std`) | drive |
//! | [`Machine`] | currents, speed and angle together | any `MotorModel`, `Shaft` |
//!
//! Source of the formulas: M. Tenerz, *Parameter Estimation in a Permanent Magnet Synchronous Motor*,
//! LiTH-ISY-EX--11/4495--SE, Linkoping 2011, called "the thesis"; corrected where it errs, which is said in place.

#[cfg(feature = "std")]
pub mod adaptive;
pub mod control;
#[cfg(feature = "std")]
pub mod drive;
pub mod frames;
pub mod inverter;
pub mod motor;
#[cfg(feature = "std")]
pub mod offline;
#[cfg(feature = "std")]
pub mod program;
pub mod robot;
pub mod sensors;
pub mod temperature;
pub mod units;

mod adaptation;
mod cabled;
mod compensated;
mod emf_harmonic;
mod exact;
mod flux_linkage;
#[cfg(feature = "std")]
mod flux_mapped;
mod injection;
mod inverter_fed;
#[cfg(feature = "std")]
mod log;
mod machine;
mod misaligned;
mod motor_model;
mod plant;
mod salient;
mod saturated;
mod shaft;
mod surface;
#[cfg(feature = "std")]
mod switching;

pub use adaptation::{
    Adaptation, AdaptationInput, DeadZone, DirectCurrent, KeLyapunov, MotorLaw, Normalized, NotAdapted, RsDirect,
    RsLyapunov,
};
pub use cabled::Cabled;
pub use compensated::{Compensated, CompensatedDrive, CompensatedWinding};
pub use emf_harmonic::EmfHarmonic;
pub use exact::{ExactSalient, ExactStep, ExactSurface, HeldIn};
pub use flux_linkage::FluxLinkage;
#[cfg(feature = "std")]
pub use flux_mapped::{FluxMapped, MappedWinding};
pub use injection::Injection;
pub use inverter_fed::{AngledDrive, InverterFed, InverterFedWinding};
pub use machine::{Machine, MachineParameters, MachineState, VoltageAndLoad};
pub use misaligned::Misaligned;
pub use motor_model::MotorModel;
pub use plant::Plant;
pub use salient::{Salient, SalientWinding};
pub use saturated::{Saturated, SaturatedWinding};
use shaft::COULOMB_WIDTH;
pub use shaft::{Load, Mechanics, Shaft, ShaftMotion, Torque};
pub use surface::Surface;
#[cfg(feature = "std")]
use switching::SwitchingInverter;

use crate::scalar::Scalar;
use serde::{Deserialize, Serialize};

/// `sqrt(2/3)`: phase peak from line-to-line rms.
pub const SQRT_2_3: f64 = 0.816_496_580_927_726;

/// `sqrt(3/2)`: line-to-line rms from phase peak, and `kt / ke`.
const SQRT_3_2: f64 = 1.224_744_871_391_589;

crate::signals! {
    /// Stator currents in the rotor frame, phase peak.
    pub struct Currents {
        /// Current along the magnet flux.
        id: "A",
        /// Current that makes torque.
        iq: "A",
    }
    /// Stator voltages in the rotor frame, phase peak, and the speed of the rotor.
    pub struct Drive {
        /// Voltage along the magnet flux.
        ud: "V",
        /// Voltage 90 electrical degrees ahead of it.
        uq: "V",
        /// Mechanical speed.
        w: "rad/s",
    }
    /// Parameters of a motor with surface magnets.
    pub struct Winding {
        /// Phase resistance; must be positive.
        rs: "ohm",
        /// Synchronous inductance; must be positive.
        ls: "H",
        /// Line-to-line rms back-EMF per mechanical speed.
        ke: "V s/rad",
    }
}

/// Number of pole pairs `np`, at least one: what turns mechanical into electrical.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "u32", into = "u32")]
pub struct PolePairs(u32);

impl PolePairs {
    /// `count` pole pairs.
    ///
    /// # Errors
    /// Zero.
    pub const fn new(count: u32) -> Result<Self, MotorError> {
        if count == 0 { Err(MotorError::NoPolePairs) } else { Ok(PolePairs(count)) }
    }

    /// The number.
    #[inline(always)]
    pub const fn get(self) -> f64 {
        self.0 as f64
    }

    /// Electrical angle (rad) or speed (rad/s) from the mechanical one.
    #[inline(always)]
    pub fn electrical<S: Scalar>(self, mechanical: S) -> S {
        mechanical * self.get()
    }

    /// Mechanical angle (rad) or speed (rad/s) from the electrical one.
    #[inline(always)]
    pub fn mechanical<S: Scalar>(self, electrical: S) -> S {
        electrical / self.get()
    }
}

impl TryFrom<u32> for PolePairs {
    type Error = MotorError;
    fn try_from(count: u32) -> Result<Self, MotorError> {
        PolePairs::new(count)
    }
}

impl From<PolePairs> for u32 {
    fn from(pole_pairs: PolePairs) -> u32 {
        pole_pairs.0
    }
}

/// Why a motor, a drive or a temperature was refused.
#[derive(Clone, Copy, PartialEq, Serialize, thiserror::Error)]
pub enum MotorError {
    /// A motor needs at least one pole pair.
    #[error("a motor has at least one pole pair; got 0 (count magnet poles, divide by 2)")]
    NoPolePairs,
    /// A quantity lies outside the range in which it means something.
    #[error("{quantity} is {value} {unit}; it must {must}")]
    OutOfRange {
        /// The quantity, in words.
        quantity: &'static str,
        /// Its value.
        value: f64,
        /// Its unit.
        unit: &'static str,
        /// The requirement, in words.
        must: &'static str,
    },
}

/// The same sentence: it is what a `main` that returns the error shows.
impl core::fmt::Debug for MotorError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        core::fmt::Display::fmt(self, f)
    }
}

impl MotorError {
    /// `value` if it is positive and finite.
    pub(crate) fn positive(quantity: &'static str, value: f64, unit: &'static str) -> Result<f64, MotorError> {
        if value > 0.0 && value.is_finite() {
            Ok(value)
        } else {
            Err(MotorError::OutOfRange { quantity, value, unit, must: "be positive and finite" })
        }
    }

    /// `value` if it is finite.
    pub(crate) fn finite(quantity: &'static str, value: f64, unit: &'static str) -> Result<f64, MotorError> {
        if value.is_finite() {
            Ok(value)
        } else {
            Err(MotorError::OutOfRange { quantity, value, unit, must: "be finite" })
        }
    }
}
