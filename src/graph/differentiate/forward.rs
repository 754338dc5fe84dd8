//! Slopes with the operations, from operands to results.

use super::{Tangent, Variables};
use crate::graph::partials::{Partial, Rule};
use crate::graph::tape::Tape;
use crate::graph::{Function, Function2, Id, Node};
use crate::scalar::Comparison;
use rustc_hash::FxHashMap;

/// Tangents of the nodes that have any.
pub(super) type Tangents = FxHashMap<Id, Tangent>;

/// Which roots vary with which leaves; rows as the roots.
pub(super) fn influence(tape: &Tape, leaves: &[Id], roots: &[Id]) -> Vec<Vec<bool>> {
    let words = leaves.len().div_ceil(64);
    let mut sets = vec![0u64; tape.graph.len() * words];
    for (number, leaf) in leaves.iter().enumerate() {
        sets[leaf.index() * words + number / 64] |= 1 << (number % 64);
    }
    for (i, node) in tape.graph.nodes().iter().enumerate() {
        let (before, own) = sets.split_at_mut(i * words);
        for operand in varying_operands(node) {
            for (to, from) in own[..words].iter_mut().zip(&before[operand.index() * words..][..words]) {
                *to |= from;
            }
        }
    }
    let holds = |root: &Id, number: usize| sets[root.index() * words + number / 64] >> (number % 64) & 1 == 1;
    roots.iter().map(|root| (0..leaves.len()).map(|number| holds(root, number)).collect()).collect()
}

/// The operands through which slopes reach a node.
pub(super) fn varying_operands(node: &Node) -> impl Iterator<Item = Id> + use<> {
    let (skip, take) = match node {
        Node::Select(..) => (2, 2),
        Node::Function(Function::Signum | Function::Floor | Function::Ceil | Function::Round | Function::Trunc, _) => {
            (0, 0)
        }
        Node::Function2(Function2::Copysign | Function2::RemEuclid, ..) => (0, 1),
        _ => (0, 4),
    };
    node.operands().skip(skip).take(take)
}

/// The nodes between variables and roots, in order; the variables among them.
pub(super) fn active(tape: &Tape, leaves: &[Id], roots: &[Id]) -> Vec<bool> {
    let mut varies = vec![false; tape.graph.len()];
    leaves.iter().for_each(|leaf| varies[leaf.index()] = true);
    // What was added after the last root, such as gradients of other roots, is not between.
    let end = roots.iter().map(|root| root.index() + 1).max().unwrap_or(0);
    for (i, node) in tape.graph.nodes()[..end].iter().enumerate() {
        varies[i] = varies[i] || varying_operands(node).any(|operand| varies[operand.index()]);
    }
    let mut needed = vec![false; tape.graph.len()];
    roots.iter().for_each(|root| needed[root.index()] = true);
    for i in (0..end).rev() {
        needed[i] = needed[i] && varies[i];
        if needed[i] {
            varying_operands(&tape.graph.nodes()[i]).for_each(|operand| needed[operand.index()] = true);
        }
    }
    needed
}

/// Slopes carried through every operation.
pub(super) fn carried(tape: &mut Tape, roots: &[Id], variables: &Variables) -> Vec<Tangent> {
    let mut tangents: Tangents = variables.leaves.iter().copied().zip(variables.tangents.iter().cloned()).collect();
    let active = active(tape, &variables.leaves, roots);
    propagate(tape, &active, &mut tangents, variables.seeds);
    roots.iter().map(|root| tangents.get(root).cloned().unwrap_or_else(|| vec![None; variables.seeds])).collect()
}

