//! The interpreter: one instruction after the other, each on several registers side by side.
//!
//! Each instruction costs an indirect jump that the processor often mispredicts. An instruction therefore works on many values: four
//! registers of eight lanes, or eight registers of four.

use super::code::{Instruction, Operation, Sound};
use super::functions::apply;
use crate::graph::Function;
use crate::scalar::Table;
use crate::wide::{Task, Wide, Width};
use std::sync::Arc;

/// The part of the code to be run.
pub(super) enum Part<'a> {
    /// The part that does not vary within a pass.
    Once,
    /// A block of samples.
    Samples {
        /// Sample, column, lane; one sample more if the next inputs are read.
        inputs: &'a [f64],
        /// Sample, row, lane.
        rows: &'a mut [f64],
        samples: usize,
    },
}

/// The instructions of a code on slots of `K` registers each.
pub(super) struct Run<'a, const K: usize> {
    pub code: &'a Sound,
    pub slots: &'a mut [f64],
    pub part: Part<'a>,
    /// The registers'.
    pub width: Width,
}

impl<const K: usize> Task for Run<'_, K> {
    type Output = ();

    #[inline(always)]
    fn run<W: Wide>(self) {
        let Run { code, slots, part, width } = self;
        let lanes = K * W::LANES;
        let (columns, height, turns) = (code.columns.len() * lanes, code.rows.len() * lanes, code.turns());
        let (inputs, rows, samples, once): (&[f64], &mut [f64], _, _) = match part {
            Part::Once => (&[], &mut [], 0, true),
            Part::Samples { inputs, rows, samples } => (inputs, rows, samples, false),
        };
        assert!(width.lanes() == W::LANES && slots.len() >= code.slots * lanes);
        assert!(once || inputs.len() >= (samples + usize::from(code.reads_next())) * columns);
        assert!(rows.len() >= samples * height);
        let (slots, inputs, rows) = (slots.as_mut_ptr(), inputs.as_ptr(), rows.as_mut_ptr());
        // Two passes through `interpret` for each sample, before and after its rows. One call, which is inlined, not three: that
        // keeps the build short.
        for half in 0..2 * samples + usize::from(once) {
            let sample = half / 2;
            let turn = &turns.all[sample % turns.all.len()];
            let instructions = match (once, half % 2) {
                (true, _) => &code.once,
                (_, 0) => {
                    for read in &code.reads {
                        let from = (sample + usize::from(read.next)) * columns + read.column * lanes;
                        // SAFETY: the column lies within its sample's row of inputs, of which there are enough; the slot
                        // within the slots, since the code is sound. So it is for all that follows.
                        unsafe { copy::<W, K>(inputs.add(from), slots.add(usize::from(read.to) * lanes)) };
                    }
                    &turn.output
                }
                _ => {
                    for (number, slot) in turn.rows.iter().enumerate() {
                        let to = sample * height + number * lanes;
                        // SAFETY: as above; the row lies within its sample's rows, of which there are enough.
                        unsafe { copy::<W, K>(slots.add(usize::from(*slot) * lanes), rows.add(to)) };
                    }
                    &turn.advance
                }
            };
            // SAFETY: as above.
            unsafe { interpret::<W, K>(instructions, &code.tables, slots, width) };
        }
        if samples % turns.all.len() == 1 {
            for (own, other) in &turns.moved {
                // SAFETY: as above.
                unsafe { copy::<W, K>(slots.add(usize::from(*other) * lanes), slots.add(usize::from(*own) * lanes)) };
            }
        }
    }
}

/// # Safety
/// Both must be `K` registers long.
#[inline(always)]
unsafe fn copy<W: Wide, const K: usize>(from: *const f64, to: *mut f64) {
    let mut k = 0;
    while k < K {
        // SAFETY: as the caller says.
        unsafe { W::read(from.add(k * W::LANES)).write(to.add(k * W::LANES)) };
        k += 1;
    }
}

/// # Safety
/// All slots that the instructions name must be there, `K` registers each, and `width` must be that of `W`.
#[inline(always)]
unsafe fn interpret<W: Wide, const K: usize>(
    code: &[Instruction],
    tables: &[Arc<Table>],
    slots: *mut f64,
    width: Width,
) {
    for instruction in code {
        // A copy, or it would be read anew after each write to the slots.
        let instruction = *instruction;
        let of = Operands::<W, K> { slots, instruction, lanes: core::marker::PhantomData };
        // SAFETY: as the caller says.
        unsafe {
            match instruction.operation {
                Operation::Copy => of.each(|[[a, _], ..]| a),
                Operation::Add => of.each(|[[a, b], ..]| a.add(b)),
                Operation::Sub => of.each(|[[a, b], ..]| a.sub(b)),
                Operation::Mul => of.each(|[[a, b], ..]| a.mul(b)),
                Operation::Neg => of.each(|[[a, _], ..]| a.neg()),
                Operation::Abs => of.each(|[[a, _], ..]| a.abs()),
                Operation::Signum => of.each(|[[a, _], ..]| signum(a)),
                Operation::Copysign => of.each(|[[a, b], ..]| a.copysign(b)),
                Operation::Recip => of.each(|[[a, _], ..]| W::splat(1.0).div(a)),
                Operation::Sqrt => of.each(|[[a, _], ..]| a.sqrt()),
                Operation::Less => of.each(|[[a, b], [c, d], ..]| a.select_lt(b, c, d)),
                Operation::LessOrEqual => of.each(|[[a, b], [c, d], ..]| a.select_le(b, c, d)),
                Operation::Equal => of.each(|[[a, b], [c, d], ..]| a.select_eq(b, c, d)),
                Operation::Fused => of.sum::<true, false>(),
                Operation::FusedProducts => of.sum::<false, false>(),
                Operation::Rounded => of.sum::<true, true>(),
                Operation::RoundedProducts => of.sum::<false, true>(),
                Operation::Function(of_one) => of.function(width, of_one),
                Operation::Table(order) => {
                    let (table, order) = (tables[usize::from(instruction.init)].grid(), [order >> 4, order & 15]);
                    of.each(|[[a, b], ..]| a.zip(b, |x, y| table.derivative([x, y], order)))
                }
                Operation::Function2(of_two) => of.each(|[[a, b], ..]| a.zip(b, |x, y| of_two.of(x, y, Some(y)))),
            }
        }
    }
}

