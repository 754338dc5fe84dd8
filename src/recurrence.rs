//! [`Recurrence`]: what happens from one sample to the next, as one graph.

mod interval;
mod late;

pub(crate) use interval::SymbolicInterval;

use crate::graph::{Following, Graph, Id, Leaf, Node};

/// A recurrence: what it carries from sample to sample, what it expects of each output.
///
/// Its graph is made of what is carried ([`Leaf::State`]), the sample's time, inputs and measurements, the next sample's
/// inputs, the time between the two, and parameters. After the parameters stand what the predictor is given (levels of noise), where inputs are late
/// the whole samples of each dead time (s), and where linear equations are crossed exactly the entries of their transition, each followed by its slopes.
#[derive(Clone, Debug)]
pub struct Recurrence {
    graph: Graph,
    next: Vec<Id>,
    mean: Vec<Id>,
    variance: Vec<Id>,
    started: Started,
    following: Vec<Following>,
}

/// What the carry at the first sample depends on.
#[derive(Clone, Debug, Default)]
pub(crate) struct Started {
    /// How many entries are the state.
    pub states: usize,
    /// Parameters on which the state depends, which otherwise is an unknown or given.
    pub state: Vec<Leaf>,
    /// States and parameters on which the entries after it depend.
    pub rest: Vec<Leaf>,
}

/// Roots that make no recurrence.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum InvalidRecurrence {
    /// A carried entry that has no next value.
    #[error(
        "the recurrence depends on entry {entry} of what is carried, but carries {carried}; give each its next value"
    )]
    NotCarried {
        /// The entry's number.
        entry: u32,
        /// How many are carried.
        carried: usize,
    },
    /// Variances of some outputs only.
    #[error("the recurrence has {variances} variances for {means} outputs; give none, or one for each")]
    Variances {
        /// Outputs.
        means: usize,
        /// Variances.
        variances: usize,
    },
}

impl Recurrence {
    /// A recurrence that carries no outputs.
    pub(crate) fn without_outputs(&self) -> Self {
        let (graph, next) = self.graph.pruned(&self.next);
        Recurrence { graph, next, mean: vec![], variance: vec![], ..self.clone() }
    }

    /// This recurrence, which starts so.
    pub(crate) fn started(self, started: Started) -> Self {
        Recurrence { started, ..self }
    }

    /// This recurrence, with numbers that follow from its parameters and the time between two samples.
    pub(crate) fn with_following(self, following: Vec<Following>) -> Self {
        Recurrence { following, ..self }
    }

    /// The numbers that follow from its parameters.
    pub(crate) fn following(&self) -> &[Following] {
        &self.following
    }

    /// This recurrence, from a state that depends on all parameters.
    pub(crate) fn started_at_rest(&self, parameters: usize) -> Self {
        let all = (0..parameters).map(|j| Leaf::Parameter(u32::try_from(j).unwrap_or(u32::MAX)));
        let started = Started { state: all.clone().collect(), ..self.started.clone() };
        // The other entries depend on the state, and so on the parameters that it depends on.
        let rest = started.rest.iter().copied().chain(all).collect();
        self.clone().started(Started { rest, ..started })
    }

    /// Whether the start of an entry depends on a state or a parameter.
    pub(crate) fn starts_from(&self, entry: usize, leaf: Leaf) -> bool {
        let Started { states, state, rest } = &self.started;
        if entry < *states { state.contains(&leaf) } else { rest.contains(&leaf) }
    }

    /// A recurrence by the nodes of what is carried next, of the outputs' means, and of their variances, if it has any.
    ///
    /// # Errors
    /// If it depends on what it does not carry.
    pub fn from_roots(graph: &Graph, next: &[Id], mean: &[Id], variance: &[Id]) -> Result<Self, InvalidRecurrence> {
        if !variance.is_empty() && variance.len() != mean.len() {
            return Err(InvalidRecurrence::Variances { means: mean.len(), variances: variance.len() });
        }
        let (graph, roots) = graph.pruned(&[next, mean, variance].concat());
        for node in graph.nodes() {
            if let Node::Leaf(Leaf::State(entry)) = *node
                && entry as usize >= next.len()
            {
                return Err(InvalidRecurrence::NotCarried { entry, carried: next.len() });
            }
        }
        let (next, rest) = roots.split_at(next.len());
        let (mean, variance) = rest.split_at(mean.len());
        let started = Started { states: next.len(), ..Started::default() };
        Ok(Recurrence {
            next: next.to_vec(),
            mean: mean.to_vec(),
            variance: variance.to_vec(),
            graph,
            started,
            following: vec![],
        })
    }

    /// The arithmetic.
    pub fn graph(&self) -> &Graph {
        &self.graph
    }

    /// The carry to the next sample.
    pub fn next(&self) -> &[Id] {
        &self.next
    }

    /// The prediction of each output.
    pub fn mean(&self) -> &[Id] {
        &self.mean
    }

    /// The variance of each output about that; empty where it is not predicted.
    pub fn variance(&self) -> &[Id] {
        &self.variance
    }
}
