//! [`Interleaved`]: what a program reads of the records in its lanes, side by side, kept from pass to pass.

use super::columns::Columns;
use super::run::WINDOW;
use super::workspace::Compiled;
use crate::aligned::Aligned;
use crate::engine::{Column, Program};
use crate::record;
use crate::sweep::Piece;
use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};

/// Most numbers of a record that are kept; longer ones are read anew at every pass.
const KEPT: usize = 4_000_000;

/// The columns of the records in the lanes of programs, by what was put side by side. Copies share them.
#[derive(Clone, Default)]
pub(crate) struct Interleaved(Arc<Mutex<Vec<Arc<Kept>>>>);

/// Memory of columns that are not kept any more, which the next ones use again: the system takes as long to give such blocks as
/// it takes to fill them.
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
    /// The columns of pieces, one piece in each lane. `None` where they are not kept: for programs that read time or step, for
    /// long records, and for programs without slopes, which run once or twice a fit, unless a program with slopes has kept the
    /// same columns.
    pub(super) fn of<'p>(
        &self,
        compiled: &Compiled,
        pieces: &[&Piece<'_>],
        columns: impl FnOnce() -> Columns<'p>,
    ) -> Option<Arc<Kept>> {
        let program = &compiled.program;
        let read = program.columns();
        let of_time = read.iter().any(|column| matches!(column, Column::Time | Column::Step));
        let numbers = pieces[0].record.len() * (read.len() + program.outputs());
        if of_time || numbers > KEPT {
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
        let all = || self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(found) = all().iter().find(|kept| is(kept)) {
            return Some(found.clone());
        }
        if program.seeds().is_empty() {
            return None;
        }
        let from = channels().map(|channel| channel.values.clone()).collect();
        let kept = Arc::new(Kept::new(compiled, begins().collect(), samples, from, &columns()));
        let mut all = all();
        // Columns of the same samples with another record in one of the lanes: a search of a fleet has ended.
        all.retain(|kept| !stands_alike(kept));
        all.push(kept.clone());
        Some(kept)
    }
}

impl Kept {
    fn new(
        compiled: &Compiled,
        begins: Vec<usize>,
        samples: usize,
        from: Vec<record::Column>,
        columns: &Columns<'_>,
    ) -> Self {
        let (program, lanes, rows) = (&compiled.program, begins.len(), columns.rows(samples));
        let (stride, outputs) = (program.columns().len() * lanes, program.outputs() * lanes);
        let [inputs, measured] = compiled.columns.take();
        let (mut inputs, mut measured) = (inputs.resized(rows * stride), measured.resized(samples * outputs));
        for first in (0..samples).step_by(WINDOW) {
            let at: Vec<usize> = begins.iter().map(|begin| begin + first).collect();
            let here = WINDOW.min(samples - first);
            columns.read(program, &at, here, &mut inputs[first * stride..]);
            columns.read_measured(&at, here, &mut measured[first * outputs..]);
        }
        let (program, idle) = (program.clone(), compiled.columns.clone());
        Kept { program, idle, begins, samples, from, inputs, measured }
    }
}

impl Drop for Kept {
    fn drop(&mut self) {
        self.idle.put([std::mem::take(&mut self.inputs), std::mem::take(&mut self.measured)]);
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
