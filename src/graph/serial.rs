//! Graphs as data: a list of nodes, checked when it is read.

use super::{Constant, Graph, Node};
use crate::scalar::Table;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::sync::Arc;

/// The part of a graph that is serialized.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Nodes {
    nodes: Vec<Node>,
    tables: Vec<Table>,
}

impl From<Graph> for Nodes {
    fn from(graph: Graph) -> Self {
        let tables = graph.tables.iter().map(|table| (**table).clone()).collect();
        Nodes { nodes: graph.nodes, tables }
    }
}

/// A list of nodes that is no graph.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "node {node} of the graph has an operand that does not come before it, or a table that is not there; write the nodes in order"
)]
pub struct InvalidGraph {
    /// The node's number.
    pub node: usize,
}

impl TryFrom<Nodes> for Graph {
    type Error = InvalidGraph;

    fn try_from(Nodes { nodes, tables }: Nodes) -> Result<Self, InvalidGraph> {
        let is_wrong = |(i, node): &(usize, &Node)| {
            let no_table = matches!(node, Node::Table { table, .. } if *table as usize >= tables.len());
            no_table || node.operands().any(|operand| operand.index() >= *i)
        };
        let wrong = nodes.iter().enumerate().find(is_wrong);
        match wrong {
            Some((node, _)) => Err(InvalidGraph { node }),
            None => {
                let known = nodes.iter().enumerate().rev().map(|(i, node)| (*node, super::Id::new(i))).collect();
                Ok(Graph { nodes, known, tables: tables.into_iter().map(Arc::new).collect() })
            }
        }
    }
}

impl Serialize for Constant {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        crate::real::serialize(&self.value(), serializer)
    }
}

impl<'de> Deserialize<'de> for Constant {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        crate::real::deserialize(deserializer).map(|value: f64| Constant::from(value))
    }
}
