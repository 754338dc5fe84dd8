//! [`Node`]: one operation.

use crate::scalar::{Comparison, Scalar};
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
}

/// A function of one number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[allow(missing_docs)]
pub enum Function {
    Recip,
    Sqrt,
    Cbrt,
    Exp,
    Exp2,
    ExpM1,
    Ln,
    Ln1p,
    Log2,
    Log10,
    Sin,
    Cos,
    Tan,
    Asin,
    Acos,
    Atan,
    Sinh,
    Cosh,
    Tanh,
    Asinh,
    Acosh,
    Atanh,
    Abs,
    Signum,
    Floor,
    Ceil,
    Round,
    Trunc,
}

impl Function {
    /// All of them.
    pub(crate) const ALL: [Function; 28] = [
        Function::Recip,
        Function::Sqrt,
        Function::Cbrt,
        Function::Exp,
        Function::Exp2,
        Function::ExpM1,
        Function::Ln,
        Function::Ln1p,
        Function::Log2,
        Function::Log10,
        Function::Sin,
        Function::Cos,
        Function::Tan,
        Function::Asin,
        Function::Acos,
        Function::Atan,
        Function::Sinh,
        Function::Cosh,
        Function::Tanh,
        Function::Asinh,
        Function::Acosh,
        Function::Atanh,
        Function::Abs,
        Function::Signum,
        Function::Floor,
        Function::Ceil,
        Function::Round,
        Function::Trunc,
    ];

    /// The function's value.
    pub fn of<S: Scalar>(self, x: S) -> S {
        match self {
            Function::Recip => x.recip(),
            Function::Sqrt => x.sqrt(),
            Function::Cbrt => x.cbrt(),
            Function::Exp => x.exp(),
            Function::Exp2 => x.exp2(),
            Function::ExpM1 => x.exp_m1(),
            Function::Ln => x.ln(),
            Function::Ln1p => x.ln_1p(),
            Function::Log2 => x.log2(),
            Function::Log10 => x.log10(),
            Function::Sin => x.sin(),
            Function::Cos => x.cos(),
            Function::Tan => x.tan(),
            Function::Asin => x.asin(),
            Function::Acos => x.acos(),
            Function::Atan => x.atan(),
            Function::Sinh => x.sinh(),
            Function::Cosh => x.cosh(),
            Function::Tanh => x.tanh(),
            Function::Asinh => x.asinh(),
            Function::Acosh => x.acosh(),
            Function::Atanh => x.atanh(),
            Function::Abs => x.abs(),
            Function::Signum => x.signum(),
            Function::Floor => x.floor(),
            Function::Ceil => x.ceil(),
            Function::Round => x.round(),
            Function::Trunc => x.trunc(),
        }
    }

    /// As it is written.
    pub fn name(self) -> &'static str {
        match self {
            Function::Recip => "recip",
            Function::Sqrt => "sqrt",
            Function::Cbrt => "cbrt",
            Function::Exp => "exp",
            Function::Exp2 => "exp2",
            Function::ExpM1 => "exp_m1",
            Function::Ln => "ln",
            Function::Ln1p => "ln_1p",
            Function::Log2 => "log2",
            Function::Log10 => "log10",
            Function::Sin => "sin",
            Function::Cos => "cos",
            Function::Tan => "tan",
            Function::Asin => "asin",
            Function::Acos => "acos",
            Function::Atan => "atan",
            Function::Sinh => "sinh",
            Function::Cosh => "cosh",
            Function::Tanh => "tanh",
            Function::Asinh => "asinh",
            Function::Acosh => "acosh",
            Function::Atanh => "atanh",
            Function::Abs => "abs",
            Function::Signum => "signum",
            Function::Floor => "floor",
            Function::Ceil => "ceil",
            Function::Round => "round",
            Function::Trunc => "trunc",
        }
    }
}

/// A function of two numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Function2 {
    /// The first to the power of the second.
    Pow,
    /// The angle of the point whose ordinate is the first and whose abscissa is the second.
    Atan2,
    /// The length of the hypotenuse.
    Hypot,
    /// The larger.
    Max,
    /// The smaller.
    Min,
    /// The first with the sign of the second.
    Copysign,
    /// The remainder of the first by the second, a constant, in `0..second`.
    RemEuclid,
}

impl Function2 {
    /// All of them.
    pub(crate) const ALL: [Function2; 7] = [
        Function2::Pow,
        Function2::Atan2,
        Function2::Hypot,
        Function2::Max,
        Function2::Min,
        Function2::Copysign,
        Function2::RemEuclid,
    ];

    /// The function's value.
    pub fn of<S: Scalar>(self, x: S, y: S, constant: Option<f64>) -> S {
        match (self, constant) {
            (Function2::Pow, Some(n)) => x.powf(n),
            (Function2::Pow, None) => x.pow(y),
            (Function2::Atan2, _) => x.atan2(y),
            (Function2::Hypot, _) => x.hypot(y),
            (Function2::Max, _) => x.max(y),
            (Function2::Min, _) => x.min(y),
            (Function2::Copysign, _) => x.copysign(y),
            (Function2::RemEuclid, period) => x.rem_euclid(period.unwrap_or(f64::NAN)),
        }
    }

    /// As it is written.
    pub fn name(self) -> &'static str {
        match self {
            Function2::Pow => "pow",
            Function2::Atan2 => "atan2",
            Function2::Hypot => "hypot",
            Function2::Max => "max",
            Function2::Min => "min",
            Function2::Copysign => "copysign",
            Function2::RemEuclid => "rem_euclid",
        }
    }
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
            Node::MulAdd([a, b, c]) => ([a, b, c, none], 3),
            Node::Select(_, all) => (all, 4),
        };
        operands.into_iter().take(count)
    }

    /// The same operation on other operands.
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
            Node::MulAdd(all) => Node::MulAdd(all.map(f)),
            Node::Select(comparison, all) => Node::Select(comparison, all.map(f)),
        }
    }
}
