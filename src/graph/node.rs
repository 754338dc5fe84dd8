//! [`Node`]: one operation.

use super::function::{Function, Function2};
use crate::scalar::Comparison;
use serde::{Deserialize, Serialize};

/// Which node of its graph.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Id(pub(super) u32);

impl Id {
    /// Its number among the nodes.
    pub fn index(self) -> usize {
        self.0 as usize
    }

    pub(crate) fn new(index: usize) -> Self {
        Id(u32::try_from(index).unwrap_or(u32::MAX))
    }
}

/// A number by its bits, so that zeros of both signs are told apart and all numbers that are none are one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Constant(u64);

impl Constant {
    /// The number.
    pub fn value(self) -> f64 {
        f64::from_bits(self.0)
    }
}

impl From<f64> for Constant {
    fn from(value: f64) -> Self {
        Constant(if value.is_nan() { f64::NAN.to_bits() } else { value.to_bits() })
    }
}

/// A quantity that comes from outside.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Leaf {
    /// The time of the sample (s).
    Time,
    /// The time from this sample to the next (s).
    Step,
    /// A state, or an entry of what a recurrence carries from sample to sample.
    State(u32),
    /// An input at the sample.
    Input(u32),
    /// An input at the next sample.
    NextInput(u32),
    /// An output as measured at the sample; not a number where there is no measurement.
    Measured(u32),
    /// A parameter.
    Parameter(u32),
    /// A value of an input that is late, where samples are evenly spaced; in graphs of one step only: [`Equations`](crate::equations::Equations)
    /// refuse it.
    Late {
        /// Which input.
        input: u32,
        /// Which value: 0 is the one that held just before this sample, 1 that of the sample after it, 2 the next.
        after: u32,
    },
}

/// One operation; operands are nodes that come before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Node {
    /// A number.
    Constant(Constant),
    /// A quantity from outside.
    Leaf(Leaf),
    /// `-a`
    Neg(Id),
    /// `a + b`
    Add(Id, Id),
    /// `a - b`
    Sub(Id, Id),
    /// `a * b`
    Mul(Id, Id),
    /// `a / b`, or `a` times the reciprocal of `b`.
    Div(Id, Id),
    /// `a * b + c`, rounded once or twice: a step of an integrator.
    MulAdd([Id; 3]),
    /// A whole power.
    Power(Id, i32),
    /// A function of one number.
    Function(Function, Id),
    /// A function of two numbers.
    Function2(Function2, Id, Id),
    /// The value of a table of the graph at a place, or its derivative of these orders there.
    Table {
        /// Which one.
        table: u32,
        /// Of the derivative, in each argument; zero for the value.
        order: [u8; 2],
        /// The arguments.
        at: [Id; 2],
    },
    /// The third, where the first two compare so; else the fourth. Where one of the two is not a number, the fourth.
    Select(Comparison, [Id; 4]),
}

impl Node {
    /// Its operands.
    pub fn operands(&self) -> impl Iterator<Item = Id> + use<> {
        let none = Id(0);
        let (operands, count) = match *self {
            Node::Constant(_) | Node::Leaf(_) => ([none; 4], 0),
            Node::Neg(a) | Node::Power(a, _) | Node::Function(_, a) => ([a, none, none, none], 1),
            Node::Add(a, b) | Node::Sub(a, b) | Node::Mul(a, b) | Node::Div(a, b) | Node::Function2(_, a, b) => {
                ([a, b, none, none], 2)
            }
            Node::Table { at: [a, b], .. } => ([a, b, none, none], 2),
            Node::MulAdd([a, b, c]) => ([a, b, c, none], 3),
            Node::Select(_, all) => (all, 4),
        };
        operands.into_iter().take(count)
    }

    /// This operation on other operands.
    pub(crate) fn with_operands(&self, mut f: impl FnMut(Id) -> Id) -> Node {
        match *self {
            Node::Constant(_) | Node::Leaf(_) => *self,
            Node::Neg(a) => Node::Neg(f(a)),
            Node::Power(a, n) => Node::Power(f(a), n),
            Node::Function(function, a) => Node::Function(function, f(a)),
            Node::Add(a, b) => Node::Add(f(a), f(b)),
            Node::Sub(a, b) => Node::Sub(f(a), f(b)),
            Node::Mul(a, b) => Node::Mul(f(a), f(b)),
            Node::Div(a, b) => Node::Div(f(a), f(b)),
            Node::Function2(function, a, b) => Node::Function2(function, f(a), f(b)),
            Node::Table { table, order, at } => Node::Table { table, order, at: at.map(f) },
            Node::MulAdd(all) => Node::MulAdd(all.map(f)),
            Node::Select(comparison, all) => Node::Select(comparison, all.map(f)),
        }
    }
}
