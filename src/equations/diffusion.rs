//! Equations without their process noise, and the parameters that are its levels.

use super::{Equations, Roots, evaluate};
use crate::graph::{Id, Leaf, Node};

/// What makes up the process noise of equations.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Diffusion {
    /// The states whose diffusion is not zero throughout.
    pub states: Vec<usize>,
    /// The free parameters on which nothing but diffusion depends.
    pub levels: Vec<usize>,
    /// Those of the states whose diffusion is not zero where the levels are.
    pub remaining: Vec<usize>,
}

/// Time, states and inputs where diffusion is evaluated: any that makes no factor zero or one.
const PLACE: f64 = 0.7;

impl Equations {
    /// Whether these depend on each parameter.
    fn depend(&self, roots: &[Id]) -> Vec<bool> {
        let reached = self.graph.reached(roots);
        let mut parameters = vec![false; self.layout.parameters.len()];
        for (node, _) in self.graph.nodes().iter().zip(reached).filter(|(_, reached)| *reached) {
            if let Node::Leaf(Leaf::Parameter(i)) = node {
                parameters[*i as usize] = true;
            }
        }
        parameters
    }

    /// The parameters that stand in its noise alone.
    pub(crate) fn levels(&self) -> Vec<usize> {
        let Roots { diffusion, noise, initial_noise, .. } = &self.roots;
        let of_noise = self.depend(&[&**diffusion, noise, initial_noise].concat());
        let none = Roots { diffusion: vec![], noise: vec![], initial_noise: vec![], ..self.roots.clone() };
        let of_others = self.depend(&none.all());
        (0..of_noise.len()).filter(|&i| of_noise[i] && !of_others[i]).collect()
    }

    /// Those of its [`levels`](Self::levels) on whose sign no variance depends: with the opposite value each standard deviation is the same or the opposite number.
    pub(crate) fn scales(&self) -> Vec<usize> {
        let Roots { diffusion, noise, initial_noise, .. } = &self.roots;
        let (x, u) = (vec![PLACE; self.layout.states.len()], vec![PLACE; self.layout.inputs.len()]);
        let sizes = |p: &[f64]| -> Vec<f64> {
            let roots = [&**diffusion, noise, initial_noise].concat();
            evaluate(&self.graph, &roots, Some((PLACE, &x, &u)), p).into_iter().map(f64::abs).collect()
        };
        let p = vec![PLACE; self.layout.parameters.len()];
        let is_scale = |level: &usize| {
            let mut opposite = p.clone();
            opposite[*level] = -PLACE;
            // What is not said is no number.
            sizes(&p).iter().zip(sizes(&opposite)).all(|(a, b)| *a == b || a.is_nan() && b.is_nan())
        };
        self.levels().into_iter().filter(is_scale).collect()
    }

    /// Its process noise, with parameters of these values, some of which are free.
    pub(crate) fn process_noise(&self, p: &[f64], free: &[bool]) -> Diffusion {
        let number = |i: usize| self.roots.diffusion.get(i).map(|root| self.graph.known(*root));
        let states: Vec<usize> =
            (0..self.layout.states.len()).filter(|i| number(*i).is_some_and(|known| known != Some(0.0))).collect();
        let of_diffusion = self.depend(&self.roots.diffusion);
        let of_others = self.depend(&Roots { diffusion: vec![], ..self.roots.clone() }.all());
        let levels: Vec<usize> = (0..free.len()).filter(|&i| free[i] && of_diffusion[i] && !of_others[i]).collect();
        let mut p = p.to_vec();
        levels.iter().for_each(|level| p[*level] = 0.0);
        let (x, u) = (vec![PLACE; self.layout.states.len()], vec![PLACE; self.layout.inputs.len()]);
        let left = evaluate(&self.graph, &self.roots.diffusion, Some((PLACE, &x, &u)), &p);
        let remaining = states.iter().copied().filter(|i| left[*i] != 0.0).collect();
        Diffusion { states, levels, remaining }
    }

    /// These equations without process noise.
    pub(crate) fn undisturbed(&self) -> Equations {
        let roots = Roots { diffusion: vec![], ..self.roots.clone() };
        let (graph, all) = self.graph.pruned(&roots.all());
        Equations { layout: self.layout.clone(), roots: roots.with(&all), graph }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::graph::Graph;
    use crate::layout::{Kind, Layout, Quantity};

    /// Of `dx = -a x + q u dw`, `dy = (s a + c) dw`, `dz = d dw` with `d` fixed, seen with a noise of `r`: `q` and `s` are levels, and what is left
    /// where they are zero is that of `y` and of `z`.
    #[test]
    fn levels_are_parameters_of_diffusion_alone() {
        let quantities = |names: &[&str]| -> Vec<Quantity> {
            names.iter().map(|name| Quantity { name: (*name).to_owned(), unit: String::new() }).collect()
        };
        let layout = Layout {
            kind: Kind::Continuous,
            states: quantities(&["x", "y", "z"]),
            inputs: quantities(&["u"]),
            outputs: quantities(&["o"]),
            parameters: quantities(&["a", "q", "s", "d", "r"]),
        };
        let mut graph = Graph::default();
        let [a, q, s, d, r] = [0, 1, 2, 3, 4].map(|i| graph.leaf(Leaf::Parameter(i)));
        let (x, u, zero, c) =
            (graph.leaf(Leaf::State(0)), graph.leaf(Leaf::Input(0)), graph.constant(0.0), graph.constant(0.3));
        let decay = graph.mul(a, x);
        let decay = graph.neg(decay);
        let by_input = graph.mul(q, u);
        let (sum, of_a) = (graph.mul(s, a), graph.mul(q, a));
        let sum = graph.add(sum, c);
        let roots = |diffusion: [_; 3]| Roots {
            state: vec![decay, zero, zero],
            output: vec![x],
            diffusion: diffusion.to_vec(),
            noise: vec![r],
            ..Roots::default()
        };
        let equations = Equations::complete(layout.clone(), &graph, &roots([by_input, sum, d])).unwrap();
        let (p, free) = ([1.0, 0.5, 0.5, 0.5, 0.5], [true, true, true, false, true]);
        let found = equations.process_noise(&p, &free);
        assert_eq!(found, Diffusion { states: vec![0, 1, 2], levels: vec![1, 2], remaining: vec![1, 2] });
        let product = Equations::complete(layout, &graph, &roots([of_a, zero, zero])).unwrap();
        assert_eq!(product.process_noise(&p, &free), Diffusion { states: vec![0], levels: vec![1], remaining: vec![] });
        let without = product.undisturbed();
        assert_eq!(without.process_noise(&p, &free), Diffusion { states: vec![], levels: vec![], remaining: vec![] });
        // The opposite of `s` is another noise of `y`.
        assert_eq!((equations.levels(), equations.scales()), (vec![1, 2, 3, 4], vec![1, 3, 4]));
        assert!(without.roots().noise.len() == 1 && without.graph().len() < product.graph().len());
    }
}
