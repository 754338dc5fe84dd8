//! How each operation changes with its operands.

use super::tape::Tape;
use super::{Function, Function2, Id, Node};
use crate::scalar::Comparison;
use core::f64::consts::{LN_2, LOG2_E, LOG10_E};

/// The slope of a node with respect to one of its operands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Partial {
    One,
    MinusOne,
    Node(Id),
}

/// How slopes pass a node.
pub(crate) enum Rule {
    /// They do not: a leaf, or a function that is flat.
    Flat,
    /// Each operand's slope times a partial slope.
    Linear(Vec<(Id, Partial)>),
    /// The same, but what does not vary contributes nothing where the partial slope is infinite.
    Singular(Vec<(Id, Id)>),
    /// As the value is selected.
    Select(Comparison, [Id; 4]),
    /// The length of a vector, which at the origin grows by the length of its slopes. Radius and both operands.
    Length(Id, Id, Id),
}

impl Tape {
    /// How slopes pass a node.
    pub fn rule(&mut self, id: Id) -> Rule {
        match self.graph.node(id) {
            Node::Constant(_) | Node::Leaf(_) => Rule::Flat,
            Node::Neg(a) => Rule::Linear(vec![(a, Partial::MinusOne)]),
            Node::Add(a, b) => Rule::Linear(vec![(a, Partial::One), (b, Partial::One)]),
            Node::Sub(a, b) => Rule::Linear(vec![(a, Partial::One), (b, Partial::MinusOne)]),
            Node::Mul(a, b) => Rule::Linear(vec![(a, Partial::Node(b)), (b, Partial::Node(a))]),
            Node::Div(a, b) => {
                let reciprocal = self.function(Function::Recip, b);
                let slope = self.mul(id, reciprocal);
                let slope = self.neg(slope);
                Rule::Linear(vec![(a, Partial::Node(reciprocal)), (b, Partial::Node(slope))])
            }
            Node::MulAdd([a, b, c]) => {
                Rule::Linear(vec![(a, Partial::Node(b)), (b, Partial::Node(a)), (c, Partial::One)])
            }
            Node::Power(a, n) => {
                let (less, n) = (self.free(|graph| graph.power(a, n.saturating_sub(1))), self.constant(f64::from(n)));
                let slope = self.mul(less, n);
                Rule::Linear(vec![(a, Partial::Node(slope))])
            }
            Node::Function(function, a) => self.rule_of_function(function, id, a),
            Node::Function2(function, a, b) => self.rule_of_function2(function, id, a, b),
            Node::Table { table, order: [i, j], at: [x, y] } => {
                let slope = |tape: &mut Self, order| {
                    Partial::Node(tape.free(|graph| graph.look_up(table as usize, order, [x, y])))
                };
                let dx = slope(self, [i.saturating_add(1), j]);
                if !self.graph.tables()[table as usize].grid().is_surface() {
                    return Rule::Linear(vec![(x, dx)]);
                }
                let dy = slope(self, [i, j.saturating_add(1)]);
                Rule::Linear(vec![(x, dx), (y, dy)])
            }
            Node::Select(comparison, all) => Rule::Select(comparison, all),
        }
    }

    fn rule_of_function(&mut self, function: Function, f: Id, x: Id) -> Rule {
        let singular =
            matches!(function, Function::Sqrt | Function::Cbrt | Function::Asin | Function::Acos | Function::Acosh);
        match self.slope_of_function(function, f, x) {
            None => Rule::Flat,
            Some(slope) if singular => Rule::Singular(vec![(x, slope)]),
            Some(slope) => Rule::Linear(vec![(x, Partial::Node(slope))]),
        }
    }

