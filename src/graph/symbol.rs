//! [`Symbol`]: the number that a graph is read with.

use super::trace::with;
use super::{Function, Function2, Graph, Id, Leaf};
use crate::scalar::{Comparison, Grid, Scalar, Table};
use core::cmp::Ordering;
use core::iter::Sum;
use core::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

/// A node of the graph that is being read on this thread ([`Graph::trace`]). Elsewhere it stands for nothing.
#[derive(Clone, Copy, Debug)]
pub struct Symbol {
    id: Id,
    /// The trace that it belongs to; zero: none.
    trace: u64,
}

impl Symbol {
    /// A quantity that comes from outside.
    pub fn leaf(leaf: Leaf) -> Self {
        Symbol::made(|graph| graph.leaf(leaf))
    }

    /// The node, if it is one of this trace.
    pub(super) fn of(self, trace: u64) -> Option<Id> {
        (self.trace == trace).then_some(self.id)
    }

    /// `k * a + self`, rounded once or twice.
    pub(crate) fn along(self, k: Self, a: Self) -> Self {
        Symbol::combined([self, k, a], |graph, [x, k, a]| graph.mul_add(k, a, x))
    }

    /// Ends the trace, if there is one.
    pub(crate) fn fail(reason: &str) {
        with(|arena| arena.fail(reason));
    }

    fn made(f: impl FnOnce(&mut Graph) -> Id) -> Self {
        let made = with(|arena| Symbol { id: f(&mut arena.graph), trace: arena.number });
        made.unwrap_or(Symbol { id: Id::default(), trace: 0 })
    }

    fn combined<const N: usize>(symbols: [Self; N], f: impl FnOnce(&mut Graph, [Id; N]) -> Id) -> Self {
        let made = with(|arena| {
            if symbols.iter().any(|symbol| symbol.trace != arena.number) {
                arena.fail("it uses a number that was kept from elsewhere");
                return Symbol { id: Id::default(), trace: 0 };
            }
            Symbol { id: f(&mut arena.graph, symbols.map(|symbol| symbol.id)), trace: arena.number }
        });
        made.unwrap_or(Symbol { id: Id::default(), trace: 0 })
    }

    fn ask(comparison: Comparison, a: Self, b: Self) -> bool {
        let answer = with(|arena| match (a.of(arena.number), b.of(arena.number)) {
            (Some(a), Some(b)) => arena.ask(comparison, a, b),
            _ => {
                arena.fail("it uses a number that was kept from elsewhere");
                false
            }
        });
        answer.unwrap_or(false)
    }

    fn order(a: Self, b: Self) -> Option<Ordering> {
        if Symbol::ask(Comparison::Less, a, b) {
            Some(Ordering::Less)
        } else if Symbol::ask(Comparison::Equal, a, b) {
            Some(Ordering::Equal)
        } else if Symbol::ask(Comparison::Less, b, a) {
            Some(Ordering::Greater)
        } else {
            None
        }
    }
}

impl Default for Symbol {
    fn default() -> Self {
        Symbol::from(0.0)
    }
}

impl From<f64> for Symbol {
    fn from(value: f64) -> Self {
        Symbol::made(|graph| graph.constant(value))
    }
}

macro_rules! comparisons {
    ($($other:ty),*) => {$(
        impl PartialEq<$other> for Symbol {
            fn eq(&self, other: &$other) -> bool {
                Symbol::ask(Comparison::Equal, *self, Symbol::from(*other))
            }
        }
        impl PartialOrd<$other> for Symbol {
            fn partial_cmp(&self, other: &$other) -> Option<Ordering> {
                Symbol::order(*self, Symbol::from(*other))
            }
            fn lt(&self, other: &$other) -> bool {
                Symbol::ask(Comparison::Less, *self, Symbol::from(*other))
            }
            fn le(&self, other: &$other) -> bool {
                Symbol::ask(Comparison::LessOrEqual, *self, Symbol::from(*other))
            }
            fn gt(&self, other: &$other) -> bool {
                Symbol::ask(Comparison::Less, Symbol::from(*other), *self)
            }
            fn ge(&self, other: &$other) -> bool {
                Symbol::ask(Comparison::LessOrEqual, Symbol::from(*other), *self)
            }
        }
    )*};
}
comparisons! { Symbol, f64 }

