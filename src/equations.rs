//! [`Equations`]: a model as data.

mod dead_times;
mod degree;
mod moments;
mod slopes;

pub(crate) use dead_times::DeadTimes;
pub(crate) use moments::MomentsOf;
pub(crate) use slopes::{Jacobian, Slopes};

use crate::functions::Functions;
use crate::graph::{Graph, Id, Leaf, Node, Symbol, Untraceable};
use crate::layout::{InvalidLayout, Kind, Layout, Quantity};
use crate::model::Model;
use crate::scalar::Scalar;
use crate::signals::Signals;
use core::fmt::{self, Display};
use degree::{Degree, degrees};
use serde::{Deserialize, Serialize};

/// A model's quantities and its arithmetic, known at run time.
///
/// A Rust model is read once ([`Equations::trace`]); equations from elsewhere are made of a graph
/// ([`Equations::new`]), and fitted by a [`Fit`](crate::Fit).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Parts", into = "Parts")]
pub struct Equations {
    layout: Layout,
    graph: Graph,
    state: Vec<Id>,
    output: Vec<Id>,
    /// Empty where not said.
    diffusion: Vec<Id>,
    noise: Vec<Id>,
    delay: Vec<Id>,
}

/// The serialized form of equations.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Parts {
    layout: Layout,
    graph: Graph,
    state: Vec<Id>,
    output: Vec<Id>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    diffusion: Vec<Id>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    noise: Vec<Id>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    delay: Vec<Id>,
}

/// A graph that does not make up equations of its layout.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum InvalidEquations {
    /// A layout whose quantities cannot be told apart by their names.
    #[error(transparent)]
    Layout(#[from] InvalidLayout),
    /// Not one root per quantity.
    #[error("the layout has {expected} {role}, the equations {found}; give one node for each")]
    Count {
        /// States or outputs.
        role: &'static str,
        /// As many as the layout has.
        expected: usize,
        /// As many as were given.
        found: usize,
    },
    /// A root that is no node of the graph.
    #[error("the equations name node {node} of a graph of {nodes}")]
    NoSuchNode {
        /// The node's number.
        node: usize,
        /// How many there are.
        nodes: usize,
    },
    /// A quantity that the layout does not have, or that a model's equations cannot depend on.
    #[error("the equations depend on {leaf:?}, which is no quantity of the layout")]
    NoSuchQuantity {
        /// The quantity.
        leaf: Leaf,
    },
}

impl Equations {
    /// The equations `dx/dt`, or the next state, as `state`, and the outputs.
    ///
    /// # Errors
    /// If they do not fit the layout.
    pub fn new(layout: Layout, graph: &Graph, state: &[Id], output: &[Id]) -> Result<Self, InvalidEquations> {
        Equations::complete(layout, graph, [state, output, &[], &[], &[]])
    }

    /// These equations with process noise, measurement noise and dead times, as [`Model::diffusion`], [`Model::noise`] and
    /// [`Model::delay`] say them. Roots in this order: derivatives (next states), outputs, the diffusion of each state, the noise of each output,
    /// the dead time of each input (s). The last three may be left empty.
    ///
    /// # Errors
    /// If they do not fit the layout, or one of the last three depends on more than parameters.
    pub fn complete(layout: Layout, graph: &Graph, roots: [&[Id]; 5]) -> Result<Self, InvalidEquations> {
        let count = |role, expected: usize, found: usize| match expected == found {
            true => Ok(()),
            false => Err(InvalidEquations::Count { role, expected, found }),
        };
        layout.check()?;
        let [state, output, diffusion, noise, delay] = roots;
        count("states", if layout.kind == Kind::Static { 0 } else { layout.states.len() }, state.len())?;
        count("outputs", layout.outputs.len(), output.len())?;
        if !diffusion.is_empty() {
            count("diffusions of states", layout.states.len(), diffusion.len())?;
        }
        if !noise.is_empty() {
            count("noises of outputs", layout.outputs.len(), noise.len())?;
        }
        if !delay.is_empty() {
            count("dead times of inputs", layout.inputs.len(), delay.len())?;
        }
        let all = roots.concat();
        if let Some(root) = all.iter().find(|root| root.index() >= graph.len()) {
            return Err(InvalidEquations::NoSuchNode { node: root.index(), nodes: graph.len() });
        }
        let (graph, all) = graph.pruned(&all);
        let (drift, levels) = all.split_at(state.len() + output.len());
        let constant = graph.reached(levels);
        for (node, constant) in graph.nodes().iter().zip(constant) {
            let Node::Leaf(leaf) = *node else { continue };
            let there = match leaf {
                Leaf::Time => !constant,
                Leaf::State(i) => (i as usize) < layout.states.len() && !constant,
                Leaf::Input(i) => (i as usize) < layout.inputs.len() && !constant,
                Leaf::Parameter(i) => (i as usize) < layout.parameters.len(),
                Leaf::Step | Leaf::NextInput(_) | Leaf::Measured(_) | Leaf::Late { .. } => false,
            };
            if !there {
                return Err(InvalidEquations::NoSuchQuantity { leaf });
            }
        }
        let (state, output) = drift.split_at(state.len());
        let (diffusion, rest) = levels.split_at(diffusion.len());
        let (noise, delay) = rest.split_at(noise.len());
        let [state, output, diffusion, noise, delay] = [state, output, diffusion, noise, delay].map(<[Id]>::to_vec);
        Ok(Equations { layout, graph, state, output, diffusion, noise, delay })
    }