    fn slope_of_function(&mut self, function: Function, f: Id, x: Id) -> Option<Id> {
        let one = self.constant(1.0);
        let over = |tape: &mut Self, factor: f64, divisor: Id| {
            let reciprocal = tape.function(Function::Recip, divisor);
            let factor = tape.constant(factor);
            tape.mul(reciprocal, factor)
        };
        Some(match function {
            Function::Recip => {
                let square = self.mul(f, f);
                self.neg(square)
            }
            Function::Sqrt => over(self, 0.5, f),
            Function::Cbrt => {
                let square = self.mul(f, f);
                over(self, 1.0 / 3.0, square)
            }
            Function::Exp => f,
            Function::Exp2 => {
                let factor = self.constant(LN_2);
                self.mul(f, factor)
            }
            Function::ExpM1 => self.add(f, one),
            Function::Ln => over(self, 1.0, x),
            Function::Ln1p => {
                let sum = self.add(x, one);
                over(self, 1.0, sum)
            }
            Function::Log2 => over(self, LOG2_E, x),
            Function::Log10 => over(self, LOG10_E, x),
            Function::Sin => self.function(Function::Cos, x),
            Function::Cos => {
                let sin = self.function(Function::Sin, x);
                self.neg(sin)
            }
            Function::Tan => {
                let square = self.mul(f, f);
                self.add(square, one)
            }
            Function::Asin | Function::Acos => {
                let inside = self.one_less_square(x);
                let root = self.function(Function::Sqrt, inside);
                over(self, if function == Function::Asin { 1.0 } else { -1.0 }, root)
            }
            Function::Atan => {
                let square = self.mul(x, x);
                let sum = self.add(square, one);
                over(self, 1.0, sum)
            }
            Function::Sinh => self.function(Function::Cosh, x),
            Function::Cosh => self.function(Function::Sinh, x),
            Function::Tanh => self.one_less_square(f),
            Function::Asinh => {
                let hypot = self.free(|graph| graph.function2(Function2::Hypot, x, one));
                over(self, 1.0, hypot)
            }
            Function::Acosh => {
                let (less, more) = (self.sub(x, one), self.add(x, one));
                let product = self.mul(less, more);
                let root = self.function(Function::Sqrt, product);
                over(self, 1.0, root)
            }
            Function::Atanh => {
                let inside = self.one_less_square(x);
                over(self, 1.0, inside)
            }
            Function::Abs => self.function(Function::Signum, x),
            Function::Signum | Function::Floor | Function::Ceil | Function::Round | Function::Trunc => return None,
        })
    }

    /// `1 - x^2` without cancellation.
    fn one_less_square(&mut self, x: Id) -> Id {
        let one = self.constant(1.0);
        let (less, more) = (self.sub(one, x), self.add(x, one));
        self.mul(less, more)
    }

    fn rule_of_function2(&mut self, function: Function2, f: Id, x: Id, y: Id) -> Rule {
        match function {
            Function2::Pow => self.rule_of_pow(f, x, y),
            Function2::Hypot => Rule::Length(f, x, y),
            Function2::Atan2 => {
                let r = self.free(|graph| graph.function2(Function2::Hypot, x, y));
                let (over, zero) = (self.function(Function::Recip, r), self.constant(0.0));
                // Twice by the radius rather than once by its square: no overflow.
                let mut slope = |of: Id, sign: f64| {
                    let (once, sign) = (self.mul(of, over), self.constant(sign));
                    let twice = self.mul(once, over);
                    let slope = self.mul(twice, sign);
                    self.select(Comparison::Less, zero, r, slope, zero)
                };
                Rule::Linear(vec![(x, Partial::Node(slope(y, 1.0))), (y, Partial::Node(slope(x, -1.0)))])
            }
            Function2::Copysign => {
                let (a, b) = (self.function(Function::Signum, x), self.function(Function::Signum, y));
                let sign = self.mul(a, b);
                Rule::Linear(vec![(x, Partial::Node(sign))])
            }
            Function2::RemEuclid => Rule::Linear(vec![(x, Partial::One)]),
            // Selects, since the tape was written.
            Function2::Max | Function2::Min => Rule::Flat,
        }
    }

    fn rule_of_pow(&mut self, f: Id, x: Id, n: Id) -> Rule {
        let (one, zero) = (self.constant(1.0), self.constant(0.0));
        let less = self.sub(n, one);
        let power = self.free(|graph| graph.function2(Function2::Pow, x, less));
        let slope = self.mul(power, n);
        if let Some(n) = self.graph.known(n) {
            return match n >= 1.0 {
                true => Rule::Linear(vec![(x, Partial::Node(slope))]),
                false => Rule::Singular(vec![(x, slope)]),
            };
        }
        let base = self.select(Comparison::Equal, n, zero, zero, slope);
        // 0^n does not move with n (n > 0): the limit of f ln x, not its 0 * -inf.
        let ln = self.function(Function::Ln, x);
        let slope = self.mul(f, ln);
        let exponent = self.select(Comparison::Equal, f, zero, zero, slope);
        Rule::Singular(vec![(x, base), (n, exponent)])
    }
}
