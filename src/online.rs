//! Online observers: estimates that move with every sample, for a controller's loop. They allocate nothing, need no
//! operating system, and never hand out a number that is not one.
//!
//! | observer | for |
//! |---|---|
//! | [`Mras`] | measured states, a few parameters with an adaptation law each: the cheapest; no interval |
//! | [`Ekf`] | any [`Model`]: states and parameters together, with their covariance |
//! | [`Rls`] | outputs linear in the parameters |
//!
//! Every update returns its innovation and an [`UpdateOutcome`]. An observer that diverges stops: it keeps the last estimates
//! that made sense, and says [`UpdateOutcome::Diverged`] until it is started anew.

mod ekf;
mod mras;
mod rls;
mod ud_factors;

pub use ekf::{Ekf, EkfStart};
pub use mras::{AdaptationLaw, Gradient, Moment, Mras, MrasStart, Order, Rate, Stepping};
pub use rls::{Forgetting, Rls};
use ud_factors::UdFactors;

use crate::model::Model;
use crate::parameter::{Parameter, Transform};
use crate::scalar::Scalar;
use crate::signals::{Of, Signals};

/// Result of one update.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Update<Y> {
    /// Measured less expected outputs, before the correction; zero for an output that was not used.
    pub innovation: Y,
    /// State of the estimates.
    pub outcome: UpdateOutcome,
}

/// State of the estimates after one update.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum UpdateOutcome {
    /// The first sample: there was no expectation to compare with.
    #[error("started")]
    Started,
    /// The estimates were corrected.
    #[error("corrected")]
    Corrected,
    /// Corrected, but for a parameter that this sample does not determine reliably.
    #[error("`{parameter}` held: {quantity} is {}, and tells nothing below {limit}", Short(*value))]
    Held {
        /// The parameter; the first, where there are several.
        parameter: &'static str,
        /// The quantity that is too small, in words and with its unit.
        quantity: &'static str,
        /// Its value.
        value: f64,
        /// The limit it stays under.
        limit: f64,
    },
    /// A measurement or input was not a finite number: it was not used.
    #[error("`{signal}` is not a number: not used")]
    Missing {
        /// The signal; the first, where there are several.
        signal: &'static str,
    },
    /// Time did not advance by one sample: what was known of the state is void, the parameters stay.
    #[error("time went on by {} s where {expected} s were expected: the state starts anew", Short(*found))]
    Restarted {
        /// Sample time (s).
        expected: f64,
        /// Time since the sample before (s).
        found: f64,
    },
    /// The observer has stopped; the estimates are those before.
    #[error("diverged: {0}")]
    Diverged(Divergence),
}

/// Why an observer stopped.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Divergence {
    /// An estimate left the bounds of its [`Parameter`].
    #[error(
        "`{parameter}` went to {}, outside {lower} to {upper}; check the sign and size of its gain, and that it is excited",
        Short(*value)
    )]
    Bounds {
        /// The parameter.
        parameter: &'static str,
        /// Where it went.
        value: f64,
        /// Its lower bound.
        lower: f64,
        /// Its upper bound.
        upper: f64,
    },
    /// An innovation stayed beyond its limit.
    #[error(
        "the innovation of `{signal}` is {}, beyond {} for {samples} samples; the model does not follow the plant",
        Short(*value),
        Short(*limit)
    )]
    Innovation {
        /// The output.
        signal: &'static str,
        /// Its innovation, in its unit.
        value: f64,
        /// The limit, in its unit.
        limit: f64,
        /// For how many samples in a row some output was beyond its limit.
        samples: u32,
    },
    /// The integrator could not cross the time since the sample before.
    #[error("the model's step cannot be resolved; bound the parameters to where its equations make sense")]
    Stuck,
    /// A prediction or an estimate overflowed.
    #[error("`{signal}` is no longer a finite number")]
    NotFinite {
        /// The state, output or parameter.
        signal: &'static str,
    },
}

