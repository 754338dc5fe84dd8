//! From instructions on slots to instructions on registers.

mod instructions;

use super::super::code::{Code, Instruction, Operation, Slot};
use super::registers::{Freed, NEVER, Registers};
use super::unit::Unit;

use iced_x86::{Encoder, IcedError, Instruction as Machine, MemoryOperand, Register};

/// Where slots, inputs and rows stand, and how many samples are left.
const SLOTS: Register = Register::RBX;
const INPUTS: Register = Register::R12;
const ROWS: Register = Register::R13;
const LEFT: Register = Register::R14;

/// The work of each sample, in order.
#[derive(Clone, Copy)]
enum Event<'a> {
    Instruction(&'a Instruction),
    /// A slot's number goes to a row.
    Row(usize, Slot),
}

/// The location of a number: in a register, or in memory.
#[derive(Clone, Copy)]
enum Location {
    Register(Register),
    Memory(MemoryOperand),
}

pub(super) struct Emitter<'a> {
    code: &'a Code,
    unit: Unit,
    encoder: Option<Encoder>,
    length: u64,
    registers: Registers,
    /// The slots that columns are read into, which stand among the inputs.
    columns: Vec<Option<i64>>,
    one: Slot,
    sign: Slot,
}

type Emitted = Result<(), IcedError>;

impl<'a> Emitter<'a> {
    pub fn new(code: &'a Code, unit: Unit) -> Self {
        let mut columns = vec![None; code.slots];
        for read in &code.reads {
            let row = if read.next { code.columns.len() } else { 0 };
            columns[usize::from(read.to)] = Some(((row + read.column) * unit.bytes) as i64);
        }
        let registers = Registers::new(unit.registers, code.slots);
        Emitter { one: code.one, sign: code.sign, code, unit, encoder: None, length: 0, registers, columns }
    }

    /// The code of the whole loop.
    pub fn emit(mut self) -> Result<Vec<u8>, IcedError> {
        use iced_x86::Code as Op;
        // Nothing is encoded the first time: it shows the registers in which a sample leaves what is carried.
        self.sample(&[])?;
        let carried = self.registers.first(self.code.carried);
        self.encoder = Some(Encoder::try_new(64)?);
        let saved = [SLOTS, INPUTS, ROWS, LEFT];
        for register in saved {
            self.put(Machine::with1(Op::Push_r64, register))?;
        }
        // Five times eight bytes, with the return address: routines want a multiple of sixteen.
        self.put(Machine::with2(Op::Sub_rm64_imm8, Register::RSP, 8))?;
        for (to, from) in saved.into_iter().zip([Register::RDI, Register::RSI, Register::RDX, Register::RCX]) {
            self.put(Machine::with2(Op::Mov_rm64_r64, to, from))?;
        }
        for (slot, register) in &carried {
            self.put(Machine::with2(self.unit.load, self.unit.register(*register), self.home(*slot)))?;
        }
        let top = self.length;
        self.sample(&carried)?;
        self.carry_on(&carried)?;
        let advance = |count: usize| (count * self.unit.bytes) as i32;
        let (inputs, rows) = (advance(self.code.columns.len()), advance(self.code.rows.len()));
        self.put(Machine::with2(Op::Add_rm64_imm32, INPUTS, inputs))?;
        self.put(Machine::with2(Op::Add_rm64_imm32, ROWS, rows))?;
        self.put(Machine::with2(Op::Sub_rm64_imm8, LEFT, 1))?;
        self.put(Machine::with_branch(Op::Jne_rel32_64, top))?;
        for (slot, register) in &carried {
            self.put(Machine::with2(self.unit.store, self.home(*slot), self.unit.register(*register)))?;
        }
        self.put(Ok(Machine::with(Op::VEX_Vzeroupper)))?;
        self.put(Machine::with2(Op::Add_rm64_imm8, Register::RSP, 8))?;
        for register in saved.into_iter().rev() {
            self.put(Machine::with1(Op::Pop_r64, register))?;
        }
        self.put(Ok(Machine::with(Op::Retnq)))?;
        Ok(self.encoder.as_mut().map(Encoder::take_buffer).unwrap_or_default())
    }

