//! From a tape to instructions: which run once a pass, in which order the others run, and where their results stand.
//!
//! Nodes are computed in the order in which they are read, depth first from the roots, so that few slots are in use; slots are assigned by a
//! linear scan. Entries of the carry are written in place where the old value is not read any more; the others are moved at the end.

mod slots;

use super::code::{Code, Column, Instruction, Operation, Read, Slot, Sound, TERMS};
use super::fusion::{Sum, Term, Work, works};
use crate::graph::{Id, Leaf, Node, Tape};
use rustc_hash::FxHashMap;
use slots::Slots;

/// More numbers than a program's instructions can name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the step needs more than {limit} numbers at a time; make the model smaller")]
pub struct TooLarge {
    /// How many can be named.
    pub limit: usize,
}

/// The nodes to be scheduled.
pub(super) struct Roots<'a> {
    pub tape: &'a Tape,
    /// In the order of the carried entries.
    pub next: &'a [Id],
    /// None: always zero.
    pub rows: &'a [Option<Id>],
    pub parameters: usize,
    /// Nodes that come as columns, in order.
    pub derived: &'a [Id],
}

/// The instructions of a step.
pub(super) fn schedule(roots: &Roots<'_>) -> Result<Sound, TooLarge> {
    let mut all: Vec<Id> = roots.rows.iter().flatten().chain(roots.next).copied().collect();
    all.extend(roots.derived);
    let works = works(roots.tape, &all);
    let mut scheduler = Scheduler::new(roots, works);
    scheduler.place_leaves()?;
    scheduler.place_invariants()?;
    let outputs: Vec<Id> = roots.rows.iter().flatten().copied().collect();
    let mut order = scheduler.order(&outputs);
    let first = order.len();
    order.extend(scheduler.order(roots.next));
    let code = scheduler.run(&order, first)?;
    Sound::new(code).ok_or(TooLarge { limit: usize::from(Slot::MAX) })
}

struct Scheduler<'a> {
    roots: &'a Roots<'a>,
    works: Vec<Option<Work>>,
    visited: Vec<bool>,
    /// Where each node's value stands.
    at: FxHashMap<Id, Slot>,
    slots: Slots,
    /// The slots of numbers, by their bits.
    numbers: FxHashMap<u64, Slot>,
    code: Code,
}

impl<'a> Scheduler<'a> {
    fn new(roots: &'a Roots<'a>, mut works: Vec<Option<Work>>) -> Self {
        let mut visited = vec![false; works.len()];
        for derived in roots.derived {
            works[derived.index()] = None;
            visited[derived.index()] = true;
        }
        let code = Code {
            carried: roots.next.len(),
            parameters: roots.parameters,
            step: None,
            constants: vec![],
            one: 0,
            sign: 0,
            once: vec![],
            columns: vec![],
            reads: vec![],
            output: vec![],
            rows: vec![],
            advance: vec![],
            slots: 0,
            tables: roots.tape.graph.tables().to_vec(),
        };
        let slots = Slots::after(roots.next.len() + roots.parameters);
        Scheduler { roots, works, visited, at: FxHashMap::default(), slots, numbers: FxHashMap::default(), code }
    }

    /// The nodes that are still to be computed, as they are needed.
    fn needed(&self) -> Vec<bool> {
        let mut needed = vec![false; self.works.len()];
        let all = self.roots.rows.iter().flatten().chain(self.roots.next);
        all.for_each(|root| needed[root.index()] = true);
        for i in (0..needed.len()).rev() {
            if needed[i]
                && let Some(work) = &self.works[i]
            {
                work.operands().iter().for_each(|operand| needed[operand.index()] = true);
            }
        }
        needed
    }

    fn column(&mut self, column: Column) -> usize {
        let known = self.code.columns.iter().position(|known| *known == column);
        known.unwrap_or_else(|| {
            self.code.columns.push(column);
            self.code.columns.len() - 1
        })
    }

    /// Slots of leaves, numbers and derived columns.
    fn place_leaves(&mut self) -> Result<(), TooLarge> {
        let needed = self.needed();
        let derived: FxHashMap<Id, usize> = self.roots.derived.iter().copied().zip(0..).collect();
        for i in (0..needed.len()).filter(|i| needed[*i]) {
            let id = Id::new(i);
            let slot = match (derived.get(&id).copied(), self.roots.tape.graph.nodes()[i]) {
                (Some(number), _) => self.read(Column::Derived(number), false)?,
                (_, Node::Constant(constant)) => self.constant(constant.value())?,
                (_, Node::Leaf(leaf)) => self.place_leaf(leaf)?,
                _ => continue,
            };
            self.at.insert(id, slot);
        }
        Ok(())
    }

