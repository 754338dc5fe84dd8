//! Derivatives along one direction that each lane is told: the first of a model's right-hand side, and the first and the
//! second of a whole step.

use super::step::Step;
use crate::equations::Equations;
use crate::graph::{Graph, Id, Leaf, Pattern, Seed, Tape, Variables, Way, slopes};
use crate::recurrence::Recurrence;

fn number(i: usize) -> u32 {
    u32::try_from(i).unwrap_or(u32::MAX)
}

/// The slopes of the roots where each of these leaves moves with its own tangent leaf.
fn along(tape: &mut Tape, roots: &[Id], leaves: &[(Leaf, Leaf)]) -> Vec<Option<Id>> {
    let variables = Variables {
        leaves: leaves.iter().map(|(leaf, _)| tape.leaf(*leaf)).collect(),
        tangents: leaves.iter().map(|(_, tangent)| vec![Some(tape.leaf(*tangent))]).collect(),
        seeds: 1,
    };
    slopes(tape, roots, &variables, Way::Carried).into_iter().map(|tangent| tangent[0]).collect()
}

/// A step with what it carries, and its outputs, differentiated once and twice along a direction in the space of the seeds.
///
/// The direction's components are parameters after those of the recurrence.
pub(super) fn second_along(recurrence: &Recurrence, seeds: &[Seed], parameters: usize, uniform: bool) -> Step {
    let mut tape = Tape::new(uniform);
    let all = [recurrence.next(), recurrence.mean(), recurrence.variance()].concat();
    let roots = tape.import(recurrence.graph(), &all);
    let n = recurrence.next().len();
    let state = |i: usize| Leaf::State(number(i));
    // Entry i is followed, after all entries, by its first and its second derivative.
    let rows = (0..n).map(|i| vec![Some(n + 2 * i), Some(n + 2 * i + 1)]).collect();
    let mut moving: Vec<(Leaf, Leaf)> = (0..n).map(|i| (state(i), state(n + 2 * i))).collect();
    for (s, seed) in seeds.iter().enumerate() {
        if let Seed::Parameter(j) = seed {
            moving.push((Leaf::Parameter(number(*j)), Leaf::Parameter(number(parameters + s))));
        }
    }
    let first = along(&mut tape, &roots, &moving);
    moving.extend((0..n).map(|i| (state(n + 2 * i), state(n + 2 * i + 1))));
    let zero = tape.constant(0.0);
    let of: Vec<Id> = first.iter().map(|first| first.unwrap_or(zero)).collect();
    let second = along(&mut tape, &of, &moving);
    let mut next = roots[..n].to_vec();
    next.extend((0..n).flat_map(|i| [first[i].unwrap_or(zero), second[i].unwrap_or(zero)]));
    let rows_of = |at: usize| [first[at], second[at], Some(roots[at])];
    let step = Step { tape, next, rows: (n..roots.len()).flat_map(rows_of).collect(), pattern: Pattern { rows } };
    step.lowered()
}

/// What a right-hand side is made of, as inputs: states, their tangents, inputs. Parameters are followed by their tangents.
pub(super) fn right_hand_side(equations: &Equations) -> Recurrence {
    let layout = equations.layout();
    let (states, parameters) = (layout.states.len(), layout.parameters.len());
    let mut graph = Graph::default();
    let value = |leaf: Leaf| match leaf {
        Leaf::State(i) => Leaf::Input(i),
        Leaf::Input(i) => Leaf::Input(number(2 * states) + i),
        other => other,
    };
    let mut tape = Tape::new(true);
    let roots = graph.import(equations.graph(), equations.state(), |graph, leaf| graph.leaf(value(leaf)));
    let roots = tape.import(&graph, &roots);
    let mut moving: Vec<(Leaf, Leaf)> =
        (0..states).map(|i| (Leaf::Input(number(i)), Leaf::Input(number(states + i)))).collect();
    moving.extend((0..parameters).map(|j| (Leaf::Parameter(number(j)), Leaf::Parameter(number(parameters + j)))));
    let tangents = along(&mut tape, &roots, &moving);
    let zero = tape.constant(0.0);
    let outputs: Vec<Id> =
        roots.iter().copied().chain(tangents.iter().map(|tangent| tangent.unwrap_or(zero))).collect();
    Recurrence::of_outputs(&tape.graph, &outputs)
}
