//! Graphs as data: a list of nodes, checked when it is read.

use super::{Constant, Graph, Node};
use crate::scalar::Table;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::sync::Arc;

/// What of a graph is written.
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

/// A number, or a word where the format has no such number.
#[derive(Serialize, Deserialize)]
#[serde(untagged)]
enum Number {
    Finite(f64),
    Word(Word),
}

#[derive(Serialize, Deserialize)]
enum Word {
    #[serde(rename = "inf")]
    Infinity,
    #[serde(rename = "-inf")]
    NegativeInfinity,
    #[serde(rename = "nan")]
    NotANumber,
}

impl Serialize for Constant {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let number = match self.value() {
            f64::INFINITY => Number::Word(Word::Infinity),
            f64::NEG_INFINITY => Number::Word(Word::NegativeInfinity),
            value if value.is_nan() => Number::Word(Word::NotANumber),
            value => Number::Finite(value),
        };
        number.serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for Constant {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Ok(Constant::from(match Number::deserialize(deserializer)? {
            Number::Finite(value) => value,
            Number::Word(Word::Infinity) => f64::INFINITY,
            Number::Word(Word::NegativeInfinity) => f64::NEG_INFINITY,
            Number::Word(Word::NotANumber) => f64::NAN,
        }))
    }
}
