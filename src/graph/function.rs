//! [`Function`] and [`Function2`]: the functions that a graph knows.

use crate::scalar::Scalar;
use serde::{Deserialize, Serialize};

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
    /// All of them; machine code calls them by number, texts by name.
    #[cfg(any(test, feature = "jit", feature = "text"))]
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
    /// All of them; machine code calls them by number, texts by name.
    #[cfg(any(feature = "jit", feature = "text"))]
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
