//! [`Tape`]: a graph that is being made into a program.
//!
//! Values are computed in the order of the model's text. Slopes, and the steps of an integrator, are *relaxed*: signs are moved to the
//! outside of products, factors that do not vary within a pass are multiplied first, and a sum of products becomes one instruction.

use super::{Function, Function2, Graph, Id, Leaf, Node};
use crate::scalar::Comparison;

/// The quantities that a node depends on, as bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Depends(u8);

impl Depends {
    const PASS: u8 = 1;
    const RECORD: u8 = 2;
    const CARRY: u8 = 4;

    fn of_leaf(leaf: Leaf, uniform: bool) -> Self {
        Depends(match leaf {
            Leaf::Parameter(_) => Self::PASS,
            Leaf::Step if uniform => Self::PASS,
            Leaf::Step | Leaf::Time | Leaf::Input(_) | Leaf::NextInput(_) | Leaf::Measured(_) => Self::RECORD,
            Leaf::State(_) => Self::CARRY,
            // By how many samples changes with a parameter.
            Leaf::Late { .. } => Self::PASS | Self::RECORD,
        })
    }

    /// Whether it changes from sample to sample.
    pub fn varies(self) -> bool {
        self.0 & (Self::RECORD | Self::CARRY) != 0
    }

    /// Whether it depends on the record and on nothing else.
    pub fn on_record_alone(self) -> bool {
        self.0 == Self::RECORD
    }
}

/// A graph whose nodes are strict or relaxed.
#[derive(Clone, Debug)]
pub(crate) struct Tape {
    pub graph: Graph,
    pub relaxed: Vec<bool>,
    pub depends: Vec<Depends>,
    /// Whether the time between two samples is the same within a pass.
    pub uniform: bool,
}

impl Tape {
    pub fn new(uniform: bool) -> Self {
        Tape { graph: Graph::default(), relaxed: vec![], depends: vec![], uniform }
    }

    /// Takes note of new nodes; a node that is asked for as part of a value is strict from now on.
    fn noted(&mut self, id: Id, relaxed: bool) -> Id {
        for i in self.relaxed.len()..self.graph.len() {
            let node = self.graph.nodes()[i];
            self.relaxed.push(relaxed);
            self.depends.push(match node {
                Node::Leaf(leaf) => Depends::of_leaf(leaf, self.uniform),
                _ => Depends(node.operands().fold(0, |all, operand| all | self.depends[operand.index()].0)),
            });
        }
        if !relaxed {
            self.relaxed[id.index()] = false;
        }
        id
    }

    pub fn depends(&self, id: Id) -> Depends {
        self.depends[id.index()]
    }

    /// A value's node.
    pub fn strict(&mut self, f: impl FnOnce(&mut Graph) -> Id) -> Id {
        let id = f(&mut self.graph);
        self.noted(id, false)
    }

    /// A node of slope arithmetic that is no sum and no product.
    pub fn free(&mut self, f: impl FnOnce(&mut Graph) -> Id) -> Id {
        let id = f(&mut self.graph);
        self.noted(id, true)
    }

    pub fn constant(&mut self, value: f64) -> Id {
        self.free(|graph| graph.constant(value))
    }

    pub fn leaf(&mut self, leaf: Leaf) -> Id {
        self.free(|graph| graph.leaf(leaf))
    }

    pub fn function(&mut self, function: Function, a: Id) -> Id {
        self.free(|graph| graph.function(function, a))
    }

    pub fn select(&mut self, comparison: Comparison, a: Id, b: Id, then: Id, otherwise: Id) -> Id {
        self.free(|graph| graph.select(comparison, a, b, then, otherwise))
    }

    /// The values of another graph's roots; maxima and minima become selects.
    pub fn import(&mut self, other: &Graph, roots: &[Id]) -> Vec<Id> {
        let reached = other.reached(roots);
        let mut new = vec![Id::default(); other.len()];
        for (i, node) in other.nodes().iter().enumerate().filter(|(i, _)| reached[*i]) {
            let node = node.with_operands(|id| new[id.index()]);
            if let Node::Table { table, order, at } = node {
                new[i] = self.strict(|graph| graph.table(&other.tables()[table as usize], order, at));
                continue;
            }
            new[i] = self.imported(node);
        }
        roots.iter().map(|root| new[root.index()]).collect()
    }

