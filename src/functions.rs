//! [`Functions`]: a model's equations on vectors whose lengths are known at run time only, and [`Sloped`]: their slopes.

use crate::layout::{Kind, Layout};
use crate::model::Model;
use crate::moments::Moments;
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
    fn diffusion(&self, t: S, x: &[S], u: &[S], p: &[S], to: &mut [S]);

    /// Measurement noise of each output, as [`Model::noise`].
    fn noise(&self, t: S, x: &[S], u: &[S], p: &[S], to: &mut [S]);

    /// Standard deviation of each state at the first sample, as [`Model::initial_noise`].
    fn initial_noise(&self, p: &[S], to: &mut [S]);

    /// The state at the first sample, as [`Model::initial`].
    fn initial(&self, u: &[S], p: &[S], to: &mut [S]);

    /// Dead time of each input, as [`Model::delay`].
    fn delay(&self, p: &[S], to: &mut [S]);

    /// Whether any state may jump at samples.
    fn jumps(&self) -> bool;

    /// The state after a sample, as [`Model::jump`].
    fn jump(&self, t: S, x: &[S], u: &[S], p: &[S], to: &mut [S]);

    /// Slopes and moments where they are known otherwise than by secants.
    fn known(&self) -> Option<&dyn Sloped<S>> {
        None
    }
}

/// Slopes and moments of a model's equations.
pub trait Sloped<S> {
    /// The slopes of [`state`](Functions::state) with respect to the states, row by row.
    fn state_slopes(&self, t: S, x: &[S], u: &[S], p: &[S], to: &mut [S]);

    /// Those of the outputs.
    fn output_slopes(&self, t: S, x: &[S], u: &[S], p: &[S], to: &mut [S]);

    /// Those of the state after a sample.
    fn jump_slopes(&self, t: S, x: &[S], u: &[S], p: &[S], to: &mut [S]);

    /// Moments of [`state`](Functions::state) where the state is Gaussian, its covariance after its mean in `carry`.
    fn state_moments(&self, t: S, carry: &[S], u: &[S], p: &[S], layout: &Layout) -> Moments<S>;

    /// Those of the outputs.
    fn output_moments(&self, t: S, carry: &[S], u: &[S], p: &[S], layout: &Layout) -> Moments<S>;

    /// Those of the state after a sample.
    fn jump_moments(&self, t: S, carry: &[S], u: &[S], p: &[S], layout: &Layout) -> Moments<S>;
}

/// Slopes and moments: those that are known; else those of an affine function, by secants, which are exact. As methods of the trait object they
/// are compiled once, not for each model.
impl<S: Scalar> dyn Functions<S> + '_ {
    pub fn state_slopes(&self, t: S, x: &[S], u: &[S], p: &[S], to: &mut [S]) {
        match self.known() {
            Some(known) => known.state_slopes(t, x, u, p, to),
            None => secants(x.len(), to, &|x, to| self.state(t, x, u, p, to)),
        }
    }

    pub fn output_slopes(&self, t: S, x: &[S], u: &[S], p: &[S], to: &mut [S]) {
        match self.known() {
            Some(known) => known.output_slopes(t, x, u, p, to),
            None => secants(x.len(), to, &|x, to| self.output(t, x, u, p, to)),
        }
    }

    pub fn jump_slopes(&self, t: S, x: &[S], u: &[S], p: &[S], to: &mut [S]) {
        match self.known() {
            Some(known) => known.jump_slopes(t, x, u, p, to),
            None => secants(x.len(), to, &|x, to| self.jump(t, x, u, p, to)),
        }
    }

    pub fn state_moments(&self, t: S, carry: &[S], u: &[S], p: &[S], layout: &Layout) -> Moments<S> {
        let n = layout.states.len();
        self.known().map_or_else(
            || affine(&carry[..n], n, |x, to| self.state(t, x, u, p, to)),
            |known| known.state_moments(t, carry, u, p, layout),
        )
    }

    pub fn output_moments(&self, t: S, carry: &[S], u: &[S], p: &[S], layout: &Layout) -> Moments<S> {
        self.known().map_or_else(
            || affine(&carry[..layout.states.len()], layout.outputs.len(), |x, to| self.output(t, x, u, p, to)),
            |known| known.output_moments(t, carry, u, p, layout),
        )
    }

    pub fn jump_moments(&self, t: S, carry: &[S], u: &[S], p: &[S], layout: &Layout) -> Moments<S> {
        let n = layout.states.len();
        self.known().map_or_else(
            || affine(&carry[..n], n, |x, to| self.jump(t, x, u, p, to)),
            |known| known.jump_moments(t, carry, u, p, layout),
        )
    }
}

