//! [`Numeric`]: a model made of plain functions over `f64`, for equations that are no generic Rust (foreign code, tables).
//!
//! Slopes come from central differences (crate `finitediff`) of each function at each point, joined to the slopes of its
//! arguments by the chain rule. They are right to some 1e-9, not exact, and cost two calls for every state, input and
//! parameter; equations written over [`Scalar`] are better where they can be had. `finitediff` steps by an absolute
//! 6e-6, which is far too much for 1e-12 and lost in rounding at 1e12; so it is handed variables scaled to about one.

use crate::layout::Kind;
use crate::model::Model;
use crate::scalar::Scalar;
use crate::signals::{Nothing, Of, Signals};
use core::any::TypeId;
use core::fmt;
use core::marker::PhantomData;

/// A model from functions over `f64`.
///
/// ```
/// use greybox::{Numeric, signals};
/// signals! { pub struct Speed { w: "rad/s" } }
/// signals! { pub struct Torque { te: "N m" } }
/// signals! { pub struct Shaft { j: "kg m^2", b: "N m s" } }
/// // dw/dt = (te - b w) / j, from somewhere that knows nothing of slopes
/// fn acceleration(_t: f64, x: &Speed, u: &Torque, p: &Shaft) -> Speed {
///     Speed { w: (u.te - p.b * x.w) / p.j }
/// }
/// let model = Numeric::<Speed, Torque, Speed, Shaft>::continuous(acceleration, |_, x, _, _| *x);
/// ```
pub struct Numeric<X: Signals, U: Signals, Y: Signals, P: Signals, F = (), G = ()> {
    state: F,
    output: G,
    state_size: Of<X, f64>,
    input_size: Of<U, f64>,
    parameter_size: Of<P, f64>,
    outputs: PhantomData<Y>,
}

/// `dx/dt = f(t, x, u, p)` of a continuous [`Numeric`] model.
#[derive(Clone, Copy, Debug)]
pub struct Derivative<F>(pub F);

/// `x[k+1] = f(t, x[k], u[k], p)` of a discrete [`Numeric`] model.
#[derive(Clone, Copy, Debug)]
pub struct Next<F>(pub F);

/// The state equation of a [`Numeric`] model: [`Derivative`], [`Next`], or [`Nothing`].
pub trait StateEquation<X: Signals, U: Signals, P: Signals>: Send + Sync {
    /// The kind of model it makes.
    const KIND: Kind;

    /// The right-hand side.
    fn value(&self, t: f64, x: &Of<X, f64>, u: &Of<U, f64>, p: &Of<P, f64>) -> Of<X, f64>;
}

impl<X: Signals, U: Signals, P: Signals, F> StateEquation<X, U, P> for Derivative<F>
where
    F: Fn(f64, &Of<X, f64>, &Of<U, f64>, &Of<P, f64>) -> Of<X, f64> + Send + Sync,
{
    const KIND: Kind = Kind::Continuous;
    fn value(&self, t: f64, x: &Of<X, f64>, u: &Of<U, f64>, p: &Of<P, f64>) -> Of<X, f64> {
        self.0(t, x, u, p)
    }
}

impl<X: Signals, U: Signals, P: Signals, F> StateEquation<X, U, P> for Next<F>
where
    F: Fn(f64, &Of<X, f64>, &Of<U, f64>, &Of<P, f64>) -> Of<X, f64> + Send + Sync,
{
    const KIND: Kind = Kind::Discrete;
    fn value(&self, t: f64, x: &Of<X, f64>, u: &Of<U, f64>, p: &Of<P, f64>) -> Of<X, f64> {
        self.0(t, x, u, p)
    }
}

impl<U: Signals, P: Signals> StateEquation<Nothing, U, P> for Nothing {
    const KIND: Kind = Kind::Static;
    fn value(&self, _t: f64, _x: &Nothing, _u: &Of<U, f64>, _p: &Of<P, f64>) -> Nothing {
        Nothing
    }
}

