//! [`Integrator`]: from one sample to the next.

mod automatic;
mod discrete;
mod esdirk;
mod rk4;
mod rk45;

pub use automatic::Automatic;
pub use discrete::Discrete;
pub use esdirk::Esdirk;
pub use rk4::Rk4;
pub use rk45::Rk45;

use crate::interval::Interval;
use crate::model::{Kind, Model};
use crate::scalar::Scalar;
use crate::signals::{Of, Signals};
use core::fmt::Debug;

/// A one-step method: carries the state across one sampling interval, slopes and all.
///
/// Steps are chosen from values only, so that the slopes are exactly those of the numbers computed.
pub trait Integrator<M: Model>: Clone + Debug + Send + Sync {
    /// What an adaptive method remembers from one interval to the next (its step).
    type Memory: Copy + Default + Send + Sync;

    /// The state at the end of the interval.
    ///
    /// # Errors
    /// `Stuck`, where the method cannot meet its tolerance.
    fn advance<S: Scalar>(
        &self,
        model: &M,
        interval: &Interval<M::Input>,
        x: Of<M::State, S>,
        p: &Of<M::Parameters, S>,
        memory: &mut Self::Memory,
    ) -> Result<Of<M::State, S>, Stuck>;

    /// Whether the method serves models of this kind.
    fn serves(&self, kind: Kind) -> bool;

    /// The same method with half the step or a far smaller tolerance, to see whether the answer moves; `None` if exact.
    fn refined(&self) -> Option<Self>;

    /// Whether its settings make sense.
    ///
    /// # Errors
    /// The setting and its value.
    #[cfg(feature = "std")]
    fn check(&self) -> Result<(), crate::error::Error> {
        Ok(())
    }

    /// Name and settings in a few words, for reports.
    #[cfg(feature = "std")]
    fn describe(&self) -> String;
}

/// The method cannot cross an interval: its step went below what time can resolve, or 100,000 steps were not enough.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stuck;

/// `x + a * k`, signal by signal.
#[inline(always)]
pub(crate) fn axpy<X: Signals, S: Scalar>(x: Of<X, S>, a: f64, k: Of<X, S>) -> Of<X, S> {
    let (x, k) = (X::into_array(x), X::into_array(k));
    X::from_fn(|i| x.as_ref()[i].plus_times(k.as_ref()[i], a))
}

/// `x + h (a[0] k[0] + a[1] k[1] + ...)`, signal by signal.
#[inline(always)]
pub(crate) fn combined<X: Signals, S: Scalar>(x: &Of<X, S>, h: f64, a: &[f64], k: &[Of<X, S>]) -> Of<X, S> {
    let mut sum = X::splat(S::from(0.0));
    for (a, k) in a.iter().zip(k) {
        sum = axpy::<X, S>(sum, *a, *k);
    }
    axpy::<X, S>(*x, h, sum)
}

/// The error that an adaptive method allows itself per step.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tolerance {
    /// Relative to the value of each state.
    pub relative: f64,
    /// On top of that, in the unit of each state.
    pub absolute: f64,
}

/// Steps per interval, tried or taken, after which a method is stuck.
const MAX_STEPS: u32 = 100_000;

impl Tolerance {
    /// Refuses what is no tolerance: a relative one that is not positive, an absolute one that is negative.
    #[cfg(feature = "std")]
    pub fn check(&self, method: &str) -> Result<(), crate::error::Error> {
        let Tolerance { relative, absolute } = *self;
        if !(relative > 0.0 && relative.is_finite()) {
            let what = format!("the relative tolerance of {method}");
            return Err(crate::error::Error::NotPositive { what, value: relative });
        }
        if absolute >= 0.0 && absolute.is_finite() {
            return Ok(());
        }
        Err(crate::error::Error::Option(format!(
            "the absolute tolerance of {method} is {absolute}; it must be finite and not negative"
        )))
    }

    /// Largest ratio of an error to what is allowed; not a number if one of the values is not finite.
    #[inline(always)]
    pub fn ratio<X: Signals, S: Scalar>(&self, error: &Of<X, f64>, from: &Of<X, S>, to: &Of<X, S>) -> f64 {
        // Below 1e-14 rounding is all there is.
        let (relative, absolute) = (self.relative.max(1e-14), self.absolute.max(0.0));
        let (error, from, to) = (X::into_array(*error), X::into_array(*from), X::into_array(*to));
        let mut largest = 0.0f64;
        for ((error, from), to) in error.as_ref().iter().zip(from.as_ref()).zip(to.as_ref()) {
            let allowed = relative * from.value().abs().max(to.value().abs()) + absolute;
            let ratio = if *error == 0.0 { 0.0 } else { error.abs() / allowed };
            if ratio.is_nan() || !to.value().is_finite() {
                return f64::NAN;
            }
            largest = largest.max(ratio);
        }
        largest
    }

    /// Crosses `interval` from `x` with the step kept in `memory` (s; zero: none yet). `step(x, tau, h)` goes from the time
    /// `t0 + tau` to `t0 + tau + h` and tells the state there and its error, which goes with this `power` of the step;
    /// `None`, where it cannot.
    #[inline(always)]
    pub fn cross<X: Signals, U: Signals, S: Scalar>(
        &self,
        power: f64,
        interval: &Interval<U>,
        mut x: Of<X, S>,
        memory: &mut f64,
        mut step: impl FnMut(&Of<X, S>, f64, f64) -> Option<(Of<X, S>, Of<X, f64>)>,
    ) -> Result<Of<X, S>, Stuck> {
        let length = interval.t1 - interval.t0;
        let (mut tau, mut growth) = (0.0, 5.0);
        // The first step is a cautious guess; a few steps later it is forgotten.
        let mut proposed = if *memory > 0.0 { *memory } else { 1e-3 * length };
        for _ in 0..MAX_STEPS {
            let left = length - tau;
            let resolution = 4.0 * f64::EPSILON * tau.max((interval.t0 + tau).abs());
            // The last two steps share what is left, so that none is tiny.
            let last = proposed >= left;
            let h = if last { left } else { proposed.min(0.5 * left) };
            if h <= resolution && !last {
                return Err(Stuck);
            }
            let ratio = match step(&x, tau, h) {
                Some((to, error)) => {
                    let ratio = self.ratio::<X, S>(&error, &x, &to);
                    if ratio <= 1.0 {
                        x = to;
                    }
                    ratio
                }
                None => f64::NAN,
            };
            let factor =
                if ratio.is_nan() { 0.1 } else { (0.9 * Scalar::powf(ratio, -1.0 / power)).clamp(0.2, growth) };
            if ratio <= 1.0 {
                growth = 5.0;
                tau += h;
                // A step cut short by the end of the interval does not shorten the next.
                proposed = if h < proposed { proposed.max(h * factor) } else { h * factor };
                if last {
                    *memory = proposed.min(1e3 * length);
                    return Ok(x);
                }
            } else {
                growth = 1.0;
                proposed = h * factor.min(0.9);
                if proposed <= resolution {
                    return Err(Stuck);
                }
            }
        }
        Err(Stuck)
    }
}
