//! Graphs by hand: each operation, with what is known computed at once.
//!
//! Only what changes no bit of any result is simplified (`-(-x)`, `x * 1`, `(-a) * b`): `x + 0` is not `x` where `x` is -0.

use super::{Constant, Function, Function2, Graph, Id, Leaf, Node};
use crate::scalar::{Comparison, Scalar, Table};
use std::sync::Arc;

impl Graph {
    /// The identifier of a node as it stands; a new one if there is none like it.
    pub(crate) fn put(&mut self, node: Node) -> Id {
        if let Some(id) = self.known.get(&node) {
            return *id;
        }
        let id = Id::new(self.nodes.len());
        self.nodes.push(node);
        self.known.insert(node, id);
        id
    }

    /// Whether there is such a node already.
    pub(crate) fn find(&self, node: Node) -> Option<Id> {
        self.known.get(&node).copied()
    }

    /// An operand; what is not of this graph counts as not a number.
    fn own(&mut self, id: Id) -> Id {
        if id.index() < self.nodes.len() { id } else { self.constant(f64::NAN) }
    }

    /// The number that a node is, if it is known.
    pub fn known(&self, id: Id) -> Option<f64> {
        match self.node(id) {
            Node::Constant(constant) => Some(constant.value()),
            _ => None,
        }
    }

    /// Whether nodes are the states, in order.
    pub(crate) fn are_states(&self, ids: &[Id]) -> bool {
        (0..).zip(ids).all(|(i, id)| self.is_state(*id, i))
    }

    /// Whether a node is the state of this number.
    pub(crate) fn is_state(&self, id: Id, number: u32) -> bool {
        matches!(self.node(id), Node::Leaf(Leaf::State(i)) if i == number)
    }

    fn negated(&self, id: Id) -> Option<Id> {
        match self.node(id) {
            Node::Neg(a) => Some(a),
            _ => None,
        }
    }

    /// A number.
    pub fn constant(&mut self, value: f64) -> Id {
        self.put(Node::Constant(Constant::from(value)))
    }

    /// A quantity from outside.
    pub fn leaf(&mut self, leaf: Leaf) -> Id {
        self.put(Node::Leaf(leaf))
    }

    /// `-a`
    pub fn neg(&mut self, a: Id) -> Id {
        let a = self.own(a);
        match (self.known(a), self.negated(a)) {
            (Some(x), _) => self.constant(-x),
            (_, Some(x)) => x,
            _ => self.put(Node::Neg(a)),
        }
    }

    /// `a + b`
    pub fn add(&mut self, a: Id, b: Id) -> Id {
        let (a, b) = (self.own(a), self.own(b));
        let is_nothing = |x: Option<f64>| x.is_some_and(|x| x == 0.0 && x.is_sign_negative());
        match (self.known(a), self.known(b)) {
            (Some(x), Some(y)) => return self.constant(x + y),
            (x, _) if is_nothing(x) => return b,
            (_, y) if is_nothing(y) => return a,
            _ => {}
        }
        match (self.negated(a), self.negated(b)) {
            (_, Some(y)) => self.sub(a, y),
            (Some(x), _) => self.sub(b, x),
            _ => self.put(Node::Add(a.min(b), a.max(b))),
        }
    }

    /// `a - b`
    pub fn sub(&mut self, a: Id, b: Id) -> Id {
        let (a, b) = (self.own(a), self.own(b));
        match (self.known(a), self.known(b)) {
            (Some(x), Some(y)) => self.constant(x - y),
            (_, Some(y)) if y == 0.0 && y.is_sign_positive() => a,
            _ => match self.negated(b) {
                Some(y) => self.add(a, y),
                None => self.put(Node::Sub(a, b)),
            },
        }
    }

    /// `a * b`
    pub fn mul(&mut self, a: Id, b: Id) -> Id {
        let (a, b) = (self.own(a), self.own(b));
        match (self.known(a), self.known(b)) {
            (Some(x), Some(y)) => return self.constant(x * y),
            (Some(1.0), _) => return b,
            (_, Some(1.0)) => return a,
            (Some(-1.0), _) => return self.neg(b),
            (_, Some(-1.0)) => return self.neg(a),
            _ => {}
        }
        match (self.negated(a), self.negated(b)) {
            (Some(x), Some(y)) => self.mul(x, y),
            (Some(x), _) => {
                let product = self.mul(x, b);
                self.neg(product)
            }
            (_, Some(y)) => {
                let product = self.mul(a, y);
                self.neg(product)
            }
            _ => self.put(Node::Mul(a.min(b), a.max(b))),
        }
    }

    /// `a / b`
    pub fn div(&mut self, a: Id, b: Id) -> Id {
        let (a, b) = (self.own(a), self.own(b));
        match (self.known(a), self.known(b)) {
            (Some(x), Some(y)) => self.constant(x / y),
            (Some(1.0), _) => self.function(Function::Recip, b),
            (_, Some(y)) => {
                let reciprocal = self.constant(1.0 / y);
                self.mul(a, reciprocal)
            }
            _ => self.put(Node::Div(a, b)),
        }
    }

