//! [`Triangles`]: the triangles of independent pieces, side by side in the lanes of vector registers.

mod absorb;

use super::Information;
use crate::aligned::Aligned;
use crate::wide::{self, Width};

/// Lanes are stored in multiples of the widest register's.
const REGISTER: usize = 8;

/// The square-root triangles of `lanes` independent pieces (records, or segments of one), all with the same columns. Rows
/// of all lanes are absorbed together by Householder reflections in vector registers (six columns: 1.1 ns per row and lane,
/// where [`Information::absorb`] takes 2).
///
/// A lane's triangle depends on its own rows only, to the last bit, and on their number; not on the other lanes and not on
/// the vector registers of the processor, but for whether it fuses a product with a sum. A lane with a NaN leaves the
/// others alone. Nothing is rescaled: entries beyond 1e150 overflow, which the lane's triangle then shows by a number
/// that is not finite, and a column whose norm over 128 rows is below 1e-140 counts as zeros.
#[derive(Clone, Debug)]
pub struct Triangles {
    columns: usize,
    lanes: usize,
    rows: u64,
    width: Width,
    /// Row after row of the triangle, each from its diagonal on, `[entry][lane]`.
    entries: Vec<f64>,
    /// Two numbers per column and lane of a register.
    factors: Vec<f64>,
    /// The rows of one register's lanes.
    scratch: Aligned,
}

impl Triangles {
    /// Nothing known about `columns` unknowns in each of `lanes` lanes.
    pub fn new(columns: usize, lanes: usize) -> Self {
        Self::with(Width::widest(), columns, lanes)
    }

    /// Triangles for these registers.
    pub(crate) fn with(width: Width, columns: usize, lanes: usize) -> Self {
        let all = columns + 1;
        // The lanes of a single register are absorbed where they stand.
        let copied = if lanes == width.lanes() { 0 } else { absorb::ROWS * all * REGISTER };
        Triangles {
            columns,
            lanes,
            rows: 0,
            width,
            entries: vec![0.0; all * (all + 1) / 2 * lanes.next_multiple_of(REGISTER)],
            factors: vec![0.0; 2 * all * REGISTER],
            scratch: Aligned::zeros(copied),
        }
    }

    /// How many unknowns each lane has.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// How many lanes.
    pub fn lanes(&self) -> usize {
        self.lanes
    }

    /// Absorbs `count` rows of all lanes, as `[row][column][lane]`: each row has its slopes, then its `y`, and the lanes of
    /// each stand side by side. The rows are used up as working space. A row of zeros changes nothing, so that lanes with
    /// fewer rows, or missing ones, are filled with zeros. Does not allocate; fastest where `rows` begins at a cache line
    /// (64 bytes). A slice that is too short is absorbed as far as it goes.
    pub fn absorb(&mut self, rows: &mut [f64], count: usize) {
        self.absorb_every(rows, count, 1);
    }

    /// [`absorb`](Self::absorb) of the first of every `step` rows, of which there are `count` in all.
    pub(crate) fn absorb_every(&mut self, rows: &mut [f64], count: usize, step: usize) {
        let stride = (self.columns + 1) * self.lanes;
        let count = count.min(rows.len().checked_div(stride).unwrap_or(0));
        self.rows += count.div_ceil(step) as u64;
        if step > 1 && self.scratch.is_empty() {
            self.scratch = Aligned::zeros(absorb::ROWS * (self.columns + 1) * REGISTER);
        }
        let task = absorb::Absorb {
            columns: self.columns + 1,
            lanes: self.lanes,
            triangles: &mut self.entries,
            rows: &mut rows[..count * stride],
            step,
            factors: &mut self.factors,
            scratch: &mut self.scratch,
        };
        wide::run(self.width, task);
    }

    /// The triangle of one lane; that of no rows for a lane that there is not.
    pub fn triangle(&self, lane: usize) -> Information {
        if lane >= self.lanes {
            return Information::new(self.columns);
        }
        let entries = self.entries.chunks_exact(self.lanes.next_multiple_of(REGISTER));
        Information { columns: self.columns, rows: self.rows, triangle: entries.map(|lanes| lanes[lane]).collect() }
    }

    /// Forgets all rows.
    pub fn clear(&mut self) {
        self.rows = 0;
        self.entries.fill(0.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::information::Block;

    /// Numbers in -1..1, the same on every run.
    fn random() -> impl FnMut() -> f64 {
        let mut seed = 1u64;
        move || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 11) as f64 / (1u64 << 52) as f64 - 1.0
        }
    }

    fn bits(triangles: &Triangles) -> Vec<u64> {
        let bits = |x: &f64| if x.is_nan() { 0 } else { x.to_bits() };
        (0..triangles.lanes)
            .flat_map(|lane| triangles.triangle(lane).triangle.iter().map(bits).collect::<Vec<_>>())
            .collect()
    }

