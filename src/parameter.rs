//! [`Parameter`]: what is known of a quantity before the fit.

use crate::scalar::Scalar;
use serde::{Deserialize, Serialize};

/// A free parameter that starts at `start`.
pub fn free(start: f64) -> Parameter {
    Parameter { start, free: true, ..fixed(start) }
}

/// A parameter that keeps `value`.
pub fn fixed(value: f64) -> Parameter {
    Parameter {
        start: value,
        free: false,
        lower: f64::NEG_INFINITY,
        upper: f64::INFINITY,
        prior: None,
        transform: Transform::Identity,
        per_experiment: false,
        positive: false,
    }
}

/// Guess, bounds, prior and transform of one parameter or initial state, in its own unit.
///
/// ```
/// use greybox::{fixed, free};
/// let rs = free(1.0).within(0.01, 10.0); // estimated, in bounds
/// let ls = free(2e-3).log(); // positive: estimated as ln(ls)
/// let j = free(1e-3).positive(); // a value that is not positive would show that model or record are wrong
/// let ke = free(0.7).prior(0.72, 0.05); // known beforehand to 0.72 +- 0.05
/// let np = fixed(4.0);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameter {
    /// Where the search starts; the value itself, if fixed.
    #[serde(with = "crate::real")]
    pub start: f64,
    /// Whether the fit may move it.
    pub free: bool,
    /// Lower bound; minus infinity stands for none.
    #[serde(with = "crate::real")]
    pub lower: f64,
    /// Upper bound; infinity stands for none.
    #[serde(with = "crate::real")]
    pub upper: f64,
    /// Prior knowledge, which counts as one more measurement.
    pub prior: Option<Prior>,
    /// The coordinate that the optimizer works in.
    pub transform: Transform,
    /// Whether each experiment has a value of its own (a winding cold and warm).
    pub per_experiment: bool,
    /// Whether only a positive value has a meaning; an estimate that is not positive is then not usable.
    #[serde(default)]
    pub positive: bool,
}

/// Knowledge from elsewhere: a Gaussian measurement of the parameter in its own unit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Prior {
    /// Expected value.
    #[serde(with = "crate::real")]
    pub mean: f64,
    /// Standard deviation.
    #[serde(with = "crate::real")]
    pub std: f64,
}

/// The coordinate that the optimizer works in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Transform {
    /// The value itself.
    Identity,
    /// Its natural logarithm: the value stays positive, and a factor is a step.
    Log,
}

impl Parameter {
    /// Keeps the value within `lower..=upper`.
    pub fn within(self, lower: f64, upper: f64) -> Self {
        Parameter { lower, upper, ..self }
    }

    /// Adds the knowledge `mean +- std` from elsewhere.
    pub fn prior(self, mean: f64, std: f64) -> Self {
        Parameter { prior: Some(Prior { mean, std }), ..self }
    }

    /// Estimates the logarithm: for positive quantities known to a factor rather than to a difference.
    pub fn log(self) -> Self {
        Parameter { transform: Transform::Log, ..self }
    }

    /// Declares that only a positive value has a meaning (a resistance, a mass, a friction), from physics. The search is not
    /// bounded: data that lead it to zero or below contradict the model, and the estimate is then not usable. Of minima of the same cost, such as
    /// mirror images, one is taken where it is positive. A level of noise of a filter, on whose sign no
    /// variance depends, is estimated by its [logarithm](Self::log), unless it has a lower bound other than zero: where zero is best, it is held there.
    pub fn positive(self) -> Self {
        Parameter { positive: true, ..self }
    }

    /// Gives each experiment a value of its own: of several, since for a fit of one it has no effect and is refused. Each record of a
    /// [`Fleet`](crate::Fleet) has its own values anyway, with or without this.
    pub fn per_experiment(self) -> Self {
        Parameter { per_experiment: true, ..self }
    }
}

impl Transform {
    /// The optimizer's coordinate of a value.
    pub fn to_coordinate(self, value: f64) -> f64 {
        match self {
            Transform::Identity => value,
            Transform::Log => Scalar::ln(value),
        }
    }

    /// The value at a coordinate.
    pub fn to_value(self, coordinate: f64) -> f64 {
        match self {
            Transform::Identity => coordinate,
            Transform::Log => Scalar::exp(coordinate),
        }
    }

    /// d value / d coordinate where the value is `value`.
    pub fn slope(self, value: f64) -> f64 {
        match self {
            Transform::Identity => 1.0,
            Transform::Log => value,
        }
    }
}
