//! [`Equations`]: a model as data.

mod dead_times;
mod degree;
mod diffusion;
mod linear;
mod moments;
mod roots;
mod slopes;
mod stored;
mod terms;

pub(crate) use dead_times::DeadTimes;
pub(crate) use diffusion::Diffusion;
pub(crate) use linear::Linear;
pub(crate) use moments::{AllMoments, MomentsOf};
pub use roots::Roots;
pub(crate) use slopes::{Jacobian, Slopes};
pub(crate) use terms::{Term, WithTerms};

use crate::functions::Functions;
use crate::graph::{Graph, Id, Leaf, Node, Symbol, Untraceable};
use crate::layout::{InvalidLayout, Kind, Layout, Quantity};
use crate::model::Model;
use crate::scalar::Scalar;
use crate::signals::Signals;
use core::fmt::{self, Display};
use degree::{Degree, degrees};
use serde::{Deserialize, Serialize};
use stored::Parts;

/// A model's quantities and its arithmetic, known at run time.
///
/// A Rust model is read once ([`Equations::trace`]); equations from elsewhere are made of a graph
/// ([`Equations::new`]), and fitted by a [`Fit`](crate::Fit).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Parts", into = "Parts")]
pub struct Equations {
    layout: Layout,
    graph: Graph,
    roots: Roots,
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
        let roots = Roots { state: state.to_vec(), output: output.to_vec(), ..Roots::default() };
        Equations::complete(layout, graph, &roots)
    }

    /// The same with process noise, measurement noise, noise of the initial state, dead times and jumps.
    ///
    /// # Errors
    /// If they do not fit the layout, a noise of the initial state or a dead time depends on more than parameters, or an initial state on more than
    /// these and inputs.
    pub fn complete(layout: Layout, graph: &Graph, roots: &Roots) -> Result<Self, InvalidEquations> {
        layout.check()?;
        roots.check(&layout)?;
        let all = roots.all();
        if let Some(root) = all.iter().find(|root| root.index() >= graph.len()) {
            return Err(InvalidEquations::NoSuchNode { node: root.index(), nodes: graph.len() });
        }
        let (graph, all) = graph.pruned(&all);
        let roots = roots.with(&all);
        let (constant, initial) = (graph.reached(&roots.constant()), graph.reached(&roots.initial));
        for (node, (constant, initial)) in graph.nodes().iter().zip(constant.into_iter().zip(initial)) {
            let Node::Leaf(leaf) = *node else { continue };
            let there = match leaf {
                Leaf::Time => !constant && !initial,
                Leaf::State(i) => (i as usize) < layout.states.len() && !constant && !initial,
                Leaf::Input(i) => (i as usize) < layout.inputs.len() && !constant,
                Leaf::Parameter(i) => (i as usize) < layout.parameters.len(),
                Leaf::Step | Leaf::NextInput(_) | Leaf::Measured(_) | Leaf::Late { .. } => false,
            };
            if !there {
                return Err(InvalidEquations::NoSuchQuantity { leaf });
            }
        }
        Ok(Equations { layout, graph, roots })
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
            let (t, x, u, p) = leaves();
            let diffusion = M::State::into_array(model.diffusion(t, &x, &u, &p));
            let noise = M::Output::into_array(model.noise(t, &x, &u, &p));
            let initial = M::State::into_array(model.initial_noise(&p));
            let begin = M::State::into_array(model.initial(&u, &p));
            let delay = M::Input::into_array(model.delay(&p));
            [diffusion.as_ref(), noise.as_ref(), initial.as_ref(), begin.as_ref(), delay.as_ref()].concat()
        })?;
        let jump = match M::KIND {
            Kind::Continuous => graph.trace(|| {
                let (t, x, u, p) = leaves();
                M::State::into_array(model.jump(t, &x, &u, &p)).as_ref().to_vec()
            })?,
            Kind::Discrete | Kind::Static => vec![],
        };
        Equations::traced(layout, &graph, [&state, &output, &levels, &jump])
    }

    /// The equations of roots that were read: states, outputs, levels of noise and dead times, and states after a sample.
    fn traced(layout: Layout, graph: &Graph, [state, output, levels, jump]: [&[Id]; 4]) -> Result<Self, Untraceable> {
        let mut levels = levels.iter().copied();
        // Noise that is not in the file is zero.
        let mut said = |count: usize, unsaid: fn(f64) -> bool| -> Vec<Id> {
            let levels: Vec<Id> = levels.by_ref().take(count).collect();
            let unsaid = |id: &Id| graph.known(*id).is_some_and(unsaid);
            if levels.iter().all(unsaid) { vec![] } else { levels }
        };
        let zero = |level| level == 0.0;
        let roots = Roots {
            state: state.to_vec(),
            output: output.to_vec(),
            diffusion: said(layout.states.len(), zero),
            noise: said(layout.outputs.len(), f64::is_nan),
            initial_noise: said(layout.states.len(), zero),
            initial: said(layout.states.len(), f64::is_nan),
            delay: said(layout.inputs.len(), zero),
            jump: if graph.are_states(jump) { vec![] } else { jump.to_vec() },
        };
        Equations::complete(layout, graph, &roots).map_err(|wrong| Untraceable { reason: wrong.to_string() })
    }

    /// The quantities.
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// The arithmetic.
    pub fn graph(&self) -> &Graph {
        &self.graph
    }

    /// The nodes of the graph that make them up.
    pub fn roots(&self) -> &Roots {
        &self.roots
    }

    /// For each state, what it is after a sample, where that changes it.
    pub(crate) fn jumping(&self) -> Vec<Option<Id>> {
        match self.roots.jump.is_empty() {
            true => vec![None; self.layout.states.len()],
            false => (0..).zip(&self.roots.jump).map(|(i, id)| (!self.graph.is_state(*id, i)).then_some(*id)).collect(),
        }
    }

    /// Which states the model says at the first sample ([`Model::initial`]).
    pub(crate) fn begins(&self) -> Vec<bool> {
        let said = |id: &Id| !self.graph.known(*id).is_some_and(f64::is_nan);
        match self.roots.initial.is_empty() {
            true => vec![false; self.layout.states.len()],
            false => self.roots.initial.iter().map(said).collect(),
        }
    }

    /// Whether they say the noise of an output ([`Model::noise`]).
    pub(crate) fn says_noise(&self, output: usize) -> bool {
        self.roots.noise.get(output).is_some_and(|id| !self.graph.known(*id).is_some_and(f64::is_nan))
    }

    /// Whether derivatives, outputs and jumps are affine in the states: then so is each step, and slopes do not depend on states.
    pub fn is_affine(&self) -> bool {
        let degrees = degrees(&self.graph, &|leaf| matches!(leaf, Leaf::State(_)));
        self.roots.moving().iter().all(|root| degrees[root.index()] <= Degree::One)
    }

    /// Moments of its functions of a Gaussian state.
    pub(crate) fn moments(&self) -> AllMoments {
        let of = |roots: &[Id]| MomentsOf::of(&self.graph, roots, self.layout.states.len());
        AllMoments { state: of(&self.roots.state), output: of(&self.roots.output), jump: of(&self.roots.jump) }
    }

    /// The values of roots; without time, states and inputs for what depends on parameters alone.
    fn values<S: Scalar>(&self, roots: &[Id], at: Option<(S, &[S], &[S])>, p: &[S], to: &mut [S]) {
        self.graph.evaluate_into(roots, to, |leaf| given(leaf, at, p));
    }
}

