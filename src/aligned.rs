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
        Aligned::within(vec![0.0; count + LINE], count)
    }

    /// A vector of this length with unspecified values, in the same memory if it is large enough.
    pub fn resized(self, count: usize) -> Self {
        if count > 0 && self.numbers.len() >= count + LINE {
            Aligned::within(self.numbers, count)
        } else {
            Aligned::zeros(count)
        }
    }

    fn within(numbers: Vec<f64>, count: usize) -> Self {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_and_copies_begin_at_a_cache_line() {
        for count in [1, 7, 64, 1_000, 100_000] {
            let mut numbers = Aligned::zeros(count);
            numbers.iter_mut().enumerate().for_each(|(i, x)| *x = i as f64);
            let copies: Vec<Aligned> = (0..3).map(|_| numbers.clone()).collect();
            for copy in copies.iter().chain([&numbers]) {
                assert_eq!(copy.as_ptr() as usize % 64, 0);
                assert!(copy.len() == count && copy.iter().enumerate().all(|(i, x)| *x == i as f64));
            }
        }
        assert!(Aligned::zeros(0).is_empty());
    }
}