    /// Reads a Rust model.
    ///
    /// # Errors
    /// If it is more than arithmetic; then it runs on [`Dual`](crate::Dual)s.
    pub fn trace<M: Model>(model: &M) -> Result<Self, Untraceable> {
        let layout = Layout::new::<M::State, M::Input, M::Output, M::Parameters>(M::KIND);
        let mut graph = Graph::default();
        let number = |i: usize| u32::try_from(i).unwrap_or(u32::MAX);
        let leaves = || {
            let t = Symbol::leaf(Leaf::Time);
            let x = M::State::from_fn(|i| Symbol::leaf(Leaf::State(number(i))));
            let u = M::Input::from_fn(|i| Symbol::leaf(Leaf::Input(number(i))));
            let p = M::Parameters::from_fn(|i| Symbol::leaf(Leaf::Parameter(number(i))));
            (t, x, u, p)
        };
        let state = match M::KIND {
            Kind::Static => vec![],
            kind => graph.trace(|| {
                let (t, x, u, p) = leaves();
                let state = match kind {
                    Kind::Discrete => model.next(t, &x, &u, &p),
                    _ => model.derivative(t, &x, &u, &p),
                };
                M::State::into_array(state).as_ref().to_vec()
            })?,
        };
        let output = graph.trace(|| {
            let (t, x, u, p) = leaves();
            M::Output::into_array(model.output(t, &x, &u, &p)).as_ref().to_vec()
        })?;
        let levels = graph.trace(|| {
            let p = leaves().3;
            let diffusion = M::State::into_array(model.diffusion(&p));
            let noise = M::Output::into_array(model.noise(&p));
            let delay = M::Input::into_array(model.delay(&p));
            diffusion.as_ref().iter().chain(noise.as_ref()).chain(delay.as_ref()).copied().collect()
        })?;
        Equations::traced(layout, &graph, [&state, &output, &levels])
    }

    /// The equations of roots that were read: states, outputs, and the noise of both with the dead times.
    fn traced(layout: Layout, graph: &Graph, [state, output, levels]: [&[Id]; 3]) -> Result<Self, Untraceable> {
        let (diffusion, rest) = levels.split_at(layout.states.len());
        let (noise, delay) = rest.split_at(layout.outputs.len());
        // Noise that is not in the file is zero.
        let said = |levels: &[Id], unsaid: fn(f64) -> bool| {
            let unsaid = |id: &Id| graph.known(*id).is_some_and(unsaid);
            if levels.iter().all(unsaid) { vec![] } else { levels.to_vec() }
        };
        let zero = |level| level == 0.0;
        let [diffusion, noise, delay] = [said(diffusion, zero), said(noise, f64::is_nan), said(delay, zero)];
        Equations::complete(layout, graph, [state, output, &diffusion, &noise, &delay])
            .map_err(|wrong| Untraceable { reason: wrong.to_string() })
    }

    /// The quantities.
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// The arithmetic.
    pub fn graph(&self) -> &Graph {
        &self.graph
    }

    /// The derivative of each state (continuous) or its next value (discrete); empty for a static model.
    pub fn state(&self) -> &[Id] {
        &self.state
    }

    /// Each output.
    pub fn output(&self) -> &[Id] {
        &self.output
    }

    /// The process noise of each state and the measurement noise of each output; empty where not said.
    pub fn levels(&self) -> [&[Id]; 2] {
        [&self.diffusion, &self.noise]
    }

    /// The dead time of each input (s), in the order of the layout: roots that depend on parameters alone. Empty where not said.
    pub fn delay(&self) -> &[Id] {
        &self.delay
    }

    /// Whether derivatives and outputs are affine in the states: then so is each step, and slopes do not depend on states.
    pub fn is_affine(&self) -> bool {
        let degrees = degrees(&self.graph);
        self.state.iter().chain(&self.output).all(|root| degrees[root.index()] <= Degree::One)
    }

