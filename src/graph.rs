//! [`Graph`]: arithmetic as a value.
//!
//! A graph is a list of nodes, each of which names its operands by their [`Id`]s; equal nodes are kept once, and what is
//! known is computed at once. It is made by hand ([`Graph::add`], [`Graph::function`], ...) or read off generic Rust code,
//! which is run once with [`Symbol`]s for numbers ([`Graph::trace`]).
//!
//! **Values are those of the text.** A sum of a product is rounded twice, as it stands; nothing is reordered, and `x * 0` is
//! not zero where `x` is not a number. Only a quotient may be the product with the reciprocal, as in
//! [`Dual`](crate::Dual).
//!
//! ```
//! use greybox::graph::{Function, Graph, Leaf};
//! let mut graph = Graph::default();
//! let (x, p) = (graph.leaf(Leaf::State(0)), graph.leaf(Leaf::Parameter(0)));
//! let px = graph.mul(p, x);
//! let root = graph.function(Function::Exp, px);
//! let value = graph.evaluate::<f64>(&[root], |leaf| if leaf == Leaf::State(0) { 2.0 } else { 0.5 })[0];
//! assert_eq!(value, 1f64.exp());
//! ```

mod build;
mod choices;
mod differentiate;
mod display;
mod evaluate;
mod function;
mod node;
mod partials;
mod serial;
mod symbol;
mod tape;
mod trace;

pub(crate) use choices::{Choices, choices};
pub use differentiate::Seed;
pub(crate) use differentiate::{Following, Pattern, Tangent, Variables, Way, narrow, slopes};
pub use function::{Function, Function2};
pub(crate) use node::{Constant, Node};
pub use node::{Id, Leaf};
pub use symbol::Symbol;
pub(crate) use tape::Tape;
pub use trace::Untraceable;

use crate::scalar::Table;
use rustc_hash::FxHashMap;
use std::sync::Arc;

/// Arithmetic as a value: nodes, each after its operands.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
#[serde(into = "serial::Nodes", try_from = "serial::Nodes")]
pub struct Graph {
    nodes: Vec<Node>,
    tables: Vec<Arc<Table>>,
    known: FxHashMap<Node, Id>,
}

impl PartialEq for Graph {
    fn eq(&self, other: &Self) -> bool {
        self.nodes == other.nodes && self.tables == other.tables
    }
}

impl Graph {
    /// All nodes, in an order in which each comes after its operands.
    pub(crate) fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// The tables that nodes name by their numbers.
    pub fn tables(&self) -> &[Arc<Table>] {
        &self.tables
    }

    /// Takes the tables of another graph for its own, by the same numbers.
    pub(crate) fn share_tables(&mut self, other: &Graph) {
        self.tables.clone_from(&other.tables);
    }

    /// The node of an identifier; not a number, if the graph has no such node.
    pub(crate) fn node(&self, id: Id) -> Node {
        self.nodes.get(id.index()).copied().unwrap_or(Node::Constant(Constant::from(f64::NAN)))
    }

    /// How many nodes there are.
    pub fn len(&self) -> usize {
        self.nodes.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.nodes.is_empty()
    }

    /// Which nodes the roots are made of, by number.
    pub fn reached(&self, roots: &[Id]) -> Vec<bool> {
        let mut reached = vec![false; self.nodes.len()];
        for root in roots {
            if let Some(reached) = reached.get_mut(root.index()) {
                *reached = true;
            }
        }
        for i in (0..self.nodes.len()).rev() {
            if reached[i] {
                for operand in self.nodes[i].operands() {
                    reached[operand.index()] = true;
                }
            }
        }
        reached
    }

    /// The graph of these roots alone, and where they stand in it.
    pub fn pruned(&self, roots: &[Id]) -> (Graph, Vec<Id>) {
        let reached = self.reached(roots);
        let mut graph = Graph { tables: self.tables.clone(), ..Graph::default() };
        let mut new = vec![Id::default(); self.nodes.len()];
        for (i, node) in self.nodes.iter().enumerate().filter(|(i, _)| reached[*i]) {
            new[i] = graph.put(node.with_operands(|id| new[id.index()]));
        }
        let mut moved = |root: &Id| new.get(root.index()).copied().unwrap_or_else(|| graph.constant(f64::NAN));
        let roots = roots.iter().map(&mut moved).collect();
        (graph, roots)
    }
}
