//! [`Method`]: an integrator whose type is not known, for systems whose number of states is known at run time only.

use super::exact::{Exact, STEPS};
use super::{Automatic, Integrator, Rk4, Square, Stiff, Stuck, System};
use crate::dual::Dual;
use crate::error::Error;
use crate::graph::Symbol;
use crate::layout::Kind;
use crate::scalar::Scalar;
use crate::signals::Entry;
use core::fmt::Debug;
use std::sync::Arc;

/// Eight slopes at a time.
pub(crate) type Duals = Dual<8>;

/// `f(position, x, to)`: writes a derivative, or the next state.
pub(crate) type Rate<'a, S> = &'a dyn Fn(f64, &[S], &mut [S]);

/// `f(position, x, value, rows)`: writes a derivative and its Jacobian, row by row, at values of the states.
pub(crate) type Slopes<'a> = &'a dyn Fn(f64, &[f64], &mut [f64], &mut [f64]);

/// An interval of a system that is given by functions.
pub(crate) struct Field<'a, S> {
    pub kind: Kind,
    /// Begin and length (s).
    pub interval: (f64, f64),
    pub states: usize,
    pub rate: Rate<'a, S>,
    pub slopes: Slopes<'a>,
}

/// A square matrix by rows.
#[derive(Clone)]
pub(crate) struct Rows {
    size: usize,
    entries: Vec<f64>,
}

impl Square for Rows {
    fn row(&self, i: usize) -> &[f64] {
        &self.entries[i * self.size..][..self.size]
    }
    fn row_mut(&mut self, i: usize) -> &mut [f64] {
        &mut self.entries[i * self.size..][..self.size]
    }
}

impl<S: Scalar> System for Field<'_, S> {
    type Scalar = S;
    type Vector<T: Entry> = Vec<T>;
    type Matrix = Rows;

    fn kind(&self) -> Kind {
        self.kind
    }

    fn interval(&self) -> (f64, f64) {
        self.interval
    }

    fn vector<T: Entry>(&self, f: impl FnMut(usize) -> T) -> Vec<T> {
        (0..self.states).map(f).collect()
    }

    fn derivative(&self, position: f64, x: &Vec<S>) -> Vec<S> {
        let mut to = vec![S::from(0.0); self.states];
        (self.rate)(position, x, &mut to);
        to
    }

    fn next(&self, x: &Vec<S>) -> Vec<S> {
        self.derivative(0.0, x)
    }

    fn jacobian(&self, position: f64, x: &Vec<f64>) -> (Vec<f64>, Rows) {
        let size = self.states;
        let mut value = vec![0.0; size];
        let mut rows = Rows { size, entries: vec![0.0; size * size] };
        (self.slopes)(position, x, &mut value, &mut rows.entries);
        (value, rows)
    }

    fn along(&self, x: &Vec<S>, part: f64, k: &Vec<S>) -> Vec<S> {
        let a = self.interval.1 * part;
        x.iter().zip(k).map(|(x, k)| x.plus_times(*k, a)).collect()
    }
}

/// The same system, the number of whose states the compiler knows.
struct OfSize<'f, 'a, S, const N: usize>(&'f Field<'a, S>);

impl<const N: usize> Square for [[f64; N]; N] {
    fn row(&self, i: usize) -> &[f64] {
        &self[i]
    }
    fn row_mut(&mut self, i: usize) -> &mut [f64] {
        &mut self[i]
    }
}

impl<S: Scalar, const N: usize> System for OfSize<'_, '_, S, N> {
    type Scalar = S;
    type Vector<T: Entry> = [T; N];
    type Matrix = [[f64; N]; N];

    fn kind(&self) -> Kind {
        self.0.kind
    }

    fn interval(&self) -> (f64, f64) {
        self.0.interval
    }

    #[inline(always)]
    fn vector<T: Entry>(&self, f: impl FnMut(usize) -> T) -> [T; N] {
        core::array::from_fn(f)
    }

    #[inline(always)]
    fn derivative(&self, position: f64, x: &[S; N]) -> [S; N] {
        let mut to = [S::from(0.0); N];
        (self.0.rate)(position, x, &mut to);
        to
    }

    #[inline(always)]
    fn next(&self, x: &[S; N]) -> [S; N] {
        self.derivative(0.0, x)
    }

    fn jacobian(&self, position: f64, x: &[f64; N]) -> ([f64; N], [[f64; N]; N]) {
        let (mut value, mut rows) = ([0.0; N], [[0.0; N]; N]);
        (self.0.slopes)(position, x, &mut value, rows.as_flattened_mut());
        (value, rows)
    }

    #[inline(always)]
    fn along(&self, x: &[S; N], part: f64, k: &[S; N]) -> [S; N] {
        let a = self.0.interval.1 * part;
        core::array::from_fn(|i| x[i].plus_times(k[i], a))
    }
}

/// Replaces the first `N` states by those at the end of the interval.
fn advance_sized<const N: usize>(
    integrator: &impl Integrator,
    field: &Field<'_, Duals>,
    x: &mut [Duals],
    step: &mut f64,
) -> Result<(), Stuck> {
    let (begin, _) = x.as_chunks_mut::<N>();
    begin[0] = integrator.advance(&OfSize(field), begin[0], step)?;
    Ok(())
}

/// An interval of a system in symbols.
pub(crate) struct SymbolicField<'a> {
    pub kind: Kind,
    /// In s.
    pub length: Symbol,
    pub states: usize,
    pub rate: Rate<'a, Symbol>,
}

