//! [`Choices`]: what the conditions of a graph depend on.

use super::{Function, Function2, Graph, Leaf, Node};
use std::collections::BTreeSet;

/// What a comparison, an absolute value, a rounding or the place in a table depends on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Choices {
    /// The parameters, other than by way of a state.
    pub parameters: Vec<usize>,
    /// Whether a state is among it.
    pub states: bool,
}

pub(crate) fn choices(graph: &Graph) -> Choices {
    // A state is none of the parameters.
    let mut of: Vec<BTreeSet<Option<usize>>> = Vec::with_capacity(graph.len());
    let mut found: BTreeSet<Option<usize>> = BTreeSet::new();
    for node in graph.nodes() {
        let choice = match node {
            Node::Select(..) => 2,
            Node::Table { .. } => 2,
            Node::Function2(function, ..) => {
                use Function2::{Copysign, Max, Min, RemEuclid};
                2 * usize::from(matches!(function, Copysign | Max | Min | RemEuclid))
            }
            Node::Function(function, _) => {
                use Function::{Abs, Ceil, Floor, Round, Signum, Trunc};
                usize::from(matches!(function, Abs | Ceil | Floor | Round | Signum | Trunc))
            }
            _ => 0,
        };
        for operand in node.operands().take(choice) {
            found.extend(of[operand.index()].iter().copied());
        }
        let mut own: BTreeSet<Option<usize>> =
            node.operands().flat_map(|operand| of[operand.index()].iter().copied()).collect();
        match node {
            Node::Leaf(Leaf::Parameter(i)) => own.insert(Some(*i as usize)),
            Node::Leaf(Leaf::State(_)) => own.insert(None),
            _ => false,
        };
        of.push(own);
    }
    Choices { states: found.contains(&None), parameters: found.into_iter().flatten().collect() }
}

#[cfg(test)]
mod tests {
    use super::{Choices, choices};
    use crate::graph::{Function, Function2, Graph, Leaf};
    use crate::scalar::Comparison;

    /// Of `u x + |p0 u|` no choice depends on the state.
    #[test]
    fn states_beside_conditions() {
        let mut graph = Graph::default();
        let (p, u, x) = (graph.leaf(Leaf::Parameter(0)), graph.leaf(Leaf::Input(0)), graph.leaf(Leaf::State(0)));
        let (product, scaled) = (graph.mul(u, x), graph.mul(p, u));
        let size = graph.function(Function::Abs, scaled);
        graph.add(product, size);
        assert_eq!(choices(&graph), Choices { parameters: vec![0], states: false });
    }

    /// Of `u < p0 ? u : p0`, `p1 |x|`, `|p2 u|` and `max(p3, u)` all parameters but the second decide a choice.
    #[test]
    fn parameters_of_conditions() {
        let mut graph = Graph::default();
        let p: Vec<_> = (0..4).map(|i| graph.leaf(Leaf::Parameter(i))).collect();
        let (u, x) = (graph.leaf(Leaf::Input(0)), graph.leaf(Leaf::State(0)));
        let least = graph.select(Comparison::Less, u, p[0], u, p[0]);
        let size = graph.function(Function::Abs, x);
        let scaled = graph.mul(p[1], size);
        let product = graph.mul(p[2], u);
        let second = graph.function(Function::Abs, product);
        let greatest = graph.function2(Function2::Max, p[3], u);
        let sum = graph.add(least, scaled);
        let sum = graph.add(sum, second);
        graph.add(sum, greatest);
        assert_eq!(choices(&graph), Choices { parameters: vec![0, 2, 3], states: true });
    }
}
