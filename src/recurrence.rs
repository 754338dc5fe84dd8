//! [`Recurrence`]: what happens from one sample to the next, as one graph.

use crate::equations::Equations;
use crate::graph::{Graph, Id, Leaf, Node, Symbol};
use crate::integrate::{Method, Rate, SymbolicField};
use crate::interval::Hold;
use crate::layout::Kind;
use crate::record::Holds;

/// A recurrence: what it carries from sample to sample, what it expects of each output.
///
/// Its graph is made of what is carried ([`Leaf::State`]), the sample's time, inputs and measurements, the next sample's
/// inputs, the time between the two, and parameters.
#[derive(Clone, Debug)]
pub struct Recurrence {
    graph: Graph,
    next: Vec<Id>,
    mean: Vec<Id>,
    variance: Vec<Id>,
}

/// Roots that make no recurrence.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum InvalidRecurrence {
    /// A carried entry that has no next value.
    #[error(
        "the recurrence depends on entry {entry} of what is carried, but carries {carried}; give each its next value"
    )]
    NotCarried {
        /// The entry's number.
        entry: u32,
        /// How many are carried.
        carried: usize,
    },
    /// Variances of some outputs only.
    #[error("the recurrence has {variances} variances for {means} outputs; give none, or one for each")]
    Variances {
        /// Outputs.
        means: usize,
        /// Variances.
        variances: usize,
    },
}

impl Recurrence {
    /// A recurrence that carries no outputs.
    pub(crate) fn without_outputs(&self) -> Self {
        let (graph, next) = self.graph.pruned(&self.next);
        Recurrence { graph, next, mean: vec![], variance: vec![] }
    }

    /// A recurrence by the nodes of what is carried next, of the outputs' means, and of their variances, if it has any.
    ///
    /// # Errors
    /// If it depends on what it does not carry.
    pub fn from_roots(graph: &Graph, next: &[Id], mean: &[Id], variance: &[Id]) -> Result<Self, InvalidRecurrence> {
        if !variance.is_empty() && variance.len() != mean.len() {
            return Err(InvalidRecurrence::Variances { means: mean.len(), variances: variance.len() });
        }
        let (graph, roots) = graph.pruned(&[next, mean, variance].concat());
        for node in graph.nodes() {
            if let Node::Leaf(Leaf::State(entry)) = *node
                && entry as usize >= next.len()
            {
                return Err(InvalidRecurrence::NotCarried { entry, carried: next.len() });
            }
        }
        let (next, rest) = roots.split_at(next.len());
        let (mean, variance) = rest.split_at(mean.len());
        Ok(Recurrence { next: next.to_vec(), mean: mean.to_vec(), variance: variance.to_vec(), graph })
    }

    /// The arithmetic.
    pub fn graph(&self) -> &Graph {
        &self.graph
    }

    /// The carry to the next sample.
    pub fn next(&self) -> &[Id] {
        &self.next
    }

    /// The prediction of each output.
    pub fn mean(&self) -> &[Id] {
        &self.mean
    }

    /// The variance of each output about that; empty where it is not predicted.
    pub fn variance(&self) -> &[Id] {
        &self.variance
    }
}

/// The equations from one sample to the next, in symbols: what is computed with it belongs to a trace.
pub(crate) struct SymbolicInterval<'a> {
    pub equations: &'a Equations,
    pub method: &'a dyn Method,
    /// Of each input.
    pub holds: &'a Holds,
}

impl SymbolicInterval<'_> {
    fn input(&self, i: u32, position: f64) -> Symbol {
        let u0 = Symbol::leaf(Leaf::Input(i));
        match self.holds.of(i as usize) {
            Hold::First if position != 0.0 => u0 + (Symbol::leaf(Leaf::NextInput(i)) - u0) * position,
            _ => u0,
        }
    }

    /// Roots of a graph of the equations' quantities, at a fraction of the interval.
    pub fn at(&self, graph: &Graph, roots: &[Id], position: f64, x: &[Symbol]) -> Vec<Symbol> {
        let begin = Symbol::leaf(Leaf::Time);
        let t = if position == 0.0 { begin } else { begin + Symbol::leaf(Leaf::Step) * position };
        graph.evaluate(roots, |leaf| match leaf {
            Leaf::Time => t,
            Leaf::State(i) => x.get(i as usize).copied().unwrap_or_default(),
            Leaf::Input(i) => self.input(i, position),
            _ => Symbol::leaf(leaf),
        })
    }

    /// `dx/dt`, or the next state of discrete equations.
    pub fn rate(&self, position: f64, x: &[Symbol], to: &mut [Symbol]) {
        let found = self.at(self.equations.graph(), self.equations.state(), position, x);
        to.iter_mut().zip(found).for_each(|(to, found)| *to = found);
    }

    /// The outputs at the sample.
    pub fn output(&self, x: &[Symbol]) -> Vec<Symbol> {
        self.at(self.equations.graph(), self.equations.output(), 0.0, x)
    }

    /// The state at the next sample.
    pub fn next(&self, x: &mut [Symbol]) {
        let kind = self.equations.layout().kind;
        self.cross(kind, x, &|position, x, to| self.rate(position, x, to));
    }

    /// Any vector at the next sample, by its rate.
    pub fn cross(&self, kind: Kind, z: &mut [Symbol], rate: Rate<'_, Symbol>) {
        if !self.method.is_fixed() {
            return Symbol::fail("the steps of its integrator depend on the state");
        }
        match self.method.advance_symbols(&SymbolicField { kind, states: z.len(), rate }, z.to_vec()) {
            Ok(end) => z.copy_from_slice(&end),
            Err(_) => Symbol::fail("its integrator cannot cross an interval"),
        }
    }
}
