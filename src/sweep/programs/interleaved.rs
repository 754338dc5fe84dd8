//! [`Interleaved`]: what a program reads of the records in its lanes, side by side, kept from pass to pass.

use super::columns::Columns;
use super::workspace::{Compiled, WINDOW};
use crate::aligned::Aligned;
use crate::engine::{Column, Program};
use crate::record;
use crate::sweep::Piece;
use std::fmt;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Most numbers of a record that are kept; longer ones are read anew at every pass.
const KEPT: usize = 4_000_000;

/// The columns of the records in the lanes of programs, by the records that were run together. Copies share them.
#[derive(Clone, Default)]
pub(crate) struct Interleaved(Arc<Mutex<Vec<Arc<Kept>>>>);

/// Memory of columns that are not kept any more, for the next ones: allocating such blocks takes as long as filling them.
#[derive(Default)]
pub(super) struct Idle(Mutex<Vec<[Aligned; 2]>>);

/// Columns of records side by side.
pub(super) struct Kept {
    program: Program,
    idle: Arc<Idle>,
    /// First sample of each lane.
    begins: Vec<usize>,
    samples: usize,
    from: Vec<record::Column>,
    /// Sample, column, lane: inputs.
    pub inputs: Aligned,
    /// Sample, output, lane: as measured.
    pub measured: Aligned,
}

impl fmt::Debug for Interleaved {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Interleaved")
    }
}

impl Interleaved {
    /// The columns of pieces, one piece in each lane. `None` where they are not kept: for programs that read time, step or late inputs, for
    /// long records, at first for records that were run together with others before, and for programs without slopes, which
    /// run once or twice a fit, unless a program with slopes has kept the same columns.
    pub(super) fn of<'p>(
        &self,
        compiled: &Compiled,
        pieces: &[&Piece<'_>],
        columns: impl FnOnce() -> Columns<'p>,
    ) -> Option<Arc<Kept>> {
        let program = &compiled.program;
        let read = program.columns();
        let moves = |column: &Column| matches!(column, Column::Time | Column::Step | Column::Late(..));
        let numbers = pieces[0].record.len() * (read.len() + program.outputs());
        if read.iter().any(moves) || numbers > KEPT {
            return None;
        }
        let samples = pieces.iter().map(|piece| piece.samples.len()).max().unwrap_or(0);
        let derives = read.iter().any(|column| matches!(column, Column::Derived(_)));
        let reads_alike = |kept: &Kept| {
            let (a, b) = (&kept.program, program);
            let alike = a.columns() == b.columns() && a.reads_next() == b.reads_next() && a.outputs() == b.outputs();
            alike && (!derives || a.is(b))
        };
        let begins = || pieces.iter().map(|piece| piece.samples.start);
        let channels = || pieces.iter().flat_map(|piece| piece.record.inputs().iter().chain(piece.record.outputs()));
        let stands_alike =
            |kept: &Kept| kept.samples == samples && kept.begins.iter().copied().eq(begins()) && reads_alike(kept);
        let is = |kept: &Kept| {
            let mut from = kept.from.iter();
            stands_alike(kept) && channels().all(|channel| from.next().is_some_and(|from| from.is(&channel.values)))
        };
        let known = self.lock().iter().find(|kept| is(kept)).cloned();
        if let Some(kept) = known.as_ref().filter(|kept| kept.is_filled()) {
            return Some(kept.clone());
        }
        if program.seeds().is_empty() {
            return None;
        }
        let from = channels().map(|channel| channel.values.clone()).collect();
        let (begins, others) = (begins().collect(), self.lock().iter().any(|kept| stands_alike(kept)));
        // Some of these records were run together with others before: searches of a fleet have ended. Those that remain may
        // need one pass only, so that their columns are kept from the second one on.
        if known.is_none() && others {
            self.lock().push(Arc::new(Kept::asked(compiled, begins, samples, from)));
            return None;
        }
        let kept = Arc::new(Kept::new(compiled, begins, samples, from, &columns()));
        for piece in pieces {
            let mut all = piece.prepared.interleaved.lock();
            if all.iter().any(|other| Arc::ptr_eq(other, &kept)) {
                continue;
            }
            // The first ones, of all records of a group, are read again by the pass over the residuals.
            let first = all.iter().find(|kept| stands_alike(kept)).cloned();
            all.retain(|kept| !stands_alike(kept) || first.as_ref().is_some_and(|first| Arc::ptr_eq(first, kept)));
            all.push(kept.clone());
        }
        Some(kept)
    }

    fn lock(&self) -> MutexGuard<'_, Vec<Arc<Kept>>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Kept {
    /// Columns that were asked for, but not read.
    fn asked(compiled: &Compiled, begins: Vec<usize>, samples: usize, from: Vec<record::Column>) -> Self {
        let (program, idle) = (compiled.program.clone(), compiled.columns.clone());
        Kept { program, idle, begins, samples, from, inputs: Aligned::default(), measured: Aligned::default() }
    }

    fn is_filled(&self) -> bool {
        !self.inputs.is_empty() || !self.measured.is_empty()
    }

    fn new(
        compiled: &Compiled,
        begins: Vec<usize>,
        samples: usize,
        from: Vec<record::Column>,
        columns: &Columns<'_>,
    ) -> Self {
        let mut kept = Kept::asked(compiled, begins, samples, from);
        let (program, begins) = (&compiled.program, &kept.begins);
        let (lanes, rows) = (begins.len(), columns.rows(samples));
        let (stride, outputs) = (program.columns().len() * lanes, program.outputs() * lanes);
        let [inputs, measured] = compiled.columns.take();
        let (mut inputs, mut measured) = (inputs.resized(rows * stride), measured.resized(samples * outputs));
        for first in (0..samples).step_by(WINDOW) {
            let at: Vec<usize> = begins.iter().map(|begin| begin + first).collect();
            let here = WINDOW.min(samples - first);
            columns.read(program, &at, here, &mut inputs[first * stride..]);
            columns.read_measured(&at, here, &mut measured[first * outputs..]);
        }
        (kept.inputs, kept.measured) = (inputs, measured);
        kept
    }
}

impl Drop for Kept {
    fn drop(&mut self) {
        if self.is_filled() {
            self.idle.put([std::mem::take(&mut self.inputs), std::mem::take(&mut self.measured)]);
        }
    }
}

impl Idle {
    fn take(&self) -> [Aligned; 2] {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).pop().unwrap_or_default()
    }

    fn put(&self, columns: [Aligned; 2]) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push(columns);
    }
}
