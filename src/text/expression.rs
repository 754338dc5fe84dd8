//! [`Expression`]: arithmetic as it is written, and where in the file it stands.

use super::remark::Span;
use super::string::Place;

/// Which node of an expression; operands come before what is made of them.
pub(super) type At = usize;

/// A sign between two numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Sign {
    Add,
    Sub,
    Mul,
    Div,
    Power,
}

/// A comparison of two numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Relation {
    Less,
    LessOrEqual,
    Greater,
    GreaterOrEqual,
}

/// What a node is made of.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Operation {
    Number(f64),
    Name(String),
    Negate(At),
    Binary(Sign, At, At),
    /// A function or a table; of a table, the orders of the derivative in its arguments.
    Call {
        name: String,
        order: [u8; 2],
        arguments: Vec<At>,
    },
    /// Condition, what holds then, and else.
    If([At; 3]),
    Compare(Relation, At, At),
    And(At, At),
    Or(At, At),
    Not(At),
}

impl Operation {
    /// Whether it is true or false rather than a number.
    pub fn is_condition(&self) -> bool {
        matches!(self, Operation::Compare(..) | Operation::And(..) | Operation::Or(..) | Operation::Not(_))
    }
}

#[derive(Clone, Debug)]
pub(super) struct Node {
    pub operation: Operation,
    /// Within the expression.
    pub span: Span,
}

/// Nodes of which the last is the whole.
#[derive(Clone, Debug)]
pub(super) struct Expression {
    pub text: String,
    pub nodes: Vec<Node>,
    pub place: Place,
}

impl Expression {
    /// Where a node stands in the file.
    pub fn span(&self, source: &str, node: At) -> Span {
        self.place.span(source, self.nodes[node].span.clone())
    }

    /// Where the whole stands in the file.
    pub fn whole(&self) -> Span {
        self.place.token.clone()
    }

    pub fn root(&self) -> At {
        self.nodes.len() - 1
    }
}