/// The moments of an affine function, which has as many values as this, about a state.
fn affine<S: Scalar>(x: &[S], values: usize, f: impl Fn(&[S], &mut [S])) -> Moments<S> {
    let (mut mean, mut slopes) = (vec![S::from(0.0); values], vec![S::from(0.0); values * x.len()]);
    f(x, &mut mean);
    secants(x.len(), &mut slopes, &f);
    Moments { mean, slopes, spread: vec![] }
}

/// The dead times of the inputs, none of those that are not late; empty where none is.
pub(crate) fn delays<S: Scalar>(functions: &dyn Functions<S>, late: &[bool], p: &[S]) -> Vec<Option<S>> {
    if !late.contains(&true) {
        return vec![];
    }
    let mut found = vec![S::from(0.0); late.len()];
    functions.delay(p, &mut found);
    late.iter().zip(found).map(|(late, delay)| late.then_some(delay)).collect()
}

/// The length of a vector by which the column of an affine function is found: so large that its value at zero, which is subtracted, takes
/// no digits from the difference. A power of two, by which a number is multiplied without rounding.
pub(crate) const LONG: f64 = (1u64 << 60) as f64;

/// The slopes of an affine function of `n` numbers, row by row: what each unit vector adds to its value at zero.
fn secants<S: Scalar>(n: usize, to: &mut [S], f: &dyn Fn(&[S], &mut [S])) {
    let rows = to.len() / n.max(1);
    let (zero, mut origin) = (vec![S::from(0.0); n], vec![S::from(0.0); rows]);
    f(&zero, &mut origin);
    for j in 0..n {
        let (mut long, mut end) = (zero.clone(), origin.clone());
        long[j] = S::from(LONG);
        f(&long, &mut end);
        for (row, (end, origin)) in end.iter().zip(&origin).enumerate() {
            to[row * n + j] = (*end - *origin) * LONG.recip();
        }
    }
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

    fn diffusion(&self, t: S, x: &[S], u: &[S], p: &[S], to: &mut [S]) {
        let (x, u, p) = (M::State::from_fn(|i| x[i]), M::Input::from_fn(|i| u[i]), M::Parameters::from_fn(|i| p[i]));
        to.copy_from_slice(M::State::into_array(Model::diffusion(&**self, t, &x, &u, &p)).as_ref());
    }

    fn noise(&self, t: S, x: &[S], u: &[S], p: &[S], to: &mut [S]) {
        let (x, u, p) = (M::State::from_fn(|i| x[i]), M::Input::from_fn(|i| u[i]), M::Parameters::from_fn(|i| p[i]));
        to.copy_from_slice(M::Output::into_array(Model::noise(&**self, t, &x, &u, &p)).as_ref());
    }

    fn initial_noise(&self, p: &[S], to: &mut [S]) {
        let p = M::Parameters::from_fn(|i| p[i]);
        to.copy_from_slice(M::State::into_array(Model::initial_noise(&**self, &p)).as_ref());
    }

    fn initial(&self, u: &[S], p: &[S], to: &mut [S]) {
        let (u, p) = (M::Input::from_fn(|i| u[i]), M::Parameters::from_fn(|i| p[i]));
        to.copy_from_slice(M::State::into_array(Model::initial(&**self, &u, &p)).as_ref());
    }

    fn delay(&self, p: &[S], to: &mut [S]) {
        let p = M::Parameters::from_fn(|i| p[i]);
        to.copy_from_slice(M::Input::into_array(Model::delay(&**self, &p)).as_ref());
    }

    /// What is compiled does not tell whether it changes the state.
    fn jumps(&self) -> bool {
        M::KIND == Kind::Continuous
    }

    fn jump(&self, t: S, x: &[S], u: &[S], p: &[S], to: &mut [S]) {
        let (x, u, p) = (M::State::from_fn(|i| x[i]), M::Input::from_fn(|i| u[i]), M::Parameters::from_fn(|i| p[i]));
        to.copy_from_slice(M::State::into_array(Model::jump(&**self, t, &x, &u, &p)).as_ref());
    }
}

#[cfg(test)]
mod tests {
    use super::secants;

    /// A value at zero that is 1e13 times what a unit of the state adds takes no digit from it.
    #[test]
    fn secants_beside_a_large_offset() {
        let mut found = [f64::NAN; 4];
        secants(2, &mut found, &|x: &[f64], to: &mut [f64]| {
            to[0] = 0.1 * x[0] + 1e12;
            to[1] = 3.0 * x[1] - 2e-5 * x[0];
        });
        for (found, expected) in found.iter().zip([0.1, 0.0, -2e-5, 3.0]) {
            assert!((found - expected).abs() <= 1e-15 * expected.abs(), "{found} {expected}");
        }
    }
}