    /// A value's node on operands of this tape.
    pub fn imported(&mut self, node: Node) -> Id {
        match node {
            Node::MulAdd([a, b, c]) => {
                let product = self.mul(a, b);
                self.add(c, product)
            }
            Node::Function2(Function2::Max, a, b) => self.either([b, a], a, b),
            Node::Function2(Function2::Min, a, b) => self.either([a, b], a, b),
            // The sign of what is not a number depends on the processor; here it is positive.
            Node::Function2(Function2::Copysign, a, b) => self.strict(|graph| {
                let zero = graph.constant(0.0);
                let sign = graph.select(Comparison::Equal, b, b, b, zero);
                graph.function2(Function2::Copysign, a, sign)
            }),
            _ => self.strict(|graph| match node {
                Node::Neg(a) => graph.neg(a),
                Node::Add(a, b) => graph.add(a, b),
                Node::Sub(a, b) => graph.sub(a, b),
                Node::Mul(a, b) => graph.mul(a, b),
                Node::Div(a, b) => graph.div(a, b),
                Node::Power(a, n) => graph.power(a, n),
                Node::Function(function, a) => graph.function(function, a),
                Node::Function2(function, a, b) => graph.function2(function, a, b),
                Node::Select(comparison, [a, b, c, d]) => graph.select(comparison, a, b, c, d),
                Node::Constant(_) | Node::Leaf(_) | Node::MulAdd(_) | Node::Table { .. } => graph.put(node),
            }),
        }
    }

    /// `a`, if the first two numbers are in order or if `b` is not a number; else `b`.
    fn either(&mut self, [low, high]: [Id; 2], a: Id, b: Id) -> Id {
        self.strict(|graph| {
            let unless_number = graph.select(Comparison::Equal, b, b, b, a);
            graph.select(Comparison::LessOrEqual, low, high, a, unless_number)
        })
    }

    fn negated(&self, id: Id) -> Option<Id> {
        match self.graph.node(id) {
            Node::Neg(a) if self.relaxed[id.index()] => Some(a),
            _ => None,
        }
    }

    /// `-a`, relaxed, as all that follows.
    pub fn neg(&mut self, a: Id) -> Id {
        match self.graph.node(a) {
            Node::Sub(x, y) if self.relaxed[a.index()] => self.sub(y, x),
            _ => self.free(|graph| graph.neg(a)),
        }
    }

    pub fn add(&mut self, a: Id, b: Id) -> Id {
        match (self.graph.known(a), self.graph.known(b)) {
            (Some(0.0), _) => return b,
            (_, Some(0.0)) => return a,
            _ => {}
        }
        match (self.negated(a), self.negated(b)) {
            (Some(x), Some(y)) => {
                let sum = self.add(x, y);
                self.neg(sum)
            }
            (Some(x), _) => self.sub(b, x),
            (_, Some(y)) => self.sub(a, y),
            _ => self.free(|graph| graph.add(a, b)),
        }
    }

    pub fn sub(&mut self, a: Id, b: Id) -> Id {
        match (self.graph.known(a), self.graph.known(b)) {
            (Some(0.0), _) => return self.neg(b),
            (_, Some(0.0)) => return a,
            _ => {}
        }
        match (self.negated(a), self.negated(b)) {
            (Some(x), Some(y)) => self.sub(y, x),
            (Some(x), _) => {
                let sum = self.add(x, b);
                self.neg(sum)
            }
            (_, Some(y)) => self.add(a, y),
            // `a - b` and `b - a` are one node.
            _ => match self.graph.find(Node::Sub(b, a)).filter(|other| self.relaxed[other.index()]) {
                Some(other) => self.free(|graph| graph.neg(other)),
                None => self.free(|graph| graph.sub(a, b)),
            },
        }
    }

    pub fn mul(&mut self, a: Id, b: Id) -> Id {
        if self.graph.known(a) == Some(0.0) || self.graph.known(b) == Some(0.0) {
            return self.constant(0.0);
        }
        if let Some(x) = self.negated(a) {
            let product = self.mul(x, b);
            return self.neg(product);
        }
        if let Some(y) = self.negated(b) {
            let product = self.mul(a, y);
            return self.neg(product);
        }
        // Factors that do not vary within a pass are multiplied first: (x r) s = x (r s).
        for (a, b) in [(a, b), (b, a)] {
            let Node::Mul(x, y) = self.graph.node(a) else { continue };
            if self.depends(b).varies() || !self.depends(a).varies() || !self.relaxed[a.index()] {
                continue;
            }
            for (x, y) in [(x, y), (y, x)] {
                if !self.depends(y).varies() {
                    let invariant = self.mul(y, b);
                    return self.mul(x, invariant);
                }
            }
        }
        self.free(|graph| graph.mul(a, b))
    }
}