    /// `a * b + c`, rounded once or twice.
    pub fn mul_add(&mut self, a: Id, b: Id, c: Id) -> Id {
        let (a, b, c) = (self.own(a), self.own(b), self.own(c));
        match (self.known(a), self.known(b)) {
            // Nothing times what is finite, as a rule: an integrator's first stage.
            (_, Some(0.0)) | (Some(0.0), _) => c,
            (_, Some(1.0)) | (Some(1.0), _) | (Some(_), Some(_)) => {
                let product = self.mul(a, b);
                self.add(product, c)
            }
            _ => self.put(Node::MulAdd([a.min(b), a.max(b), c])),
        }
    }

    /// `a` to the power `n`
    pub fn power(&mut self, a: Id, n: i32) -> Id {
        let a = self.own(a);
        match (self.known(a), n) {
            (Some(x), _) => self.constant(Scalar::powi(x, n)),
            (_, 0) => self.constant(1.0),
            (_, 1) => a,
            (_, 2) => self.mul(a, a),
            _ => self.put(Node::Power(a, n)),
        }
    }

    /// A function of one number.
    pub fn function(&mut self, function: Function, a: Id) -> Id {
        let a = self.own(a);
        match (self.known(a), self.node(a)) {
            (Some(x), _) => self.constant(function.of(x)),
            (_, Node::Neg(x)) if function == Function::Abs => self.function(Function::Abs, x),
            _ => self.put(Node::Function(function, a)),
        }
    }

    /// A function of two numbers.
    pub fn function2(&mut self, function: Function2, a: Id, b: Id) -> Id {
        let (a, b) = (self.own(a), self.own(b));
        match (function, self.known(a), self.known(b)) {
            (_, Some(x), Some(y)) => self.constant(function.of(x, y, Some(y))),
            (Function2::Pow, _, Some(0.0)) => self.constant(1.0),
            (Function2::Pow, _, Some(1.0)) => a,
            (Function2::Pow, _, Some(2.0)) => self.mul(a, a),
            _ => self.put(Node::Function2(function, a, b)),
        }
    }

    /// The value of a table at a place, or its derivative of these orders; a table of one argument takes the first.
    pub fn table(&mut self, table: &Table, order: [u8; 2], at: [Id; 2]) -> Id {
        let number = self.tables.iter().position(|known| **known == *table).unwrap_or_else(|| {
            self.tables.push(Arc::new(table.clone()));
            self.tables.len() - 1
        });
        self.look_up(number, order, at)
    }

    /// A look-up by the table's number among those of this graph.
    pub(crate) fn look_up(&mut self, number: usize, order: [u8; 2], at: [Id; 2]) -> Id {
        let Some(table) = self.tables.get(number).cloned() else { return self.constant(f64::NAN) };
        let [x, y] = at.map(|id| self.own(id));
        let y = if table.grid().is_surface() { y } else { x };
        match (self.known(x), self.known(y)) {
            (Some(x), Some(y)) => self.constant(table.grid().derivative([x, y], order)),
            _ => self.put(Node::Table { table: Id::new(number).0, order, at: [x, y] }),
        }
    }

    /// `then`, where the comparison of `a` with `b` holds, else `otherwise`.
    pub fn select(&mut self, comparison: Comparison, a: Id, b: Id, then: Id, otherwise: Id) -> Id {
        let [a, b, then, otherwise] = [a, b, then, otherwise].map(|id| self.own(id));
        match (self.known(a), self.known(b)) {
            _ if then == otherwise => then,
            (Some(x), Some(y)) => {
                if comparison.holds(x, y) {
                    then
                } else {
                    otherwise
                }
            }
            _ => self.put(Node::Select(comparison, [a, b, then, otherwise])),
        }
    }

    /// Another graph's roots in this one, its leaves replaced.
    ///
    /// # Panics
    /// Never.
    pub fn import(&mut self, other: &Graph, roots: &[Id], mut leaf: impl FnMut(&mut Graph, Leaf) -> Id) -> Vec<Id> {
        let reached = other.reached(roots);
        let mut new = vec![Id::default(); other.len()];
        for (i, node) in other.nodes().iter().enumerate().filter(|(i, _)| reached[*i]) {
            let at = |id: Id| new[id.index()];
            new[i] = match *node {
                Node::Constant(constant) => self.constant(constant.value()),
                Node::Leaf(of) => leaf(self, of),
                Node::Neg(a) => self.neg(at(a)),
                Node::Add(a, b) => self.add(at(a), at(b)),
                Node::Sub(a, b) => self.sub(at(a), at(b)),
                Node::Mul(a, b) => self.mul(at(a), at(b)),
                Node::Div(a, b) => self.div(at(a), at(b)),
                Node::MulAdd([a, b, c]) => self.mul_add(at(a), at(b), at(c)),
                Node::Power(a, n) => self.power(at(a), n),
                Node::Function(function, a) => self.function(function, at(a)),
                Node::Function2(function, a, b) => self.function2(function, at(a), at(b)),
                Node::Table { table, order, at: [a, b] } => {
                    self.table(&other.tables[table as usize], order, [at(a), at(b)])
                }
                Node::Select(comparison, [a, b, c, d]) => self.select(comparison, at(a), at(b), at(c), at(d)),
            };
        }
        roots.iter().map(|root| new.get(root.index()).copied().unwrap_or_else(|| self.constant(f64::NAN))).collect()
    }
}