    fn put(&mut self, machine: Result<Machine, IcedError>) -> Emitted {
        if let Some(encoder) = &mut self.encoder {
            self.length += encoder.encode(&machine?, self.length)? as u64;
        }
        Ok(())
    }

    /// Rows go out as soon as their numbers are there.
    fn events(&self) -> Vec<Event<'a>> {
        let code = self.code;
        let mut written_last = vec![None; code.slots];
        for (at, instruction) in code.output.iter().enumerate() {
            written_last[usize::from(instruction.to)] = Some(at);
        }
        let mut rows_after: Vec<Vec<Event<'a>>> = vec![vec![]; code.output.len() + 1];
        for (row, slot) in code.rows.iter().enumerate() {
            let after = written_last[usize::from(*slot)].map_or(0, |at: usize| at + 1);
            rows_after[after].push(Event::Row(row, *slot));
        }
        let mut events = vec![];
        for (at, rows) in rows_after.into_iter().enumerate() {
            events.extend(rows);
            events.extend(code.output.get(at).map(Event::Instruction));
        }
        events.extend(code.advance.iter().map(Event::Instruction));
        events
    }

    /// One sample. Before it, each carried number of this list stands in its register and not in its slot; after it, each stands
    /// in some register or in its slot. All other carried numbers stand in their slots, before and after.
    fn sample(&mut self, carried: &[(Slot, u8)]) -> Emitted {
        let events = self.events();
        let reads = |event: &Event<'_>| -> Vec<Slot> {
            match event {
                Event::Row(_, slot) => vec![*slot],
                Event::Instruction(instruction) => self.operands(instruction),
            }
        };
        // When each slot is read next, after each event; what is carried is read after all.
        let mut next = vec![NEVER; self.code.slots];
        next[..self.code.carried].fill(events.len());
        let mut after: Vec<Vec<(Slot, usize)>> = Vec::with_capacity(events.len());
        for (position, event) in events.iter().enumerate().rev() {
            let slots = reads(event);
            let to = match event {
                Event::Instruction(instruction) => Some(instruction.to),
                Event::Row(..) => None,
            };
            after.push(slots.iter().copied().chain(to).map(|slot| (slot, next[usize::from(slot)])).collect());
            to.into_iter().for_each(|slot| next[usize::from(slot)] = NEVER);
            slots.iter().for_each(|slot| next[usize::from(*slot)] = position);
        }
        after.reverse();
        self.registers.clear();
        self.registers.next = next;
        carried.iter().for_each(|(slot, register)| self.registers.bind(*slot, *register, true));
        for (event, after) in events.iter().zip(after) {
            let to = match event {
                Event::Instruction(instruction) => Some(instruction.to),
                Event::Row(..) => None,
            };
            // A slot that an instruction overwrites is read by it for the last time.
            for (slot, next) in &after {
                self.registers.next[usize::from(*slot)] = if Some(*slot) == to { NEVER } else { *next };
            }
            match event {
                Event::Row(row, slot) => self.row(*row, *slot)?,
                Event::Instruction(instruction) => self.instruction(instruction)?,
            }
            for (slot, next) in after {
                self.registers.next[usize::from(slot)] = next;
                if next == NEVER {
                    self.registers.forget(slot);
                }
            }
            self.registers.release();
        }
        self.write_back(carried)
    }

    /// Moves what is carried to where the next sample begins with it.
    fn carry_on(&mut self, carried: &[(Slot, u8)]) -> Emitted {
        let at = |(slot, to): &(Slot, u8)| self.registers.of(*slot).map(|from| (from, *to));
        let mut moves: Vec<(u8, u8)> = carried.iter().filter_map(at).filter(|(from, to)| from != to).collect();
        let missing: Vec<(Slot, u8)> =
            carried.iter().copied().filter(|(slot, _)| self.registers.of(*slot).is_none()).collect();
        while !moves.is_empty() {
            // A move into a register that no other move reads from. Where all are read from, the moves form circles: one is opened
            // by a copy of what its first move reads.
            let (from, to) = match moves.iter().position(|(_, to)| moves.iter().all(|(from, _)| from != to)) {
                Some(free) => moves.swap_remove(free),
                None => {
                    let used = |register: &u8| {
                        carried.iter().any(|(_, to)| to == register) || moves.iter().any(|(from, _)| from == register)
                    };
                    // There is one: those of a circle are targets, which are half of the registers at most.
                    let spare = (0..self.unit.registers).find(|register| !used(register)).unwrap_or(0);
                    let from = std::mem::replace(&mut moves[0].0, spare);
                    (from, spare)
                }
            };
            self.put(Machine::with2(self.unit.copy, self.unit.register(to), self.unit.register(from)))?;
        }
        for (slot, register) in missing {
            self.put(Machine::with2(self.unit.load, self.unit.register(register), self.home(slot)))?;
        }
        Ok(())
    }

    /// The slots that an instruction reads here: a factor of one is not.
    fn operands(&self, instruction: &Instruction) -> Vec<Slot> {
        let mut slots: Vec<Slot> = instruction.reads().collect();
        match instruction.operation {
            Operation::Neg | Operation::Abs | Operation::Copysign => slots.push(self.sign),
            Operation::Recip => slots.push(self.one),
            Operation::Signum => slots.extend([self.sign, self.one]),
            _ => {}
        }
        slots
    }

    fn home(&self, slot: Slot) -> MemoryOperand {
        match self.columns[usize::from(slot)] {
            Some(offset) => MemoryOperand::with_base_displ(INPUTS, offset),
            None => MemoryOperand::with_base_displ(SLOTS, (usize::from(slot) * self.unit.bytes) as i64),
        }
    }

    fn write_back(&mut self, but: &[(Slot, u8)]) -> Emitted {
        for (register, slot) in self.registers.unwritten() {
            if but.iter().any(|(kept, _)| *kept == slot) {
                continue;
            }
            self.put(Machine::with2(self.unit.store, self.home(slot), self.unit.register(register)))?;
        }
        Ok(())
    }

    /// A register for something new.
    fn fresh(&mut self) -> Result<(u8, Register), IcedError> {
        let register = match self.registers.take() {
            Some(Freed::Clean(register)) => register,
            Some(Freed::Spilled(register, slot)) => {
                self.put(Machine::with2(self.unit.store, self.home(slot), self.unit.register(register)))?;
                register
            }
            // Not with sixteen registers: an instruction has nine operands at most, and two results.
            None => 0,
        };
        Ok((register, self.unit.register(register)))
    }

    /// A slot's number in a register.
    fn load(&mut self, slot: Slot) -> Result<Register, IcedError> {
        if let Some(register) = self.registers.find(slot) {
            return Ok(self.unit.register(register));
        }
        let (number, register) = self.fresh()?;
        self.put(Machine::with2(self.unit.load, register, self.home(slot)))?;
        self.registers.bind(slot, number, false);
        Ok(register)
    }

    /// A slot's number in a register, if it is there or will be read again soon; else in memory.
    fn place(&mut self, slot: Slot) -> Result<Location, IcedError> {
        if let Some(register) = self.registers.find(slot) {
            return Ok(Location::Register(self.unit.register(register)));
        }
        if self.registers.is_worth_loading(self.registers.next[usize::from(slot)]) {
            return self.load(slot).map(Location::Register);
        }
        Ok(Location::Memory(self.home(slot)))
    }

    fn row(&mut self, row: usize, slot: Slot) -> Emitted {
        let from = self.load(slot)?;
        let to = MemoryOperand::with_base_displ(ROWS, (row * self.unit.bytes) as i64);
        self.put(Machine::with2(self.unit.store, to, from))
    }
}
