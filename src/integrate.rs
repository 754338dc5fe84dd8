//! [`Integrator`]: from one sample to the next.

mod automatic;
mod discrete;
mod rk4;

pub use automatic::Automatic;
pub use discrete::Discrete;
pub use rk4::Rk4;

use crate::interval::Interval;
use crate::model::{Kind, Model};
use crate::scalar::Scalar;
use crate::signals::Of;
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

    /// Name and settings in a few words, for reports.
    #[cfg(feature = "std")]
    fn describe(&self) -> String;
}

/// The method cannot cross an interval: its step went below what time can resolve.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stuck;

/// `x + a * k`, signal by signal.
#[inline(always)]
pub(crate) fn axpy<X: crate::signals::Signals, S: Scalar>(x: Of<X, S>, a: f64, k: Of<X, S>) -> Of<X, S> {
    let (x, k) = (X::into_array(x), X::into_array(k));
    X::from_fn(|i| x.as_ref()[i] + k.as_ref()[i] * a)
}
