//! [`Model`]: the equations, written once.

use crate::layout::Kind;
#[cfg(feature = "std")]
use crate::layout::{Layout, are_of};
use crate::scalar::Scalar;
use crate::signals::{Of, Signals};

/// A physical system, as arithmetic on named quantities.
///
/// The functions are generic over [`Scalar`], so that one text serves simulation, exact slopes and observers. Constants
/// multiply from the right (`x * 2.0`).
///
/// The names and units of all quantities come from the four signal types.
///
/// ```
/// use greybox::{Model, Scalar, signals};
/// signals! {
///     pub struct Level { h: "m" }
///     pub struct Inflow { q: "m^3/s" }
///     pub struct Tank { area: "m^2", outlet: "m^2" }
/// }
/// struct Draining;
/// impl Model for Draining {
///     type State = Level;
///     type Input = Inflow;
///     type Output = Level;
///     type Parameters = Tank;
///     fn derivative<S: Scalar>(&self, _t: S, x: &Level<S>, u: &Inflow<S>, p: &Tank<S>) -> Level<S> {
///         Level { h: (u.q - p.outlet * (x.h * 19.62).sqrt()) / p.area }
///     }
///     fn output<S: Scalar>(&self, _t: S, x: &Level<S>, _u: &Inflow<S>, _p: &Tank<S>) -> Level<S> {
///         *x
///     }
/// }
/// let slope = Draining.derivative(0.0, &Level { h: 1.0 }, &Inflow { q: 0.0 }, &Tank { area: 0.5, outlet: 4e-4 });
/// assert!((slope.h + 4e-4 * 19.62f64.sqrt() / 0.5).abs() < 1e-15);
/// ```
pub trait Model: Send + Sync {
    /// The states `x`; [`Nothing`](crate::Nothing) for a static model.
    type State: Signals;
    /// The inputs `u`; [`Nothing`](crate::Nothing) if there are none.
    type Input: Signals;
    /// The outputs `y`, in the units they are measured in.
    type Output: Signals;
    /// The parameters `p`.
    type Parameters: Signals;

    /// The kind of the equations; continuous unless said otherwise.
    const KIND: Kind = Kind::Continuous;

    /// `dx/dt` of a continuous model, per second, at time `t` (s).
    ///
    /// Not called for other kinds. Left unwritten, it is not a number, which the first simulated step reports.
    #[inline]
    fn derivative<S: Scalar>(
        &self,
        _t: S,
        _x: &Of<Self::State, S>,
        _u: &Of<Self::Input, S>,
        _p: &Of<Self::Parameters, S>,
    ) -> Of<Self::State, S> {
        Self::State::splat(S::from(f64::NAN))
    }

    /// The state at the next sample of a discrete model, from the state and the input at time `t` (s).
    ///
    /// Not called for other kinds. Left unwritten, it is not a number, which the first simulated step reports.
    #[inline]
    fn next<S: Scalar>(
        &self,
        _t: S,
        _x: &Of<Self::State, S>,
        _u: &Of<Self::Input, S>,
        _p: &Of<Self::Parameters, S>,
    ) -> Of<Self::State, S> {
        Self::State::splat(S::from(f64::NAN))
    }

    /// The state just after the sample at time `t` (s), of a continuous model, from the state before it and the input at the sample: what changes at
    /// once there, before the interval to the next. So a digital controller computes its command, which its states hold until the next
    /// sample (their derivative is zero), and an input column of doses is added to a state. Unchanged unless written.
    ///
    /// Outputs at the sample are those of the state before it. Rows of a record at one instant are one sample: it changes the state once, after
    /// them. Not called for other kinds.
    #[inline]
    fn jump<S: Scalar>(
        &self,
        _t: S,
        x: &Of<Self::State, S>,
        _u: &Of<Self::Input, S>,
        _p: &Of<Self::Parameters, S>,
    ) -> Of<Self::State, S> {
        *x
    }

