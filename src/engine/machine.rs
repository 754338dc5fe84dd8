//! [`Machine`]: a step as machine code of x86-64, with the loop over the samples in it.
//!
//! Instructions keep the order and the rounding of the interpreter's, and call the same functions, so that the bits are the
//! same. Which numbers stand in registers is decided by who is read last (L. A. Belady, "A study of replacement algorithms for
//! a virtual-storage computer", IBM Systems Journal 5, 1966, 78-101); the rest waits in the slots. Pages are written first and
//! made executable then, never both.

mod emit;
mod registers;
mod routines;
mod unit;

use super::code::Sound;
use crate::scalar::Table;
use crate::wide::Width;
use emit::Emitter;
use memmap2::{Mmap, MmapMut};
use std::sync::Arc;
use unit::Unit;

/// Slots, inputs, rows, samples.
type Entry = unsafe extern "sysv64" fn(*mut f64, *const f64, *mut f64, usize);

/// Machine code of a step.
#[derive(Debug)]
pub(super) struct Machine {
    code: Mmap,
    /// The tables that the code names by their addresses.
    _tables: Vec<Arc<Table>>,
}

impl Machine {
    /// None where the processor or the system does not allow it.
    pub fn new(code: &Sound, width: Width) -> Option<Self> {
        let unit = Unit::of(width)?;
        let bytes = Emitter::new(code, unit).emit().ok()?;
        let mut pages = MmapMut::map_anon(bytes.len()).ok()?;
        pages.copy_from_slice(&bytes);
        pages.make_exec().ok().map(|pages| Machine { code: pages, _tables: code.tables.clone() })
    }

    /// Bytes of code.
    pub fn len(&self) -> usize {
        self.code.len()
    }

    /// Runs through a block of samples of the step that the code was made of, on one register for each slot.
    ///
    /// # Panics
    /// If a slice is too short.
    pub fn run(&self, code: &Sound, lanes: usize, slots: &mut [f64], inputs: &[f64], rows: &mut [f64], samples: usize) {
        let (columns, height) = (code.columns.len() * lanes, code.rows.len() * lanes);
        assert!(slots.len() >= code.slots * lanes && rows.len() >= samples * height);
        assert!(inputs.len() >= (samples + usize::from(code.reads_next())) * columns);
        if samples == 0 {
            return;
        }
        // SAFETY: the pages hold a function of this type: `emit` writes nothing else. It reads and writes the slots of a
        // sound code, `samples` rows, and as many rows of inputs (one more if the next are read), all of which are there.
        unsafe {
            let entry: Entry = core::mem::transmute::<*const u8, Entry>(self.code.as_ptr());
            entry(slots.as_mut_ptr(), inputs.as_ptr(), rows.as_mut_ptr(), samples);
        }
    }
}
