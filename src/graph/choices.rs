//! Which parameters the conditions of a graph depend on.

use super::{Function, Function2, Graph, Leaf, Node};
use std::collections::BTreeSet;

/// The parameters on which a comparison, an absolute value, a rounding or the place in a table depends, other than by way of a state.
pub(crate) fn choosing(graph: &Graph) -> Vec<usize> {
    let (mut of, mut found) = (Vec::<BTreeSet<usize>>::with_capacity(graph.len()), BTreeSet::new());
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
            found.extend(&of[operand.index()]);
        }
        let mut own: BTreeSet<usize> =
            node.operands().flat_map(|operand| of[operand.index()].iter().copied()).collect();
        if let Node::Leaf(Leaf::Parameter(i)) = node {
            own.insert(*i as usize);
        }
        of.push(own);
    }
    found.into_iter().collect()
}

#[cfg(test)]
mod tests {
    use super::choosing;
    use crate::graph::{Function, Function2, Graph, Leaf};
    use crate::scalar::Comparison;

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
        assert_eq!(choosing(&graph), [0, 2, 3]);
    }
}
