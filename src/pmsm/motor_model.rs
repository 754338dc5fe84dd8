//! The interface of a motor to inverter, cable and shaft, and the code that these wrappers share.

use super::{Currents, PolePairs};
use crate::{Model, Of, Scalar};

/// A model whose states and outputs are the dq currents of a motor: what an [`InverterFed`](super::InverterFed), a
/// [`Cabled`](super::Cabled) or a [`Machine`](super::Machine) can be made of.
///
/// A motor with a flux map of its own implements this, and composes with all of them.
pub trait MotorModel: Model<State = Currents, Output = Currents> {
    /// Its pole pairs.
    fn pole_pairs(&self) -> PolePairs;

    /// Electromagnetic torque (N m) at these currents and this mechanical angle (rad).
    fn torque<S: Scalar>(&self, x: &Currents<S>, theta: S, p: &Of<Self::Parameters, S>) -> S;
}

/// Declares a model that wraps a motor `M`, with the parameters `P`: any signals that hold, by name, those of `M` and those
/// of the wrapper.
///
/// `|wrapper, x, u, p, motor| { ... }` makes of currents `x`, input `u` and parameters `p`, in numbers of type `S`, those of the
/// motor, and of what the function `motor` gives for them (the derivative of its currents, or the next ones) those of the
/// whole.
macro_rules! wraps_motor {
    (
        $(#[$meta:meta])* $name:ident, $input:ty,
        |$wrapper:ident, $x:ident, $u:ident, $p:ident, $motor:ident| $through:block
    ) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
        #[serde(transparent)]
        pub struct $name<M, P> {
            motor: M,
            #[serde(skip)]
            parameters: core::marker::PhantomData<fn() -> P>,
        }

        impl<M: MotorModel, P: Signals> $name<M, P> {
            /// Around this motor.
            pub const fn new(motor: M) -> Self {
                $name { motor, parameters: core::marker::PhantomData }
            }

            #[inline(always)]
            fn through<S: Scalar>(
                &self,
                $x: &Currents<S>,
                $u: &Of<$input, S>,
                $p: &Of<P, S>,
                $motor: impl FnOnce(&Currents<S>, &Of<M::Input, S>, &Of<M::Parameters, S>) -> Currents<S>,
            ) -> Currents<S> {
                let $wrapper = self;
                $through
            }
        }

        impl<M: MotorModel, P: Signals> crate::Model for $name<M, P> {
            type State = Currents;
            type Input = $input;
            type Output = Currents;
            type Parameters = P;
            const KIND: crate::Kind = M::KIND;

            #[inline(always)]
            fn derivative<S: Scalar>(
                &self,
                t: S,
                x: &Currents<S>,
                u: &Of<Self::Input, S>,
                p: &Of<P, S>,
            ) -> Currents<S> {
                self.through(x, u, p, |x, u, p| self.motor.derivative(t, x, u, p))
            }

            #[inline(always)]
            fn next<S: Scalar>(&self, t: S, x: &Currents<S>, u: &Of<Self::Input, S>, p: &Of<P, S>) -> Currents<S> {
                self.through(x, u, p, |x, u, p| self.motor.next(t, x, u, p))
            }

            #[inline(always)]
            fn output<S: Scalar>(
                &self,
                _t: S,
                x: &Currents<S>,
                _u: &Of<Self::Input, S>,
                _p: &Of<P, S>,
            ) -> Currents<S> {
                *x
            }
        }
    };
}
pub(super) use wraps_motor;

/// Names the motor's pole pairs, and its torque if the wrapper does not change it.
macro_rules! passes_on {
    (pole_pairs) => {
        fn pole_pairs(&self) -> PolePairs {
            self.motor.pole_pairs()
        }
    };
    (torque) => {
        #[inline(always)]
        fn torque<S: Scalar>(&self, x: &Currents<S>, theta: S, p: &Of<P, S>) -> S {
            self.motor.torque(x, theta, &P::part::<M::Parameters, S>(*p))
        }
    };
}
pub(super) use passes_on;
