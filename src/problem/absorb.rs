//! [`Absorber`]: from windows of standardized errors to costs and triangles.

use super::Weighing;
use super::job::Job;
use super::likelihood::Likelihood;
use crate::information::{Block, Information, Triangles};
use crate::sweep::Window;
use crate::wide::{self, Task, Wide, Width};

/// Rows that are absorbed together.
const ROWS: usize = 256;

/// Absorbs the rows of jobs that run in parallel lanes.
pub(super) struct Absorber<'o> {
    weighing: Vec<Weighing<'o>>,
    /// Whether there is neither a loss nor a weight: the cost is half the sum of squares, plus that of the logarithms of variances where these are
    /// predicted.
    plain: bool,
    rows: Vec<u64>,
    /// Twice that cost, for each lane.
    sums: Vec<f64>,
    columns: usize,
    triangles: Option<Triangles>,
    alone: Option<Alone>,
}

impl<'o> Absorber<'o> {
    pub fn new(jobs: &[&Job<'o>]) -> Self {
        let objective = jobs[0].objective;
        Absorber {
            weighing: jobs.iter().map(|job| Weighing::new(job.objective, job.experiment)).collect(),
            plain: objective.loss().is_none() && !objective.is_weighted(),
            rows: vec![0; jobs.len()],
            sums: vec![],
            columns: jobs[0].seeds.len(),
            triangles: None,
            alone: None,
        }
    }

    /// Absorbs a window; its contents are overwritten.
    pub fn absorb(&mut self, window: &mut Window) {
        let count = window.len() * window.outputs();
        if self.plain {
            self.count(window);
            if window.has_variances() {
                self.sums.resize(window.lanes(), 0.0);
                let (width, columns, sums) = (window.width, window.columns(), &mut self.sums[..]);
                let (rows, variances) = window.rows_and_variances_mut();
                wide::run(width, Likelihood { rows, variances, columns, sums });
            } else if window.lanes() > 1 {
                self.square(window);
            }
        } else {
            self.weigh(window, &mut []);
        }
        if window.has_variances() {
            self.absorb_rows(window.lanes(), window.width, window.variance_rows_mut(), count);
        }
        self.absorb_rows(window.lanes(), window.width, window.rows_mut(), count);
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
        match lanes {
            1 => self.alone.get_or_insert_with(|| Alone::new(self.columns)).absorb(rows),
            _ => self.triangles.get_or_insert_with(|| Triangles::with(width, self.columns, lanes)).absorb(rows, count),
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
        for (lane, rows) in self.rows.iter_mut().enumerate() {
            *rows += rows_of_each
                * match window.whole {
                    true => (window.samples[lane] * outputs) as u64,
                    false => window.measurements(lane),
                };
        }
    }

    /// Multiplies rows by the roots of their weights, and the numbers `beside`, one for each error or none at all.
    fn weigh(&mut self, window: &mut Window, beside: &mut [f64]) {
        let (lanes, last) = (window.lanes(), window.columns() - 1);
        let outputs = window.outputs();
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
                    self.rows[lane] += 1;
                }
                self.rows[lane] += 1;
            }
        }
    }

    /// Cost and triangle of a job.
    pub fn part(&mut self, lane: usize) -> (f64, Information) {
        let sum = match (&self.alone, self.sums.get(lane)) {
            (_, Some(sum)) => *sum,
            (Some(alone), None) if self.plain => alone.squares,
            _ => 0.0,
        };
        let cost = self.weighing[lane].cost + 0.5 * sum;
        let triangle = match (&mut self.alone, &self.triangles) {
            (Some(alone), _) => alone.triangle(),
            (None, Some(triangles)) => triangles.triangle(lane),
            (None, None) => Information::new(self.columns),
        };
        (cost, triangle.of_rows(self.rows[lane]))
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

    fn absorb(&mut self, mut rows: &[f64]) {
        let (width, capacity) = (self.block.columns() + 1, self.block.capacity());
        while !rows.is_empty() {
            let len = self.block.len();
            let count = (capacity - len).min(rows.len() / width);
            let (now, later) = rows.split_at(count * width);
            for column in 0..width {
                let to = &mut self.block.column_mut(column)[len..len + count];
                to.iter_mut().zip(now.iter().skip(column).step_by(width)).for_each(|(to, from)| *to = *from);
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
