//! [`SymbolicInterval`]: equations from one sample to the next, in symbols.

use super::late::{LateInputs, Part};
use crate::equations::Equations;
use crate::graph::{Graph, Id, Leaf, Symbol};
use crate::integrate::{Method, Rate, SymbolicField};
use crate::interval::Hold;
use crate::layout::Kind;
use crate::record::Holds;
use crate::scalar::{Comparison, Scalar};
use crate::transition::Crossing;
use core::cell::{Cell, OnceCell};

/// The equations from one sample to the next: what is computed with it belongs to one trace.
pub(crate) struct SymbolicInterval<'a> {
    equations: &'a Equations,
    method: &'a dyn Method,
    /// Of each input.
    holds: &'a Holds,
    /// Made in the trace.
    late: OnceCell<LateInputs>,
    /// Of a method that is exact; made in the trace.
    crossing: OnceCell<Option<Crossing<Symbol>>>,
    /// The part between two cuts that is being crossed.
    part: Cell<Option<Part>>,
}

impl<'a> SymbolicInterval<'a> {
    pub fn new(equations: &'a Equations, method: &'a dyn Method, holds: &'a Holds) -> Self {
        SymbolicInterval {
            equations,
            method,
            holds,
            late: OnceCell::new(),
            crossing: OnceCell::new(),
            part: Cell::new(None),
        }
    }

    pub fn equations(&self) -> &'a Equations {
        self.equations
    }

    fn late(&self) -> &LateInputs {
        self.late.get_or_init(|| LateInputs::of(self.equations))
    }

    /// How much after the sample (s).
    fn after(&self, position: f64) -> Symbol {
        let (begin, length) = match self.part.get() {
            Some(Part { begin, length, .. }) => (begin, length),
            None => (Symbol::default(), Symbol::leaf(Leaf::Step)),
        };
        if position == 0.0 { begin } else { begin + length * position }
    }

    fn input(&self, i: u32, position: f64) -> Symbol {
        let (hold, number) = (self.holds.of(i as usize), self.part.get().map(|part| part.number));
        if let Some(late) = self.late().input(i, hold, number, || self.after(position)) {
            return late;
        }
        let u0 = Symbol::leaf(Leaf::Input(i));
        let fraction = match number {
            Some(_) => self.after(position) / Symbol::leaf(Leaf::Step),
            None => Symbol::from(position),
        };
        match hold {
            Hold::First if position != 0.0 || number.is_some() => {
                u0 + (Symbol::leaf(Leaf::NextInput(i)) - u0) * fraction
            }
            _ => u0,
        }
    }

    /// Roots of a graph of the equations' quantities, at a fraction of the interval, or of the part that is being crossed.
    pub fn at(&self, graph: &Graph, roots: &[Id], position: f64, x: &[Symbol]) -> Vec<Symbol> {
        let begin = Symbol::leaf(Leaf::Time);
        let t = if position == 0.0 && self.part.get().is_none() { begin } else { begin + self.after(position) };
        graph.evaluate(roots, |leaf| match leaf {
            Leaf::Time => t,
            Leaf::State(i) => x.get(i as usize).copied().unwrap_or_default(),
            Leaf::Input(i) => self.input(i, position),
            _ => Symbol::leaf(leaf),
        })
    }

    /// `dx/dt`, or the next state of discrete equations.
    pub fn rate(&self, position: f64, x: &[Symbol], to: &mut [Symbol]) {
        let found = self.at(self.equations.graph(), &self.equations.roots().state, position, x);
        to.iter_mut().zip(found).for_each(|(to, found)| *to = found);
    }

    /// The outputs at the sample.
    pub fn output(&self, x: &[Symbol]) -> Vec<Symbol> {
        self.at(self.equations.graph(), &self.equations.roots().output, 0.0, x)
    }

    /// The transition of linear equations, where the method is exact: numbers that follow from parameters.
    pub fn crossing(&self) -> Option<&Crossing<Symbol>> {
        let made = || {
            let linear = self.method.is_exact().then(|| self.equations.linear()).flatten()?;
            Some(linear.crossing(|following| Symbol::leaf(Leaf::Parameter(following.number))))
        };
        self.crossing.get_or_init(made).as_ref()
    }

    /// The state after the sample.
    pub fn jump(&self, x: &mut [Symbol]) {
        let after = self.at(self.equations.graph(), &self.equations.roots().jump, 0.0, x);
        x.iter_mut().zip(after).for_each(|(x, after)| *x = self.if_time_passes(after, *x));
    }

    /// One of two numbers, by whether the next sample is at another instant.
    pub fn if_time_passes(&self, then: Symbol, or: Symbol) -> Symbol {
        Symbol::select(Comparison::Less, Symbol::default(), Symbol::leaf(Leaf::Step), then, or)
    }

    /// The state at the next sample.
    pub fn next(&self, x: &mut [Symbol]) {
        self.jump(x);
        self.flow(x);
    }

    /// The state at the next sample, from the state after the jump at this one.
    pub fn flow(&self, x: &mut [Symbol]) {
        if let Some(crossing) = self.crossing() {
            return crossing.state(x, !self.holds.all_zero(), |position, x, to| self.rate(position, x, to));
        }
        let kind = self.equations.layout().kind;
        self.cross(kind, x, &|position, x, to| self.rate(position, x, to));
    }

    /// Any vector at the next sample, by its rate.
    pub fn cross(&self, kind: Kind, z: &mut [Symbol], rate: Rate<'_, Symbol>) {
        if !self.method.is_fixed() {
            return Symbol::fail("the steps of its integrator depend on the state");
        }
        let parts = if kind == Kind::Discrete { vec![] } else { self.late().parts() };
        if parts.is_empty() {
            return self.advance(kind, Symbol::leaf(Leaf::Step), z, rate);
        }
        for part in parts {
            self.part.set(Some(part));
            self.advance(kind, part.length, z, rate);
            self.part.set(None);
        }
    }

    fn advance(&self, kind: Kind, length: Symbol, z: &mut [Symbol], rate: Rate<'_, Symbol>) {
        match self.method.advance_symbols(&SymbolicField { kind, length, states: z.len(), rate }, z.to_vec()) {
            Ok(end) => z.copy_from_slice(&end),
            Err(_) => Symbol::fail("its integrator cannot cross an interval"),
        }
    }
}
