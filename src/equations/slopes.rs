//! [`Slopes`]: the slopes of equations with respect to the states, as graphs.

use super::{Equations, Roots, evaluate};
use crate::graph::{Graph, Id, Leaf, Tape, Variables, Way, slopes};
use crate::scalar::Scalar;

/// The Jacobians of a model with respect to its states. They are graphs like the equations themselves: their own slopes with respect to
/// states and parameters, which the gradient of a filter's likelihood needs, are as exact.
#[derive(Clone, Debug)]
pub(crate) struct Slopes {
    /// Of the derivatives, or the next states.
    pub state: Jacobian,
    /// Of the outputs.
    pub output: Jacobian,
    /// Of the states after a sample; empty where samples change nothing.
    pub jump: Jacobian,
}

/// The slopes of some functions, row by row.
#[derive(Clone, Debug)]
pub(crate) struct Jacobian {
    pub graph: Graph,
    pub entries: Vec<Id>,
}

impl Slopes {
    pub fn of(equations: &Equations) -> Self {
        let states = equations.layout().states.len();
        let of = |roots: &[Id]| Jacobian::of(equations.graph(), roots, states);
        let Roots { state, output, jump, .. } = equations.roots();
        Slopes { state: of(state), output: of(output), jump: of(jump) }
    }
}

impl Jacobian {
    pub fn of(graph: &Graph, roots: &[Id], states: usize) -> Self {
        let mut tape = Tape::new(true);
        let values = tape.import(graph, roots);
        let (zero, one) = (tape.constant(0.0), tape.constant(1.0));
        let leaf = |i: usize| Leaf::State(u32::try_from(i).unwrap_or(u32::MAX));
        let leaves = (0..states).map(|i| tape.leaf(leaf(i))).collect();
        let tangents = (0..states).map(|i| (0..states).map(|j| (i == j).then_some(one)).collect()).collect();
        let found = slopes(&mut tape, &values, &Variables { leaves, tangents, seeds: states }, Way::Carried);
        let entries: Vec<Id> = found.into_iter().flatten().map(|slope| slope.unwrap_or(zero)).collect();
        let (graph, entries) = tape.graph.pruned(&entries);
        Jacobian { graph, entries }
    }

    /// The entries at a time, a state, inputs and parameters.
    pub fn at<S: Scalar>(&self, t: S, x: &[S], u: &[S], p: &[S], to: &mut [S]) {
        let found = evaluate(&self.graph, &self.entries, Some((t, x, u)), p);
        to.iter_mut().zip(found).for_each(|(to, found)| *to = found);
    }
}
