//! Gradients against the operations, from a result to what it is made of.

use super::Tangent;
use super::forward::{active, plus_times};
use crate::graph::Id;
use crate::graph::partials::{Partial, Rule};
use crate::graph::tape::Tape;

/// The gradient of each root with respect to the leaves: one sweep for each.
pub(super) fn gradients(tape: &mut Tape, roots: &[Id], leaves: &[Id]) -> Vec<Tangent> {
    roots.iter().map(|root| gradient(tape, *root, leaves)).collect()
}

fn gradient(tape: &mut Tape, root: Id, leaves: &[Id]) -> Tangent {
    let active = active(tape, leaves, &[root]);
    let mut adjoints: Vec<Option<Id>> = vec![None; active.len()];
    let mut is_leaf = vec![false; active.len()];
    leaves.iter().for_each(|leaf| is_leaf[leaf.index()] = true);
    adjoints[root.index()] = Some(tape.constant(1.0));
    for i in (0..=root.index()).rev().filter(|i| active[*i] && !is_leaf[*i]) {
        let Some(adjoint) = adjoints[i] else { continue };
        let mut give = |tape: &mut Tape, operand: Id, adjoint: Id, partial: Partial| {
            if active[operand.index()] {
                let sum = adjoints[operand.index()];
                adjoints[operand.index()] = plus_times(tape, sum, adjoint, partial);
            }
        };
        match tape.rule(Id::new(i)) {
            Rule::Linear(terms) => {
                for (operand, partial) in terms {
                    give(tape, operand, adjoint, partial);
                }
            }
            Rule::Select(comparison, [a, b, then, otherwise]) => {
                let zero = tape.constant(0.0);
                let of_then = tape.select(comparison, a, b, adjoint, zero);
                give(tape, then, of_then, Partial::One);
                let of_otherwise = tape.select(comparison, a, b, zero, adjoint);
                give(tape, otherwise, of_otherwise, Partial::One);
            }
            // Where its slope is finite; else it is a cut, hence a leaf, as lengths are.
            Rule::Singular(terms) => {
                for (operand, partial) in terms {
                    give(tape, operand, adjoint, Partial::Node(partial));
                }
            }
            Rule::Flat | Rule::Length(..) => {}
        }
    }
    leaves.iter().map(|leaf| if active[leaf.index()] { adjoints[leaf.index()] } else { None }).collect()
}