#[inline(always)]
pub(super) fn signum<W: Wide>(a: W) -> W {
    a.select_eq(a, W::splat(1.0).copysign(a), a)
}

/// An instruction and the slots that it works on.
struct Operands<W, const K: usize> {
    slots: *mut f64,
    instruction: Instruction,
    lanes: core::marker::PhantomData<W>,
}

impl<W: Wide, const K: usize> Operands<W, K> {
    /// The first register of a slot.
    #[inline(always)]
    fn at(&self, slot: u16) -> *mut f64 {
        self.slots.wrapping_add(usize::from(slot) * K * W::LANES)
    }

    /// Addresses of a pair of slots.
    #[inline(always)]
    fn pair(&self, j: usize) -> [*mut f64; 2] {
        let [a, b] = self.instruction.pairs[j];
        [self.at(a), self.at(b)]
    }

    #[inline(always)]
    unsafe fn each(&self, f: impl Fn([[W; 2]; 2]) -> W) {
        let ([a, b], [c, d], to) = (self.pair(0), self.pair(1), self.at(self.instruction.to));
        let mut k = 0;
        while k < K {
            // SAFETY: the slots are there, as `interpret` demands; unused operands are slot zero.
            unsafe {
                let at = |slot: *mut f64| W::read(slot.add(k * W::LANES));
                f([[at(a), at(b)], [at(c), at(d)]]).write(to.add(k * W::LANES));
            }
            k += 1;
        }
    }

    #[inline(always)]
    unsafe fn function(&self, width: Width, of: Function) {
        // SAFETY: the slots are there, as `interpret` demands, and the width is that of `W`.
        unsafe { apply(width, of, self.at(self.instruction.pairs[0][0]), self.at(self.instruction.to), K) };
    }

    /// A sum of `N` pairs: from `init`, or from the first product; each operation rounded, or each product with its sum.
    #[inline(always)]
    unsafe fn sum_of<const N: usize, const INIT: bool, const ROUNDED: bool>(&self) {
        // Loops and no closures, which are compiled once for each of the hundreds of instances of this function.
        let (init, factor) = (self.at(self.instruction.init), self.at(self.instruction.factor));
        let to = self.at(self.instruction.to);
        let mut pairs = [[to; 2]; N];
        let mut signs = [W::splat(0.0); N];
        let mut j = 0;
        while j < N {
            pairs[j] = self.pair(j);
            signs[j] = W::splat(SIGNS[usize::from(self.instruction.signs >> j & 1)]);
            j += 1;
        }
        let mut k = 0;
        while k < K {
            let from = k * W::LANES;
            // SAFETY: the slots are there, as `interpret` demands.
            unsafe {
                let mut sum = if INIT {
                    W::read(init.add(from))
                } else {
                    W::read(pairs[0][0].add(from)).mul(W::read(pairs[0][1].add(from)))
                };
                let mut j = usize::from(!INIT);
                while j < N {
                    // Rounding is symmetric, so that a turned sign is as good as a subtraction.
                    let (a, b) = (W::read(pairs[j][0].add(from)).xor(signs[j]), W::read(pairs[j][1].add(from)));
                    sum = if ROUNDED { sum.add(a.mul(b)) } else { a.mul_add(b, sum) };
                    j += 1;
                }
                if self.instruction.scaled {
                    sum = sum.mul(W::read(factor.add(from)));
                }
                sum.write(to.add(from));
            }
            k += 1;
        }
    }

    #[inline(always)]
    unsafe fn sum<const INIT: bool, const ROUNDED: bool>(&self) {
        // SAFETY: as above.
        unsafe {
            match self.instruction.count {
                1 => self.sum_of::<1, INIT, ROUNDED>(),
                2 => self.sum_of::<2, INIT, ROUNDED>(),
                3 => self.sum_of::<3, INIT, ROUNDED>(),
                4 => self.sum_of::<4, INIT, ROUNDED>(),
                _ => self.sum_of::<5, INIT, ROUNDED>(),
            }
        }
    }
}

const SIGNS: [f64; 2] = [0.0, -0.0];