impl<X: Signals, U: Signals, Y: Signals, P: Signals> Numeric<X, U, Y, P> {
    /// The model `dx/dt = derivative(t, x, u, p)`, `y = output(t, x, u, p)`.
    pub fn continuous<F, G>(derivative: F, output: G) -> Numeric<X, U, Y, P, Derivative<F>, G>
    where
        F: Fn(f64, &Of<X, f64>, &Of<U, f64>, &Of<P, f64>) -> Of<X, f64> + Send + Sync,
        G: Fn(f64, &Of<X, f64>, &Of<U, f64>, &Of<P, f64>) -> Of<Y, f64> + Send + Sync,
    {
        Numeric::made_of(Derivative(derivative), output)
    }

    /// The model `x[k+1] = next(t, x[k], u[k], p)`, `y = output(t, x, u, p)`.
    pub fn discrete<F, G>(next: F, output: G) -> Numeric<X, U, Y, P, Next<F>, G>
    where
        F: Fn(f64, &Of<X, f64>, &Of<U, f64>, &Of<P, f64>) -> Of<X, f64> + Send + Sync,
        G: Fn(f64, &Of<X, f64>, &Of<U, f64>, &Of<P, f64>) -> Of<Y, f64> + Send + Sync,
    {
        Numeric::made_of(Next(next), output)
    }
}

impl<U: Signals, Y: Signals, P: Signals> Numeric<Nothing, U, Y, P> {
    /// The model `y = output(t, Nothing, u, p)`.
    pub fn without_state<G>(output: G) -> Numeric<Nothing, U, Y, P, Nothing, G>
    where
        G: Fn(f64, &Nothing, &Of<U, f64>, &Of<P, f64>) -> Of<Y, f64> + Send + Sync,
    {
        Numeric::made_of(Nothing, output)
    }
}

impl<X: Signals, U: Signals, Y: Signals, P: Signals, F, G> Numeric<X, U, Y, P, F, G> {
    fn made_of(state: F, output: G) -> Self {
        let (state_size, input_size, parameter_size) = (X::splat(1.0), U::splat(1.0), P::splat(0.0));
        Numeric { state, output, state_size, input_size, parameter_size, outputs: PhantomData }
    }

    /// How large states, inputs and parameters typically are, each in its unit.
    ///
    /// Each is stepped by 6e-6 of this or of its own value, whichever is larger. Left unsaid it is one for states and inputs
    /// and nothing for parameters; say it where a state's own size is far below one, or where a parameter may pass zero.
    pub fn sizes(self, states: Of<X, f64>, inputs: Of<U, f64>, parameters: Of<P, f64>) -> Self {
        Numeric { state_size: states, input_size: inputs, parameter_size: parameters, ..self }
    }

    /// `f` with the slopes that central differences and the chain rule give it.
    fn lifted<S: Scalar, R: Signals>(
        &self,
        f: impl Fn(&Of<X, f64>, &Of<U, f64>, &Of<P, f64>) -> Of<R, f64>,
        x: &Of<X, S>,
        u: &Of<U, S>,
        p: &Of<P, S>,
    ) -> Of<R, S> {
        let values = |v: S| v.value();
        let result = R::map(f(&X::map(*x, values), &U::map(*u, values), &P::map(*p, values)), S::from);
        if TypeId::of::<S>() == TypeId::of::<f64>() {
            return result;
        }
        let variables = joined::<X, U, P, S>(x, u, p);
        let at: Vec<f64> = variables.iter().map(Scalar::value).collect();
        let sizes = joined::<X, U, P, f64>(&self.state_size, &self.input_size, &self.parameter_size);
        let columns = |v: &[f64]| {
            let (x, v) = taken::<X>(v);
            let (u, v) = taken::<U>(v);
            R::into_array(f(&x, &u, &taken::<P>(v).0)).as_ref().to_vec()
        };
        let slopes = central_jacobian(&columns, &at, &sizes);
        let mut result = R::into_array(result);
        for (entry, slopes) in result.as_mut().iter_mut().zip(&slopes) {
            for ((variable, value), slope) in variables.iter().zip(&at).zip(slopes) {
                *entry += (*variable - *value) * *slope;
            }
        }
        R::from_array(result)
    }
}

