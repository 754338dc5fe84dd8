//! [`Linear`]: equations that are linear in states and inputs, with constant coefficients.

use super::degree::{Degree, degrees};
use super::{Equations, Jacobian, evaluate};
use crate::dual::Dual;
use crate::graph::{Following, Graph, Id, Leaf, Node, narrow};
use crate::layout::Kind;
use crate::moments::entry;
use crate::scalar::Scalar;
use crate::transition::{Crossing, Filter, Sensor, Transition, squares};

/// Slopes of a pass.
const SLOPES: usize = 8;

/// `dx = (A x + B u + c) dt + dw`, where `A`, `B`, `c` and the levels of the noise depend on parameters alone.
#[derive(Clone, Debug)]
pub(crate) struct Linear {
    a: Jacobian,
    /// The levels of the noise, if there are any.
    diffusion: Option<(Graph, Vec<Id>)>,
    states: usize,
    parameters: usize,
    entries: Vec<Entry>,
    sensors: Option<Sensors>,
}

/// Measurements whose slopes and noises depend on parameters alone, as does what samples change of the state.
#[derive(Clone, Debug)]
struct Sensors {
    output: Jacobian,
    /// The levels of their noises.
    noise: (Graph, Vec<Id>),
    /// Of the state after a sample; empty where samples change nothing.
    jump: Jacobian,
    /// The parameters that the covariance of a filter depends on.
    moves: Vec<u32>,
}

/// One of the matrices of a [`Crossing`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Part {
    Kept,
    Constant,
    Ramp,
    Covariance,
}

impl Part {
    fn of<S>(self, crossing: &mut Crossing<S>) -> &mut [Option<S>] {
        match self {
            Part::Kept => &mut crossing.kept,
            Part::Constant => &mut crossing.constant,
            Part::Ramp => &mut crossing.ramp,
            Part::Covariance => &mut crossing.covariance,
        }
    }
}

/// An entry of a matrix that is not always zero.
#[derive(Clone, Debug)]
struct Entry {
    part: Part,
    at: usize,
    following: Following,
}

impl Equations {
    /// These equations as linear ones; `None` where they are not, where their coefficients change, where an input is late, and where what samples
    /// change of the state is not affine in it.
    pub(crate) fn linear(&self) -> Option<Linear> {
        self.is_linear().then(|| Linear::of(self))
    }

    /// Whether they are so.
    pub(crate) fn is_linear(&self) -> bool {
        let (layout, roots, graph) = (&self.layout, &self.roots, &self.graph);
        let at_most_one = |roots: &[Id], of: &dyn Fn(Leaf) -> bool| {
            let degrees = degrees(graph, of);
            roots.iter().all(|root| degrees[root.index()] <= Degree::One)
        };
        let is_linear = at_most_one(&roots.state, &|leaf| matches!(leaf, Leaf::State(_) | Leaf::Input(_)));
        let on = |roots: &[Id], leaf: &dyn Fn(&Leaf) -> bool| {
            let nodes = graph.nodes().iter().zip(graph.reached(roots));
            nodes.filter(|(_, reached)| *reached).any(|(node, _)| matches!(node, Node::Leaf(of) if leaf(of)))
        };
        let moves = on(&roots.state, &|leaf| *leaf == Leaf::Time)
            || on(&roots.diffusion, &|leaf| !matches!(leaf, Leaf::Parameter(_)));
        let is_late = self.late().contains(&true);
        let continuous = layout.kind == Kind::Continuous && !layout.states.is_empty();
        let jumps_affinely = at_most_one(&roots.jump, &|leaf| matches!(leaf, Leaf::State(_)));
        continuous && is_linear && !moves && !is_late && jumps_affinely
    }
}

impl Linear {
    fn of(equations: &Equations) -> Self {
        let Equations { layout, graph, roots } = equations;
        let (states, parameters) = (layout.states.len(), layout.parameters.len());
        let a = Jacobian::of(graph, &roots.state, states);
        let diffusion = (!roots.diffusion.is_empty()).then(|| graph.pruned(&roots.diffusion));
        let mut linear = Linear { a, diffusion, states, parameters, entries: vec![], sensors: None };
        linear.entries = linear.found();
        linear.sensors = linear.sensors_of(equations);
        linear
    }

