//! [`Recurrence`]: what happens from one sample to the next, as one graph.

use crate::equations::Equations;
use crate::graph::{Graph, Id, Leaf, Node, Symbol, Untraceable};
use crate::integrate::{Integrator, Square, System};
use crate::interval::Hold;
use crate::layout::Kind;
use crate::signals::Entry;

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
    /// The simulation of equations by a method of fixed steps: the state is carried.
    ///
    /// # Errors
    /// If the method looks at the numbers that it steps.
    pub fn new<I: Integrator>(equations: &Equations, integrator: &I, hold: Hold) -> Result<Self, Untraceable> {
        if !I::FIXED {
            return Err(Untraceable { reason: "the steps of its integrator depend on the state".to_owned() });
        }
        let mut graph = Graph::default();
        let mean = graph.import(equations.graph(), equations.output(), Graph::leaf);
        let states = u32::try_from(equations.layout().states.len()).unwrap_or(u32::MAX);
        let next = graph.trace(|| {
            let system = SymbolicSystem { equations, hold };
            let x = (0..states).map(|i| Symbol::leaf(Leaf::State(i))).collect();
            integrator.advance(&system, x, &mut 0.0).unwrap_or_else(|_| {
                Symbol::fail("its integrator cannot cross an interval");
                vec![]
            })
        })?;
        Recurrence::from_roots(&graph, &next, &mean, &[]).map_err(|wrong| Untraceable { reason: wrong.to_string() })
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

    /// What is carried to the next sample.
    pub fn next(&self) -> &[Id] {
        &self.next
    }

    /// What is expected of each output.
    pub fn mean(&self) -> &[Id] {
        &self.mean
    }

    /// The variance of each output about that; empty where it is not predicted.
    pub fn variance(&self) -> &[Id] {
        &self.variance
    }
}

/// The equations of one interval in symbols.
pub(crate) struct SymbolicSystem<'a> {
    pub equations: &'a Equations,
    pub hold: Hold,
}

impl SymbolicSystem<'_> {
    fn input(&self, i: u32, position: f64) -> Symbol {
        let u0 = Symbol::leaf(Leaf::Input(i));
        match self.hold {
            Hold::First if position != 0.0 => u0 + (Symbol::leaf(Leaf::NextInput(i)) - u0) * position,
            _ => u0,
        }
    }

    fn right_hand_side(&self, position: f64, x: &[Symbol]) -> Vec<Symbol> {
        let begin = Symbol::leaf(Leaf::Time);
        let t = if position == 0.0 { begin } else { begin + Symbol::leaf(Leaf::Step) * position };
        self.equations.graph().evaluate(self.equations.state(), |leaf| match leaf {
            Leaf::Time => t,
            Leaf::State(i) => x.get(i as usize).copied().unwrap_or_default(),
            Leaf::Input(i) => self.input(i, position),
            _ => Symbol::leaf(leaf),
        })
    }
}

impl System for SymbolicSystem<'_> {
    type Scalar = Symbol;
    type Vector<T: Entry> = Vec<T>;
    type Matrix = DenseRows;

    fn kind(&self) -> Kind {
        self.equations.layout().kind
    }

    fn interval(&self) -> (f64, f64) {
        Symbol::fail("its integrator asks for the interval in numbers");
        (f64::NAN, f64::NAN)
    }

    fn vector<T: Entry>(&self, f: impl FnMut(usize) -> T) -> Vec<T> {
        (0..self.equations.layout().states.len()).map(f).collect()
    }

    fn derivative(&self, position: f64, x: &Vec<Symbol>) -> Vec<Symbol> {
        self.right_hand_side(position, x)
    }

    fn next(&self, x: &Vec<Symbol>) -> Vec<Symbol> {
        self.right_hand_side(0.0, x)
    }

    fn jacobian(&self, _position: f64, x: &Vec<f64>) -> (Vec<f64>, DenseRows) {
        Symbol::fail("its integrator asks for a Jacobian in numbers");
        (vec![f64::NAN; x.len()], DenseRows::new(x.len()))
    }

    fn along(&self, x: &Vec<Symbol>, part: f64, k: &Vec<Symbol>) -> Vec<Symbol> {
        if part == 0.0 {
            return x.clone();
        }
        let h = Symbol::leaf(Leaf::Step) * part;
        x.iter().zip(k).map(|(x, k)| x.along(*k, h)).collect()
    }
}

/// A square matrix by rows whose size is known at run time.
#[derive(Clone, Debug)]
pub(crate) struct DenseRows {
    size: usize,
    entries: Vec<f64>,
}

impl DenseRows {
    /// Zeros.
    pub fn new(size: usize) -> Self {
        DenseRows { size, entries: vec![0.0; size * size] }
    }
}

impl Square for DenseRows {
    fn row(&self, i: usize) -> &[f64] {
        &self.entries[i * self.size..][..self.size]
    }
    fn row_mut(&mut self, i: usize) -> &mut [f64] {
        &mut self.entries[i * self.size..][..self.size]
    }
}
