//! Equations with terms that they lack.

use super::Equations;
use crate::graph::{Function, Graph, Id, Leaf};
use crate::layout::Quantity;

/// Terms that are added at the most: each is a column of slopes.
const MOST_TERMS: usize = 16;

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

/// The function of a quantity that a term is: one, `x`, `x |x|`, `x^3` or `x^2`.
#[derive(Clone, Copy)]
enum Shape {
    One,
    Itself,
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
            Shape::SignedSquare => format!("`{name}` |`{name}`|"),
            Shape::Cube => format!("`{name}`^3"),
            Shape::Square => format!("`{name}`^2"),
        }
    }
}

impl Equations {
    /// These equations with terms in the derivatives (next states) that process noise acts on: a constant, the state's own powers, each quantity
    /// by itself, then powers of the others.
    pub(crate) fn with_terms(&self) -> WithTerms {
        let number = |i: usize| u32::try_from(i).unwrap_or(u32::MAX);
        let disturbed =
            |i: &usize| self.roots.diffusion.get(*i).is_some_and(|level| self.graph.known(*level) != Some(0.0));
        let disturbed: Vec<usize> = (0..self.roots.state.len()).filter(disturbed).collect();
        let states = self.layout.states.iter().enumerate().map(|(j, one)| (Leaf::State(number(j)), one));
        let inputs = self.layout.inputs.iter().enumerate().map(|(j, one)| (Leaf::Input(number(j)), one));
        let all: Vec<(Leaf, &Quantity)> = states.chain(inputs).collect();
        let powers = [Shape::SignedSquare, Shape::Cube, Shape::Square];
        let mut wanted: Vec<(usize, Shape, Option<usize>)> = vec![];
        wanted.extend(disturbed.iter().map(|&i| (i, Shape::One, None)));
        wanted.extend(disturbed.iter().flat_map(|&i| powers.map(|shape| (i, shape, Some(i)))));
        wanted.extend(disturbed.iter().flat_map(|&i| (0..all.len()).map(move |q| (i, Shape::Itself, Some(q)))));
        let others = |i: usize| (0..all.len()).filter(move |q| *q != i);
        wanted.extend(
            disturbed.iter().flat_map(|&i| others(i).flat_map(move |q| powers.map(|shape| (i, shape, Some(q))))),
        );
        let left_out = wanted.len().saturating_sub(MOST_TERMS);
        wanted.truncate(MOST_TERMS);
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