    fn sensors_of(&self, equations: &Equations) -> Option<Sensors> {
        let Equations { layout, graph, roots } = equations;
        let of = |roots: &[Id]| Jacobian::of(graph, roots, self.states);
        let (output, jump, noise) = (of(&roots.output), of(&roots.jump), graph.pruned(&roots.noise));
        let said = !layout.outputs.is_empty() && roots.noise.len() == layout.outputs.len();
        let on_parameters = |graph: &Graph, roots: &[Id]| {
            let nodes = graph.nodes().iter().zip(graph.reached(roots));
            let leaf = |node: &Node| !matches!(node, Node::Leaf(leaf) if !matches!(leaf, Leaf::Parameter(_)));
            nodes.filter(|(_, reached)| *reached).all(|(node, _)| leaf(node))
        };
        let constant = |of: &Jacobian| on_parameters(&of.graph, &of.entries);
        if !said || !constant(&output) || !constant(&jump) || !on_parameters(&noise.0, &noise.1) {
            return None;
        }
        let parts = [(&self.a.graph, &self.a.entries), (&output.graph, &output.entries), (&jump.graph, &jump.entries)];
        let levels = self.diffusion.iter().chain([&noise]).map(|(graph, roots)| (graph, roots));
        let each = |(graph, roots): (&Graph, &Vec<Id>)| {
            roots.iter().filter_map(|root| moving(graph, *root, self.parameters)).collect::<Vec<_>>()
        };
        let all: Vec<Vec<bool>> = parts.into_iter().chain(levels).flat_map(each).collect();
        Some(Sensors { output, noise, jump, moves: narrowed(&joined(self.parameters, all.iter())) })
    }

    /// The entries that are not always zero, with the parameters that move them.
    fn found(&self) -> Vec<Entry> {
        let n = self.states;
        let of_a: Vec<Option<Vec<bool>>> =
            self.a.entries.iter().map(|root| moving(&self.a.graph, *root, self.parameters)).collect();
        let level =
            |i: usize| self.diffusion.as_ref().and_then(|(graph, roots)| moving(graph, roots[i], self.parameters));
        // Whether a state reaches another in some time, itself at once.
        let mut reaches: Vec<bool> = (0..n * n).map(|at| at % (n + 1) == 0 || of_a[at].is_some()).collect();
        for over in 0..n {
            for at in 0..n * n {
                reaches[at] = reaches[at] || reaches[at / n * n + over] && reaches[over * n + at % n];
            }
        }
        // The parameters of what lies between the state `j` and the state `i`.
        let between = |(i, j): (usize, usize)| {
            let on_the_way = (0..n * n).filter(|at| reaches[i * n + at / n] && reaches[at % n * n + j]);
            joined(self.parameters, on_the_way.filter_map(|at| of_a[at].as_ref()))
        };
        let between: Vec<Vec<bool>> = (0..n * n).map(|at| between((at / n, at % n))).collect();
        let mut found = vec![];
        for part in [Part::Kept, Part::Constant, Part::Ramp] {
            found.extend((0..n * n).filter(|at| reaches[*at]).map(|at| (part, at, between[at].clone())));
        }
        for i in 0..n {
            for j in i..n {
                let noises = (0..n).filter(|k| reaches[i * n + k] && reaches[j * n + k]);
                let moved: Vec<Vec<bool>> = noises
                    .filter_map(|k| {
                        level(k).map(|own| {
                            joined(self.parameters, [&own, &between[i * n + k], &between[j * n + k]].into_iter())
                        })
                    })
                    .collect();
                if !moved.is_empty() {
                    found.push((Part::Covariance, i * n + j, joined(self.parameters, moved.iter())));
                }
            }
        }
        let mut number = self.parameters;
        let numbered = |(part, at, moves): (Part, usize, Vec<bool>)| {
            let following = Following { number: narrow(number), moves: narrowed(&moves) };
            number = following.end();
            Entry { part, at, following }
        };
        found.into_iter().map(numbered).collect()
    }

