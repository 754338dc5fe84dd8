//! Runs pieces in the lanes of a program.

use super::columns::Columns;
use crate::engine::{Group, Program};
use crate::record::Time;
use crate::sweep::{Piece, Reached, RunError, Visit, Window};
use crate::wide::{self, Task, Wide, Width};

/// Samples per window. Windows are counted from the begin of each piece, so that a lane's bits do not depend on the
/// length of another.
pub(super) const WINDOW: usize = 64;

/// Pieces that run in the lanes of a group.
pub(super) struct Run<'r> {
    program: &'r Program,
    group: Group,
    pieces: Vec<Piece<'r>>,
    columns: Columns<'r>,
    /// Sample, column, lane.
    inputs: Vec<f64>,
    /// Sample, output, lane: as measured.
    measured: Vec<f64>,
    /// Where variances are predicted, all rows of each sample.
    rows: Vec<f64>,
    /// First sample of each lane.
    begins: Vec<usize>,
}

impl<'r> Run<'r> {
    pub fn new(program: &'r Program, pieces: Vec<Piece<'r>>) -> Self {
        let mut group = program.group(pieces.len());
        let lanes = group.lanes();
        // Lanes without a piece repeat the first.
        let piece = |lane: usize| pieces.get(lane).unwrap_or(&pieces[0]);
        for lane in 0..lanes {
            group.set_parameters(lane, piece(lane).parameters);
            if let Time::Uniform { step, .. } = piece(lane).record.times() {
                group.set_step(lane, *step);
            }
        }
        group.prepare();
        let columns = Columns::new(program, (0..lanes).map(piece));
        let rows = WINDOW * program.row_length() * lanes;
        let mut run = Run {
            program,
            group,
            pieces,
            inputs: vec![0.0; columns.rows(WINDOW) * program.columns().len() * lanes],
            columns,
            measured: vec![0.0; WINDOW * program.outputs() * lanes],
            rows: if program.variances() > 0 { vec![0.0; rows] } else { vec![] },
            begins: vec![0; lanes],
        };
        run.start();
        run
    }

    /// Sets every lane to the begin of its piece.
    fn start(&mut self) {
        for lane in 0..self.group.lanes() {
            let piece = self.pieces.get(lane).unwrap_or(&self.pieces[0]);
            self.group.resume(lane, &piece.carry, &piece.slopes);
        }
    }

