//! A graph in numbers of any type.

use super::{Graph, Id, Leaf, Node};
use crate::scalar::Scalar;

impl Graph {
    /// The values of the roots, where the leaves have these values.
    pub fn evaluate<S: Scalar>(&self, roots: &[Id], leaf: impl FnMut(Leaf) -> S) -> Vec<S> {
        let mut values = vec![];
        self.evaluate_first(self.needed(roots), &mut values, leaf);
        let value = |root: &Id| values.get(root.index()).copied().unwrap_or(S::from(f64::NAN));
        roots.iter().map(value).collect()
    }

    /// How many nodes, from the first on, have all that the roots need: each comes after its operands.
    fn needed(&self, roots: &[Id]) -> usize {
        roots.iter().map(|root| root.index() + 1).max().unwrap_or(0).min(self.len())
    }

    /// The values of all nodes, in their order.
    pub fn evaluate_all<S: Scalar>(&self, values: &mut Vec<S>, leaf: impl FnMut(Leaf) -> S) {
        self.evaluate_first(self.len(), values, leaf);
    }

    /// The values of the first nodes.
    fn evaluate_first<S: Scalar>(&self, count: usize, values: &mut Vec<S>, mut leaf: impl FnMut(Leaf) -> S) {
        values.clear();
        values.reserve(count);
        for node in &self.nodes()[..count] {
            let value = self.compute(node, |id| values[id.index()], &mut leaf);
            values.push(value);
        }
    }

    /// The values of the roots in `to`, of a few nodes without an allocation.
    pub(crate) fn evaluate_into<S: Scalar>(&self, roots: &[Id], to: &mut [S], leaf: impl FnMut(Leaf) -> S) {
        match self.needed(roots) {
            0..=16 => self.evaluate_few::<S, 16>(roots, to, leaf),
            17..=64 => self.evaluate_few::<S, 64>(roots, to, leaf),
            _ => to.iter_mut().zip(self.evaluate(roots, leaf)).for_each(|(to, value)| *to = value),
        }
    }

    /// The values of roots among the first `MOST` nodes.
    fn evaluate_few<S: Scalar, const MOST: usize>(&self, roots: &[Id], to: &mut [S], mut leaf: impl FnMut(Leaf) -> S) {
        let mut values = [S::from(f64::NAN); MOST];
        for (i, node) in self.nodes()[..self.needed(roots)].iter().enumerate() {
            values[i] = self.compute(node, |id| values[id.index()], &mut leaf);
        }
        let value = |root: &Id| values.get(root.index()).copied().unwrap_or(S::from(f64::NAN));
        to.iter_mut().zip(roots).for_each(|(to, root)| *to = value(root));
    }

    /// The value of one root.
    pub(crate) fn value(&self, root: Id, leaf: impl FnMut(Leaf) -> f64) -> f64 {
        let mut value = [f64::NAN];
        self.evaluate_into(&[root], &mut value, leaf);
        value[0]
    }

    /// The value of a node, from those of its operands.
    #[inline(always)]
    fn compute<S: Scalar>(&self, node: &Node, at: impl Fn(Id) -> S, leaf: &mut impl FnMut(Leaf) -> S) -> S {
        match *node {
            Node::Constant(constant) => S::from(constant.value()),
            Node::Leaf(of) => leaf(of),
            Node::Neg(a) => -at(a),
            Node::Add(a, b) => at(a) + at(b),
            Node::Sub(a, b) => at(a) - at(b),
            Node::Mul(a, b) => at(a) * at(b),
            Node::Div(a, b) => at(a) / at(b),
            Node::MulAdd([a, b, c]) => at(a) * at(b) + at(c),
            Node::Power(a, n) => at(a).powi(n),
            Node::Function(function, a) => function.of(at(a)),
            Node::Function2(function, a, b) => function.of(at(a), at(b), self.known(b)),
            Node::Table { table, order, at: [a, b] } => {
                S::look_up(&self.tables()[table as usize].grid(), [at(a), at(b)], order)
            }
            Node::Select(comparison, [a, b, c, d]) => S::select(comparison, at(a), at(b), at(c), at(d)),
        }
    }
}
