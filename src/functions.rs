//! [`Functions`]: a model's equations on vectors whose lengths are known at run time only.

use crate::layout::Kind;
use crate::model::Model;
use crate::scalar::Scalar;
use crate::signals::Signals;
use core::ops::Deref;
use std::sync::Arc;

/// A model's equations in numbers of type `S`, each vector in the order of the model's [`Layout`](crate::layout::Layout).
pub trait Functions<S>: Send + Sync {
    /// `dx/dt` of a continuous model, the next state of a discrete one; not called for a static one.
    fn state(&self, t: S, x: &[S], u: &[S], p: &[S], to: &mut [S]);

    /// The outputs.
    fn output(&self, t: S, x: &[S], u: &[S], p: &[S], to: &mut [S]);

    /// Process noise of each state, as [`Model::diffusion`].
    fn diffusion(&self, p: &[S], to: &mut [S]);

    /// Measurement noise of each output, as [`Model::noise`].
    fn noise(&self, p: &[S], to: &mut [S]);
}

/// A value that is borrowed or shared.
#[derive(Debug)]
pub enum Handle<'a, T> {
    Borrowed(&'a T),
    Shared(Arc<T>),
}

impl<T> Clone for Handle<'_, T> {
    fn clone(&self) -> Self {
        match self {
            Handle::Borrowed(value) => Handle::Borrowed(value),
            Handle::Shared(value) => Handle::Shared(value.clone()),
        }
    }
}

impl<T: Clone> Handle<'_, T> {
    /// The value, shared; a copy of one that is borrowed.
    pub fn shared(&self) -> Arc<T> {
        match self {
            Handle::Borrowed(value) => Arc::new((*value).clone()),
            Handle::Shared(value) => value.clone(),
        }
    }
}

impl<T> Deref for Handle<'_, T> {
    type Target = T;

    #[inline(always)]
    fn deref(&self) -> &T {
        match self {
            Handle::Borrowed(value) => value,
            Handle::Shared(value) => value,
        }
    }
}

impl<M: Model, S: Scalar> Functions<S> for Handle<'_, M> {
    fn state(&self, t: S, x: &[S], u: &[S], p: &[S], to: &mut [S]) {
        let (x, u, p) = (M::State::from_fn(|i| x[i]), M::Input::from_fn(|i| u[i]), M::Parameters::from_fn(|i| p[i]));
        let found = match M::KIND {
            Kind::Continuous => self.derivative(t, &x, &u, &p),
            Kind::Discrete => self.next(t, &x, &u, &p),
            Kind::Static => x,
        };
        to.copy_from_slice(M::State::into_array(found).as_ref());
    }

    fn output(&self, t: S, x: &[S], u: &[S], p: &[S], to: &mut [S]) {
        let (x, u, p) = (M::State::from_fn(|i| x[i]), M::Input::from_fn(|i| u[i]), M::Parameters::from_fn(|i| p[i]));
        to.copy_from_slice(M::Output::into_array(Model::output(&**self, t, &x, &u, &p)).as_ref());
    }

    fn diffusion(&self, p: &[S], to: &mut [S]) {
        let p = M::Parameters::from_fn(|i| p[i]);
        to.copy_from_slice(M::State::into_array(Model::diffusion(&**self, &p)).as_ref());
    }

    fn noise(&self, p: &[S], to: &mut [S]) {
        let p = M::Parameters::from_fn(|i| p[i]);
        to.copy_from_slice(M::Output::into_array(Model::noise(&**self, &p)).as_ref());
    }
}