    /// Starts again with other pieces, as many as before, of the same records with the same parameters.
    pub fn restart(&mut self, change: impl FnOnce(&mut [Piece<'r>])) {
        change(&mut self.pieces);
        self.start();
    }

    /// A window for these pieces.
    pub fn empty_window(&self) -> Window {
        let (lanes, seeds) = (self.group.lanes(), self.program.seeds().len());
        let samples = WINDOW.min(self.longest());
        let mut window = Window::new(lanes, self.program.outputs(), seeds, samples, self.program.variances() > 0);
        window.carry = vec![0.0; self.program.carried() * lanes];
        window
    }

    fn longest(&self) -> usize {
        self.pieces.iter().map(|piece| piece.samples.len()).max().unwrap_or(0)
    }

    /// Runs a window of all pieces, `begin` samples after their first one, and writes the final carries of those that
    /// end with it into `reached`.
    pub fn next(&mut self, begin: usize, window: &mut Window, reached: &mut [Reached]) {
        let samples = WINDOW.min(self.longest() - begin);
        self.read(begin, samples);
        for (lane, Piece { samples: all, .. }) in self.pieces.iter().enumerate() {
            window.begin[lane] = all.start + begin;
            window.samples[lane] = all.len().saturating_sub(begin).min(WINDOW);
        }
        self.group.carries(&mut window.carry);
        self.end_within(window, samples, reached);
        self.fill(window, samples);
        for (lane, reached) in reached.iter_mut().enumerate() {
            if begin + samples == self.pieces[lane].samples.len() {
                *reached = self.reached(&self.group, lane);
            }
        }
    }

    /// Reads the inputs of a window that begins `begin` samples after the first of each piece.
    fn read(&mut self, begin: usize, samples: usize) {
        for (lane, to) in self.begins.iter_mut().enumerate() {
            *to = self.pieces.get(lane).unwrap_or(&self.pieces[0]).samples.start + begin;
        }
        self.columns.read(self.program, &self.begins, samples, &mut self.inputs);
    }

    /// Runs all pieces to their ends.
    pub fn all(mut self, visit: Visit<'_>) -> Vec<Result<Reached, RunError>> {
        let mut window = self.empty_window();
        let mut reached = vec![Reached::default(); self.pieces.len()];
        for begin in (0..self.longest()).step_by(WINDOW) {
            self.next(begin, &mut window, &mut reached);
            if !visit(&mut window) {
                return vec![Err(RunError::Stopped); self.pieces.len()];
            }
        }
        reached.into_iter().map(Ok).collect()
    }

    /// Runs the first piece and returns its carry at the samples `at`, in ascending order.
    pub fn follow(mut self, at: &[usize]) -> Result<Vec<Vec<f64>>, RunError> {
        let mut sample = self.pieces[0].samples.start;
        let mut found = Vec::with_capacity(at.len());
        for &next in at {
            while sample < next {
                let samples = WINDOW.min(next - sample);
                self.read(sample - self.pieces[0].samples.start, samples);
                self.group.run(&self.inputs, &mut [], samples);
                sample += samples;
            }
            let mut carry = vec![0.0; self.program.carried()];
            self.group.carry(0, &mut carry);
            if carry.iter().any(|x| !x.is_finite()) {
                return Err(RunError::Failed { sample: next });
            }
            found.push(carry);
        }
        Ok(found)
    }

    fn reached(&self, group: &Group, lane: usize) -> Reached {
        let (carried, seeds) = (self.program.carried(), self.program.seeds().len());
        let mut reached = Reached { carry: vec![0.0; carried], slopes: vec![0.0; carried * seeds] };
        group.carry(lane, &mut reached.carry);
        group.carry_slopes(lane, &mut reached.slopes);
        reached
    }

    /// The final carries of pieces that end within the next window, but before the end of their records.
    fn end_within(&self, window: &Window, samples: usize, reached: &mut [Reached]) {
        for (lane, (piece, reached)) in self.pieces.iter().zip(reached).enumerate() {
            let here = window.samples[lane];
            if here > 0 && here < samples && piece.samples.end < piece.record.len() {
                let mut group = self.group.clone();
                let mut rows = vec![0.0; here * self.program.row_length() * group.lanes()];
                group.run(&self.inputs, &mut rows, here);
                *reached = self.reached(&group, lane);
            }
        }
    }

    /// Runs a window and turns predicted outputs into prediction errors.
    fn fill(&mut self, window: &mut Window, samples: usize) {
        let (lanes, outputs, columns) = (self.group.lanes(), window.outputs(), window.columns());
        let width = columns * lanes;
        if window.has_variances() {
            self.group.run(&self.inputs, &mut self.rows, samples);
            for (k, rows) in self.rows.chunks_exact(2 * outputs * width).take(samples).enumerate() {
                for (j, row) in rows.chunks_exact(width).enumerate() {
                    match j.checked_sub(outputs) {
                        None => window.row_mut(k, j).copy_from_slice(row),
                        Some(j) => window.variance_row_mut(k, j).copy_from_slice(row),
                    }
                }
            }
        } else {
            self.group.run(&self.inputs, window.all_rows_mut(), samples);
        }
        self.columns.read_measured(&self.begins, samples, &mut self.measured);
        let rows = window.all_rows_mut();
        let errors = Errors { rows, measured: &self.measured, samples: samples * outputs, columns, lanes };
        let finite = wide::run(Width::widest(), errors);
        let all_lanes = u32::MAX >> (32 - lanes);
        let pieces = u32::MAX >> (32 - self.pieces.len());
        window.whole = finite && self.pieces.iter().enumerate().all(|(lane, _)| window.samples[lane] == samples);
        if window.whole {
            (0..samples * outputs).for_each(|row| window.set_measured(row / outputs, row % outputs, pieces));
            return;
        }
        for k in 0..samples {
            let active = (0..self.pieces.len()).filter(|&lane| k < window.samples[lane]);
            let active = active.fold(0u32, |bits, lane| bits | 1 << lane);
            for j in 0..outputs {
                let measured = self.measured[(k * outputs + j) * lanes..][..lanes].iter().enumerate();
                let there = measured.fold(0u32, |bits, (lane, y)| bits | u32::from(!y.is_nan()) << lane);
                window.set_measured(k, j, there & active);
                if there & active != all_lanes {
                    window.clear_unmeasured_row(k, j);
                }
            }
        }
    }
}

/// Turns means into errors in the last column of each row; returns whether all are finite.
struct Errors<'e> {
    rows: &'e mut [f64],
    measured: &'e [f64],
    samples: usize,
    columns: usize,
    lanes: usize,
}

impl Task for Errors<'_> {
    type Output = bool;

    #[inline(always)]
    fn run<W: Wide>(self) -> bool {
        let Errors { rows, measured, samples, columns, lanes } = self;
        let width = columns * lanes;
        // A difference of what is not finite is not a number.
        let mut differences = W::splat(0.0);
        let mut finite = true;
        for (row, measured) in rows.chunks_exact_mut(width).zip(measured.chunks_exact(lanes)).take(samples) {
            let means = &mut row[width - lanes..];
            if lanes % W::LANES == 0 {
                for (mean, y) in means.chunks_exact_mut(W::LANES).zip(measured.chunks_exact(W::LANES)) {
                    let error = W::load(y).sub(W::load(mean));
                    differences = differences.add(error.sub(error));
                    error.store(mean);
                }
            } else {
                for (mean, y) in means.iter_mut().zip(measured) {
                    *mean = y - *mean;
                    finite &= mean.is_finite();
                }
            }
        }
        finite && differences.all_below(1.0)
    }
}