    /// Moments of derivatives (next states), and of outputs, of a Gaussian state.
    pub(crate) fn moments(&self) -> (MomentsOf, MomentsOf) {
        let of = |roots: &[Id]| MomentsOf::of(&self.graph, roots, self.layout.states.len());
        (of(&self.state), of(&self.output))
    }

    /// The values of roots; without time, states and inputs for what depends on parameters alone.
    fn values<S: Scalar>(&self, roots: &[Id], at: Option<(S, &[S], &[S])>, p: &[S], to: &mut [S]) {
        let found = evaluate(&self.graph, roots, at, p);
        to.iter_mut().zip(found).for_each(|(to, found)| *to = found);
    }
}

/// The values of a graph's roots at a time, a state and inputs, and at parameters; NaN of what is not given.
fn evaluate<S: Scalar>(graph: &Graph, roots: &[Id], at: Option<(S, &[S], &[S])>, p: &[S]) -> Vec<S> {
    graph.evaluate(roots, |leaf| match (leaf, at) {
        (Leaf::Parameter(i), _) => p[i as usize],
        (Leaf::Time, Some((t, ..))) => t,
        (Leaf::State(i), Some((_, x, _))) => x[i as usize],
        (Leaf::Input(i), Some((_, _, u))) => u[i as usize],
        _ => S::from(f64::NAN),
    })
}

/// The name of a leaf by a layout.
pub(crate) fn name(layout: &Layout, leaf: Leaf) -> String {
    let name = |of: &[Quantity], i: u32| {
        of.get(i as usize).map_or_else(|| format!("{leaf:?}"), |quantity| quantity.name.clone())
    };
    match leaf {
        Leaf::Time => "t".to_owned(),
        Leaf::State(i) => name(&layout.states, i),
        Leaf::Input(i) => name(&layout.inputs, i),
        Leaf::Parameter(i) => name(&layout.parameters, i),
        Leaf::Measured(i) => name(&layout.outputs, i),
        Leaf::Step | Leaf::NextInput(_) | Leaf::Late { .. } => format!("{leaf:?}"),
    }
}

impl<S: Scalar> Functions<S> for Equations {
    fn state(&self, t: S, x: &[S], u: &[S], p: &[S], to: &mut [S]) {
        match self.layout.kind {
            Kind::Static => to.copy_from_slice(x),
            _ => self.values(&self.state, Some((t, x, u)), p, to),
        }
    }

    fn output(&self, t: S, x: &[S], u: &[S], p: &[S], to: &mut [S]) {
        self.values(&self.output, Some((t, x, u)), p, to);
    }

    fn diffusion(&self, p: &[S], to: &mut [S]) {
        to.fill(S::from(0.0));
        self.values(&self.diffusion, None, p, to);
    }

    fn noise(&self, p: &[S], to: &mut [S]) {
        to.fill(S::from(f64::NAN));
        self.values(&self.noise, None, p, to);
    }

    fn delay(&self, p: &[S], to: &mut [S]) {
        to.fill(S::from(0.0));
        self.values(&self.delay, None, p, to);
    }
}

impl From<Equations> for Parts {
    fn from(Equations { layout, graph, state, output, diffusion, noise, delay }: Equations) -> Self {
        Parts { layout, graph, state, output, diffusion, noise, delay }
    }
}

impl TryFrom<Parts> for Equations {
    type Error = InvalidEquations;

    fn try_from(parts: Parts) -> Result<Self, InvalidEquations> {
        let Parts { layout, graph, state, output, diffusion, noise, delay } = parts;
        Equations::complete(layout, &graph, [&state, &output, &diffusion, &noise, &delay])
    }
}

impl Display for Equations {
    /// One line per state, output and dead time, by the names of the layout, after what they share.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let left = |name: &str| match self.layout.kind {
            Kind::Continuous => format!("d({name})/dt"),
            _ => format!("next {name}"),
        };
        let state = self.layout.states.iter().zip(&self.state).map(|(quantity, root)| (left(&quantity.name), *root));
        let outputs = self.layout.outputs.iter().zip(&self.output);
        let output = outputs.map(|(quantity, root)| (format!("output {}", quantity.name), *root));
        let late = self.layout.inputs.iter().zip(&self.delay).zip(self.late()).filter(|(_, late)| *late);
        let delay = late.map(|((quantity, root), _)| (format!("dead time of {}", quantity.name), *root));
        let roots: Vec<(String, Id)> = state.chain(output).chain(delay).collect();
        self.graph.write(f, &|leaf| name(&self.layout, leaf), &roots)
    }
}