impl Neg for Symbol {
    type Output = Self;
    fn neg(self) -> Self {
        Symbol::combined([self], |graph, [a]| graph.neg(a))
    }
}

macro_rules! operators {
    ($($trait:ident $method:ident $assign:ident $assign_method:ident;)*) => {$(
        impl $trait for Symbol {
            type Output = Self;
            fn $method(self, b: Self) -> Self {
                Symbol::combined([self, b], |graph, [a, b]| graph.$method(a, b))
            }
        }
        impl $trait<f64> for Symbol {
            type Output = Self;
            fn $method(self, b: f64) -> Self {
                $trait::$method(self, Symbol::from(b))
            }
        }
        impl $assign for Symbol {
            fn $assign_method(&mut self, b: Self) {
                *self = $trait::$method(*self, b);
            }
        }
        impl $assign<f64> for Symbol {
            fn $assign_method(&mut self, b: f64) {
                *self = $trait::$method(*self, b);
            }
        }
    )*};
}
operators! {
    Add add AddAssign add_assign; Sub sub SubAssign sub_assign; Mul mul MulAssign mul_assign; Div div DivAssign div_assign;
}

impl Sum for Symbol {
    fn sum<I: Iterator<Item = Self>>(terms: I) -> Self {
        terms.reduce(|a, b| a + b).unwrap_or_default()
    }
}

macro_rules! functions {
    ($($name:ident $function:ident;)*) => {$(
        fn $name(self) -> Self {
            Symbol::combined([self], |graph, [a]| graph.function(Function::$function, a))
        }
    )*};
}

macro_rules! functions_of_two {
    ($($name:ident $function:ident;)*) => {$(
        fn $name(self, other: Self) -> Self {
            Symbol::combined([self, other], |graph, [a, b]| graph.function2(Function2::$function, a, b))
        }
    )*};
}

impl Scalar for Symbol {
    fn value(&self) -> f64 {
        Symbol::fail("it asks a number for its value (`value()`)");
        f64::NAN
    }
    fn chain(self, _f: f64, _df: f64) -> Self {
        Symbol::fail("it applies a function that the library does not know (`chain`)");
        Symbol::from(f64::NAN)
    }
    fn select(comparison: Comparison, a: Self, b: Self, then: Self, otherwise: Self) -> Self {
        Symbol::combined([a, b, then, otherwise], |graph, [a, b, c, d]| graph.select(comparison, a, b, c, d))
    }
    functions! {
        sqrt Sqrt; cbrt Cbrt; exp Exp; exp2 Exp2; exp_m1 ExpM1; ln Ln; ln_1p Ln1p; log2 Log2; log10 Log10; sin Sin; cos Cos;
        tan Tan; asin Asin; acos Acos; atan Atan; sinh Sinh; cosh Cosh; tanh Tanh; asinh Asinh; acosh Acosh; atanh Atanh;
        recip Recip; abs Abs; signum Signum; floor Floor; ceil Ceil; round Round; trunc Trunc;
    }
    functions_of_two! { pow Pow; atan2 Atan2; hypot Hypot; max Max; min Min; copysign Copysign; }
    fn powi(self, n: i32) -> Self {
        Symbol::combined([self], |graph, [a]| graph.power(a, n))
    }
    fn powf(self, n: f64) -> Self {
        self.pow(Symbol::from(n))
    }
    fn sin_cos(self) -> (Self, Self) {
        (self.sin(), self.cos())
    }
    fn mul_add(self, a: Self, b: Self) -> Self {
        self * a + b
    }
    fn clamp(self, low: f64, high: f64) -> Self {
        let (low, high) = (Symbol::from(low), Symbol::from(high));
        let above = Symbol::select(Comparison::Less, self, low, low, self);
        Symbol::select(Comparison::Less, high, self, high, above)
    }
    fn look_up(table: &Grid<'_>, at: [Self; 2], order: [u8; 2]) -> Self {
        Symbol::combined(at, |graph, at| graph.table(&Table::from(table), order, at))
    }
    fn fract(self) -> Self {
        self - self.trunc()
    }
    fn rem_euclid(self, period: f64) -> Self {
        let period = Symbol::from(period);
        Symbol::combined([self, period], |graph, [a, b]| graph.function2(Function2::RemEuclid, a, b))
    }
}