    /// Process noise at time `t` (s): of a continuous model the standard deviation of each state's disturbance over one second of white
    /// noise (unit of the state per square root of a second), of a discrete model that of what is added at each step. Zero
    /// unless written. Predictors that filter use it ([`Kalman`](crate::Kalman)), at the state that they expect; a simulation does not.
    #[inline]
    fn diffusion<S: Scalar>(
        &self,
        _t: S,
        _x: &Of<Self::State, S>,
        _u: &Of<Self::Input, S>,
        _p: &Of<Self::Parameters, S>,
    ) -> Of<Self::State, S> {
        Self::State::splat(S::from(0.0))
    }

    /// Standard deviation of the measurement noise of each output at time `t` (s), in its unit, for predictors that filter, which ask for it at the
    /// state that they expect. It may be a part of the output, or an input: a column of the record with the deviation of each sample. Left
    /// unwritten, it is not a number, which such a predictor refuses.
    #[inline]
    fn noise<S: Scalar>(
        &self,
        _t: S,
        _x: &Of<Self::State, S>,
        _u: &Of<Self::Input, S>,
        _p: &Of<Self::Parameters, S>,
    ) -> Of<Self::Output, S> {
        Self::Output::splat(S::from(f64::NAN))
    }

    /// Standard deviation of each state at the first sample, about the initial state that is estimated or given, in the unit of the state.
    /// Zero unless written. Predictors that filter begin with it, unless they are told otherwise
    /// ([`InitialCovariance`](crate::InitialCovariance)); a simulation does not use it.
    #[inline]
    fn initial_noise<S: Scalar>(&self, _p: &Of<Self::Parameters, S>) -> Of<Self::State, S> {
        Self::State::splat(S::from(0.0))
    }

    /// The state at the first sample, as the model has it: of the input there and of parameters, so that experiments share what is unknown of it (a
    /// set point, an angle of rest). An entry that is not a number, as each is unless written, is not said: that state is estimated. What an
    /// experiment declares of its own state ([`Experiment::initial`](crate::Experiment::initial)) stands in place of all entries; a simulation
    /// is told its state ([`simulate`](crate::simulate)).
    #[inline]
    fn initial<S: Scalar>(&self, _u: &Of<Self::Input, S>, _p: &Of<Self::Parameters, S>) -> Of<Self::State, S> {
        Self::State::splat(S::from(f64::NAN))
    }

    /// Dead time of each input (s): at time `t` the model has the input of as much earlier; before the first sample, that of the first
    /// sample. Zero unless written. Continuous models see a held input jump between samples; a discrete or static one has the input that holds at
    /// the sample. One that is negative or not finite fails the simulation, which names it. Online observers refuse a dead time
    /// ([`ObserverError::Late`](crate::online::ObserverError::Late)).
    #[inline]
    fn delay<S: Scalar>(&self, _p: &Of<Self::Parameters, S>) -> Of<Self::Input, S> {
        Self::Input::splat(S::from(0.0))
    }

    /// The outputs at time `t` (s).
    fn output<S: Scalar>(
        &self,
        t: S,
        x: &Of<Self::State, S>,
        u: &Of<Self::Input, S>,
        p: &Of<Self::Parameters, S>,
    ) -> Of<Self::Output, S>;
}

#[cfg(feature = "std")]
impl Layout {
    /// The layout of a model's signals.
    pub fn of<M: Model>() -> Self {
        Layout::new::<M::State, M::Input, M::Output, M::Parameters>(M::KIND)
    }

    /// Whether it is that of a model.
    pub(crate) fn is_of<M: Model>(&self) -> bool {
        self.kind == M::KIND
            && are_of::<M::State>(&self.states)
            && are_of::<M::Input>(&self.inputs)
            && are_of::<M::Output>(&self.outputs)
            && are_of::<M::Parameters>(&self.parameters)
    }
}
