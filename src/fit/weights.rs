//! Weights of samples, by a function of the typed sample or by an expression.

use crate::equations::name;
use crate::error::Error;
use crate::experiment::Sample;
use crate::graph::{Graph, Id, Leaf, Node};
use crate::layout::Layout;
use crate::model::Model;
use crate::problem::Weights;
use crate::record::Record;
use crate::signals::Signals;
use crate::weighting::Weighting;
use core::marker::PhantomData;

/// A typed weighting as untyped [`Weights`].
pub(super) struct ByModel<W, M> {
    pub weighting: W,
    pub model: PhantomData<fn(&M)>,
}

impl<M: Model, W: Weighting<M>> Weights for ByModel<W, M> {
    fn weight(&self, record: &Record, k: usize) -> f64 {
        let (t, inputs, outputs) = (record.time(k), record.inputs(), record.outputs());
        let u = M::Input::from_fn(|i| inputs[i].values[k]);
        let y = M::Output::from_fn(|j| outputs[j].values[k]);
        self.weighting.weight(&Sample { t, u, y })
    }

    fn check(&self) -> Result<(), Error> {
        self.weighting.check()
    }

    fn describe(&self) -> String {
        self.weighting.describe()
    }
}

/// The root of a graph of time, inputs and measured outputs.
pub(super) struct ByExpression {
    graph: Graph,
    root: Id,
    layout: Layout,
}

impl ByExpression {
    pub fn new(layout: &Layout, graph: &Graph, root: Id) -> Self {
        let (graph, roots) = graph.pruned(&[root]);
        ByExpression { root: roots.first().copied().unwrap_or_default(), graph, layout: layout.clone() }
    }
}

impl Weights for ByExpression {
    fn weight(&self, record: &Record, k: usize) -> f64 {
        self.graph.value(self.root, |leaf| match leaf {
            Leaf::Time => record.time(k),
            Leaf::Input(i) => record.inputs()[i as usize].values[k],
            Leaf::Measured(j) => record.outputs()[j as usize].values[k],
            _ => f64::NAN,
        })
    }

    fn check(&self) -> Result<(), Error> {
        let (inputs, outputs) = (self.layout.inputs.len(), self.layout.outputs.len());
        let leaf = |node: &Node| match *node {
            Node::Leaf(Leaf::Input(i)) if (i as usize) >= inputs => Some(Leaf::Input(i)),
            Node::Leaf(Leaf::Measured(j)) if (j as usize) >= outputs => Some(Leaf::Measured(j)),
            Node::Leaf(Leaf::Time | Leaf::Input(_) | Leaf::Measured(_)) => None,
            Node::Leaf(other) => Some(other),
            _ => None,
        };
        match self.graph.nodes().iter().find_map(leaf) {
            None => Ok(()),
            Some(leaf) => Err(Error::Option(format!(
                "weighting: the weight depends on {leaf:?}; it may depend on time, inputs and measured outputs of the model"
            ))),
        }
    }

    fn describe(&self) -> String {
        self.graph.one_line(self.root, &|leaf| name(&self.layout, leaf))
    }
}
