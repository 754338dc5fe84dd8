//! [`Weighting`]: how much each sample matters, by what the user knows of the machine.
//!
//! A weight multiplies the cost of its sample; it is not an inverse variance (that is what the noise levels are for), so
//! only its course over the record matters, not its scale.

use crate::error::Error;
use crate::experiment::Sample;
use crate::model::Model;
use crate::signals::Signals;
use serde::{Deserialize, Serialize};

/// The weight of a sample in the cost. Any function of the sample is one: `|s: &Sample<Pmsm>| s.u.w.abs()`.
pub trait Weighting<M: Model>: Send + Sync {
    /// The weight: finite, zero or more.
    ///
    /// It should not depend on the measured outputs, whose noise would then bias the estimate.
    fn weight(&self, sample: &Sample<M>) -> f64;

    /// Whether it fits the model.
    ///
    /// # Errors
    /// A signal that the model does not have, a constant that makes no sense.
    fn check(&self) -> Result<(), Error> {
        Ok(())
    }

    /// Name and constants, for reports.
    fn describe(&self) -> String {
        "a function of the sample".to_owned()
    }
}

impl<M: Model, F: Fn(&Sample<M>) -> f64 + Send + Sync> Weighting<M> for F {
    fn weight(&self, sample: &Sample<M>) -> f64 {
        self(sample)
    }
}

/// A weight by one input, such as the speed (M. Tenerz, LiTH-ISY-EX--11/4495--SE, 2011, eq. 5.9).
///
/// ```
/// use greybox::weighting::{BySignal, WeightFunction};
/// let weighting = BySignal::new("w", WeightFunction::Square { scale: 100.0 }); // (w / 100)^2
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BySignal {
    /// Name of the input.
    pub signal: String,
    /// The weight as a function of the signal.
    pub function: WeightFunction,
}

/// The weight as a function of an input `w`, in its unit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum WeightFunction {
    /// `|w|`.
    Absolute,
    /// `(w / scale)^2`.
    Square {
        /// Where the weight is one.
        scale: f64,
    },
    /// One where `|w| >= threshold`, else zero.
    Above {
        /// The smallest `|w|` that counts.
        threshold: f64,
    },
}

impl BySignal {
    /// The weight `function` of the input named `signal`.
    pub fn new(signal: impl Into<String>, function: WeightFunction) -> Self {
        BySignal { signal: signal.into(), function }
    }
}

impl<M: Model> Weighting<M> for BySignal {
    /// Not a number, where the model has no such input.
    fn weight(&self, sample: &Sample<M>) -> f64 {
        let inputs = M::Input::into_array(sample.u);
        let w = M::Input::position(&self.signal).map_or(f64::NAN, |i| inputs.as_ref()[i]);
        match self.function {
            WeightFunction::Absolute => w.abs(),
            WeightFunction::Square { scale } => (w / scale).powi(2),
            WeightFunction::Above { .. } if w.is_nan() => w,
            WeightFunction::Above { threshold } => f64::from(u8::from(w.abs() >= threshold)),
        }
    }

    fn check(&self) -> Result<(), Error> {
        if M::Input::position(&self.signal).is_none() {
            let available = M::Input::NAMES.iter().map(|&name| name.to_owned()).collect();
            return Err(Error::UnknownSignal { signal: self.signal.clone(), available });
        }
        let (what, value) = match self.function {
            WeightFunction::Absolute => return Ok(()),
            WeightFunction::Square { scale } => ("scale", scale),
            WeightFunction::Above { threshold } => ("threshold", threshold),
        };
        if value > 0.0 && value.is_finite() {
            return Ok(());
        }
        Err(Error::NotPositive { what: format!("the {what} of the weighting by `{}`", self.signal), value })
    }

    fn describe(&self) -> String {
        let w = &self.signal;
        match self.function {
            WeightFunction::Absolute => format!("|{w}|"),
            WeightFunction::Square { scale } => format!("({w}/{scale})^2"),
            WeightFunction::Above { threshold } => format!("1 where |{w}| >= {threshold}, else 0"),
        }
    }
}
