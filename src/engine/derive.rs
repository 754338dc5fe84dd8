//! Derived columns: costly operations whose operands are the record's columns alone. They are computed once for each record
//! instead of at each evaluation, and read like measured columns.

use super::code::{Column, Sound};
use super::interpret::{Part, Run};
use super::schedule::{Roots, TooLarge, schedule};
use crate::graph::{Id, Node, Tape};
use crate::wide::{Width, run};

/// The nodes that become derived columns: functions and quotients of the record's columns, and what is computed from them,
/// where nodes that vary with unknowns read them.
pub(super) fn costly(tape: &Tape, roots: &[Id]) -> Vec<Id> {
    let reached = tape.graph.reached(roots);
    let mut costly = vec![false; tape.graph.len()];
    let mut read = vec![false; tape.graph.len()];
    roots.iter().for_each(|root| read[root.index()] = true);
    for (i, node) in tape.graph.nodes().iter().enumerate().filter(|(i, _)| reached[*i]) {
        if tape.depends[i].on_record_alone() {
            let itself = matches!(node, Node::Function(..) | Node::Function2(..) | Node::Table { .. });
            costly[i] = itself || node.operands().any(|operand| costly[operand.index()]);
        } else {
            node.operands().for_each(|operand| read[operand.index()] = true);
        }
    }
    (0..costly.len()).filter(|i| costly[*i] && read[*i]).map(Id::new).collect()
}

/// The program of the derived columns: consecutive samples are its lanes.
#[derive(Debug)]
pub(super) struct Derivation(Sound);

impl Derivation {
    pub fn new(tape: &Tape, derived: &[Id]) -> Result<Self, TooLarge> {
        let rows: Vec<_> = derived.iter().copied().map(Some).collect();
        schedule(&Roots { tape, next: &[], rows: &rows, parameters: 0, derived: &[] }).map(Derivation)
    }

    pub fn reads(&self) -> (&[Column], bool) {
        (&self.0.columns, self.0.reads_next())
    }

    pub fn run(&self, width: Width, columns: &[&[f64]], samples: usize) -> Vec<Vec<f64>> {
        let (code, lanes) = (&self.0, width.lanes());
        let mut derived = vec![Vec::with_capacity(samples); code.rows.len()];
        if derived.is_empty() {
            return derived;
        }
        let mut slots = vec![0.0; code.slots * lanes];
        for (slot, value) in &code.constants {
            slots[usize::from(*slot) * lanes..][..lanes].fill(*value);
        }
        run(width, Run::<1> { code, slots: &mut slots, part: Part::Once, width });
        let mut inputs = vec![0.0; 2 * columns.len() * lanes];
        let mut rows = vec![0.0; code.rows.len() * lanes];
        for begin in (0..samples).step_by(lanes) {
            let there = lanes.min(samples - begin);
            for (next, half) in inputs.chunks_exact_mut((columns.len() * lanes).max(1)).enumerate() {
                for (column, lanes) in columns.iter().zip(half.chunks_exact_mut(lanes)) {
                    if next == 0 || code.reads_next() {
                        lanes[..there].copy_from_slice(&column[begin + next..][..there]);
                    }
                }
            }
            let part = Part::Samples { inputs: &inputs, rows: &mut rows, samples: 1 };
            run(width, Run::<1> { code, slots: &mut slots, part, width });
            for (derived, row) in derived.iter_mut().zip(rows.chunks_exact(lanes)) {
                derived.extend(&row[..there]);
            }
        }
        derived
    }
}