/// An observer that cannot be made as asked.
#[derive(Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ObserverError {
    /// A quantity that must be positive and finite.
    #[error("{what} of `{signal}` is {value}; it must be positive and finite")]
    NotPositive {
        /// The quantity.
        what: &'static str,
        /// The signal or parameter that it belongs to.
        signal: &'static str,
        /// The value given.
        value: f64,
    },
    /// A start that is not a number or not within its bounds (above zero for a logarithm).
    #[error("`{parameter}` starts at {start}, which is not between its bounds {lower} and {upper}")]
    Start {
        /// The parameter or state.
        parameter: &'static str,
        /// Its start.
        start: f64,
        /// Its lower bound.
        lower: f64,
        /// Its upper bound.
        upper: f64,
    },
    /// A model with a dead time, which observers do not have.
    #[error(
        "input `{input}` is late by {delay} s, and an observer has no dead time: take a model without it, and give the input of as much earlier"
    )]
    Late {
        /// The input.
        input: &'static str,
        /// Its dead time at the start (s).
        delay: f64,
    },
    /// A free quantity without a prior, where an observer needs to know how far off the start may be.
    #[error("`{parameter}` is free but has no prior; say how far off its start may be: free(start).prior(start, std)")]
    NoPrior {
        /// The parameter or state.
        parameter: &'static str,
    },
    /// A logarithm in an observer that does not know them.
    #[error(
        "`{parameter}` is to be estimated as its logarithm, which only Ekf does; leave log() out and bound it instead"
    )]
    Logarithm {
        /// The parameter.
        parameter: &'static str,
    },
    /// A forgetting factor above one.
    #[error("the forgetting factor is {factor}; it is at most 1, which forgets nothing")]
    Forgetting {
        /// The value given.
        factor: f64,
    },
    /// More free quantities than the observer was made for.
    #[error(
        "{needed} states and free parameters do not fit an observer made for {capacity}; make its last const parameter {needed}"
    )]
    Capacity {
        /// States and free parameters.
        needed: usize,
        /// The observer's const parameter.
        capacity: usize,
    },
    /// A pull below zero, which pushes.
    #[error("the pull on `{state}` is {value}; it must be zero (none) or more")]
    Pull {
        /// The state.
        state: &'static str,
        /// The value given.
        value: f64,
    },
    /// Forward Euler of a model that has no derivative.
    #[error("forward Euler needs a continuous model; step this one with Stepping::Split")]
    EulerOfDiscrete,
    /// Gains that make the sampled observer unstable.
    #[error(
        "the sampled observer is unstable at point {point} of those given: its error grows by {radius} per sample; lower the gains, shorten the sample time, or update before predicting"
    )]
    Unstable {
        /// Position of the operating point, from zero.
        point: usize,
        /// Spectral radius of the linearized error system.
        radius: f64,
    },
}

/// The same sentence: it is what a `main` that returns the error shows.
impl core::fmt::Debug for ObserverError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        core::fmt::Display::fmt(self, f)
    }
}

/// A number by four significant digits.
struct Short(f64);

impl core::fmt::Display for Short {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let digits = 3.0 - Scalar::floor(Scalar::log10(Scalar::abs(self.0)));
        let power = |n: f64| Scalar::powf(10.0, n);
        // Powers of ten are whole on one side of the point only.
        let short = if !digits.is_finite() || digits > 22.0 {
            self.0
        } else if digits >= 0.0 {
            Scalar::round(self.0 * power(digits)) / power(digits)
        } else {
            Scalar::round(self.0 / power(-digits)) * power(-digits)
        };
        write!(f, "{short}")
    }
}

/// When innovations mean divergence: some output beyond its limit for `patience` samples in a row.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Watch<Y> {
    /// Limit of each output's innovation: in its unit ([`Mras`], [`Rls`]) or in its standard deviations ([`Ekf`]).
    pub limit: Y,
    /// Number of consecutive samples.
    pub patience: u32,
}

/// The watch at work.
#[derive(Clone, Copy)]
struct Guard<Y: Signals> {
    watch: Watch<Of<Y, f64>>,
    beyond: u32,
}

impl<Y: Signals> Guard<Y> {
    fn new(watch: Watch<Of<Y, f64>>) -> Self {
        Guard { watch, beyond: 0 }
    }

    /// Judges the innovations of one sample, each with its limit's unit.
    #[inline]
    fn judge(&mut self, innovation: Of<Y, f64>, unit: impl Fn(usize) -> f64) -> Result<(), Divergence> {
        let (e, limit) = (Y::into_array(innovation), Y::into_array(self.watch.limit));
        for i in 0..Y::LEN {
            let (value, limit) = (e.as_ref()[i], limit.as_ref()[i] * unit(i));
            if value.abs() > limit {
                self.beyond += 1;
                if self.beyond < self.watch.patience {
                    return Ok(());
                }
                return Err(Divergence::Innovation { signal: Y::NAMES[i], value, limit, samples: self.beyond });
            }
        }
        self.beyond = 0;
        Ok(())
    }
}

/// The first signal that is not a finite number.
#[inline(always)]
fn not_finite<X: Signals>(signals: &Of<X, f64>) -> Option<&'static str> {
    let values = X::into_array(*signals);
    (0..X::LEN).find(|&i| !values.as_ref()[i].is_finite()).map(|i| X::NAMES[i])
}

