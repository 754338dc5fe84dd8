//! [`Code`]: a step as a list of instructions on numbered slots, for one lane or many.

use super::turns::Turns;
use crate::graph::{Function, Function2, Leaf};
use crate::scalar::Table;
use std::sync::Arc;

/// Where a number of each lane stands.
pub(super) type Slot = u16;

/// The operation of an instruction. Operands are its pairs, in order; sums name theirs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Operation {
    Copy,
    Add,
    Sub,
    Mul,
    Neg,
    Abs,
    Signum,
    Copysign,
    Recip,
    Sqrt,
    /// The third where the first is less than the second, else the fourth.
    Less,
    LessOrEqual,
    Equal,
    /// `init +- a b +- c d ...`, each product added in one rounding.
    Fused,
    /// `a b +- c d ...`, each product but the first added in one rounding.
    FusedProducts,
    /// `init +- a b +- c d ...`, every operation rounded.
    Rounded,
    /// `a b +- c d ...`, every operation rounded.
    RoundedProducts,
    Function(Function),
    Function2(Function2),
    /// The table named by `init`, or its derivative of the orders in the upper and the lower four bits.
    Table(u8),
}

/// Terms of one instruction.
pub(super) const TERMS: usize = 5;

/// One instruction.
#[derive(Clone, Copy, Debug)]
pub(super) struct Instruction {
    pub operation: Operation,
    /// Pairs in use, of a sum.
    pub count: u8,
    /// Which pairs are subtracted, by bits, of a sum.
    pub signs: u8,
    /// Whether the sum is multiplied by `factor`, after all its terms.
    pub scaled: bool,
    pub to: Slot,
    /// The first term of a sum.
    pub init: Slot,
    pub factor: Slot,
    pub pairs: [[Slot; 2]; TERMS],
}

impl Instruction {
    pub fn new(operation: Operation, to: Slot, operands: &[Slot]) -> Self {
        let mut pairs = [[0; 2]; TERMS];
        for (pair, operands) in pairs.iter_mut().zip(operands.chunks(2)) {
            pair[..operands.len()].copy_from_slice(operands);
        }
        Instruction { operation, count: 0, signs: 0, scaled: false, to, init: 0, factor: 0, pairs }
    }

    /// This instruction with other slots in the place of those that it reads and of the one that it writes. Unused operands are slot zero.
    pub fn renamed(mut self, read: impl Fn(Slot) -> Slot, write: impl Fn(Slot) -> Slot) -> Self {
        self.pairs.iter_mut().flatten().for_each(|slot| *slot = read(*slot));
        // A table is named by `init`.
        if !matches!(self.operation, Operation::Table(_)) {
            self.init = read(self.init);
        }
        (self.factor, self.to) = (read(self.factor), write(self.to));
        self
    }

    /// The slots that it reads.
    pub fn reads(&self) -> impl Iterator<Item = Slot> + use<> {
        let (first, count) = match self.operation {
            Operation::Fused | Operation::Rounded => (Some(self.init), 2 * self.count),
            Operation::FusedProducts | Operation::RoundedProducts => (None, 2 * self.count),
            Operation::Less | Operation::LessOrEqual | Operation::Equal => (None, 4),
            Operation::Add | Operation::Sub | Operation::Mul | Operation::Copysign => (None, 2),
            Operation::Function2(_) | Operation::Table(_) => (None, 2),
            _ => (None, 1),
        };
        let pairs = self.pairs.into_iter().flatten().take(count.into());
        first.into_iter().chain(pairs).chain(self.scaled.then_some(self.factor))
    }
}

/// A number per sample and lane that a program reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Column {
    /// The sample's time (s).
    Time,
    /// The time to the next sample (s); only where it is not the same for all samples.
    Step,
    /// An input.
    Input(usize),
    /// An output as measured; not a number where there is none.
    Measured(usize),
    /// A late input, so many samples after the one that it had reached just before.
    Late(usize, usize),
    /// Costly functions of the record alone, computed once per record.
    Derived(usize),
}