/// Entries of three vectors in one.
pub(crate) fn joined<X: Signals, U: Signals, P: Signals, T: crate::signals::Entry>(
    x: &Of<X, T>,
    u: &Of<U, T>,
    p: &Of<P, T>,
) -> Vec<T> {
    [X::into_array(*x).as_ref(), U::into_array(*u).as_ref(), P::into_array(*p).as_ref()].concat()
}

/// The first entries as a vector, and the rest.
pub(crate) fn taken<X: Signals>(v: &[f64]) -> (Of<X, f64>, &[f64]) {
    let entry = |i: usize| v.get(i).copied().unwrap_or(f64::NAN);
    (X::from_fn(entry), v.get(X::LEN..).unwrap_or_default())
}

/// `d f[i] / d v[j]` by central differences; each `v[j]` is stepped by 6e-6 of its value or of `sizes[j]`, whichever is
/// larger (of one, where both are zero).
pub(crate) fn central_jacobian(f: &dyn Fn(&[f64]) -> Vec<f64>, at: &[f64], sizes: &[f64]) -> Vec<Vec<f64>> {
    if at.is_empty() {
        return vec![Vec::new(); f(at).len()];
    }
    let scale: Vec<f64> = at.iter().zip(sizes).map(|(v, size)| v.abs().max(size.abs())).collect();
    let scale: Vec<f64> = scale.into_iter().map(|s| if s > 0.0 && s.is_finite() { s } else { 1.0 }).collect();
    let scaled: Vec<f64> = at.iter().zip(&scale).map(|(v, s)| v / s).collect();
    let of_scaled = |z: &Vec<f64>| Ok(f(&z.iter().zip(&scale).map(|(z, s)| z * s).collect::<Vec<f64>>()));
    let mut slopes = finitediff::vec::central_jacobian(&of_scaled)(&scaled).unwrap_or_default();
    for row in &mut slopes {
        row.iter_mut().zip(&scale).for_each(|(slope, scale)| *slope /= scale);
    }
    slopes
}

impl<X: Signals, U: Signals, Y: Signals, P: Signals, F, G> Model for Numeric<X, U, Y, P, F, G>
where
    F: StateEquation<X, U, P>,
    G: Fn(f64, &Of<X, f64>, &Of<U, f64>, &Of<P, f64>) -> Of<Y, f64> + Send + Sync,
{
    type State = X;
    type Input = U;
    type Output = Y;
    type Parameters = P;
    const KIND: Kind = F::KIND;

    fn derivative<S: Scalar>(&self, t: S, x: &Of<X, S>, u: &Of<U, S>, p: &Of<P, S>) -> Of<X, S> {
        self.lifted::<S, X>(|x, u, p| self.state.value(t.value(), x, u, p), x, u, p)
    }

    fn next<S: Scalar>(&self, t: S, x: &Of<X, S>, u: &Of<U, S>, p: &Of<P, S>) -> Of<X, S> {
        self.lifted::<S, X>(|x, u, p| self.state.value(t.value(), x, u, p), x, u, p)
    }

    fn output<S: Scalar>(&self, t: S, x: &Of<X, S>, u: &Of<U, S>, p: &Of<P, S>) -> Of<Y, S> {
        self.lifted::<S, Y>(|x, u, p| (self.output)(t.value(), x, u, p), x, u, p)
    }
}

impl<X: Signals, U: Signals, Y: Signals, P: Signals, F, G> fmt::Debug for Numeric<X, U, Y, P, F, G> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Numeric")
            .field("state_size", &self.state_size)
            .field("input_size", &self.input_size)
            .field("parameter_size", &self.parameter_size)
            .finish_non_exhaustive()
    }
}
