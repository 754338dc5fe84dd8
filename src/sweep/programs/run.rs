//! Runs pieces in the lanes of a program.

use super::columns::Columns;
use super::crossed::Crossing;
use super::interleaved::Kept;
use super::settling::{BLOCK, Lanes};
use super::workspace::{Compiled, WINDOW, Workspace};
use crate::record::Time;
use crate::sweep::{Piece, Reached, RunError, Visit, Window};
use crate::wide::{self, Task, Wide};
use std::sync::Arc;

/// Pieces that run in the lanes of a group.
pub(super) struct Run<'r> {
    compiled: &'r Compiled,
    pieces: Vec<Piece<'r>>,
    /// Where windows are read from that are not kept.
    columns: Option<Columns<'r>>,
    /// The kept columns, from the first sample of each piece on.
    kept: Option<Arc<Kept>>,
    /// Where linear equations are crossed exactly.
    crossing: Option<Crossing<'r>>,
    /// Where covariances may settle.
    settling: Option<Lanes<'r>>,
    space: Workspace,
}

impl<'r> Run<'r> {
    pub fn new(compiled: &'r Compiled, pieces: Vec<Piece<'r>>) -> Self {
        let mut space = compiled.workspace(pieces.len());
        let (group, lanes) = (&mut space.group, space.begins.len());
        // Lanes without a piece repeat the first.
        let all: Vec<&Piece<'r>> = (0..lanes).map(|lane| pieces.get(lane).unwrap_or(&pieces[0])).collect();
        let crossing = compiled.crossed.as_ref().map(|crossed| Crossing::new(crossed, &all));
        for (lane, piece) in all.iter().enumerate().filter(|_| crossing.is_none()) {
            match &compiled.late {
                Some(late) => group.set_parameters(lane, &late.parameters(piece)),
                None => group.set_parameters(lane, piece.parameters),
            }
            if let Time::Uniform { step, .. } = piece.record.times() {
                group.set_step(lane, *step);
            }
        }
        group.prepare();
        let settling = compiled.settling.as_ref();
        let settling = settling.map(|settling| Lanes::new(settling, &compiled.program, pieces.len()));
        let mut run = Run { compiled, pieces, columns: None, kept: None, crossing, settling, space };
        run.start();
        run
    }

    /// Sets every lane to the begin of its piece.
    fn start(&mut self) {
        for lane in 0..self.space.group.lanes() {
            let piece = self.pieces.get(lane).unwrap_or(&self.pieces[0]);
            self.space.group.resume(lane, &piece.carry, &piece.slopes);
        }
        self.settling.iter_mut().for_each(Lanes::restart);
    }

