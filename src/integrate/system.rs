//! [`System`]: a model's equations over one sampling interval, with inputs and parameters filled in.

use super::{Integrator, Stuck};
use crate::dual::Dual;
use crate::interval::Interval;
use crate::layout::Kind;
use crate::model::Model;
use crate::scalar::Scalar;
use crate::signals::{Entry, Of, Signals};

/// The equations that an [`Integrator`](super::Integrator) steps: those of a model between two samples, in numbers of one type.
///
/// Positions in the interval are fractions of it, from 0 to 1.
pub trait System {
    /// Number type of the state.
    type Scalar: Scalar;
    /// One entry per state: an array, or a vector where the number of states is known at run time only.
    type Vector<T: Entry>: Clone + AsRef<[T]> + AsMut<[T]>;
    /// A row per state of one entry per state.
    type Matrix: Square;

    /// The kind of the equations.
    fn kind(&self) -> Kind;

    /// The begin of the interval (s) and its length (s).
    fn interval(&self) -> (f64, f64);

    /// The vector whose entry `i` is `f(i)`.
    fn vector<T: Entry>(&self, f: impl FnMut(usize) -> T) -> Self::Vector<T>;

    /// `dx/dt` at a position, per second.
    fn derivative(&self, position: f64, x: &Self::Vector<Self::Scalar>) -> Self::Vector<Self::Scalar>;

    /// The next state of a discrete system.
    fn next(&self, x: &Self::Vector<Self::Scalar>) -> Self::Vector<Self::Scalar>;

    /// Value of the derivative at a position and values of the states, and its Jacobian with respect to these.
    fn jacobian(&self, position: f64, x: &Self::Vector<f64>) -> (Self::Vector<f64>, Self::Matrix);

    /// `x + k * (part of the interval's length)`, entry by entry.
    fn along(
        &self,
        x: &Self::Vector<Self::Scalar>,
        part: f64,
        k: &Self::Vector<Self::Scalar>,
    ) -> Self::Vector<Self::Scalar>;
}

/// A square matrix by rows.
pub trait Square: Clone {
    /// Row `i`.
    fn row(&self, i: usize) -> &[f64];
    /// Row `i`, to be written.
    fn row_mut(&mut self, i: usize) -> &mut [f64];
}

/// Rows in an array of arrays.
#[derive(Clone, Debug)]
pub struct Rows<X: Signals>(X::Array<X::Array<f64>>);

impl<X: Signals> Square for Rows<X> {
    #[inline(always)]
    fn row(&self, i: usize) -> &[f64] {
        self.0.as_ref()[i].as_ref()
    }
    #[inline(always)]
    fn row_mut(&mut self, i: usize) -> &mut [f64] {
        self.0.as_mut()[i].as_mut()
    }
}

/// The equations of a typed model in one interval. Its vectors are arrays.
pub struct ModelSystem<'a, M: Model, S: Scalar> {
    /// The model.
    pub model: &'a M,
    /// The interval, with the inputs at its ends.
    pub interval: &'a Interval<M::Input>,
    /// The parameters.
    pub p: &'a Of<M::Parameters, S>,
}

impl<M: Model, S: Scalar> ModelSystem<'_, M, S> {
    /// The state at the end of the interval, from that before the sample at its begin.
    ///
    /// # Errors
    /// Where the method is [`Stuck`].
    #[inline(always)]
    pub fn step<I: Integrator>(
        &self,
        integrator: &I,
        x: Of<M::State, S>,
        step: &mut f64,
    ) -> Result<Of<M::State, S>, Stuck> {
        self.flow(integrator, self.jump(x), step)
    }

    /// The same from the state after the sample.
    ///
    /// # Errors
    /// Where the method is [`Stuck`].
    #[inline(always)]
    pub fn flow<I: Integrator>(
        &self,
        integrator: &I,
        x: Of<M::State, S>,
        step: &mut f64,
    ) -> Result<Of<M::State, S>, Stuck> {
        integrator.advance(self, M::State::into_array(x), step).map(M::State::from_array)
    }

    /// The state after the sample at the begin of the interval; unchanged where the next is at the same instant.
    #[inline(always)]
    pub fn jump(&self, x: Of<M::State, S>) -> Of<M::State, S> {
        let Interval { t0, t1, .. } = *self.interval;
        if M::KIND != Kind::Continuous || t1 <= t0 {
            return x;
        }
        self.model.jump(S::from(t0), &x, &self.interval.input::<S>(0.0), self.p)
    }
}

/// Columns of the Jacobian per evaluation.
const COLUMNS: usize = 8;

impl<M: Model, S: Scalar> System for ModelSystem<'_, M, S> {
    type Scalar = S;
    type Vector<T: Entry> = <M::State as Signals>::Array<T>;
    type Matrix = Rows<M::State>;

    #[inline(always)]
    fn kind(&self) -> Kind {
        M::KIND
    }

    #[inline(always)]
    fn interval(&self) -> (f64, f64) {
        (self.interval.t0, self.interval.t1 - self.interval.t0)
    }

    #[inline(always)]
    fn vector<T: Entry>(&self, f: impl FnMut(usize) -> T) -> Self::Vector<T> {
        M::State::array_from_fn(f)
    }

    #[inline(always)]
    fn derivative(&self, position: f64, x: &Self::Vector<S>) -> Self::Vector<S> {
        let Interval { t0, t1, .. } = *self.interval;
        let u = self.interval.input::<S>(position);
        let t = S::from(t0 + position * (t1 - t0));
        M::State::into_array(self.model.derivative(t, &M::State::from_array(*x), &u, self.p))
    }

    #[inline(always)]
    fn next(&self, x: &Self::Vector<S>) -> Self::Vector<S> {
        let u = self.interval.input::<S>(0.0);
        M::State::into_array(self.model.next(S::from(self.interval.t0), &M::State::from_array(*x), &u, self.p))
    }

    fn jacobian(&self, position: f64, x: &Self::Vector<f64>) -> (Self::Vector<f64>, Rows<M::State>) {
        let Interval { t0, t1, .. } = *self.interval;
        let t = Dual::<COLUMNS>::constant(t0 + position * (t1 - t0));
        let u = self.interval.input::<Dual<COLUMNS>>(position);
        let p = M::Parameters::map(*self.p, |p: S| Dual::<COLUMNS>::constant(p.value()));
        let mut f = *x;
        let mut rows = Rows::<M::State>(M::State::array_from_fn(|_| M::State::array_from_fn(|_| 0.0)));
        for from in (0..M::State::LEN).step_by(COLUMNS) {
            let lane = |i: usize| i.checked_sub(from).unwrap_or(COLUMNS);
            let seeded = M::State::from_fn(|i| Dual::<COLUMNS>::variable(x.as_ref()[i], lane(i)));
            let duals = M::State::into_array(self.model.derivative(t, &seeded, &u, &p));
            for (i, dual) in duals.as_ref().iter().enumerate() {
                f.as_mut()[i] = dual.value;
                for (entry, slope) in rows.row_mut(i).iter_mut().skip(from).zip(dual.slopes) {
                    *entry = slope;
                }
            }
        }
        (f, rows)
    }

    #[inline(always)]
    fn along(&self, x: &Self::Vector<S>, part: f64, k: &Self::Vector<S>) -> Self::Vector<S> {
        let a = (self.interval.t1 - self.interval.t0) * part;
        M::State::array_from_fn(|i| x.as_ref()[i].plus_times(k.as_ref()[i], a))
    }
}
