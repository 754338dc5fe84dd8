//! Equations with terms that they lack.

use super::Equations;
use crate::graph::{Function, Graph, Id, Leaf, Node};
use crate::layout::Quantity;

/// Terms that are added at the most, to what process noise acts on and to a simulation: each is a column of slopes.
const OF_FILTERS: usize = 16;
const OF_SIMULATIONS: usize = 32;

/// A term that a state's derivative (next state) might lack.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Term {
    /// Number of the state.
    pub state: usize,
    /// The term in words.
    pub what: String,
}

/// Equations with a further parameter for each term, the factor of it.
pub(crate) struct WithTerms {
    pub equations: Equations,
    pub terms: Vec<Term>,
    /// How many more there would be.
    pub left_out: usize,
}

/// The function of a quantity that a term is: one, `x`, the sign of `x`, `x |x|`, `x^3` or `x^2`.
#[derive(Clone, Copy)]
enum Shape {
    One,
    Itself,
    Sign,
    SignedSquare,
    Cube,
    Square,
}

impl Shape {
    fn node(self, graph: &mut Graph, x: Option<Leaf>) -> Id {
        let x = x.map(|leaf| graph.leaf(leaf));
        match (self, x) {
            (Shape::One, _) | (_, None) => graph.constant(1.0),
            (Shape::Itself, Some(x)) => x,
            (Shape::Sign, Some(x)) => graph.function(Function::Signum, x),
            (Shape::SignedSquare, Some(x)) => {
                let size = graph.function(Function::Abs, x);
                graph.mul(x, size)
            }
            (Shape::Cube, Some(x)) => graph.power(x, 3),
            (Shape::Square, Some(x)) => graph.power(x, 2),
        }
    }

    fn what(self, name: &str) -> String {
        match self {
            Shape::One => "a constant".to_owned(),
            Shape::Itself => format!("`{name}`"),
            Shape::Sign => format!("the sign of `{name}`"),
            Shape::SignedSquare => format!("`{name}` |`{name}`|"),
            Shape::Cube => format!("`{name}`^3"),
            Shape::Square => format!("`{name}`^2"),
        }
    }
}

impl Equations {
    /// These equations with terms in the derivatives (next states) that process noise acts on; for a simulation, in those in which a parameter
    /// stands: others say what a state is.
    pub(crate) fn with_terms(&self, simulated: bool) -> WithTerms {
        let powers = [Shape::Sign, Shape::SignedSquare, Shape::Cube, Shape::Square];
        let states = 0..self.roots.state.len();
        match simulated {
            true => self.with(&states.filter(|i| self.is_modeled(*i)).collect::<Vec<_>>(), &powers, OF_SIMULATIONS),
            false => self.with(&states.filter(|i| self.is_disturbed(*i)).collect::<Vec<_>>(), &powers[1..], OF_FILTERS),
        }
    }

    fn is_disturbed(&self, state: usize) -> bool {
        self.roots.diffusion.get(state).is_some_and(|level| self.graph.known(*level) != Some(0.0))
    }

    fn is_modeled(&self, state: usize) -> bool {
        let reached = self.graph.reached(&[self.roots.state[state]]);
        let is_parameter = |node: &Node| matches!(node, Node::Leaf(Leaf::Parameter(_)));
        self.graph.nodes().iter().zip(reached).any(|(node, reached)| reached && is_parameter(node))
    }

    /// With a constant, the states' own powers, each quantity by itself, then powers of the others, at most so many.
    fn with(&self, to: &[usize], powers: &[Shape], most: usize) -> WithTerms {
        let number = |i: usize| u32::try_from(i).unwrap_or(u32::MAX);
        let states = self.layout.states.iter().enumerate().map(|(j, one)| (Leaf::State(number(j)), one));
        let inputs = self.layout.inputs.iter().enumerate().map(|(j, one)| (Leaf::Input(number(j)), one));
        let all: Vec<(Leaf, &Quantity)> = states.chain(inputs).collect();
        let mut wanted: Vec<(usize, Shape, Option<usize>)> = vec![];
        wanted.extend(to.iter().map(|&i| (i, Shape::One, None)));
        wanted.extend(to.iter().flat_map(|&i| powers.iter().map(move |shape| (i, *shape, Some(i)))));
        wanted.extend(to.iter().flat_map(|&i| (0..all.len()).map(move |q| (i, Shape::Itself, Some(q)))));
        let others = |i: usize| (0..all.len()).filter(move |q| *q != i);
        wanted.extend(
            to.iter().flat_map(|&i| others(i).flat_map(move |q| powers.iter().map(move |shape| (i, *shape, Some(q))))),
        );
        let left_out = wanted.len().saturating_sub(most);
        wanted.truncate(most);
        let (mut graph, mut roots, mut layout) = (self.graph.clone(), self.roots.clone(), self.layout.clone());
        let mut terms = vec![];
        for (k, (state, shape, quantity)) in wanted.into_iter().enumerate() {
            let factor = graph.leaf(Leaf::Parameter(number(self.layout.parameters.len() + k)));
            let node = shape.node(&mut graph, quantity.map(|q| all[q].0));
            let term = graph.mul(factor, node);
            roots.state[state] = graph.add(roots.state[state], term);
            terms.push(Term { state, what: shape.what(quantity.map_or("", |q| all[q].1.name.as_str())) });
            layout.parameters.push(Quantity { name: format!("term {k}"), unit: String::new() });
        }
        WithTerms { equations: Equations { layout, graph, roots }, terms, left_out }
    }
}
