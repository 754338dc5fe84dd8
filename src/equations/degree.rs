//! The degree of equations in some of their quantities.

use crate::graph::{Graph, Id, Leaf, Node};

/// How a node depends on the quantities.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Degree {
    Zero,
    One,
    Higher,
}

/// The degree of each node in the quantities that are asked for.
pub(super) fn degrees(graph: &Graph, counts: &dyn Fn(Leaf) -> bool) -> Vec<Degree> {
    let mut degrees: Vec<Degree> = Vec::with_capacity(graph.len());
    for node in graph.nodes() {
        let of = |id: Id| degrees[id.index()];
        let product = |a: Degree, b: Degree| match (a, b) {
            (Degree::Zero, other) | (other, Degree::Zero) => other,
            _ => Degree::Higher,
        };
        let constant = |needed: Degree, result: Degree| if needed == Degree::Zero { result } else { Degree::Higher };
        let degree = match *node {
            Node::Constant(_) => Degree::Zero,
            Node::Leaf(leaf) if counts(leaf) => Degree::One,
            Node::Leaf(_) => Degree::Zero,
            Node::Neg(a) => of(a),
            Node::Add(a, b) | Node::Sub(a, b) => of(a).max(of(b)),
            Node::Mul(a, b) => product(of(a), of(b)),
            Node::Div(a, b) => constant(of(b), of(a)),
            Node::MulAdd([a, b, c]) => product(of(a), of(b)).max(of(c)),
            Node::Select(_, [a, b, c, d]) => constant(of(a).max(of(b)), of(c).max(of(d))),
            _ => constant(node.operands().map(of).max().unwrap_or(Degree::Zero), Degree::Zero),
        };
        degrees.push(degree);
    }
    degrees
}