    /// Each width, some of whose lanes hold a NaN, an overflow or zeros.
    #[test]
    fn every_width_gives_the_same_bits() {
        for columns in [0, 1, 2, 4, 5, 7, 8, 9, 12, 16, 20] {
            for lanes in [1, 4, 8, 11, 32] {
                let (mut next, count) = (random(), 150);
                let mut rows: Vec<f64> = (0..count * (columns + 1) * lanes).map(|_| next()).collect();
                if lanes > 4 {
                    rows.iter_mut().skip(1).step_by(lanes).for_each(|x| *x *= 1e200);
                    rows.iter_mut().skip(2).step_by(lanes).for_each(|x| *x = 0.0);
                    rows[7 * (columns + 1) * lanes + 3] = f64::NAN;
                }
                let by = |width: Width| {
                    let mut triangles = Triangles::with(width, columns, lanes);
                    for part in [37, count - 37] {
                        let done = triangles.rows as usize * (columns + 1) * lanes;
                        triangles.absorb(&mut rows[done..].to_vec(), part);
                    }
                    bits(&triangles)
                };
                let portable = by(Width::portable());
                for width in [Width::avx512(), Width::avx2()].into_iter().flatten() {
                    assert_eq!(by(width), portable, "{columns} columns, {lanes} lanes, {width:?}");
                }
            }
        }
    }

    #[test]
    fn a_lane_is_what_information_makes_of_its_rows() {
        for columns in [0, 1, 5, 9, 17] {
            let (mut next, lanes, count) = (random(), 16, 150);
            let width = columns + 1;
            let rows: Vec<f64> = (0..count * width * lanes).map(|_| next()).collect();
            let mut triangles = Triangles::new(columns, lanes);
            triangles.absorb(&mut rows.clone(), count);
            for lane in [0, 7, 8, 15] {
                let mut block = Block::new(columns, count);
                for row in rows.chunks_exact(width * lanes) {
                    let row: Vec<f64> = row.iter().skip(lane).step_by(lanes).copied().collect();
                    assert!(block.push(&row[..columns], row[columns]));
                }
                let mut alone = Information::new(columns);
                alone.absorb(&mut block);
                let triangle = triangles.triangle(lane);
                assert_eq!(triangle.rows(), alone.rows());
                // Entries up to 12, sums of 150 terms: some hundred roundings at most.
                for (a, b) in triangle.triangle.iter().zip(&alone.triangle) {
                    assert!((a - b).abs() < 1e-13, "{columns} columns, lane {lane}: {a} {b}");
                }
            }
        }
    }

    /// Zeros, at the end and in between, change no bit; nor do a NaN, an overflow or other numbers in the other lanes.
    #[test]
    fn a_lane_depends_on_its_own_rows_alone() {
        let (columns, lanes, count) = (4, 8, 100);
        let (mut next, stride) = (random(), (columns + 1) * lanes);
        let rows: Vec<f64> = (0..count * stride).map(|_| next()).collect();
        let triangle = |rows: &[f64], lane: usize| {
            let mut triangles = Triangles::new(columns, lanes);
            triangles.absorb(&mut rows.to_vec(), rows.len() / stride);
            triangles.triangle(lane).triangle
        };
        let alone = triangle(&rows, 5);
        let mut others = rows.clone();
        for (at, x) in others.iter_mut().enumerate().filter(|(at, _)| at % lanes != 5) {
            *x = [f64::NAN, 1e300, 0.0, f64::NEG_INFINITY, 1e-300, 3.0][at % 6];
        }
        assert_eq!(triangle(&others, 5), alone);
        assert!(triangle(&others, 4).iter().any(|x| !x.is_finite()), "what overflows shows");
        let mut longer = rows.clone();
        longer.extend(vec![0.0; 29 * stride]);
        assert_eq!(triangle(&longer, 5), alone);

        let mut triangles = Triangles::new(columns, lanes);
        triangles.absorb(&mut rows.clone(), count);
        triangles.absorb(&mut vec![0.0; 7 * stride], 7);
        assert_eq!(triangles.triangle(5).triangle, alone);
        assert_eq!(triangles.triangle(5).rows(), 107);
        triangles.clear();
        assert_eq!(triangles.triangle(5), Information::new(columns));
        // More rows asked for than there are, and a lane that there is not.
        triangles.absorb(&mut rows.clone()[..3 * stride + 1], 4);
        assert_eq!((triangles.triangle(0).rows(), triangles.triangle(8).rows()), (3, 0));
        assert_eq!((triangles.columns(), triangles.lanes()), (4, 8));
    }

    /// A column so small that its squares vanish is no more than zeros, and what the others say is kept.
    #[test]
    fn a_column_that_underflows_leaves_the_others_right() {
        let (columns, lanes) = (2, 8);
        let mut next = random();
        let rows: Vec<f64> = (0..50 * lanes).flat_map(|_| [0.0, 0.0, 0.0].map(|_: f64| next())).collect();
        let triangle = |scale: f64| {
            let mut rows = rows.clone();
            rows.iter_mut().enumerate().filter(|(at, _)| at / lanes % 3 == 0).for_each(|(_, x)| *x *= scale);
            let mut triangles = Triangles::new(columns, lanes);
            triangles.absorb(&mut rows, 50);
            triangles.triangle(0)
        };
        let (zero, tiny, small) = (triangle(0.0), triangle(1e-159), triangle(1e-130));
        assert_eq!(tiny, zero);
        // The squares of 1e-130 are still numbers: the triangle is that of the rows times the scale.
        let plain = triangle(1.0);
        for (i, j) in [(0, 0), (0, 1), (1, 1), (1, 2), (2, 2)] {
            let expected = plain.at(i, j) * if j == 0 { 1e-130 } else { 1.0 };
            assert!((small.at(i, j) - expected).abs() <= 1e-14 * expected.abs(), "{i} {j}");
        }
    }
}
