//! The operations that a Jacobian is cut at.

use super::forward::{Tangents, active, plus_times, tangent, varying_operands};
use super::{Tangent, Variables};
use crate::graph::partials::{Partial, Rule};
use crate::graph::tape::Tape;
use crate::graph::{Function, Function2, Id, Leaf, Node};

/// Gradients of some nodes with respect to others.
type Gradients = fn(&mut Tape, &[Id], &[Id]) -> Vec<Tangent>;

/// The cuts between variables and roots, each after those that it depends on.
pub(super) struct Cuts(Vec<Id>);

impl Cuts {
    pub fn new(tape: &Tape, roots: &[Id], variables: &Variables) -> Self {
        let active = active(tape, &variables.leaves, roots);
        let (growth, positive) = (growth(tape), positive(tape));
        let mut sound = vec![true; tape.graph.len()];
        let mut cuts = vec![];
        for (i, node) in tape.graph.nodes().iter().enumerate().filter(|(i, _)| active[*i]) {
            let operands_sound = varying_operands(node).all(|id| !active[id.index()] || sound[id.index()]);
            let regular = matches!(*node, Node::Function(Function::Sqrt, a) if positive[a.index()] == Some(true));
            let singular = !regular && is_singular(tape, node);
            if singular || matches!(node, Node::Select(..)) && !operands_sound {
                cuts.push(Id::new(i));
                sound[i] = false;
            } else {
                sound[i] = operands_sound && has_finite_partials(node, &growth);
            }
        }
        Cuts(cuts)
    }

    /// How many.
    pub fn count(&self) -> usize {
        self.0.len()
    }

    /// The slopes of the roots by gradients and the chain rule.
    pub fn slopes(&self, tape: &mut Tape, roots: &[Id], variables: &Variables, gradients: Gradients) -> Vec<Tangent> {
        let leaves: Vec<Id> = variables.leaves.iter().chain(&self.0).copied().collect();
        let mut known: Tangents = variables.leaves.iter().copied().zip(variables.tangents.iter().cloned()).collect();
        for cut in &self.0 {
            let rule = tape.rule(*cut);
            let operands: Vec<Id> = match &rule {
                Rule::Singular(terms) => terms.iter().map(|(operand, _)| *operand).collect(),
                Rule::Select(_, [_, _, then, otherwise]) => vec![*then, *otherwise],
                Rule::Length(_, a, b) => vec![*a, *b],
                Rule::Flat | Rule::Linear(_) => vec![],
            };
            let mut of_operands = Tangents::default();
            for (operand, gradient) in operands.iter().zip(gradients(tape, &operands, &leaves)) {
                of_operands.insert(*operand, chained(tape, &gradient, &leaves, &known, variables.seeds));
            }
            let slopes = tangent(tape, &rule, &of_operands, variables.seeds);
            known.insert(*cut, slopes);
        }
        let gradients = gradients(tape, roots, &leaves);
        gradients.iter().map(|gradient| chained(tape, gradient, &leaves, &known, variables.seeds)).collect()
    }
}

/// The chain rule: a gradient times the slopes of what it is taken with respect to.
fn chained(tape: &mut Tape, gradient: &Tangent, leaves: &[Id], known: &Tangents, seeds: usize) -> Tangent {
    let slope = |s: usize| {
        let terms = leaves.iter().zip(gradient).filter_map(|(leaf, partial)| {
            let slope = known.get(leaf).and_then(|tangent| tangent[s])?;
            partial.map(|partial| (slope, partial))
        });
        terms.fold(None, |sum, (slope, partial)| plus_times(tape, sum, slope, Partial::Node(partial)))
    };
    (0..seeds).map(slope).collect()
}

/// Whether a slope may be infinite where the value is finite, or is no product of the operands' slopes.
fn is_singular(tape: &Tape, node: &Node) -> bool {
    match *node {
        Node::Function(function, _) => {
            matches!(function, Function::Sqrt | Function::Cbrt | Function::Asin | Function::Acos | Function::Acosh)
        }
        Node::Function2(Function2::Hypot, ..) => true,
        Node::Function2(Function2::Pow, _, n) => tape.graph.known(n).is_none_or(|n| n < 1.0),
        _ => false,
    }
}

/// Whether each value is above a positive number (true) or at least not negative (false), if that can be said.
fn positive(tape: &Tape) -> Vec<Option<bool>> {
    let mut positive: Vec<Option<bool>> = Vec::with_capacity(tape.graph.len());
    for node in tape.graph.nodes() {
        let of = |id: Id| positive[id.index()];
        positive.push(match *node {
            Node::Constant(constant) if constant.value() >= 0.0 => Some(constant.value() > 0.0),
            Node::Mul(a, b) if a == b => Some(of(a) == Some(true)),
            Node::Mul(a, b) => of(a).zip(of(b)).map(|_| false),
            Node::Add(a, b) => of(a).zip(of(b)).map(|(a, b)| a || b),
            Node::Function(Function::Abs | Function::Sqrt | Function::Exp, _) => Some(false),
            Node::Function(Function::Cosh, _) => Some(true),
            _ => None,
        });
    }
    positive
}

/// Without bound, or not a number.
const UNBOUNDED: u32 = u32::MAX;

/// The power of the leaves that each value grows with at most; leaves are taken to be below 1e150.
fn growth(tape: &Tape) -> Vec<u32> {
    let mut growth: Vec<u32> = Vec::with_capacity(tape.graph.len());
    for node in tape.graph.nodes() {
        let of = |id: Id| growth[id.index()];
        let largest = || node.operands().map(of).max().unwrap_or(UNBOUNDED);
        growth.push(match *node {
            Node::Constant(constant) if constant.value().abs() < 1e100 => 0,
            Node::Constant(_) => UNBOUNDED,
            Node::Leaf(Leaf::Measured(_)) => UNBOUNDED,
            Node::Leaf(_) => 1,
            Node::Neg(_) | Node::Add(..) | Node::Sub(..) => largest(),
            Node::Mul(a, b) => of(a).saturating_add(of(b)),
            Node::MulAdd([a, b, c]) => of(a).saturating_add(of(b)).max(of(c)),
            Node::Select(_, [_, _, c, d]) => of(c).max(of(d)),
            Node::Table { at: [a, b], .. } => of(a).max(of(b)),
            Node::Function(function, a) => match function {
                Function::Abs | Function::Floor | Function::Ceil | Function::Round | Function::Trunc => of(a),
                Function::Sin | Function::Cos | Function::Tanh | Function::Atan | Function::Signum => match of(a) {
                    UNBOUNDED => UNBOUNDED,
                    _ => 0,
                },
                _ => UNBOUNDED,
            },
            Node::Div(..) | Node::Power(..) | Node::Function2(..) => UNBOUNDED,
        });
    }
    growth
}

/// Whether zero times each partial slope is zero.
fn has_finite_partials(node: &Node, growth: &[u32]) -> bool {
    let of = |id: Id| growth[id.index()] <= 2;
    match *node {
        Node::Constant(_) | Node::Leaf(_) | Node::Neg(_) | Node::Add(..) | Node::Sub(..) | Node::Select(..) => true,
        Node::Table { at: [a, b], .. } => of(a) && of(b),
        Node::Mul(a, b) | Node::MulAdd([a, b, _]) => of(a) && of(b),
        Node::Function(function, a) => {
            let bounded = matches!(
                function,
                Function::Sin | Function::Cos | Function::Tanh | Function::Atan | Function::Abs | Function::Signum
            );
            bounded && of(a)
        }
        Node::Div(..) | Node::Power(..) | Node::Function2(..) => false,
    }
}
