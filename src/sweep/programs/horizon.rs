//! Predictions a fixed number of samples ahead: every restart is a trajectory of its own, so restarts run in parallel
//! lanes.

use super::run::Run;
use super::workspace::{Compiled, WINDOW};
use crate::sweep::{Piece, Reached, RunError, Visit, Window};
use std::borrow::Cow;
use std::ops::Range;

/// Runs a piece; its windows have one lane.
pub(super) fn run(compiled: &Compiled, piece: &Piece<'_>, steps: usize, visit: Visit<'_>) -> Result<Reached, RunError> {
    let (outputs, seeds) = (compiled.program.outputs(), compiled.program.seeds().len());
    let mut window = Window::new(1, outputs, seeds, WINDOW, false);
    // Nothing is carried from window to window: all of them begin with the state at the record's first sample.
    window.carry = piece.carry.to_vec();
    let all = piece.samples.clone();
    // The first samples of a record are simulated from its begin.
    let simulated = all.start..steps.clamp(all.start, all.end);
    if !simulated.is_empty() {
        let from_begin = Piece { samples: 0..simulated.end, ..piece.clone() };
        let mut go_on = true;
        Run::new(compiled, vec![from_begin]).all(&mut |many| {
            // Samples before this piece belong to other pieces.
            let before = simulated.start.saturating_sub(many.begin[0]).min(many.samples[0]);
            (window.begin[0], window.samples[0]) = (many.begin[0] + before, many.samples[0] - before);
            let rows = (0..window.samples[0]).flat_map(|k| (0..outputs).map(move |j| (k, j)));
            rows.for_each(|(k, j)| copy(many, (before + k, 0), &mut window, k, j));
            go_on = window.samples[0] == 0 || visit(&mut window);
            go_on
        });
        if !go_on {
            return Err(RunError::Stopped);
        }
    }
    let mut restarts = Restarts::new(compiled, piece, steps);
    for begin in (simulated.end..all.end).step_by(WINDOW) {
        let samples = begin..all.end.min(begin + WINDOW);
        (window.begin[0], window.samples[0]) = (begin, samples.len());
        restarts.fill(samples, &mut window);
        if !visit(&mut window) {
            return Err(RunError::Stopped);
        }
    }
    Ok(Reached::default())
}

/// Trajectories from measured states.
struct Restarts<'r> {
    run: Run<'r>,
    lanes: usize,
    steps: usize,
    states: usize,
    measured: &'r [f64],
}

impl<'r> Restarts<'r> {
    fn new(compiled: &'r Compiled, piece: &Piece<'r>, steps: usize) -> Self {
        let (states, seeds) = (compiled.program.carried(), compiled.program.seeds().len());
        let one = Piece { samples: 0..steps + 1, slopes: vec![0.0; states * seeds].into(), ..piece.clone() };
        let lanes = compiled.program.lanes();
        let run = Run::new(compiled, vec![one; lanes]);
        Restarts { run, lanes, steps, states, measured: &piece.prepared.restarts }
    }

    /// The rows of some samples.
    fn fill(&mut self, samples: Range<usize>, window: &mut Window) {
        let Restarts { run, lanes, steps, states, measured } = self;
        let first = samples.start;
        for group in samples.clone().step_by(*lanes) {
            let there = (*lanes).min(samples.end - group);
            run.restart(|pieces| {
                for (lane, piece) in pieces.iter_mut().enumerate() {
                    let from = group + lane.min(there - 1) - *steps;
                    piece.samples = from..from + *steps + 1;
                    piece.carry = Cow::Borrowed(&measured[from * *states..][..*states]);
                }
            });
            let mut last = 0;
            for begin in (0..*steps + 1).step_by(WINDOW) {
                run.next(begin, &mut []);
                last = *steps - begin;
            }
            for (lane, sample) in (group..group + there).enumerate() {
                let known = measured[(sample - *steps) * *states..][..*states].iter().all(|x| !x.is_nan());
                for j in 0..window.outputs() {
                    copy(run.window(), (last, lane), window, sample - first, j);
                    if !known {
                        window.set_measured(sample - first, j, 0);
                        window.row_mut(sample - first, j).fill(0.0);
                    }
                }
            }
        }
    }
}

/// Copies an output's row of a sample of a lane.
fn copy(many: &Window, (sample, lane): (usize, usize), to: &mut Window, k: usize, j: usize) {
    let row = many.row(sample, j).iter().skip(lane).step_by(many.lanes());
    to.row_mut(k, j).iter_mut().zip(row).for_each(|(to, from)| *to = *from);
    to.set_measured(k, j, u32::from(many.is_measured(sample, j, lane)));
}