    /// Starts again with other pieces, as many as before, of the same records with the same parameters.
    pub fn restart(&mut self, change: impl FnOnce(&mut [Piece<'r>])) {
        change(&mut self.pieces);
        self.start();
    }

    /// The window that was run last.
    pub fn window(&self) -> &Window {
        &self.space.window
    }

    fn longest(&self) -> usize {
        self.pieces.iter().map(|piece| piece.samples.len()).max().unwrap_or(0)
    }

    /// Runs a window of all pieces, `begin` samples after their first one, and writes the final carries of those that
    /// end with it into `reached`.
    pub fn next(&mut self, begin: usize, reached: &mut [Reached]) {
        let samples = WINDOW.min(self.longest() - begin);
        if self.kept.is_none() {
            self.read(begin, samples);
        }
        let Workspace { group, window, .. } = &mut self.space;
        for (lane, Piece { samples: all, .. }) in self.pieces.iter().enumerate() {
            window.begin[lane] = all.start + begin;
            window.samples[lane] = all.len().saturating_sub(begin).min(WINDOW);
        }
        group.carries(&mut window.carry);
        if let Some(settling) = &self.settling {
            settling.carries(&mut window.carry, group.lanes());
        }
        window.repeat(false);
        window.settled = if self.settling.is_some() { u32::MAX >> (32 - self.pieces.len()) } else { 0 };
        self.fill(begin, samples, reached);
    }

    /// Predicts the samples `begin..end` of the window that begins `first` samples after the first of each piece.
    fn predict(&mut self, first: usize, begin: usize, end: usize) {
        let samples = end - begin;
        let Workspace { group, inputs, rows, window, .. } = &mut self.space;
        let program = &self.compiled.program;
        if let Some(crossing) = &mut self.crossing {
            crossing.enter(group, &self.pieces, first + begin);
        }
        let [settled, active] = match (&mut self.settling, &self.crossing) {
            (Some(settling), Some(crossing)) => settling.enter(group, crossing, &self.pieces, first + begin),
            _ => [0, u32::MAX],
        };
        window.settled &= settled | !active;
        let whole = settled == active && self.pieces.len() == active.count_ones() as usize;
        let whole = whole && window.samples[..self.pieces.len()].iter().all(|here| *here == samples);
        let (inputs, read): (&[f64], usize) =
            self.kept.as_ref().map_or((inputs, begin), |kept| (&kept.inputs, first + begin));
        if let Some(settling) = self.settling.as_mut().filter(|_| whole) {
            let inputs = &inputs[read * program.columns().len() * group.lanes()..];
            return settling.run_all(inputs, window, samples);
        }
        let rows = if window.has_variances() { rows } else { window.all_rows_mut() };
        let (inputs_at, rows_at) = (program.columns().len() * group.lanes(), program.row_length() * group.lanes());
        let (inputs, rows) = (&inputs[read * inputs_at..], &mut rows[begin * rows_at..]);
        if settled != active {
            match begin {
                0 => group.run(inputs, rows, samples),
                _ => group.go_on(inputs, rows, samples),
            }
        }
        if let Some(settling) = self.settling.as_mut().filter(|_| settled != 0) {
            settling.run(inputs, rows, [begin, end], settled);
        }
    }

    /// Reads the inputs of a window that begins `begin` samples after the first of each piece.
    fn read(&mut self, begin: usize, samples: usize) {
        let Workspace { begins, inputs, .. } = &mut self.space;
        for (lane, to) in begins.iter_mut().enumerate() {
            *to = self.pieces.get(lane).unwrap_or(&self.pieces[0]).samples.start + begin;
        }
        let columns = self.columns.get_or_insert_with(|| {
            Columns::new(&self.compiled.program, self.compiled.late.as_ref(), &self.pieces, begins.len())
        });
        columns.read(&self.compiled.program, begins, samples, inputs);
    }

    /// Runs all pieces to their ends.
    pub fn all(mut self, visit: Visit<'_>) -> Vec<Result<Reached, RunError>> {
        let lanes = (0..self.space.group.lanes()).map(|lane| self.pieces.get(lane).unwrap_or(&self.pieces[0]));
        let lanes: Vec<&Piece<'_>> = lanes.collect();
        self.kept = lanes[0].prepared.interleaved.of(self.compiled, &lanes, || {
            Columns::new(&self.compiled.program, self.compiled.late.as_ref(), &self.pieces, lanes.len())
        });
        let mut reached = vec![Reached::default(); self.pieces.len()];
        for begin in (0..self.longest()).step_by(WINDOW) {
            self.next(begin, &mut reached);
            if !visit(&mut self.space.window) {
                return vec![Err(RunError::Stopped); self.pieces.len()];
            }
        }
        self.compiled.keep(self.space);
        reached.into_iter().map(Ok).collect()
    }

    /// Runs the first piece and returns its carry at the samples `at`, in ascending order.
    pub fn follow(mut self, at: &[usize]) -> Result<Vec<Vec<f64>>, RunError> {
        let mut sample = self.pieces[0].samples.start;
        let mut found = Vec::with_capacity(at.len());
        for &next in at {
            while sample < next {
                let (begin, samples) = (sample - self.pieces[0].samples.start, WINDOW.min(next - sample));
                self.read(begin, samples);
                let mut done = 0;
                for end in self.cuts(begin, samples).into_iter().chain([samples]) {
                    self.predict(begin, done, end);
                    done = end;
                }
                sample += samples;
            }
            let carry = self.reached(0).carry;
            if carry.iter().any(|x| !x.is_finite()) {
                return Err(RunError::Failed { sample: next });
            }
            found.push(carry);
        }
        self.compiled.keep(self.space);
        Ok(found)
    }

    fn reached(&self, lane: usize) -> Reached {
        if let Some(reached) = self.settling.as_ref().and_then(|settling| settling.settled(lane)) {
            return reached;
        }
        let program = &self.compiled.program;
        let (carried, seeds) = (program.carried(), program.seeds().len());
        let mut reached = Reached { carry: vec![0.0; carried], slopes: vec![0.0; carried * seeds] };
        self.space.group.carry(lane, &mut reached.carry);
        self.space.group.carry_slopes(lane, &mut reached.slopes);
        reached
    }

    /// Where a window is cut, `begin` samples after the first of each piece, in ascending order: where a piece ends that is continued by another,
    /// where the length of an interval changes that is crossed exactly, and where covariances may have settled.
    fn cuts(&self, begin: usize, samples: usize) -> Vec<usize> {
        let continued = |(piece, here): &(&Piece<'_>, &usize)| {
            (1..samples).contains(*here) && piece.samples.end < piece.record.len()
        };
        let ends = self.pieces.iter().zip(&self.space.window.samples).filter(continued).map(|(_, here)| *here);
        let changes = |crossing: &Crossing<'_>| crossing.changes(&self.pieces, begin..begin + samples);
        let changes = self.crossing.as_ref().map_or(vec![], changes);
        // To the end of the last block, which may go on after this window.
        let ahead = (begin + samples).next_multiple_of(BLOCK) - begin;
        let moves = |settling: &Lanes<'_>| !settling.stays(&self.pieces, begin, ahead);
        let blocks = if self.settling.as_ref().is_some_and(moves) { samples } else { 0 };
        let blocks = (1..blocks).filter(|k| (begin + k).is_multiple_of(BLOCK));
        let mut cuts: Vec<usize> = ends.chain(changes).chain(blocks).collect();
        cuts.sort_unstable();
        cuts.dedup();
        cuts
    }

    /// Runs a window, `begin` samples after the first of each piece, and turns predicted outputs into prediction errors.
    fn fill(&mut self, begin: usize, samples: usize, reached: &mut [Reached]) {
        let mut done = 0;
        for end in self.cuts(begin, samples).into_iter().chain([samples]) {
            self.predict(begin, done, end);
            for (lane, reached) in reached.iter_mut().enumerate() {
                if begin + end == self.pieces[lane].samples.len() {
                    *reached = self.reached(lane);
                }
            }
            done = end;
        }
        let Workspace { group, measured, rows, begins, window, .. } = &mut self.space;
        let (lanes, outputs, columns) = (group.lanes(), window.outputs(), window.columns());
        let width = columns * lanes;
        if window.has_variances() && !window.is_repeated() {
            for (k, rows) in rows.chunks_exact(2 * outputs * width).take(samples).enumerate() {
                for (j, row) in rows.chunks_exact(width).enumerate() {
                    match j.checked_sub(outputs) {
                        None => window.row_mut(k, j).copy_from_slice(row),
                        Some(j) => window.variance_row_mut(k, j).copy_from_slice(row),
                    }
                }
            }
        }
        let measured: &[f64] = match &self.kept {
            Some(kept) => &kept.measured[begin * outputs * lanes..],
            None => {
                self.columns.iter().for_each(|columns| columns.read_measured(begins, samples, measured));
                measured
            }
        };
        let (register, rows) = (window.width, window.all_rows_mut());
        let errors = Errors { rows, measured, samples: samples * outputs, columns, lanes };
        let finite = wide::run(register, errors);
        let all_lanes = u32::MAX >> (32 - lanes);
        let pieces = u32::MAX >> (32 - self.pieces.len());
        window.whole = finite && self.pieces.iter().enumerate().all(|(lane, _)| window.samples[lane] == samples);
        if window.whole {
            window.set_all_measured(samples, pieces);
            return;
        }
        // A value that all pieces have and that is finite was measured.
        let shortest = window.samples[..self.pieces.len()].iter().copied().min().unwrap_or(0);
        let plain = if finite { shortest } else { 0 };
        window.set_all_measured(plain, pieces);
        for k in plain..samples {
            let active = (0..self.pieces.len()).filter(|&lane| k < window.samples[lane]);
            let active = active.fold(0u32, |bits, lane| bits | 1 << lane);
            for j in 0..outputs {
                let measured = measured[(k * outputs + j) * lanes..][..lanes].iter().enumerate();
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
