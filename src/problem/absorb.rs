//! [`Absorber`]: from windows of standardized errors to costs and triangles.

use super::Weighing;
use super::job::Job;
use super::likelihood::Likelihood;
use super::repeated::joined;
use crate::information::{Block, Information, Triangles};
use crate::sweep::Window;
use crate::wide::{self, Task, Wide, Width};

/// Rows that are absorbed together.
const ROWS: usize = 256;

/// Absorbs the rows of jobs that run in parallel lanes: into one triangle for each lane, or into one for each lane and output.
pub(super) struct Absorber<'o> {
    weighing: Vec<Weighing<'o>>,
    /// Whether there is neither a loss nor a weight: the cost is half the sum of squares, plus that of the logarithms of variances where these are
    /// predicted.
    plain: bool,
    /// How many triangles a lane has: one, or one for each output.
    sets: usize,
    /// Measurements, lane by lane and set by set.
    rows: Vec<u64>,
    /// Twice that cost, for each lane.
    sums: Vec<f64>,
    columns: usize,
    /// Those of each set, where jobs run in parallel lanes.
    triangles: Vec<Triangles>,
    /// That of each set, where one job runs alone.
    alone: Vec<Alone>,
}

impl<'o> Absorber<'o> {
    /// With one triangle for each lane, or one for each of so many outputs.
    pub fn new(jobs: &[&Job<'o>], sets: usize) -> Self {
        let objective = jobs[0].objective;
        Absorber {
            weighing: jobs.iter().map(|job| Weighing::new(job.objective, job.experiment)).collect(),
            plain: objective.loss().is_none() && !objective.is_weighted(),
            sets,
            rows: vec![0; jobs.len() * sets],
            sums: vec![],
            columns: jobs[0].seeds.len(),
            triangles: vec![],
            alone: vec![],
        }
    }

    /// Absorbs a window; its contents are overwritten.
    pub fn absorb(&mut self, window: &mut Window) {
        let count = window.len() * window.outputs();
        let (lanes, width, columns) = (window.lanes(), window.width, window.columns());
        if self.plain {
            self.count(window);
            if window.has_variances() {
                self.sums.resize(lanes, 0.0);
                let sums = &mut self.sums[..];
                let (rows, variances) = window.rows_and_variances_mut();
                wide::run(width, Likelihood { rows, variances, columns, sums });
            } else if window.lanes() > 1 {
                self.square(window);
            }
        } else {
            self.weigh(window, &mut []);
        }
        if window.has_variances() {
            let samples = if self.plain && window.settled != 0 { joined(window) } else { window.len() };
            let of_variances = samples * window.outputs();
            let rows = &mut window.variance_rows_mut()[..of_variances * columns * lanes];
            self.absorb_rows(lanes, width, rows, of_variances);
        }
        self.absorb_rows(lanes, width, window.rows_mut(), count);
    }

    /// Absorbs a window in which `replace` overwrites the errors; it is given the numbers `beside`, one for each error, row by row and lane by lane. Rows and
    /// these numbers are weighted as the errors are.
    pub fn absorb_instead(
        &mut self,
        window: &mut Window,
        beside: &mut [f64],
        replace: impl FnOnce(&mut Window, &[f64]),
    ) {
        let count = window.len() * window.outputs();
        match self.plain {
            true => self.count(window),
            false => self.weigh(window, beside),
        }
        replace(window, beside);
        self.absorb_rows(window.lanes(), window.width, window.rows_mut(), count);
    }

    fn absorb_rows(&mut self, lanes: usize, width: Width, rows: &mut [f64], count: usize) {
        let (columns, sets) = (self.columns, self.sets);
        if lanes == 1 {
            self.alone.resize_with(sets, || Alone::new(columns));
            self.alone.iter_mut().enumerate().for_each(|(set, alone)| alone.absorb(rows, set, sets));
            return;
        }
        self.triangles.resize_with(sets, || Triangles::with(width, columns, lanes));
        for (set, triangles) in self.triangles.iter_mut().enumerate().take(count) {
            triangles.absorb_every(&mut rows[set * (columns + 1) * lanes..], count - set, sets);
        }
    }

    /// Sums of squares of parallel lanes.
    fn square(&mut self, window: &mut Window) {
        let (width, columns) = (window.width, window.columns());
        self.sums.resize(window.lanes(), 0.0);
        wide::run(width, Square { rows: window.rows_mut(), columns, squares: &mut self.sums });
    }

    /// Counts the rows of measurements.
    fn count(&mut self, window: &Window) {
        let (outputs, rows_of_each) = (window.outputs(), if window.has_variances() { 2 } else { 1 });
        for (lane, rows) in self.rows.chunks_mut(self.sets).enumerate() {
            let of_each = outputs / self.sets;
            for (set, rows) in rows.iter_mut().enumerate() {
                *rows += rows_of_each
                    * match window.whole {
                        true => (window.samples[lane] * of_each) as u64,
                        false => window.measurements(lane, set, self.sets),
                    };
            }
        }
    }

    /// Multiplies rows by the roots of their weights, and the numbers `beside`, one for each error or none at all.
    fn weigh(&mut self, window: &mut Window, beside: &mut [f64]) {
        let (lanes, last) = (window.lanes(), window.columns() - 1);
        let outputs = window.outputs();
        window.spread();
        for (k, j) in (0..window.len()).flat_map(|k| (0..outputs).map(move |j| (k, j))) {
            for (lane, weighing) in self.weighing.iter_mut().enumerate() {
                if !window.is_measured(k, j, lane) {
                    continue;
                }
                let [first, second] = weighing.rows(window, k, j, lane);
                let weigh = |row: &mut [f64], (root, error): (f64, f64)| {
                    row[lane..last * lanes].iter_mut().step_by(lanes).for_each(|slope| *slope *= root);
                    row[last * lanes + lane] = error;
                };
                weigh(window.row_mut(k, j), first);
                beside.iter_mut().skip((k * outputs + j) * lanes + lane).take(1).for_each(|one| *one *= first.0);
                if window.has_variances() {
                    weigh(window.variance_row_mut(k, j), second);
                }
                self.rows[lane * self.sets + j % self.sets] += if window.has_variances() { 2 } else { 1 };
            }
        }
    }

    /// Cost and triangles of a job.
    pub fn part(&mut self, lane: usize) -> (f64, Vec<Information>) {
        let sum = match self.sums.get(lane) {
            Some(sum) => *sum,
            None if self.plain => self.alone.iter().map(|alone| alone.squares).sum(),
            None => 0.0,
        };
        let cost = self.weighing[lane].cost + 0.5 * sum;
        let triangle = |set: usize| {
            let triangle = match (self.alone.get_mut(set), self.triangles.get(set)) {
                (Some(alone), _) => alone.triangle(),
                (None, Some(triangles)) => triangles.triangle(lane),
                (None, None) => Information::new(self.columns),
            };
            triangle.of_rows(self.rows[lane * self.sets + set])
        };
        (cost, (0..self.sets).map(triangle).collect())
    }
}

/// Absorbs the rows of a job that runs in a single lane.
struct Alone {
    information: Information,
    block: Block,
    /// The sum of the squares of the errors.
    squares: f64,
}

impl Alone {
    fn new(columns: usize) -> Self {
        Alone { information: Information::new(columns), block: Block::new(columns, ROWS), squares: 0.0 }
    }

