//! [`Integrator`]: from one sample to the next.

mod automatic;
mod discrete;
mod esdirk;
#[cfg(feature = "std")]
mod exact;
#[cfg(feature = "std")]
mod method;
mod rk4;
mod rk45;
#[cfg(feature = "std")]
mod stiff;
mod system;
mod tolerance;

pub use automatic::Automatic;
pub use discrete::Discrete;
pub use esdirk::Esdirk;
#[cfg(feature = "std")]
pub(crate) use method::{Duals, Field, Method, Rate, Slopes, SymbolicField, automatic, exact, stepped, stiff};
pub use rk4::Rk4;
pub use rk45::Rk45;
#[cfg(feature = "std")]
use stiff::Stiff;
pub use system::{ModelSystem, Square, System};
use tolerance::Tolerance;

use crate::layout::Kind;
use crate::scalar::Scalar;
use crate::signals::{Of, Signals};
use core::fmt::Debug;

/// A one-step method: carries the state of a [`System`] across one sampling interval, slopes and all.
///
/// Steps are chosen from values only, so that the slopes are exactly those of the numbers computed. It is written once for
/// all number types, and for states whose length the compiler knows as for those whose length it does not.
pub trait Integrator: Clone + Debug + Send + Sync + 'static {
    /// Whether the steps are the same whatever the values. The whole step of such a method is differentiated and compiled
    /// for each model; the others take their steps one by one.
    const FIXED: bool;

    /// The state at the end of the interval. `step` is what an adaptive method hands from one interval to the next: the
    /// length of its step (s), zero before the first.
    ///
    /// # Errors
    /// `Stuck`, where the method cannot meet its tolerance.
    fn advance<Y: System>(
        &self,
        system: &Y,
        x: Y::Vector<Y::Scalar>,
        step: &mut f64,
    ) -> Result<Y::Vector<Y::Scalar>, Stuck>;

    /// Whether the method serves models of this kind.
    fn serves(&self, kind: Kind) -> bool;

    /// This method with half the step or a far smaller tolerance, to see whether the answer moves; `None` if the step
    /// is exact for models of this kind.
    fn refined(&self, kind: Kind) -> Option<Self>;

    /// Whether its settings make sense.
    ///
    /// # Errors
    /// The setting and its value.
    #[cfg(feature = "std")]
    fn check(&self) -> Result<(), crate::error::Error> {
        Ok(())
    }

    /// Name and settings in a few words, as it steps models of this kind, for reports.
    #[cfg(feature = "std")]
    fn describe(&self, kind: Kind) -> String;
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
#[cfg(feature = "std")]
#[inline(always)]
pub(crate) fn combined<X: Signals, S: Scalar>(x: &Of<X, S>, h: f64, a: &[f64], k: &[Of<X, S>]) -> Of<X, S> {
    let mut sum = X::splat(S::from(0.0));
    for (a, k) in a.iter().zip(k) {
        sum = axpy::<X, S>(sum, *a, *k);
    }
    axpy::<X, S>(*x, h, sum)
}
