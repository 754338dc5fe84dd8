//! [`Block`]: rows gathered for one absorption, stored by columns.

/// Rows processed together by one step of the loops; columns are stored in multiples of it.
pub(super) const LANES: usize = 8;
const LINE: usize = 64;

/// Up to `capacity` rows `(phi, y)` to be absorbed at once, stored by columns, so that the reflections run along vector
/// lanes. Around 256 rows fill the fast cache without leaving it.
#[derive(Debug)]
pub struct Block {
    columns: usize,
    capacity: usize,
    len: usize,
    // Distance from one column to the next, in entries.
    stride: usize,
    // Where the first column starts, so that columns start at cache lines.
    offset: usize,
    entries: Vec<f64>,
    // One number per column, for the reflections.
    products: Vec<f64>,
}

impl Block {
    /// An empty block for rows of `columns` slopes and one `y`.
    pub fn new(columns: usize, capacity: usize) -> Self {
        // An odd number of cache lines keeps the columns from competing for the same ones.
        let stride = (capacity.div_ceil(LANES) | 1) * LANES;
        let spare = LINE / size_of::<f64>();
        let entries = vec![0.0; stride * (columns + 1) + spare];
        let offset = entries.as_ptr().align_offset(LINE).min(spare);
        Block { columns, capacity, len: 0, stride, offset, entries, products: vec![0.0; columns + 1] }
    }

    /// How many slopes a row has.
    #[inline(always)]
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// How many rows it can hold.
    #[inline(always)]
    pub fn capacity(&self) -> usize {
        self.capacity
    }

    /// How many rows it holds.
    #[inline(always)]
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether it holds no row.
    #[inline(always)]
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Whether no further row fits.
    #[inline(always)]
    pub fn is_full(&self) -> bool {
        self.len >= self.capacity
    }

    /// Forgets all rows.
    #[inline(always)]
    pub fn clear(&mut self) {
        self.len = 0;
    }

    /// Says that the first `len` entries of every column are rows; at most the capacity.
    #[inline(always)]
    pub fn set_len(&mut self, len: usize) {
        self.len = len.min(self.capacity);
    }

    /// All `capacity` entries of a column to be filled; column number `columns` is `y`, one beyond is empty.
    #[inline(always)]
    pub fn column_mut(&mut self, column: usize) -> &mut [f64] {
        let capacity = if column <= self.columns { self.capacity } else { 0 };
        let start = self.offset + self.stride * column.min(self.columns);
        &mut self.entries[start..start + capacity]
    }

    /// Appends one row. False, and nothing done, if the block is full or `phi` has not `columns` slopes.
    #[inline(always)]
    #[must_use]
    pub fn push(&mut self, phi: &[f64], y: f64) -> bool {
        let fits = !self.is_full() && phi.len() == self.columns;
        if fits {
            let mut at = self.offset + self.len;
            for &slope in phi {
                self.entries[at] = slope;
                at += self.stride;
            }
            self.entries[at] = y;
            self.len += 1;
        }
        fits
    }

    /// The columns, each `stride` long, of which the first `rows` count (a multiple of [`LANES`], the rows after the
    /// last one set to zero), and one scratch number per column.
    #[inline(always)]
    pub(super) fn parts(&mut self) -> Parts<'_> {
        let rows = self.len.next_multiple_of(LANES).min(self.stride);
        let columns = &mut self.entries[self.offset..self.offset + self.stride * (self.columns + 1)];
        for column in columns.chunks_exact_mut(self.stride) {
            column[self.len..rows].fill(0.0);
        }
        Parts { columns, stride: self.stride, rows, products: &mut self.products }
    }
}

pub(super) struct Parts<'a> {
    pub columns: &'a mut [f64],
    pub stride: usize,
    pub rows: usize,
    pub products: &'a mut [f64],
}

// By hand, because the place of the first column depends on the allocation.
impl Clone for Block {
    fn clone(&self) -> Self {
        let mut block = Block::new(self.columns, self.capacity);
        let (from, to, size) = (self.offset, block.offset, self.stride * (self.columns + 1));
        block.entries[to..to + size].copy_from_slice(&self.entries[from..from + size]);
        block.len = self.len;
        block
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::information::Information;

    /// Rows that are not absorbed yet are copied with all columns and the residuals.
    #[test]
    fn a_copy_holds_the_same_rows() {
        let mut block = Block::new(2, 64);
        for (row, residual) in [([1.0, 2.0], 3.0), ([-1.0, 0.5], -2.0), ([4.0, -0.25], 7.0)] {
            Information::new(2).gather(&mut block, &row, residual);
        }
        let absorbed = |mut block: Block| {
            let mut triangle = Information::new(2);
            triangle.absorb(&mut block);
            triangle
        };
        let (copy, original) = (absorbed(block.clone()), absorbed(block));
        // The sum of squares is that of the residuals.
        assert!((original.residual_at_zero() - (9.0 + 4.0 + 49.0)).abs() < 1e-13, "{}", original.residual_at_zero());
        assert_eq!(copy.residual_at_zero(), original.residual_at_zero());
        assert_eq!(copy.solve().unwrap(), original.solve().unwrap());
    }
}
