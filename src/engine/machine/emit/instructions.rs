//! Each instruction in those of the processor.

use super::super::registers::NEVER;
use super::{Emitted, Emitter, Instruction, Location, Machine, Operation, Slot};
use crate::graph::{Function, Function2};
use iced_x86::{IcedError, Register};
use std::sync::Arc;

impl Emitter<'_> {
    /// `to = a op b`
    fn binary(&mut self, op: iced_x86::Code, to: Register, a: Register, b: Location) -> Emitted {
        self.put(match b {
            Location::Register(b) => Machine::with3(op, to, a, b),
            Location::Memory(b) => Machine::with3(op, to, a, b),
        })
    }

    pub(super) fn instruction(&mut self, instruction: &Instruction) -> Emitted {
        // None of its operands may leave its register before it is read.
        for slot in self.operands(instruction) {
            self.registers.find(slot);
        }
        let [[a, b], [c, d], ..] = instruction.pairs;
        let unit_op = match instruction.operation {
            Operation::Add => Some(self.unit.add),
            Operation::Sub => Some(self.unit.sub),
            Operation::Mul => Some(self.unit.mul),
            _ => None,
        };
        if let Some(op) = unit_op {
            let a = self.load(a)?;
            let b = self.place(b)?;
            let (number, to) = self.fresh()?;
            self.binary(op, to, a, b)?;
            self.registers.bind(instruction.to, number, true);
            return Ok(());
        }
        match instruction.operation {
            Operation::Fused | Operation::FusedProducts | Operation::Rounded | Operation::RoundedProducts => {
                self.sum(instruction)
            }
            Operation::Less => self.select(instruction, 0x11),
            Operation::LessOrEqual => self.select(instruction, 0x12),
            Operation::Equal => self.select(instruction, 0x00),
            Operation::Function(function) => {
                let number = Function::ALL.iter().position(|known| *known == function).unwrap_or(0);
                self.call(number, self.unit.unary as *const () as u64, &[a, instruction.to], instruction.to)
            }
            Operation::Function2(function) => {
                let number = Function2::ALL.iter().position(|known| *known == function).unwrap_or(0);
                self.call(number, self.unit.binary as *const () as u64, &[a, b, instruction.to], instruction.to)
            }
            Operation::Table(order) => {
                use iced_x86::Code as Op;
                let table = self.code.tables.get(usize::from(instruction.init)).map_or(core::ptr::null(), Arc::as_ptr);
                self.put(Machine::with2(Op::Mov_r64_imm64, Register::R8, table as u64))?;
                let routine = self.unit.look_up as *const () as u64;
                self.call(order.into(), routine, &[a, b, instruction.to], instruction.to)
            }
            _ => self.of_one(instruction, [a, b, c, d]),
        }
    }

    /// Signs, reciprocals, roots, copies.
    fn of_one(&mut self, instruction: &Instruction, [a, b, ..]: [Slot; 4]) -> Emitted {
        let x = self.load(a)?;
        let number = match instruction.operation {
            Operation::Neg | Operation::Abs => {
                let sign = self.load(self.sign)?;
                let (number, to) = self.fresh()?;
                let negate = instruction.operation == Operation::Neg;
                let op = if negate { self.unit.xor } else { self.unit.and_not };
                self.put(Machine::with3(op, to, sign, x))?;
                number
            }
            Operation::Recip => {
                let one = self.load(self.one)?;
                let (number, to) = self.fresh()?;
                self.put(Machine::with3(self.unit.div, to, one, x))?;
                number
            }
            Operation::Sqrt => {
                let (number, to) = self.fresh()?;
                self.put(match self.unit.bytes {
                    8 => Machine::with3(self.unit.sqrt, to, x, x),
                    _ => Machine::with2(self.unit.sqrt, to, x),
                })?;
                number
            }
            Operation::Copysign => {
                let from = self.load(b)?;
                self.with_sign(x, from)?
            }
            Operation::Signum => {
                let one = self.load(self.one)?;
                let signed = self.with_sign(one, x)?;
                let signed = self.unit.register(signed);
                let (number, to) = self.fresh()?;
                self.blend([x, x, signed, x], 0x00, to)?;
                number
            }
            _ => {
                let (number, to) = self.fresh()?;
                self.put(Machine::with2(self.unit.copy, to, x))?;
                number
            }
        };
        self.registers.bind(instruction.to, number, true);
        Ok(())
    }

    /// The size of `x` with the sign of `from`.
    fn with_sign(&mut self, x: Register, from: Register) -> Result<u8, IcedError> {
        let sign = self.load(self.sign)?;
        let (_, size) = self.fresh()?;
        let (number, to) = self.fresh()?;
        self.put(Machine::with3(self.unit.and_not, size, sign, x))?;
        self.put(Machine::with3(self.unit.and, to, sign, from))?;
        self.put(Machine::with3(self.unit.or, to, to, size))?;
        Ok(number)
    }

    fn select(&mut self, instruction: &Instruction, comparison: u32) -> Emitted {
        let [[a, b], [c, d], ..] = instruction.pairs;
        let operands = [self.load(a)?, self.load(b)?, self.load(c)?, self.load(d)?];
        let (number, to) = self.fresh()?;
        self.blend(operands, comparison, to)?;
        self.registers.bind(instruction.to, number, true);
        Ok(())
    }

    /// `then` where the comparison of `a` with `b` holds.
    fn blend(&mut self, [a, b, then, otherwise]: [Register; 4], comparison: u32, to: Register) -> Emitted {
        if self.unit.masks {
            self.put(Machine::with4(self.unit.compare, Register::K1, a, b, comparison))?;
            let blend = Machine::with3(self.unit.blend, to, otherwise, then).map(|mut blend| {
                blend.set_op_mask(Register::K1);
                blend
            });
            return self.put(blend);
        }
        let (_, mask) = self.fresh()?;
        self.put(Machine::with4(self.unit.compare, mask, a, b, comparison))?;
        self.put(Machine::with4(self.unit.blend, to, otherwise, then, mask))
    }

    fn sum(&mut self, instruction: &Instruction) -> Emitted {
        let rounded = matches!(instruction.operation, Operation::Rounded | Operation::RoundedProducts);
        let from_init = matches!(instruction.operation, Operation::Fused | Operation::Rounded);
        let count = usize::from(instruction.count);
        let (number, sum, from) = if from_init { self.init(instruction)? } else { self.first_product(instruction)? };
        for j in from..count {
            let [a, b] = instruction.pairs[j];
            let minus = instruction.signs >> j & 1 == 1;
            if b == self.one {
                let a = self.place(a)?;
                self.binary(if minus { self.unit.sub } else { self.unit.add }, sum, sum, a)?;
            } else {
                let (a, b) = if self.registers.find(b).is_some() { (b, a) } else { (a, b) };
                let a = self.load(a)?;
                let b = self.place(b)?;
                if rounded {
                    let (product_number, product) = self.fresh()?;
                    self.binary(self.unit.mul, product, a, b)?;
                    let op = if minus { self.unit.sub } else { self.unit.add };
                    self.binary(op, sum, sum, Location::Register(product))?;
                    self.registers.free(product_number);
                } else {
                    self.binary(if minus { self.unit.fnma } else { self.unit.fma }, sum, a, b)?;
                }
            }
        }
        if instruction.scaled {
            let factor = self.place(instruction.factor)?;
            self.binary(self.unit.mul, sum, sum, factor)?;
        }
        self.registers.bind(instruction.to, number, true);
        Ok(())
    }

    /// The register that a sum is made in, with what it starts from.
    fn init(&mut self, instruction: &Instruction) -> Result<(u8, Register, usize), IcedError> {
        let slot = instruction.init;
        let others = instruction.pairs[..usize::from(instruction.count)].as_flattened().contains(&slot)
            || instruction.scaled && instruction.factor == slot;
        let dies = self.registers.next[usize::from(slot)] == NEVER && !others;
        if let Some(number) = self.registers.find(slot) {
            if dies {
                return Ok((number, self.unit.register(number), 0));
            }
            let from = self.unit.register(number);
            let (number, sum) = self.fresh()?;
            self.put(Machine::with2(self.unit.copy, sum, from))?;
            return Ok((number, sum, 0));
        }
        let (number, sum) = self.fresh()?;
        self.put(Machine::with2(self.unit.load, sum, self.home(slot)))?;
        Ok((number, sum, 0))
    }

    fn first_product(&mut self, instruction: &Instruction) -> Result<(u8, Register, usize), IcedError> {
        let [a, b] = instruction.pairs[0];
        let (a, b) = if self.registers.find(b).is_some() { (b, a) } else { (a, b) };
        let a = self.load(a)?;
        let b = self.place(b)?;
        let (number, sum) = self.fresh()?;
        self.binary(self.unit.mul, sum, a, b)?;
        Ok((number, sum, 1))
    }

    /// A routine on numbers in memory. It may use all registers.
    fn call(&mut self, number: usize, routine: u64, arguments: &[Slot], to: Slot) -> Emitted {
        use iced_x86::Code as Op;
        // Arguments that are read for the last time must reach memory all the same.
        for slot in &arguments[..arguments.len() - 1] {
            let next = &mut self.registers.next[usize::from(*slot)];
            *next = (*next).min(NEVER - 1);
        }
        self.write_back(&[])?;
        self.registers.clear();
        self.put(Ok(Machine::with(Op::VEX_Vzeroupper)))?;
        self.put(Machine::with2(Op::Mov_r32_imm32, Register::EDI, number as u32))?;
        for (register, slot) in [Register::RSI, Register::RDX, Register::RCX].into_iter().zip(arguments) {
            self.put(Machine::with2(Op::Lea_r64_m, register, self.home(*slot)))?;
        }
        self.put(Machine::with2(Op::Mov_r64_imm64, Register::RAX, routine))?;
        self.put(Machine::with1(Op::Call_rm64, Register::RAX))?;
        self.registers.forget(to);
        Ok(())
    }
}
