//! [`Absorber`]: from windows of standardized errors to costs and triangles.

use super::pass::Job;
use super::{Objective, Weighing};
use crate::information::{Block, Information, Triangles};
use crate::sweep::Window;
use crate::wide::{self, Task, Wide, Width};

/// Rows that are absorbed together.
const ROWS: usize = 256;

/// What absorbs the rows of jobs that run side by side.
pub(super) struct Absorber<'o> {
    weighing: Vec<Weighing<'o>>,
    /// Whether every error counts by its square.
    plain: bool,
    rows: Vec<u64>,
    /// Sums of squares, where every error counts by its own, lane by lane.
    squares: Vec<f64>,
    triangles: Triangles,
    alone: Option<(Information, Block)>,
    /// Room for one row.
    row: Vec<f64>,
}

impl<'o> Absorber<'o> {
    pub fn new(objective: &'o Objective<'o>, jobs: &[&Job<'_>]) -> Self {
        let columns = jobs[0].seeds.len();
        Absorber {
            weighing: jobs.iter().map(|job| Weighing::new(objective, job.experiment)).collect(),
            plain: objective.loss().is_none() && !objective.is_weighted() && !objective.sweep.predicts_variance(),
            rows: vec![0; jobs.len()],
            squares: vec![],
            triangles: Triangles::new(columns, 0),
            alone: None,
            row: vec![0.0; columns],
        }
    }

    /// Takes in a window, which is used up.
    pub fn absorb(&mut self, window: &mut Window) {
        let (lanes, columns) = (window.lanes(), window.columns() - 1);
        if lanes == 1 {
            return self.absorb_alone(window);
        }
        if self.triangles.lanes() != lanes {
            self.triangles = Triangles::new(columns, lanes);
        }
        let count = window.len() * window.outputs();
        if self.plain {
            self.square(window);
        } else {
            self.weigh(window);
        }
        if window.has_variances() {
            self.triangles.absorb(window.variance_rows_mut(), count);
        }
        self.triangles.absorb(window.rows_mut(), count);
    }

    /// Sums of squares.
    fn square(&mut self, window: &mut Window) {
        let (lanes, columns, outputs) = (window.lanes(), window.columns(), window.outputs());
        self.squares.resize(lanes, 0.0);
        wide::run(Width::widest(), Square { rows: window.rows_mut(), columns, squares: &mut self.squares });
        for (lane, rows) in self.rows.iter_mut().enumerate() {
            *rows += match window.whole {
                true => (window.samples[lane] * outputs) as u64,
                false => window.measurements(lane),
            };
        }
    }

    /// Multiplies rows by the roots of their weights.
    fn weigh(&mut self, window: &mut Window) {
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
                if window.has_variances() {
                    weigh(window.variance_row_mut(k, j), second);
                    self.rows[lane] += 1;
                }
                self.rows[lane] += 1;
            }
        }
    }

    fn absorb_alone(&mut self, window: &mut Window) {
        let columns = window.columns() - 1;
        let (information, block) =
            self.alone.get_or_insert_with(|| (Information::new(columns), Block::new(columns, ROWS)));
        let row = &mut self.row;
        for k in 0..window.samples[0] {
            for j in 0..window.outputs() {
                if !window.is_measured(k, j, 0) {
                    continue;
                }
                let [(root, error), second] = self.weighing[0].rows(window, k, j, 0);
                row.iter_mut().zip(window.row(k, j)).for_each(|(to, from)| *to = from * root);
                information.gather(block, row, error);
                if window.has_variances() {
                    let (root, error) = second;
                    row.iter_mut().zip(window.variance_row(k, j)).for_each(|(to, from)| *to = from * root);
                    information.gather(block, row, error);
                }
            }
        }
    }

    /// Cost and triangle of a job.
    pub fn part(&mut self, lane: usize) -> (f64, Information) {
        let cost = self.weighing[lane].cost + 0.5 * self.squares.get(lane).unwrap_or(&0.0);
        match self.alone.take() {
            Some((mut information, mut block)) => {
                information.absorb(&mut block);
                (cost, information)
            }
            None => (cost, self.triangles.triangle(lane).of_rows(self.rows[lane])),
        }
    }
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