    /// What follows from the parameters, after them.
    pub fn following(&self) -> Vec<Following> {
        self.entries.iter().map(|entry| entry.following.clone()).collect()
    }

    /// An interval, of the numbers that follow.
    pub fn crossing<S: Clone>(&self, number: impl Fn(&Following) -> S) -> Crossing<S> {
        let none = || vec![None; self.states * self.states];
        let mut crossing =
            Crossing { n: self.states, kept: none(), constant: none(), ramp: none(), covariance: none() };
        for entry in &self.entries {
            entry.part.of(&mut crossing)[entry.at] = Some(number(&entry.following));
        }
        crossing
    }

    /// How many numbers the parameters are with what follows from them.
    fn end(&self) -> usize {
        self.entries.last().map_or(self.parameters, |last| last.following.end())
    }

    /// Of a filter, the constant covariance before a sample, upper triangle row by row, numbered after what follows from the parameters. `None` where slopes
    /// or noises of outputs are not constant.
    pub fn settling(&self) -> Option<Vec<Following>> {
        let moves = &self.sensors.as_ref()?.moves;
        let begin = |entry: usize| narrow(self.end() + entry * (1 + moves.len()));
        let entries = 0..self.states * (self.states + 1) / 2;
        Some(entries.map(|entry| Following { number: begin(entry), moves: moves.clone() }).collect())
    }

    /// The numbers of [`settling`](Self::settling), from those of an interval, where all outputs are measured at every sample and all intervals are alike, and
    /// after them the variances of the outputs, of the same kind; `None` where the covariance does not settle.
    pub fn settled(&self, numbers: &[f64]) -> Option<Vec<f64>> {
        let (n, sensors) = (self.states, self.sensors.as_ref()?);
        let (parameters, moves) = (&numbers[..self.parameters], &sensors.moves);
        let plain = self.crossing(|following| numbers[following.number as usize]);
        let value = sensors.filter(plain, parameters).settled()?;
        let width = 1 + moves.len();
        let entries = n * (n + 1) / 2;
        let mut settled = vec![0.0; (entries + sensors.noise.1.len()) * width];
        for pass in 0..moves.len().div_ceil(SLOPES).max(1) {
            let here: Vec<u32> = moves.iter().skip(pass * SLOPES).take(SLOPES).copied().collect();
            let mut p: Vec<Dual<SLOPES>> = parameters.iter().map(|p| Dual::from(*p)).collect();
            for (lane, j) in here.iter().enumerate() {
                p[*j as usize] = Dual::variable(parameters[*j as usize], lane);
            }
            let number = |following: &Following| {
                let (first, mut number) = (following.number as usize, Dual::from(numbers[following.number as usize]));
                for (slope, j) in number.slopes.iter_mut().zip(&here) {
                    let at = following.moves.iter().position(|moves| moves == j);
                    *slope = at.map_or(0.0, |at| numbers[first + 1 + at]);
                }
                number
            };
            let [covariance, variances] = sensors.filter(self.crossing(number), &p).about(&value);
            let pairs = (0..n).flat_map(|i| (i..n).map(move |j| (entry(n, i, j), i * n + j)));
            let found = pairs.map(|(entry, at)| (entry, covariance[at])).chain((entries..).zip(variances));
            for (entry, found) in found {
                let to = &mut settled[entry * width..][..width];
                to[0] = found.value;
                to[1 + pass * SLOPES..].iter_mut().zip(found.slopes).for_each(|(to, slope)| *to = slope);
            }
        }
        settled.iter().all(|number| number.is_finite()).then_some(settled)
    }

