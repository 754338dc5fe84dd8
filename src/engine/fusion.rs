//! Which operations become one instruction: sums of products.
//!
//! Of values every operation is rounded as the text says; slopes are fused.

use super::code::{Operation, TERMS};
use crate::graph::{Function, Function2, Id, Node, Tape};
use crate::scalar::Comparison;

/// A product, or a number by itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Term {
    pub a: Id,
    pub b: Option<Id>,
    pub minus: bool,
}

/// `(init +- a b +- ...) factor`; without `init` the first term is a product that is added.
#[derive(Clone, Debug)]
pub(super) struct Sum {
    /// Each operation, not each product with its sum.
    pub rounded: bool,
    pub init: Option<Id>,
    pub terms: Vec<Term>,
    pub factor: Option<Id>,
}

/// The instruction that computes a node.
#[derive(Clone, Debug)]
pub(super) enum Work {
    Sum(Sum),
    /// Any other operation.
    Operation(Operation, Vec<Id>),
    /// A table's value or derivative.
    Table {
        table: u32,
        order: u8,
        at: [Id; 2],
    },
}

impl Work {
    /// The nodes that it reads.
    pub fn operands(&self) -> Vec<Id> {
        match self {
            Work::Sum(Sum { init, terms, factor, .. }) => {
                let products = terms.iter().flat_map(|term| [Some(term.a), term.b]).flatten();
                init.iter().copied().chain(products).chain(*factor).collect()
            }
            Work::Operation(_, operands) => operands.clone(),
            Work::Table { at, .. } => at.to_vec(),
        }
    }
}

impl Sum {
    /// As a simpler operation, where it is one.
    fn work(self) -> Work {
        match (self.init, &self.terms[..], self.factor) {
            (Some(a), [Term { a: b, b: None, minus }], None) => {
                Work::Operation(if *minus { Operation::Sub } else { Operation::Add }, vec![a, *b])
            }
            (None, [Term { a, b: None, minus: true }], None) => Work::Operation(Operation::Neg, vec![*a]),
            _ => Work::Sum(self),
        }
    }
}

/// How many instructions the roots take at each sample.
pub(super) fn instructions(tape: &Tape, roots: &[Id]) -> usize {
    let works = works(tape, roots);
    let varying = works.iter().enumerate().filter(|(i, _)| tape.depends[*i].varies());
    varying
        .filter_map(|(_, work)| work.as_ref())
        .map(|work| match work {
            Work::Sum(sum) => sum.terms.len().div_ceil(TERMS),
            Work::Operation(Operation::Function(_) | Operation::Function2(_), _) | Work::Table { .. } => 10,
            Work::Operation(..) => 1,
        })
        .sum()
}

/// The instruction of each node that the roots need; none for leaves, numbers, and nodes that are part of another node's sum.
pub(super) fn works(tape: &Tape, roots: &[Id]) -> Vec<Option<Work>> {
    let reached = tape.graph.reached(roots);
    let mut uses = vec![0u32; tape.graph.len()];
    for (_, node) in tape.graph.nodes().iter().enumerate().filter(|(i, _)| reached[*i]) {
        node.operands().for_each(|operand| uses[operand.index()] += 1);
    }
    roots.iter().for_each(|root| uses[root.index()] += 1);
    let mut fusion = Fusion { tape, uses, absorbed: vec![false; tape.graph.len()] };
    let mut works = vec![None; tape.graph.len()];
    for i in (0..tape.graph.len()).rev().filter(|i| reached[*i]) {
        if !fusion.absorbed[i] {
            works[i] = fusion.work(Id::new(i));
        }
    }
    works
}

struct Fusion<'a> {
    tape: &'a Tape,
    uses: Vec<u32>,
    absorbed: Vec<bool>,
}