impl Column {
    /// The column that a leaf is read from, and whether at the next sample.
    pub(super) fn of_leaf(leaf: Leaf) -> Option<(Self, bool)> {
        Some(match leaf {
            Leaf::Time => (Column::Time, false),
            Leaf::Step => (Column::Step, false),
            Leaf::Input(i) => (Column::Input(i as usize), false),
            Leaf::NextInput(i) => (Column::Input(i as usize), true),
            Leaf::Measured(i) => (Column::Measured(i as usize), false),
            Leaf::Late { input, after } => (Column::Late(input as usize, after as usize), false),
            Leaf::State(_) | Leaf::Parameter(_) => return None,
        })
    }
}

/// A number that a program reads at each sample: from where, and into which slot.
#[derive(Clone, Copy, Debug)]
pub(super) struct Read {
    pub column: usize,
    pub next: bool,
    pub to: Slot,
}

/// A step as instructions.
///
/// Slots: what is carried, then parameters, the step's length, and the rest.
#[derive(Clone, Debug)]
pub(super) struct Code {
    /// Numbers carried from sample to sample.
    pub carried: usize,
    pub parameters: usize,
    /// The slot of the step's length, if it is the same for all samples and anything depends on it.
    pub step: Option<Slot>,
    pub constants: Vec<(Slot, f64)>,
    /// The slot of 1, and of the number whose only bit is the sign's.
    pub one: Slot,
    pub sign: Slot,
    /// Once a pass.
    pub once: Vec<Instruction>,
    pub columns: Vec<Column>,
    pub reads: Vec<Read>,
    /// At each sample, up to the rows.
    pub output: Vec<Instruction>,
    /// The slots of each row's numbers.
    pub rows: Vec<Slot>,
    /// At each sample, after the rows.
    pub advance: Vec<Instruction>,
    pub slots: usize,
    pub tables: Vec<Arc<Table>>,
}

/// Code that was checked: all slots, columns and tables that it names exist. Unchecked reads and writes rely on it. With its turns.
#[derive(Clone, Debug)]
pub(super) struct Sound {
    code: Code,
    turns: Turns,
}

impl Sound {
    /// None for a code that is not sound.
    pub fn new(mut code: Code) -> Option<Self> {
        let turns = Turns::of(&mut code);
        code.is_sound(&turns).then_some(Sound { code, turns })
    }

    /// The instructions of even and of odd samples.
    pub fn turns(&self) -> &Turns {
        &self.turns
    }
}

impl core::ops::Deref for Sound {
    type Target = Code;
    fn deref(&self) -> &Code {
        &self.code
    }
}

impl Code {
    /// Whether the row of inputs after the last is read.
    pub fn reads_next(&self) -> bool {
        self.reads.iter().any(|read| read.next)
    }

    /// Slots of every instruction and list lie below `slots`.
    fn is_sound(&self, turns: &Turns) -> bool {
        let of_turns = turns.all.iter().flat_map(|turn| turn.output.iter().chain(&turn.advance));
        let instructions = self.once.iter().chain(&self.output).chain(&self.advance).chain(of_turns);
        let all = instructions.clone().flat_map(|instruction| instruction.reads().chain([instruction.to]));
        let others = self.constants.iter().map(|(slot, _)| *slot).chain(self.reads.iter().map(|read| read.to));
        let rows = self.rows.iter().chain(turns.all.iter().flat_map(|turn| &turn.rows)).copied();
        let moved = turns.moved.iter().flat_map(|(own, other)| [*own, *other]);
        let others = others.chain(rows).chain(moved).chain(self.step).chain([self.one, self.sign]);
        let columns = self.reads.iter().all(|read| read.column < self.columns.len());
        let mut instructions = instructions;
        let tables = instructions.all(|instruction| match instruction.operation {
            Operation::Table(_) => usize::from(instruction.init) < self.tables.len(),
            _ => true,
        });
        tables
            && columns
            && self.carried + self.parameters <= self.slots
            && turns.all.iter().all(|turn| turn.rows.len() == self.rows.len())
            && all.chain(others).all(|slot| usize::from(slot) < self.slots)
    }
}