    fn place_leaf(&mut self, leaf: Leaf) -> Result<Slot, TooLarge> {
        match (leaf, Column::of_leaf(leaf)) {
            (Leaf::State(i), _) => slots::narrow(i as usize),
            (Leaf::Parameter(j), _) => slots::narrow(self.code.carried + j as usize),
            (Leaf::Step, _) if self.roots.tape.uniform => {
                let slot = self.slots.fresh()?;
                self.code.step = Some(slot);
                Ok(slot)
            }
            (_, Some((column, next))) => self.read(column, next),
            (_, None) => self.constant(f64::NAN),
        }
    }

    fn read(&mut self, column: Column, next: bool) -> Result<Slot, TooLarge> {
        let to = self.slots.fresh()?;
        let column = self.column(column);
        self.code.reads.push(Read { column, next, to });
        Ok(to)
    }

    fn constant(&mut self, value: f64) -> Result<Slot, TooLarge> {
        if let Some(slot) = self.numbers.get(&value.to_bits()) {
            return Ok(*slot);
        }
        let slot = self.slots.fresh()?;
        self.code.constants.push((slot, value));
        self.numbers.insert(value.to_bits(), slot);
        Ok(slot)
    }

    /// Nodes that do not vary within a pass are computed before it, in the order of the nodes.
    fn place_invariants(&mut self) -> Result<(), TooLarge> {
        let needed = self.needed();
        for i in (0..needed.len()).filter(|i| needed[*i] && !self.roots.tape.depends[*i].varies()) {
            if let Some(work) = self.works[i].clone() {
                let to = self.slots.fresh()?;
                let instructions = self.instructions(&work, to)?;
                self.code.once.extend(instructions);
                self.at.insert(Id::new(i), to);
            }
            self.visited[i] = true;
        }
        // Constants that every sum may need, while slots are still assigned permanently.
        self.constant(0.0)?;
        self.code.one = self.constant(1.0)?;
        self.code.sign = self.constant(-0.0)?;
        Ok(())
    }

    /// The nodes that the roots need and that are not computed yet, depth first.
    fn order(&mut self, roots: &[Id]) -> Vec<Id> {
        let mut order = vec![];
        let mut open: Vec<(Id, bool)> = roots.iter().rev().map(|root| (*root, false)).collect();
        while let Some((id, ready)) = open.pop() {
            let Some(work) = self.works[id.index()].as_ref() else { continue };
            if ready {
                order.push(id);
            } else if !self.visited[id.index()] {
                self.visited[id.index()] = true;
                open.push((id, true));
                open.extend(work.operands().into_iter().rev().map(|operand| (operand, false)));
            }
        }
        order
    }

    /// The instructions of the samples: those up to `first` before the rows are read off.
    fn run(mut self, order: &[Id], first: usize) -> Result<Code, TooLarge> {
        let last = self.last_reads(order, first);
        let mut targets: FxHashMap<Id, Vec<Slot>> = FxHashMap::default();
        for (entry, id) in self.roots.next.iter().enumerate() {
            targets.entry(*id).or_default().push(slots::narrow(entry)?);
        }
        let leaves: FxHashMap<Slot, Id> = self.at.iter().map(|(id, slot)| (*slot, *id)).collect();
        for (position, id) in order.iter().enumerate() {
            let Some(work) = self.works[id.index()].clone() else { continue };
            if position == first {
                self.release_rows(&work, &last, first);
            }
            let mut dying: Vec<Slot> = work
                .operands()
                .iter()
                .filter(|id| last.get(*id) == Some(&position))
                .filter_map(|id| self.at.get(id).copied())
                .collect();
            dying.sort_unstable();
            dying.dedup();
            // An instruction may write where it reads; one of several instructions may not.
            let single = !matches!(&work, Work::Sum(sum) if sum.terms.len() > TERMS);
            if single {
                dying.iter().for_each(|slot| self.slots.release(*slot));
            }
            let in_place = targets.get(id).map(|slots| slots[0]).filter(|slot| {
                let read_until = leaves.get(slot).and_then(|leaf| last.get(leaf)).copied();
                position >= first && read_until.is_none_or(|until| until < position || single && until == position)
            });
            let to = match in_place {
                Some(slot) => slot,
                None => self.slots.temporary()?,
            };
            if !single {
                dying.iter().for_each(|slot| self.slots.release(*slot));
            }
            let instructions = self.instructions(&work, to)?;
            if position < first {
                self.code.output.extend(instructions);
            } else {
                self.code.advance.extend(instructions);
            }
            self.at.insert(*id, to);
        }
        self.finish()
    }