impl System for SymbolicField<'_> {
    type Scalar = Symbol;
    type Vector<T: Entry> = Vec<T>;
    type Matrix = Rows;

    fn kind(&self) -> Kind {
        self.kind
    }

    fn interval(&self) -> (f64, f64) {
        Symbol::fail("its integrator asks for the interval in numbers");
        (f64::NAN, f64::NAN)
    }

    fn vector<T: Entry>(&self, f: impl FnMut(usize) -> T) -> Vec<T> {
        (0..self.states).map(f).collect()
    }

    fn derivative(&self, position: f64, x: &Vec<Symbol>) -> Vec<Symbol> {
        let mut to = vec![Symbol::default(); self.states];
        (self.rate)(position, x, &mut to);
        to
    }

    fn next(&self, x: &Vec<Symbol>) -> Vec<Symbol> {
        self.derivative(0.0, x)
    }

    fn jacobian(&self, _position: f64, x: &Vec<f64>) -> (Vec<f64>, Rows) {
        Symbol::fail("its integrator asks for a Jacobian in numbers");
        let size = x.len();
        (x.clone(), Rows { size, entries: vec![f64::NAN; size * size] })
    }

    fn along(&self, x: &Vec<Symbol>, part: f64, k: &Vec<Symbol>) -> Vec<Symbol> {
        if part == 0.0 {
            return x.clone();
        }
        let h = self.length * part;
        x.iter().zip(k).map(|(x, k)| x.along(*k, h)).collect()
    }
}

/// An [`Integrator`] as an object.
pub(crate) trait Method: Debug + Send + Sync {
    /// Replaces the state at the begin of the interval by that at its end.
    fn advance_values(&self, field: &Field<'_, f64>, x: &mut [f64], step: &mut f64) -> Result<(), Stuck>;
    fn advance_duals(&self, field: &Field<'_, Duals>, x: &mut [Duals], step: &mut f64) -> Result<(), Stuck>;
    fn advance_symbols(&self, field: &SymbolicField<'_>, x: Vec<Symbol>) -> Result<Vec<Symbol>, Stuck>;
    fn is_fixed(&self) -> bool;
    /// Whether linear equations with constant coefficients are to be taken from sample to sample exactly, and not by this method.
    fn is_exact(&self) -> bool {
        false
    }
    /// This method with a finer step, if there is one.
    fn refined(&self, kind: Kind) -> Option<Arc<dyn Method>>;
    /// Refuses models of a kind that the method does not serve, and settings that make no sense.
    fn check(&self, kind: Kind) -> Result<(), Error>;
    fn describe(&self, kind: Kind) -> String;
}

impl<I: Integrator> Method for I {
    fn advance_values(&self, field: &Field<'_, f64>, x: &mut [f64], step: &mut f64) -> Result<(), Stuck> {
        x.copy_from_slice(&self.advance(field, x.to_vec(), step)?);
        Ok(())
    }

    /// Numbers with slopes are long: of a few, no more are moved than there are.
    fn advance_duals(&self, field: &Field<'_, Duals>, x: &mut [Duals], step: &mut f64) -> Result<(), Stuck> {
        match x.len() {
            1 => advance_sized::<1>(self, field, x, step),
            2 => advance_sized::<2>(self, field, x, step),
            3 => advance_sized::<3>(self, field, x, step),
            4 => advance_sized::<4>(self, field, x, step),
            _ => {
                x.copy_from_slice(&self.advance(field, x.to_vec(), step)?);
                Ok(())
            }
        }
    }

    fn advance_symbols(&self, field: &SymbolicField<'_>, x: Vec<Symbol>) -> Result<Vec<Symbol>, Stuck> {
        self.advance(field, x, &mut 0.0)
    }

    fn is_fixed(&self) -> bool {
        I::FIXED
    }

    fn refined(&self, kind: Kind) -> Option<Arc<dyn Method>> {
        Some(Arc::new(Integrator::refined(self, kind)?))
    }

    fn check(&self, kind: Kind) -> Result<(), Error> {
        if self.serves(kind) {
            return Integrator::check(self);
        }
        let word = |kind| match kind {
            Kind::Continuous => "continuous",
            Kind::Discrete => "discrete",
            Kind::Static => "static",
        };
        let kinds = [Kind::Continuous, Kind::Discrete, Kind::Static];
        let serves = kinds.into_iter().find(|&kind| self.serves(kind)).map_or("no", word);
        Err(Error::WrongIntegrator { model: word(kind), integrator: Integrator::describe(self, kind), serves })
    }

    fn describe(&self, kind: Kind) -> String {
        Integrator::describe(self, kind)
    }
}

/// The default method with this number of steps per sample. It is not generic, nor inlined, so that it is compiled with the
/// library and not with each model; nor is [`stiff`].
#[inline(never)]
pub(crate) fn automatic(substeps: u32) -> Arc<dyn Method> {
    Arc::new(Automatic { continuous: Rk4 { substeps } })
}

/// The method for other equations beside those that this one serves: steps, where it is exact.
pub(crate) fn stepped(method: &Arc<dyn Method>) -> Arc<dyn Method> {
    if method.is_exact() { automatic(STEPS) } else { method.clone() }
}

/// The default method of filters of linear equations with constant coefficients.
pub(crate) fn exact() -> Arc<dyn Method> {
    Arc::new(Exact)
}

/// The last of the default methods.
#[inline(never)]
pub(crate) fn stiff() -> Arc<dyn Method> {
    Arc::new(Stiff::default())
}