/// The values of a graph's roots at a time, a state and inputs, and at parameters.
fn evaluate<S: Scalar>(graph: &Graph, roots: &[Id], at: Option<(S, &[S], &[S])>, p: &[S]) -> Vec<S> {
    graph.evaluate(roots, |leaf| given(leaf, at, p))
}

/// The value of a leaf; NaN of what is not given, such as an empty state.
fn given<S: Scalar>(leaf: Leaf, at: Option<(S, &[S], &[S])>, p: &[S]) -> S {
    match (leaf, at) {
        (Leaf::Parameter(i), _) => p[i as usize],
        (Leaf::Time, Some((t, ..))) => t,
        (Leaf::State(i), Some((_, x, _))) if !x.is_empty() => x[i as usize],
        (Leaf::Input(i), Some((_, _, u))) => u[i as usize],
        _ => S::from(f64::NAN),
    }
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
            _ => self.values(&self.roots.state, Some((t, x, u)), p, to),
        }
    }

    fn output(&self, t: S, x: &[S], u: &[S], p: &[S], to: &mut [S]) {
        self.values(&self.roots.output, Some((t, x, u)), p, to);
    }

    fn diffusion(&self, t: S, x: &[S], u: &[S], p: &[S], to: &mut [S]) {
        to.fill(S::from(0.0));
        self.values(&self.roots.diffusion, Some((t, x, u)), p, to);
    }

    fn noise(&self, t: S, x: &[S], u: &[S], p: &[S], to: &mut [S]) {
        to.fill(S::from(f64::NAN));
        self.values(&self.roots.noise, Some((t, x, u)), p, to);
    }

    fn initial_noise(&self, p: &[S], to: &mut [S]) {
        to.fill(S::from(0.0));
        self.values(&self.roots.initial_noise, None, p, to);
    }

    fn initial(&self, u: &[S], p: &[S], to: &mut [S]) {
        to.fill(S::from(f64::NAN));
        self.values(&self.roots.initial, Some((S::from(f64::NAN), &[], u)), p, to);
    }

    fn delay(&self, p: &[S], to: &mut [S]) {
        to.fill(S::from(0.0));
        self.values(&self.roots.delay, None, p, to);
    }

    fn jumps(&self) -> bool {
        !self.roots.jump.is_empty()
    }

    fn jump(&self, t: S, x: &[S], u: &[S], p: &[S], to: &mut [S]) {
        to.copy_from_slice(x);
        self.values(&self.roots.jump, Some((t, x, u)), p, to);
    }
}

impl Display for Equations {
    /// One line per state, jump, output and dead time, by the names of the layout, after what they share.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let left = |name: &str| match self.layout.kind {
            Kind::Continuous => format!("d({name})/dt"),
            _ => format!("next {name}"),
        };
        let state =
            self.layout.states.iter().zip(&self.roots.state).map(|(quantity, root)| (left(&quantity.name), *root));
        let jumps = self.layout.states.iter().zip(self.jumping());
        let jump = jumps.filter_map(|(state, root)| Some((format!("{} after a sample", state.name), root?)));
        let outputs = self.layout.outputs.iter().zip(&self.roots.output);
        let output = outputs.map(|(quantity, root)| (format!("output {}", quantity.name), *root));
        let late = self.layout.inputs.iter().zip(&self.roots.delay).zip(self.late()).filter(|(_, late)| *late);
        let delay = late.map(|((quantity, root), _)| (format!("dead time of {}", quantity.name), *root));
        let roots: Vec<(String, Id)> = state.chain(jump).chain(output).chain(delay).collect();
        self.graph.write(f, &|leaf| name(&self.layout, leaf), &roots)
    }
}