    /// Absorbs the row of number `set` of every `sets` rows.
    fn absorb(&mut self, mut rows: &[f64], set: usize, sets: usize) {
        let (width, capacity) = (self.block.columns() + 1, self.block.capacity());
        let stride = width * sets;
        while !rows.is_empty() {
            let len = self.block.len();
            let count = (capacity - len).min(rows.len() / stride);
            let (now, later) = rows.split_at(count * stride);
            for column in 0..width {
                let to = &mut self.block.column_mut(column)[len..len + count];
                let from = now.iter().skip(set * width + column).step_by(stride);
                to.iter_mut().zip(from).for_each(|(to, from)| *to = *from);
            }
            self.squares += sum_of_squares(&self.block.column_mut(width - 1)[len..len + count]);
            self.block.set_len(len + count);
            if self.block.is_full() {
                self.information.absorb(&mut self.block);
            }
            rows = later;
        }
    }

    fn triangle(&mut self) -> Information {
        self.information.absorb(&mut self.block);
        self.information.clone()
    }
}

/// In eight sums, so that no addition waits for the one before.
fn sum_of_squares(values: &[f64]) -> f64 {
    let mut sums = [0.0; 8];
    let eights = values.chunks_exact(8);
    let rest = eights.remainder();
    for eight in eights {
        sums.iter_mut().zip(eight).for_each(|(sum, value)| *sum += value * value);
    }
    sums.iter_mut().zip(rest).for_each(|(sum, value)| *sum += value * value);
    sums.iter().sum()
}

/// Adds the squares of the errors, the last column of each row, to each lane's sum.
struct Square<'s> {
    rows: &'s [f64],
    columns: usize,
    squares: &'s mut [f64],
}

impl Task for Square<'_> {
    type Output = ();

    #[inline(always)]
    fn run<W: Wide>(self) {
        let Square { rows, columns, squares } = self;
        let lanes = squares.len();
        let errors = rows.chunks_exact(columns * lanes).map(|row| &row[(columns - 1) * lanes..]);
        for first in (0..lanes - lanes % W::LANES).step_by(W::LANES) {
            let mut sum = W::load(&squares[first..]);
            for errors in errors.clone() {
                let error = W::load(&errors[first..]);
                sum = sum.add(error.mul(error));
            }
            sum.store(&mut squares[first..]);
        }
        for lane in lanes - lanes % W::LANES..lanes {
            errors.clone().for_each(|errors| squares[lane] += errors[lane] * errors[lane]);
        }
    }
}
