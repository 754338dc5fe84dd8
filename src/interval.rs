//! [`Interval`]: the time from one sample to the next, and what the input does in it.

use crate::scalar::Scalar;
use crate::signals::{Of, Signals};
use serde::{Deserialize, Serialize};

/// How the input behaves between two samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Hold {
    /// Constant from each sample to the next (what a digital controller commands).
    #[default]
    Zero,
    /// A straight line from each sample to the next (a sampled physical quantity).
    First,
}

/// The time between two samples and the input in it.
#[derive(Clone, Copy, Debug)]
pub struct Interval<U: Signals> {
    /// Its begin (s).
    pub t0: f64,
    /// Its end (s).
    pub t1: f64,
    /// The input at its begin.
    pub u0: Of<U, f64>,
    /// The input at its end; the same under a zero-order hold.
    pub u1: Of<U, f64>,
    /// How the input gets from one to the other.
    pub hold: Hold,
}

impl<U: Signals> Interval<U> {
    /// The input at the fraction `s` (0 to 1) of the interval.
    #[inline(always)]
    pub fn input<S: Scalar>(&self, s: f64) -> Of<U, S> {
        match self.hold {
            Hold::Zero => U::map(self.u0, S::from),
            Hold::First => {
                let (u0, u1) = (U::into_array(self.u0), U::into_array(self.u1));
                U::from_fn(|i| S::from(u0.as_ref()[i] + (u1.as_ref()[i] - u0.as_ref()[i]) * s))
            }
        }
    }
}
