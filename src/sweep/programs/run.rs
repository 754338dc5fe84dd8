//! Pieces side by side through a program.

use crate::engine::{Column, Group, Program};
use crate::record::{Record, Time};
use crate::sweep::{Piece, Reached, RunError, Visit, Window};
use std::ops::Range;

/// Samples per window. Lanes of any length see the same windows, counted from their begin, so that their bits do not
/// depend on each other.
pub(super) const WINDOW: usize = 32;

/// Pieces on their way through their records.
pub(super) struct Run<'r> {
    program: &'r Program,
    group: Group,
    pieces: Vec<Piece<'r>>,
    columns: Vec<Source<'r>>,
    /// Sample, column, lane.
    inputs: Vec<f64>,
    /// Sample, output, lane: as measured.
    measured: Vec<f64>,
    /// Where variances are predicted, all rows of each sample.
    rows: Vec<f64>,
    /// Room for what one lane carries.
    carry: Vec<f64>,
}

/// Where the numbers of a column of a lane come from; lane by lane, column by column.
enum Source<'r> {
    Values(&'r [f64]),
    Time(&'r Record),
    Step(&'r Record),
    /// Number of the derived column.
    Derived(usize),
}

impl<'r> Run<'r> {
    pub fn new(program: &'r Program, pieces: Vec<Piece<'r>>) -> Self {
        let mut group = program.group(pieces.len());
        let lanes = group.lanes();
        for lane in 0..lanes {
            // Lanes without a piece do what the first does.
            let piece = pieces.get(lane).unwrap_or(&pieces[0]);
            group.set_parameters(lane, piece.parameters);
            if let Time::Uniform { step, .. } = piece.record.times() {
                group.set_step(lane, *step);
            }
        }
        group.prepare();
        let source = |piece: &Piece<'r>, column: &Column| match *column {
            Column::Time => Source::Time(piece.record),
            Column::Step => Source::Step(piece.record),
            Column::Input(i) => Source::Values(&piece.record.inputs()[i].values),
            Column::Measured(j) => Source::Values(&piece.record.outputs()[j].values),
            Column::Derived(n) => Source::Derived(n),
        };
        let columns = pieces.iter().flat_map(|piece| program.columns().iter().map(move |column| source(piece, column)));
        let columns = columns.collect();
        let rows = WINDOW * program.row_length() * lanes;
        let mut run = Run {
            program,
            group,
            pieces,
            columns,
            inputs: vec![0.0; (WINDOW + 1) * program.columns().len() * lanes],
            measured: vec![0.0; WINDOW * program.outputs() * lanes],
            rows: if program.variances() > 0 { vec![0.0; rows] } else { vec![] },
            carry: vec![0.0; program.carried()],
        };
        run.start();
        run
    }

    /// Puts every lane to the begin of its piece.
    fn start(&mut self) {
        for lane in 0..self.group.lanes() {
            let piece = self.pieces.get(lane).unwrap_or(&self.pieces[0]);
            self.group.resume(lane, &piece.carry, &piece.slopes);
        }
    }

    /// Begins anew with other pieces of the same records with the same parameters, as many as before.
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

    /// Runs a window of all pieces, which begins so many samples after they do, and says where each has come to by its end.
    pub fn next(&mut self, begin: usize, window: &mut Window, reached: &mut [Reached]) {
        let (lanes, carried) = (self.group.lanes(), self.program.carried());
        let samples = WINDOW.min(self.longest() - begin);
        for lane in 0..self.pieces.len() {
            let Range { start, end } = self.pieces[lane].samples;
            window.begin[lane] = start + begin;
            window.samples[lane] = (end - start).saturating_sub(begin).min(WINDOW);
            self.read(lane, start + begin, samples);
        }
        for lane in 0..lanes {
            self.group.carry(lane, &mut self.carry);
            (0..carried).for_each(|i| window.carry[i * lanes + lane] = self.carry[i]);
        }
        self.end_within(window, samples, reached);
        self.fill(window, samples);
        for (lane, reached) in reached.iter_mut().enumerate() {
            if window.samples[lane] == samples {
                *reached = self.reached(&self.group, lane);
            }
        }
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

    /// Runs the first piece and notes its carry at some samples, which rise.
    pub fn follow(mut self, at: &[usize]) -> Result<Vec<Vec<f64>>, RunError> {
        let mut sample = self.pieces[0].samples.start;
        let mut found = Vec::with_capacity(at.len());
        for &next in at {
            while sample < next {
                let samples = WINDOW.min(next - sample);
                self.read(0, sample, samples);
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

    /// Where the pieces arrive that end within the window that is about to run, with samples of their records to come.
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

    /// Reads the inputs of a lane, from a sample of its record on; beyond the last, that is repeated.
    fn read(&mut self, lane: usize, begin: usize, samples: usize) {
        let (lanes, count) = (self.group.lanes(), self.program.columns().len());
        let piece = &self.pieces[lane];
        let (record, last) = (piece.record, piece.record.len() - 1);
        let rows = samples + usize::from(self.program.reads_next());
        let there = rows.min((last + 1).saturating_sub(begin));
        let derived = match self.columns.iter().any(|source| matches!(source, Source::Derived(_))) {
            true => derived(self.program, record, begin.min(last), there.max(1)),
            false => vec![],
        };
        let copies = if lane == 0 { self.pieces.len()..lanes } else { 0..0 };
        for (c, source) in self.columns[lane * count..][..count].iter().enumerate() {
            let to = &mut self.inputs[c * lanes..];
            let mut put = |k: usize, value: f64| {
                let row = &mut to[k * count * lanes..][..lanes];
                row[lane] = value;
                row[copies.clone()].fill(value);
            };
            match source {
                Source::Values(values) => {
                    values[begin.min(last)..][..there].iter().enumerate().for_each(|(k, value)| put(k, *value));
                    (there..rows).for_each(|k| put(k, values[last]));
                }
                Source::Time(record) => (0..rows).for_each(|k| put(k, record.time((begin + k).min(last)))),
                Source::Step(record) => (0..rows).for_each(|k| put(k, step(record, begin + k))),
                Source::Derived(n) => {
                    (0..rows).for_each(|k| put(k, derived[*n].get(k).or(derived[*n].last()).copied().unwrap_or(0.0)));
                }
            }
        }
        let outputs = self.program.outputs();
        for (j, channel) in record.outputs().iter().enumerate().take(outputs) {
            let to = &mut self.measured[j * lanes + lane..];
            let values = &channel.values[begin.min(last)..];
            to.iter_mut().step_by(outputs * lanes).zip(values).take(samples).for_each(|(to, y)| *to = *y);
        }
    }

    /// Runs a window and makes prediction errors of the outputs.
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
        for k in 0..samples {
            let active = (0..self.pieces.len()).filter(|&lane| k < window.samples[lane]);
            let active = active.fold(0u32, |bits, lane| bits | 1 << lane);
            for j in 0..outputs {
                let measured = &self.measured[(k * outputs + j) * lanes..][..lanes];
                let row = window.row_mut(k, j);
                let mut there = 0u32;
                for (lane, (mean, y)) in row[width - lanes..].iter_mut().zip(measured).enumerate() {
                    *mean = y - *mean;
                    there |= u32::from(!y.is_nan()) << lane;
                }
                window.set_measured(k, j, there & active);
                if there & active != u32::MAX >> (32 - lanes) {
                    window.clear_unmeasured_row(k, j);
                }
            }
        }
    }
}

/// Time to the next sample (s); after the last none passes.
fn step(record: &Record, sample: usize) -> f64 {
    if sample + 1 < record.len() { record.time(sample + 1) - record.time(sample) } else { 0.0 }
}

/// The derived columns of some samples.
fn derived(program: &Program, record: &Record, begin: usize, samples: usize) -> Vec<Vec<f64>> {
    let (columns, next) = program.derived_from();
    let last = record.len() - 1;
    let sample = |k: usize| (begin + k).min(last);
    let number = |column: &Column, k: usize| match *column {
        Column::Time => record.time(sample(k)),
        Column::Step => step(record, begin + k),
        Column::Input(i) => record.inputs()[i].values[sample(k)],
        Column::Measured(j) => record.outputs()[j].values[sample(k)],
        Column::Derived(_) => f64::NAN,
    };
    let rows = samples + usize::from(next);
    let columns: Vec<Vec<f64>> =
        columns.iter().map(|column| (0..rows).map(|k| number(column, k)).collect()).collect();
    program.derive(&columns.iter().map(Vec::as_slice).collect::<Vec<_>>(), samples)
}
