//! [`Group`]: the lanes of a program.

use super::Compiled;
use super::interpret::{Part, Run};
use crate::aligned::Aligned;
use crate::wide::{run, run_narrow};
use std::sync::Arc;

/// Slopes below this are set to zero between blocks: squared they are denormal, which slows processors down up to 60 times.
const NEGLIGIBLE: f64 = 1e-150;

/// Trajectories side by side: their parameters, what they carry, and working memory.
///
/// Set parameters and steps, [`prepare`](Self::prepare), [`start`](Self::start) each lane, [`run`](Self::run) block by block.
///
/// # Panics
/// All methods, where there is no such lane, or where a slice is too short.
#[derive(Clone, Debug)]
pub struct Group {
    program: Arc<Compiled>,
    registers: usize,
    /// Slot, lane.
    numbers: Aligned,
}

impl Group {
    pub(super) fn new(program: Arc<Compiled>, registers: usize) -> Self {
        let lanes = registers * program.width.lanes();
        let numbers = Aligned::zeros(program.code.slots * lanes);
        let mut group = Group { program, registers, numbers };
        for (slot, value) in group.program.clone().code.constants.iter() {
            group.slot(usize::from(*slot)).fill(*value);
        }
        group
    }

    /// How many trajectories there are.
    pub fn lanes(&self) -> usize {
        self.registers * self.program.width.lanes()
    }

    fn slot(&mut self, slot: usize) -> &mut [f64] {
        let lanes = self.lanes();
        &mut self.numbers[slot * lanes..][..lanes]
    }

    fn number(&self, slot: usize, lane: usize) -> f64 {
        let lanes = self.lanes();
        self.numbers[slot * lanes..][..lanes][lane]
    }

    /// A lane's parameters; those that nothing depends on may be left out at the end.
    pub fn set_parameters(&mut self, lane: usize, values: &[f64]) {
        let (carried, parameters, lanes) = (self.program.code.carried, self.program.parameters, self.lanes());
        let slots = self.numbers.chunks_exact_mut(lanes).skip(carried);
        slots.zip(values).take(parameters).for_each(|(slot, value)| slot[lane] = *value);
    }

    /// The time (s) from sample to sample of a lane, if it is the same for all samples.
    pub fn set_step(&mut self, lane: usize, step: f64) {
        if let Some(slot) = self.program.code.step {
            self.slot(usize::from(slot))[lane] = step;
        }
    }

    /// Computes what depends on parameters and steps alone: after they have been set, before anything runs.
    pub fn prepare(&mut self) {
        self.interpret(Part::Once);
    }

    /// Runs on whatever registers there are.
    fn interpret(&mut self, part: Part<'_>) {
        let program = Arc::clone(&self.program);
        let (code, slots, width) = (&program.code, &mut self.numbers[..], program.width);
        match self.registers {
            1 => run(width, Run::<1> { code, slots, part, width }),
            2 => run(width, Run::<2> { code, slots, part, width }),
            4 => run(width, Run::<4> { code, slots, part, width }),
            _ => run_narrow(width, Run::<8> { code, slots, part, width }),
        }
    }

    /// The carry of a lane, without slopes.
    pub fn carry(&self, lane: usize, carry: &mut [f64]) {
        for (i, entry) in carry.iter_mut().enumerate().take(self.program.pattern.rows.len()) {
            *entry = self.number(i, lane);
        }
    }

    /// The carries of all lanes, without slopes: entry, lane.
    pub fn carries(&self, carries: &mut [f64]) {
        let length = self.program.pattern.rows.len() * self.lanes();
        carries[..length].copy_from_slice(&self.numbers[..length]);
    }

    /// The slopes of what a lane carries: entry by entry, one for each seed.
    pub fn carry_slopes(&self, lane: usize, slopes: &mut [f64]) {
        for (to, at) in slopes.iter_mut().zip(self.program.pattern.rows.iter().flatten()) {
            *to = at.map_or(0.0, |at| self.number(at, lane));
        }
    }

    /// Puts back what was carried, as it was read; slopes that are always zero stay so.
    pub fn resume(&mut self, lane: usize, carry: &[f64], slopes: &[f64]) {
        let program = Arc::clone(&self.program);
        for (i, _) in program.pattern.rows.iter().enumerate() {
            self.slot(i)[lane] = carry[i];
        }
        for (from, at) in slopes.iter().zip(program.pattern.rows.iter().flatten()) {
            if let Some(at) = at {
                self.slot(*at)[lane] = *from;
            }
        }
    }

    /// Runs through a block of samples. `inputs`: sample, column, lane, with one sample more if the program
    /// [reads the next](super::Program::reads_next). `rows`: sample, output, slopes and mean, lane; then variances likewise.
    pub fn run(&mut self, inputs: &[f64], rows: &mut [f64], samples: usize) {
        self.clear_negligible();
        self.go_on(inputs, rows, samples);
    }

    /// Runs on within a block.
    pub(crate) fn go_on(&mut self, inputs: &[f64], rows: &mut [f64], samples: usize) {
        let program = Arc::clone(&self.program);
        let lanes = self.lanes();
        match &program.machine {
            Some(machine) => machine.run(&program.code, lanes, &mut self.numbers, inputs, rows, samples),
            None => self.interpret(Part::Samples { inputs, rows, samples }),
        }
    }

    /// Sets negligible slopes to zero.
    fn clear_negligible(&mut self) {
        let (values, carried, lanes) = (self.program.pattern.rows.len(), self.program.code.carried, self.lanes());
        for slope in &mut self.numbers[values * lanes..carried * lanes] {
            if slope.abs() < NEGLIGIBLE {
                *slope = 0.0;
            }
        }
    }
}