    /// The parameters, and after them what follows from them and the length of an interval (s), with its slopes.
    pub fn numbers(&self, parameters: &[f64], h: f64) -> Vec<f64> {
        let mut moving = vec![false; self.parameters];
        self.entries.iter().flat_map(|entry| &entry.following.moves).for_each(|j| moving[*j as usize] = true);
        let moving: Vec<usize> = (0..self.parameters).filter(|j| moving[*j]).collect();
        let mut numbers = parameters.to_vec();
        numbers.resize(self.end(), 0.0);
        for pass in 0..moving.len().div_ceil(SLOPES).max(1) {
            let lane = |j: usize| {
                moving.iter().position(|moves| *moves == j).map_or(SLOPES, |at| at.wrapping_sub(pass * SLOPES))
            };
            let p: Vec<Dual<SLOPES>> =
                parameters.iter().enumerate().map(|(j, p)| Dual::variable(*p, lane(j))).collect();
            let mut crossing = self.transition(&p, h).crossing();
            for Entry { part, at, following } in &self.entries {
                let Some(found) = part.of(&mut crossing)[*at] else { continue };
                let first = following.number as usize;
                numbers[first] = found.value;
                for (to, j) in numbers[first + 1..].iter_mut().zip(&following.moves) {
                    if let Some(slope) = found.slopes.get(lane(*j as usize)) {
                        *to = *slope;
                    }
                }
            }
        }
        numbers
    }

    fn transition<S: Scalar>(&self, p: &[S], h: f64) -> Transition<S> {
        let n = self.states;
        let a = evaluate(&self.a.graph, &self.a.entries, None, p);
        let levels = self.diffusion.as_ref().map(|(graph, roots)| evaluate(graph, roots, None, p));
        let levels = levels.unwrap_or_else(|| vec![S::from(0.0); n]);
        Transition::over(n, &a, &squares(&levels), S::from(h))
    }
}

impl Sensors {
    /// The filter by them over an interval.
    fn filter<S: Scalar>(&self, crossing: Crossing<S>, p: &[S]) -> Filter<S> {
        let at = |of: &Jacobian| evaluate(&of.graph, &of.entries, None, p);
        let (slopes, levels) = (at(&self.output), evaluate(&self.noise.0, &self.noise.1, None, p));
        let rows = slopes.chunks(crossing.n).zip(levels);
        let sensors = rows.map(|(c, r)| Sensor { slopes: c.to_vec(), variance: r * r }).collect();
        crossing.filter(&at(&self.jump), sensors)
    }
}

/// The parameters that a root depends on; `None` of one that is zero.
fn moving(graph: &Graph, root: Id, parameters: usize) -> Option<Vec<bool>> {
    if graph.known(root) == Some(0.0) {
        return None;
    }
    let mut moving = vec![false; parameters];
    for (node, reached) in graph.nodes().iter().zip(graph.reached(&[root])) {
        if let Node::Leaf(Leaf::Parameter(j)) = node
            && reached
        {
            moving[*j as usize] = true;
        }
    }
    Some(moving)
}

/// The numbers of those that move.
fn narrowed(moving: &[bool]) -> Vec<u32> {
    moving.iter().enumerate().filter(|(_, moves)| **moves).map(|(j, _)| narrow(j)).collect()
}