/// Whether all parameters are numbers within their bounds.
#[inline(always)]
fn in_bounds<P: Signals>(values: &Of<P, f64>, known: &Of<P, Parameter>) -> Result<(), Divergence> {
    let (values, known) = (P::into_array(*values), P::into_array(*known));
    for i in 0..P::LEN {
        let (value, Parameter { lower, upper, .. }) = (values.as_ref()[i], known.as_ref()[i]);
        if !(value >= lower && value <= upper && value.is_finite()) {
            let parameter = P::NAMES[i];
            return Err(if value.is_finite() {
                Divergence::Bounds { parameter, value, lower, upper }
            } else {
                Divergence::NotFinite { signal: parameter }
            });
        }
    }
    Ok(())
}

/// Whether all starts are numbers within their bounds.
fn check_starts<P: Signals>(known: &Of<P, Parameter>) -> Result<(), ObserverError> {
    let known = P::into_array(*known);
    for (name, &Parameter { start, lower, upper, transform, .. }) in P::NAMES.iter().zip(known.as_ref()) {
        let positive = transform == Transform::Identity || start > 0.0;
        if !(start.is_finite() && start >= lower && start <= upper && positive) {
            return Err(ObserverError::Start { parameter: name, start, lower, upper });
        }
    }
    Ok(())
}

/// Whether no input is late at the start.
fn check_not_late<M: Model>(model: &M, known: &Of<M::Parameters, Parameter>) -> Result<(), ObserverError> {
    let delays = M::Input::into_array(model.delay(&M::Parameters::map(*known, |known| known.start)));
    match delays.as_ref().iter().position(|delay| *delay != 0.0) {
        Some(i) => Err(ObserverError::Late { input: M::Input::NAMES[i], delay: delays.as_ref()[i] }),
        None => Ok(()),
    }
}

/// Whether all parameters are estimated as they are, for observers that know no logarithms.
fn check_identity<P: Signals>(known: &Of<P, Parameter>) -> Result<(), ObserverError> {
    let known = P::into_array(*known);
    match known.as_ref().iter().position(|known| known.free && known.transform == Transform::Log) {
        Some(i) => Err(ObserverError::Logarithm { parameter: P::NAMES[i] }),
        None => Ok(()),
    }
}

/// Whether a value is positive and finite.
fn check_positive(what: &'static str, signal: &'static str, value: f64) -> Result<(), ObserverError> {
    if value > 0.0 && value.is_finite() { Ok(()) } else { Err(ObserverError::NotPositive { what, signal, value }) }
}

/// Whether all entries are.
fn check_all_positive<X: Signals>(what: &'static str, values: &Of<X, f64>) -> Result<(), ObserverError> {
    let values = X::into_array(*values);
    X::NAMES.iter().zip(values.as_ref()).try_for_each(|(name, value)| check_positive(what, name, *value))
}

/// Standard deviation of what is known at the start; zero for what is fixed.
fn prior_std(name: &'static str, known: &Parameter) -> Result<f64, ObserverError> {
    match known.prior {
        _ if !known.free => Ok(0.0),
        None => Err(ObserverError::NoPrior { parameter: name }),
        Some(prior) => check_positive("the prior's standard deviation", name, prior.std).map(|()| prior.std),
    }
}

/// The rhythm of the samples.
#[derive(Clone, Copy)]
struct Clock {
    ts: f64,
    last: Option<f64>,
}

/// How a sample falls into the rhythm.
enum Beat {
    First,
    Regular,
    Jump { found: f64 },
}

impl Clock {
    fn new(ts: f64) -> Result<Self, ObserverError> {
        check_positive("the sample time (s)", "t", ts)?;
        Ok(Clock { ts, last: None })
    }

    /// Takes the sample at `t`; a tenth of a sample of jitter passes.
    #[inline(always)]
    fn beat(&mut self, t: f64) -> Beat {
        let Some(last) = self.last.replace(t) else { return Beat::First };
        let found = t - last;
        if (found - self.ts).abs() <= 0.1 * self.ts { Beat::Regular } else { Beat::Jump { found } }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_said_shortly() {
        for (value, said) in [
            (-0.000_993_374_516_914, "-0.0009934"),
            (123_456.789, "123500"),
            (0.0, "0"),
            (20.0, "20"),
            (1e-300, &format!("{}", 1e-300)),
            (f64::INFINITY, "inf"),
        ] {
            assert_eq!(Short(value).to_string(), said);
        }
    }
}