impl Fusion<'_> {
    fn work(&mut self, id: Id) -> Option<Work> {
        let operation = |operation: Operation, operands: &[Id]| Some(Work::Operation(operation, operands.to_vec()));
        match self.tape.graph.node(id) {
            Node::Constant(_) | Node::Leaf(_) => None,
            Node::Add(..) | Node::Sub(..) | Node::Neg(_) if self.tape.relaxed[id.index()] => {
                Some(self.fused(id).work())
            }
            Node::Add(..) | Node::Sub(..) => Some(self.rounded(id).work()),
            Node::Neg(a) => operation(Operation::Neg, &[a]),
            Node::Mul(a, b) => {
                let scaled = self.scaled(id, a, b).or_else(|| self.scaled(id, b, a));
                scaled.or(operation(Operation::Mul, &[a, b]))
            }
            Node::Function(function, a) => operation(of_function(function), &[a]),
            Node::Function2(Function2::Copysign, a, b) => operation(Operation::Copysign, &[a, b]),
            Node::Function2(function, a, b) => operation(Operation::Function2(function), &[a, b]),
            Node::Select(comparison, all) => operation(of_comparison(comparison), &all),
            Node::Table { table, order: [i, j], at } => {
                Some(Work::Table { table, order: i.min(15) << 4 | j.min(15), at })
            }
            // Not on a tape whose operations are those of registers.
            Node::Div(..) | Node::MulAdd(_) | Node::Power(..) => None,
        }
    }

    /// Whether a node is read by nothing but `reader`, and varies as it does.
    fn belongs(&self, id: Id, reader: Id) -> bool {
        self.uses[id.index()] == 1 && self.tape.depends(id).varies() == self.tape.depends(reader).varies()
    }

    /// The product of a sum that nothing else reads with a factor.
    fn scaled(&mut self, id: Id, sum: Id, factor: Id) -> Option<Work> {
        let is_sum = matches!(self.tape.graph.node(sum), Node::Add(..) | Node::Sub(..));
        if !is_sum || !self.belongs(sum, id) {
            return None;
        }
        self.absorbed[sum.index()] = true;
        let found = if self.tape.relaxed[sum.index()] { self.fused(sum) } else { self.rounded(sum) };
        Some(Work::Sum(Sum { factor: Some(factor), ..found }))
    }

    /// A relaxed sum, with all relaxed sums and products in it.
    fn fused(&mut self, id: Id) -> Sum {
        let mut terms: Vec<Term> = vec![];
        let mut open = vec![(id, false)];
        while let Some((at, minus)) = open.pop() {
            let own = at == id || self.belongs(at, id) && self.tape.relaxed[at.index()];
            match self.tape.graph.node(at) {
                Node::Add(a, b) if own => open.extend([(b, minus), (a, minus)]),
                Node::Sub(a, b) if own => open.extend([(b, !minus), (a, minus)]),
                Node::Neg(a) if own => open.push((a, !minus)),
                Node::Mul(a, b) if own => terms.push(Term { a, b: Some(b), minus }),
                _ => {
                    terms.push(Term { a: at, b: None, minus });
                    continue;
                }
            }
            self.absorbed[at.index()] |= at != id;
        }
        let init = terms.iter().position(|term| term.b.is_none() && !term.minus).map(|at| terms.remove(at).a);
        if init.is_none()
            && let Some(first) = terms.iter().position(|term| term.b.is_some() && !term.minus)
        {
            let first = terms.remove(first);
            terms.insert(0, first);
        }
        Sum { rounded: false, init, terms, factor: None }
    }

    /// The factors of a product that belongs to the reader.
    fn product(&self, id: Id, reader: Id) -> Option<[Id; 2]> {
        match self.tape.graph.node(id) {
            Node::Mul(a, b) if self.belongs(id, reader) => Some([a, b]),
            _ => None,
        }
    }

    fn is_strict_sum(&self, id: Id, reader: Id) -> bool {
        let sum = matches!(self.tape.graph.node(id), Node::Add(..) | Node::Sub(..));
        sum && !self.tape.relaxed[id.index()] && self.belongs(id, reader)
    }

    /// A sum of a value: a chain of additions, in the order of the text.
    fn rounded(&mut self, id: Id) -> Sum {
        let (mut at, mut terms) = (id, vec![]);
        let init = loop {
            let (l, r, minus) = match self.tape.graph.node(at) {
                Node::Sub(l, r) => (l, r, true),
                Node::Add(l, r) => (l, r, false),
                _ => break Some(at),
            };
            // The sum so far, and what is added to it last. Addition commutes, so that either operand may be the sum.
            let product = |x: Id| self.product(x, id);
            let sum = |x: Id| self.is_strict_sum(x, id);
            let swap = !minus && product(r).is_none() && (product(l).is_some() || !sum(l) && sum(r));
            let (before, last) = if swap { (r, l) } else { (l, r) };
            match product(last) {
                Some([a, b]) => {
                    self.absorbed[last.index()] = true;
                    terms.push(Term { a, b: Some(b), minus });
                }
                None => terms.push(Term { a: last, b: None, minus }),
            }
            if let Some([a, b]) = self.product(before, id) {
                self.absorbed[before.index()] = true;
                terms.push(Term { a, b: Some(b), minus: false });
                break None;
            }
            if !self.is_strict_sum(before, id) {
                break Some(before);
            }
            self.absorbed[before.index()] = true;
            at = before;
        };
        terms.reverse();
        Sum { rounded: true, init, terms, factor: None }
    }
}

fn of_comparison(comparison: Comparison) -> Operation {
    match comparison {
        Comparison::Less => Operation::Less,
        Comparison::LessOrEqual => Operation::LessOrEqual,
        Comparison::Equal => Operation::Equal,
    }
}

fn of_function(function: Function) -> Operation {
    match function {
        Function::Abs => Operation::Abs,
        Function::Signum => Operation::Signum,
        Function::Recip => Operation::Recip,
        Function::Sqrt => Operation::Sqrt,
        _ => Operation::Function(function),
    }
}
