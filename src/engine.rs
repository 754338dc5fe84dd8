//! [`Program`]: a recurrence with its slopes, compiled, for many trajectories side by side.
//!
//! A [`Recurrence`] is differentiated as a whole, with respect to chosen seeds, scheduled to instructions, and run on *lanes*:
//! each lane is a trajectory of its own, with its own parameters, start and record. A lane's bits depend on nothing but its
//! own numbers: not on other lanes, nor on the number of lanes, nor on what runs the instructions.
//!
//! The interpreter runs everywhere. Where the processor is an x86-64 with AVX2, and the feature `jit` is on, the instructions
//! become machine code.

mod choice;
mod code;
mod derive;
mod functions;
mod fusion;
mod group;
mod interpret;
#[cfg(all(feature = "jit", target_arch = "x86_64"))]
mod machine;
mod schedule;
mod step;
#[cfg(test)]
mod tests;
mod turns;

pub(crate) use choice::only_duals;
pub use code::Column;
pub use group::Group;
pub use schedule::TooLarge;

use crate::graph::{Following, Leaf, Node, Pattern, Seed};
use crate::recurrence::Recurrence;
use crate::wide::Width;
use choice::Machine;
use code::Sound;
use derive::Derivation;
use schedule::{Roots, schedule};
use std::sync::Arc;
use step::Step;

/// How the samples of a pass follow each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sampling {
    /// By the same step, which each lane is told.
    Uniform,
    /// By steps that are a column.
    Irregular,
}

/// How many trajectories run at a time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Trajectories {
    /// Several, side by side.
    Many,
    /// One: as fast as it can follow itself.
    One,
}

/// A recurrence with its slopes, compiled. Clones share it.
#[derive(Clone, Debug)]
pub struct Program(Arc<Compiled>);

#[derive(Debug)]
struct Compiled {
    code: Sound,
    derivation: Derivation,
    pattern: Pattern,
    seeds: Vec<Seed>,
    parameters: usize,
    outputs: usize,
    variances: usize,
    width: Width,
    trajectories: Trajectories,
    machine: Option<Machine>,
}

/// As many parameters as a recurrence depends on, and those before them.
fn parameters(recurrence: &Recurrence) -> usize {
    let parameter = |node: &Node| match node {
        Node::Leaf(Leaf::Parameter(j)) => Some(*j as usize + 1),
        _ => None,
    };
    let written = recurrence.graph().nodes().iter().filter_map(parameter);
    written.chain(recurrence.following().iter().map(Following::end)).max().unwrap_or(0)
}

impl Program {
    /// Differentiates a recurrence with respect to the seeds (none: values only) and compiles it.
    ///
    /// # Errors
    /// If it needs too many numbers at a time.
    pub fn compile(
        recurrence: &Recurrence,
        seeds: &[Seed],
        sampling: Sampling,
        trajectories: Trajectories,
    ) -> Result<Self, TooLarge> {
        let step = Step::new(recurrence, seeds, sampling == Sampling::Uniform);
        let parameters = parameters(recurrence);
        let roots: Vec<_> = step.rows.iter().flatten().chain(&step.next).copied().collect();
        let derived = derive::costly(&step.tape, &roots);
        let (tape, next, rows) = (&step.tape, &step.next, &step.rows);
        let code = schedule(&Roots { tape, next, rows, parameters, derived: &derived })?;
        let (width, machine) = choice::engine(&code, trajectories);
        Ok(Program(Arc::new(Compiled {
            code,
            derivation: Derivation::new(&step.tape, &derived)?,
            pattern: step.pattern,
            seeds: seeds.to_vec(),
            parameters,
            outputs: recurrence.mean().len(),
            variances: recurrence.variance().len(),
            width,
            trajectories,
            machine,
        })))
    }

    /// Whether this is the same program.
    pub(crate) fn is(&self, other: &Program) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }

    /// Lanes of the largest group: what is best for many trajectories.
    pub fn lanes(&self) -> usize {
        self.0.width.lanes() * self.0.registers(usize::MAX)
    }

    /// The registers that it runs on.
    pub(crate) fn width(&self) -> Width {
        self.0.width
    }

    /// Lanes of the group for so many trajectories.
    pub fn lanes_for(&self, trajectories: usize) -> usize {
        self.0.width.lanes() * self.0.registers(trajectories)
    }

    /// A group of at least so many lanes, if it can be: the smallest such group, or the largest.
    pub fn group(&self, lanes: usize) -> Group {
        Group::new(Arc::clone(&self.0), self.0.registers(lanes))
    }

    /// The columns read at each sample, in order.
    pub fn columns(&self) -> &[Column] {
        &self.0.code.columns
    }

    /// Whether the inputs at the next sample are read: then a run needs one row of columns more than it has samples.
    pub fn reads_next(&self) -> bool {
        self.0.code.reads_next()
    }

    /// The quantities with respect to which slopes are computed.
    pub fn seeds(&self) -> &[Seed] {
        &self.0.seeds
    }

    /// Numbers that each sample's rows have: for each output the slopes and the mean, then for each variance the same.
    pub fn row_length(&self) -> usize {
        (self.0.outputs + self.0.variances) * (self.0.seeds.len() + 1)
    }

    /// Outputs.
    pub fn outputs(&self) -> usize {
        self.0.outputs
    }

    /// Variances: none, or as many as outputs.
    pub fn variances(&self) -> usize {
        self.0.variances
    }

    /// Entries of what is carried, without slopes.
    pub fn carried(&self) -> usize {
        self.0.pattern.rows.len()
    }

    /// Bytes of machine code; zero, where instructions are interpreted.
    pub fn machine_code(&self) -> usize {
        self.0.machine.as_ref().map_or(0, Machine::len)
    }

    /// The columns that [`derive`](Self::derive) reads, in order; at the next sample, too, if the second says so.
    pub fn derived_from(&self) -> (&[Column], bool) {
        self.0.derivation.reads()
    }

    /// The derived columns of a record: `columns` are those of [`derived_from`](Self::derived_from), each with a number for
    /// every sample, and one more at the end if the next sample is read. One vector per [`Column::Derived`].
    ///
    /// # Panics
    /// If a column is too short.
    pub fn derive(&self, columns: &[&[f64]], samples: usize) -> Vec<Vec<f64>> {
        self.0.derivation.run(self.0.width, columns, samples)
    }
}

impl Compiled {
    /// Registers side by side for so many lanes.
    fn registers(&self, lanes: usize) -> usize {
        match lanes.div_ceil(self.width.lanes()) {
            _ if self.trajectories == Trajectories::One || self.machine.is_some() => 1,
            0 | 1 => 1,
            2 => 2,
            3 | 4 => 4,
            _ if self.width.lanes() != 4 => 4,
            _ => 8,
        }
    }
}
