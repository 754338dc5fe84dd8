//! A graph in numbers of any type.

use super::{Graph, Id, Leaf, Node};
use crate::scalar::Scalar;

impl Graph {
    /// The values of the roots, where the leaves have these values.
    pub fn evaluate<S: Scalar>(&self, roots: &[Id], leaf: impl FnMut(Leaf) -> S) -> Vec<S> {
        let mut values = vec![];
        self.evaluate_all(&mut values, leaf);
        let value = |root: &Id| values.get(root.index()).copied().unwrap_or(S::from(f64::NAN));
        roots.iter().map(value).collect()
    }

    /// The values of all nodes, in their order.
    pub fn evaluate_all<S: Scalar>(&self, values: &mut Vec<S>, mut leaf: impl FnMut(Leaf) -> S) {
        values.clear();
        values.reserve(self.len());
        for node in self.nodes() {
            let value = self.compute(node, |id| values[id.index()], &mut leaf);
            values.push(value);
        }
    }

    /// The values of the roots in `to`, of a small graph without an allocation.
    pub(crate) fn evaluate_into<S: Scalar>(&self, roots: &[Id], to: &mut [S], mut leaf: impl FnMut(Leaf) -> S) {
        const SMALL: usize = 64;
        if self.len() > SMALL {
            to.iter_mut().zip(self.evaluate(roots, leaf)).for_each(|(to, value)| *to = value);
            return;
        }
        let mut values = [S::from(f64::NAN); SMALL];
        for (i, node) in self.nodes().iter().enumerate() {
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