/// The gradient of each root with respect to the leaves.
pub(super) fn gradients(tape: &mut Tape, roots: &[Id], leaves: &[Id]) -> Vec<Tangent> {
    let one = tape.constant(1.0);
    let unit = |at: usize| (0..leaves.len()).map(|i| (i == at).then_some(one)).collect();
    let mut tangents: Tangents = leaves.iter().enumerate().map(|(at, leaf)| (*leaf, unit(at))).collect();
    let active = active(tape, leaves, roots);
    propagate(tape, &active, &mut tangents, leaves.len());
    roots.iter().map(|root| tangents.get(root).cloned().unwrap_or_else(|| vec![None; leaves.len()])).collect()
}

fn propagate(tape: &mut Tape, active: &[bool], tangents: &mut Tangents, seeds: usize) {
    for i in (0..active.len()).filter(|i| active[*i]) {
        let id = Id::new(i);
        if tangents.contains_key(&id) {
            continue;
        }
        let rule = tape.rule(id);
        let tangent = tangent(tape, &rule, tangents, seeds);
        tangents.insert(id, tangent);
    }
}

/// A node's slopes by its rule and those of its operands.
pub(super) fn tangent(tape: &mut Tape, rule: &Rule, tangents: &Tangents, seeds: usize) -> Tangent {
    let of = |id: &Id, s: usize| tangents.get(id).and_then(|tangent| tangent[s]);
    let slope = |s: usize| match rule {
        Rule::Flat => None,
        Rule::Linear(terms) => {
            let terms = terms.iter().filter_map(|(operand, partial)| of(operand, s).map(|slope| (slope, *partial)));
            terms
                .collect::<Vec<_>>()
                .into_iter()
                .fold(None, |sum, (slope, partial)| plus_times(tape, sum, slope, partial))
        }
        Rule::Singular(terms) => {
            let mut sum = None;
            for (operand, partial) in terms {
                let Some(slope) = of(operand, s) else { continue };
                let zero = tape.constant(0.0);
                let product = tape.mul(slope, *partial);
                let term = match tape.graph.known(slope) {
                    Some(_) => product,
                    None => tape.select(Comparison::Equal, slope, zero, zero, product),
                };
                sum = plus_times(tape, sum, term, Partial::One);
            }
            sum
        }
        Rule::Select(comparison, [a, b, then, otherwise]) => match (of(then, s), of(otherwise, s)) {
            (None, None) => None,
            (then, otherwise) => {
                let zero = tape.constant(0.0);
                Some(tape.select(*comparison, *a, *b, then.unwrap_or(zero), otherwise.unwrap_or(zero)))
            }
        },
        Rule::Length(r, a, b) => match (of(a, s), of(b, s)) {
            (None, None) => None,
            (da, db) => Some(length(tape, [*r, *a, *b], [da, db])),
        },
    };
    (0..seeds).map(slope).collect()
}

/// `sum + slope * partial`
pub(super) fn plus_times(tape: &mut Tape, sum: Option<Id>, slope: Id, partial: Partial) -> Option<Id> {
    let term = match partial {
        Partial::One => slope,
        Partial::MinusOne => tape.neg(slope),
        Partial::Node(partial) => tape.mul(slope, partial),
    };
    Some(match sum {
        None => term,
        Some(sum) => tape.add(sum, term),
    })
}

/// The slope of a hypotenuse `r` of `a` and `b`: at the origin its length, as in [`Dual`](crate::Dual).
fn length(tape: &mut Tape, [r, a, b]: [Id; 3], [da, db]: [Option<Id>; 2]) -> Id {
    let (zero, over) = (tape.constant(0.0), tape.function(Function::Recip, r));
    let mut away = None;
    for (x, dx) in [(a, da), (b, db)] {
        if let Some(dx) = dx {
            let cosine = tape.mul(x, over);
            away = plus_times(tape, away, dx, Partial::Node(cosine));
        }
    }
    let (da, db) = (da.unwrap_or(zero), db.unwrap_or(zero));
    let at_origin = tape.free(|graph| graph.function2(Function2::Hypot, da, db));
    tape.select(Comparison::Equal, r, zero, at_origin, away.unwrap_or(zero))
}
