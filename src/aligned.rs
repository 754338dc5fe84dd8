//! [`Aligned`]: numbers that begin at a cache line.

use core::ops::{Deref, DerefMut, Range};

/// Numbers in a cache line.
const LINE: usize = 8;

/// A fixed count of numbers that begin at a cache line (64 bytes): a vector register's worth of them never crosses one.
#[derive(Debug, Default)]
pub(crate) struct Aligned {
    numbers: Vec<f64>,
    range: Range<usize>,
}

impl Aligned {
    /// Zeros.
    pub fn zeros(count: usize) -> Self {
        if count == 0 {
            return Aligned::default();
        }
        let numbers = vec![0.0; count + LINE];
        // Where the system cannot tell the offset, the numbers begin anywhere.
        let first = numbers.as_ptr().align_offset(LINE * size_of::<f64>()).min(LINE);
        Aligned { numbers, range: first..first + count }
    }
}

impl Deref for Aligned {
    type Target = [f64];

    #[inline(always)]
    fn deref(&self) -> &[f64] {
        &self.numbers[self.range.clone()]
    }
}

impl DerefMut for Aligned {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut [f64] {
        &mut self.numbers[self.range.clone()]
    }
}

/// The copy may begin at another offset of its memory.
impl Clone for Aligned {
    fn clone(&self) -> Self {
        let mut copy = Aligned::zeros(self.len());
        copy.copy_from_slice(self);
        copy
    }
}
