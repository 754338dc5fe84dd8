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

/// Value and Jacobian (by rows) of a derivative, at a position and values of the states.
pub(crate) type Slopes<'a> = &'a dyn Fn(f64, &[f64]) -> (Vec<f64>, Vec<Vec<f64>>);

/// An interval of a system that is given by functions.
pub(crate) struct Field<'a, S> {
    pub kind: Kind,
    /// Begin and length (s).
    pub interval: (f64, f64),
    pub states: usize,
    pub rate: Rate<'a, S>,
    pub slopes: Slopes<'a>,
}

impl Square for Vec<Vec<f64>> {
    fn row(&self, i: usize) -> &[f64] {
        &self[i]
    }
    fn row_mut(&mut self, i: usize) -> &mut [f64] {
        &mut self[i]
    }
}

impl<S: Scalar> System for Field<'_, S> {
    type Scalar = S;
    type Vector<T: Entry> = Vec<T>;
    type Matrix = Vec<Vec<f64>>;

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

    fn jacobian(&self, position: f64, x: &Vec<f64>) -> (Vec<f64>, Vec<Vec<f64>>) {
        (self.slopes)(position, x)
    }

    fn along(&self, x: &Vec<S>, part: f64, k: &Vec<S>) -> Vec<S> {
        let a = self.interval.1 * part;
        x.iter().zip(k).map(|(x, k)| x.plus_times(*k, a)).collect()
    }
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
    type Matrix = Vec<Vec<f64>>;

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

    fn jacobian(&self, _position: f64, x: &Vec<f64>) -> (Vec<f64>, Vec<Vec<f64>>) {
        Symbol::fail("its integrator asks for a Jacobian in numbers");
        (x.clone(), vec![x.clone(); x.len()])
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
    fn advance_values(&self, field: &Field<'_, f64>, x: Vec<f64>, step: &mut f64) -> Result<Vec<f64>, Stuck>;
    fn advance_duals(&self, field: &Field<'_, Duals>, x: Vec<Duals>, step: &mut f64) -> Result<Vec<Duals>, Stuck>;
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
    fn advance_values(&self, field: &Field<'_, f64>, x: Vec<f64>, step: &mut f64) -> Result<Vec<f64>, Stuck> {
        self.advance(field, x, step)
    }

    fn advance_duals(&self, field: &Field<'_, Duals>, x: Vec<Duals>, step: &mut f64) -> Result<Vec<Duals>, Stuck> {
        self.advance(field, x, step)
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