    /// Gives back the slots of rows that nothing else reads; the rows have been read off.
    fn release_rows(&mut self, work: &Work, last: &FxHashMap<Id, usize>, first: usize) {
        let operands = work.operands();
        let mut done: Vec<Slot> = vec![];
        for row in
            self.roots.rows.iter().flatten().filter(|row| last.get(row) == Some(&first) && !operands.contains(row))
        {
            done.extend(self.at.get(row));
        }
        done.sort_unstable();
        done.dedup();
        done.into_iter().for_each(|slot| self.slots.release(slot));
    }

    /// The position after which each node's value is not read any more.
    fn last_reads(&self, order: &[Id], first: usize) -> FxHashMap<Id, usize> {
        let mut last = FxHashMap::default();
        for row in self.roots.rows.iter().flatten() {
            last.insert(*row, first);
        }
        for (position, id) in order.iter().enumerate() {
            for operand in self.works[id.index()].iter().flat_map(Work::operands) {
                let until = last.entry(operand).or_insert(position);
                *until = position.max(*until);
            }
        }
        // Read by the moves after all else.
        for next in self.roots.next {
            last.insert(*next, usize::MAX);
        }
        last
    }

    fn finish(mut self) -> Result<Code, TooLarge> {
        let zero = self.constant(0.0)?;
        let at = |id: &Id| self.at.get(id).copied().unwrap_or(zero);
        let rows: Vec<Slot> = self.roots.rows.iter().map(|row| row.as_ref().map_or(zero, at)).collect();
        let moves: Vec<(Slot, Slot)> =
            (0..).zip(self.roots.next.iter().map(at)).filter(|(to, from)| to != from).collect();
        self.code.rows = rows;
        let spare = self.slots.fresh()?;
        for (to, from) in slots::sequence(moves, spare) {
            self.code.advance.push(Instruction::new(Operation::Copy, to, &[from]));
        }
        self.code.slots = self.slots.count();
        Ok(self.code)
    }

    /// A node's instructions; of a long sum, several.
    fn instructions(&mut self, work: &Work, to: Slot) -> Result<Vec<Instruction>, TooLarge> {
        let (zero, one) = (self.constant(0.0)?, self.constant(1.0)?);
        let at = |id: &Id| self.at.get(id).copied().unwrap_or(zero);
        match work {
            Work::Operation(operation, operands) => {
                let operands: Vec<Slot> = operands.iter().map(at).collect();
                Ok(vec![Instruction::new(*operation, to, &operands)])
            }
            Work::Table { table, order, at: places } => {
                let mut instruction = Instruction::new(Operation::Table(*order), to, &[at(&places[0]), at(&places[1])]);
                instruction.init = slots::narrow(*table as usize)?;
                Ok(vec![instruction])
            }
            Work::Sum(Sum { rounded, init, terms, factor }) => {
                let mut init = init.as_ref().map(at);
                if init.is_none() && terms.first().is_some_and(|term| term.minus || term.b.is_none()) {
                    init = Some(zero);
                }
                let mut instructions = vec![];
                for terms in terms.chunks(TERMS) {
                    let operation = match (rounded, init) {
                        (false, Some(_)) => Operation::Fused,
                        (false, None) => Operation::FusedProducts,
                        (true, Some(_)) => Operation::Rounded,
                        (true, None) => Operation::RoundedProducts,
                    };
                    let pair = |term: &Term| [at(&term.a), term.b.as_ref().map_or(one, at)];
                    let slots: Vec<Slot> = terms.iter().flat_map(pair).collect();
                    let mut instruction = Instruction::new(operation, to, &slots);
                    instruction.count = terms.len() as u8;
                    instruction.init = init.unwrap_or(0);
                    for (number, _) in terms.iter().enumerate().filter(|(_, term)| term.minus) {
                        instruction.signs |= 1 << number;
                    }
                    instructions.push(instruction);
                    init = Some(to);
                }
                if let (Some(last), Some(factor)) = (instructions.last_mut(), factor) {
                    (last.scaled, last.factor) = (true, at(factor));
                }
                Ok(instructions)
            }
        }
    }
}
