//! Adaptation laws: what the error between measured and predicted states says of the parameters.

use crate::dual::Dual;
use crate::layout::Kind;
use crate::model::Model;
use crate::signals::{Of, Signals};

/// The input of an adaptation law at one sample.
pub struct Moment<'a, M: Model> {
    /// The observer's model.
    pub model: &'a M,
    /// Sample time (s).
    pub ts: f64,
    /// Time (s).
    pub t: f64,
    /// Predicted states, before the correction.
    pub x: &'a Of<M::State, f64>,
    /// Measured less predicted states.
    pub e: &'a Of<M::State, f64>,
    /// Inputs.
    pub u: &'a Of<M::Input, f64>,
    /// Parameters, before the correction.
    pub p: &'a Of<M::Parameters, f64>,
}

/// How a parameter moves in one sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Rate {
    /// By so much per second, in its unit.
    Adapt(f64),
    /// Not at all: this sample does not determine it reliably.
    Hold {
        /// The quantity that is too small, in words and with its unit.
        quantity: &'static str,
        /// Its value.
        value: f64,
        /// The limit it stays under.
        limit: f64,
    },
}

/// An adaptation law: how the error between measured and predicted states moves the parameters. Closures are laws.
pub trait AdaptationLaw<M: Model> {
    /// The rate of each parameter.
    fn rates(&self, now: &Moment<M>) -> Of<M::Parameters, Rate>;
}

impl<M: Model, F: Fn(&Moment<M>) -> Of<M::Parameters, Rate>> AdaptationLaw<M> for F {
    #[inline(always)]
    fn rates(&self, now: &Moment<M>) -> Of<M::Parameters, Rate> {
        self(now)
    }
}

/// The gradient law `dp/dt = gain (df/dp)^T e`, for any model by exact slopes; of a discrete model, `df` is what one
/// sample adds, per second, and so is a part of it where samples change the state of a continuous one ([`Model::jump`]).
///
/// Where `f` is linear in the parameters, this is the law of Lyapunov's `V = e^T e + sum of (error of p)^2 / gain`. `N`
/// is the number of parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gradient<P, const N: usize> {
    /// Gain of each parameter, zero or more: (unit of p)^2 / (s (unit of x)^2).
    pub gain: P,
}

impl<M: Model, const N: usize> AdaptationLaw<M> for Gradient<Of<M::Parameters, f64>, N> {
    #[inline]
    fn rates(&self, now: &Moment<M>) -> Of<M::Parameters, Rate> {
        const { assert!(N == M::Parameters::LEN, "the second parameter of Gradient is the number of parameters") };
        let p = M::Parameters::into_array(*now.p);
        let p = M::Parameters::from_fn(|i| Dual::<N>::variable(p.as_ref()[i], i));
        let (x, u) = (M::State::map(*now.x, Dual::from), M::Input::map(*now.u, Dual::from));
        let (f, scale) = match M::KIND {
            Kind::Continuous => {
                let after = now.model.jump(Dual::from(now.t), &x, &u, &p);
                let f = now.model.derivative(Dual::from(now.t), &after, &u, &p);
                let (f, after) = (M::State::into_array(f), M::State::into_array(after));
                (M::State::from_fn(|i| f.as_ref()[i] + after.as_ref()[i] * now.ts.recip()), 1.0)
            }
            Kind::Discrete => (now.model.next(Dual::from(now.t), &x, &u, &p), 1.0 / now.ts),
            Kind::Static => (x, 0.0),
        };
        let (f, e, gain) =
            (M::State::into_array(f), M::State::into_array(*now.e), M::Parameters::into_array(self.gain));
        M::Parameters::from_fn(|j| {
            let mut sum = 0.0;
            for i in 0..M::State::LEN {
                sum += f.as_ref()[i].slopes[j] * e.as_ref()[i];
            }
            Rate::Adapt(sum * gain.as_ref()[j] * scale)
        })
    }
}