fn joined<'m>(parameters: usize, all: impl Iterator<Item = &'m Vec<bool>>) -> Vec<bool> {
    all.fold(vec![false; parameters], |mut joined, one| {
        joined.iter_mut().zip(one).for_each(|(joined, one)| *joined |= one);
        joined
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::{Layout, Quantity};

    /// A chain of three states, the middle one disturbed: `dx = -a x + b y`, `dy = -c y + d z + u + q dw`, `dz = e`.
    fn chain(change: impl Fn(&mut Graph, &mut [Id; 3], &mut Id)) -> Equations {
        let mut graph = Graph::default();
        let [x, y, z] = [0, 1, 2].map(|i| graph.leaf(Leaf::State(i)));
        let [a, b, c, d, e, q] = [0, 1, 2, 3, 4, 5].map(|j| graph.leaf(Leaf::Parameter(j)));
        let u = graph.leaf(Leaf::Input(0));
        let sum = |graph: &mut Graph, terms: [(Id, Id); 2]| {
            let [first, second] = terms.map(|(p, x)| graph.mul(p, x));
            graph.sub(second, first)
        };
        let (dx, dy) = (sum(&mut graph, [(a, x), (b, y)]), sum(&mut graph, [(c, y), (d, z)]));
        let mut state = [dx, graph.add(dy, u), e];
        let mut level = q;
        change(&mut graph, &mut state, &mut level);
        let zero = graph.constant(0.0);
        let named = |names: &str| names.chars().map(|name| Quantity { name: name.into(), unit: "1".into() }).collect();
        let layout = Layout {
            kind: Kind::Continuous,
            states: named("xyz"),
            inputs: named("u"),
            outputs: named("x"),
            parameters: named("abcdeq"),
        };
        let roots = super::super::Roots {
            state: state.to_vec(),
            output: vec![x],
            diffusion: vec![zero, level, zero],
            ..Default::default()
        };
        Equations::complete(layout, &graph, &roots).unwrap()
    }

    const P: [f64; 6] = [0.7, 1.3, 2.0, -0.4, 0.3, 0.5];

    /// What is left out is zero in numbers; the rest is the transition by all parameters as duals, and no slope is left out that is not zero.
    #[test]
    fn entries_and_slopes_are_those_of_the_dense_transition() {
        let linear = chain(|_, _, _| {}).linear().unwrap();
        let numbers = linear.numbers(&P, 0.6);
        assert_eq!(numbers[..6], P);
        let p: Vec<Dual<8>> = P.iter().enumerate().map(|(j, p)| Dual::variable(*p, j)).collect();
        let dense = linear.transition(&p, 0.6).crossing();
        let following = linear.crossing(Clone::clone);
        let parts = [
            (&dense.kept, &following.kept, 6),
            (&dense.constant, &following.constant, 6),
            (&dense.ramp, &following.ramp, 6),
            // Of `x` and `y`.
            (&dense.covariance, &following.covariance, 3),
        ];
        for (dense, following, there) in parts {
            assert_eq!(following.iter().flatten().count(), there);
            for (at, (dense, following)) in dense.iter().zip(following).enumerate() {
                let dense = dense.unwrap();
                match following {
                    // The lower triangle of a covariance is not asked for.
                    None if there == 3 && at / 3 > at % 3 => {}
                    None => assert!(dense.value == 0.0 && dense.slopes == [0.0; 8], "{at}"),
                    Some(Following { number, moves }) => {
                        let found = &numbers[*number as usize..][..moves.len() + 1];
                        assert_eq!(found[0], dense.value);
                        for j in 0..8u32 {
                            let slope = moves.iter().position(|moves| *moves == j).map_or(0.0, |at| found[1 + at]);
                            assert_eq!(slope, dense.slopes[j as usize], "{at}, {j}");
                        }
                    }
                }
            }
        }
    }

    /// A product of states, of a state and an input, a coefficient or a level that changes with time or state, and a state under a root.
    #[test]
    fn what_is_not_linear_with_constant_coefficients() {
        assert!(chain(|_, _, _| {}).linear().is_some());
        let refused = |change: &dyn Fn(&mut Graph, Id, Id) -> Id, of_level: bool| {
            let equations = chain(|graph, state, level| {
                let (x, time) = (graph.leaf(Leaf::State(0)), graph.leaf(Leaf::Time));
                let changed = change(graph, x, time);
                if of_level { *level = changed } else { state[0] = changed }
            });
            equations.linear().is_none()
        };
        assert!(refused(&|graph, x, _| graph.mul(x, x), false));
        assert!(refused(
            &|graph, x, _| {
                let u = graph.leaf(Leaf::Input(0));
                graph.mul(x, u)
            },
            false
        ));
        assert!(refused(&|graph, x, t| graph.mul(x, t), false) && refused(&|_, _, t| t, false));
        assert!(refused(&|graph, x, _| graph.function(crate::graph::Function::Sqrt, x), false));
        assert!(refused(&|_, x, _| x, true) && refused(&|_, _, t| t, true));
    }
}
