//! [`Settling`]: filters of linear equations whose covariances have settled, in the lanes of a run.
//!
//! The covariance of such a filter does not depend on what is measured. Where every output is measured at samples that are evenly spaced, it becomes
//! constant, and its value follows from the parameters. From there on the state alone is carried, with constant gains.

use super::crossed::{Crossing, Numbers};
use crate::engine::{Column, Group, Program, Sampling, Trajectories};
use crate::graph::{Following, Seed};
use crate::moments::entry;
use crate::recurrence::Recurrence;
use crate::sweep::{Piece, Reached, Window};
use crate::wide::{self, Task, Wide};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// Samples after which covariances are compared with constant ones: a part of a window.
pub(super) const BLOCK: usize = 32;
/// In shorter records the samples of constant covariance save less than it takes to find that.
const WORTH: usize = 1_000;
/// A covariance has settled where no entry is off by more than this part of the standard deviations. Later ones are nearer, so that the likelihood is off by
/// this part of a few of its terms.
const NEAR: f64 = 1e-10;
/// And its slopes where none is off by more than this part of the largest one with respect to the same quantity.
const NEAR_SLOPES: f64 = 1e-8;

/// The program of settled filters, compiled when the first one is.
pub(super) struct Settling {
    recurrence: Recurrence,
    covariance: Vec<Following>,
    seeds: Vec<Seed>,
    sampling: Sampling,
    trajectories: Trajectories,
    program: OnceLock<Option<Program>>,
    /// Groups of runs that have ended.
    idle: Mutex<Vec<Group>>,
}

/// The length of the intervals (s) from so many samples of a piece on, `after` its first one; `None` where it changes, where a measurement is missing, and
/// in short records.
fn even(piece: &Piece<'_>, after: usize, samples: usize) -> Option<f64> {
    let Piece { record, prepared, samples: all, .. } = piece;
    let here = all.start + after..all.end.min(all.start + after + samples);
    if record.len() < WORTH || prepared.misses(record, here.clone()) {
        return None;
    }
    let lengths = prepared.lengths(record);
    let length = lengths.after(here.start);
    let one = length > 0.0 && (lengths.count() == 1 || here.clone().all(|sample| lengths.after(sample) == length));
    one.then_some(length)
}

impl Settling {
    /// With the recurrence of settled filters, and the numbers of the entries of their covariance. `None` if one of these is a seed: they are not carried.
    pub fn new(
        recurrence: Recurrence,
        covariance: Vec<Following>,
        seeds: &[Seed],
        sampling: Sampling,
        trajectories: Trajectories,
    ) -> Option<Settling> {
        let states = recurrence.next().len();
        let known = |seed: &Seed| matches!(seed, Seed::Parameter(_)) || matches!(seed, Seed::Carry(i) if *i < states);
        let seeds = seeds.iter().all(known).then(|| seeds.to_vec())?;
        let (program, idle) = (OnceLock::new(), Mutex::default());
        Some(Settling { recurrence, covariance, seeds, sampling, trajectories, program, idle })
    }

    /// The program, for use beside that of filters which have not settled; none where the two read other columns or have other lanes.
    fn program(&self, unsettled: &Program) -> Option<&Program> {
        let make = || {
            let program = Program::compile(&self.recurrence, &self.seeds, self.sampling, self.trajectories).ok()?;
            let alike = program.columns() == unsettled.columns()
                && program.reads_next() == unsettled.reads_next()
                && program.width() == unsettled.width()
                && program.outputs() == unsettled.outputs()
                && program.lanes_for(usize::MAX) == unsettled.lanes_for(usize::MAX)
                && !program.columns().iter().any(|column| matches!(column, Column::Derived(_)));
            alike.then_some(program)
        };
        self.program.get_or_init(make).as_ref()
    }

    /// Memory for so many pieces.
    fn group(&self, program: &Program, pieces: usize) -> Group {
        let lanes = program.lanes_for(pieces);
        let mut idle = self.idle.lock().unwrap_or_else(PoisonError::into_inner);
        let known = idle.iter().position(|group| group.lanes() == lanes).map(|at| idle.swap_remove(at));
        drop(idle);
        known.unwrap_or_else(|| program.group(pieces))
    }

    /// The covariance of numbers, with its slopes, where that in `carry` differs by no more than this part.
    pub fn covariance(&self, numbers: Numbers, carry: &[f64], part: f64) -> Option<Reached> {
        let limit = self.limit(numbers);
        let near = limit.is_near(self.states(), &carry[self.states()..], part);
        near.then_some(Reached { carry: limit.covariance, slopes: limit.slopes })
    }

    fn states(&self) -> usize {
        self.recurrence.next().len()
    }

    /// The covariance of numbers, and its slopes with respect to the seeds.
    fn limit(&self, numbers: Numbers) -> Limit {
        let moves = self.covariance.first().map_or(&[][..], |first| &first.moves);
        let slope = |first: usize, seed: &Seed| match *seed {
            Seed::Parameter(j) => {
                let at = moves.iter().position(|moves| *moves as usize == j);
                at.map_or(0.0, |at| numbers[first + 1 + at])
            }
            Seed::Carry(_) => 0.0,
        };
        let firsts = || self.covariance.iter().map(|following| following.number as usize);
        let covariance = firsts().map(|first| numbers[first]).collect();
        let slopes = firsts().flat_map(|first| self.seeds.iter().map(move |seed| slope(first, seed))).collect();
        // The variances of the outputs stand after the covariance.
        let end = self.covariance.last().map_or(numbers.len(), Following::end);
        let row = |first: usize| self.seeds.iter().map(move |seed| slope(first, seed)).chain([numbers[first]]);
        let variances = (end..numbers.len()).step_by(1 + moves.len()).flat_map(row).collect();
        Limit { covariance, slopes, variances, numbers: numbers.clone() }
    }
}

/// The constant covariance of a lane.
struct Limit {
    covariance: Vec<f64>,
    slopes: Vec<f64>,
    /// The row of the variance of each output: slopes, then the variance.
    variances: Vec<f64>,
    /// Parameters, and what follows from them.
    numbers: Numbers,
}

/// A lane with a piece.
#[derive(Default)]
struct Lane {
    /// The length of the intervals (s) for which `limit` was asked.
    length: Option<f64>,
    limit: Option<Arc<Limit>>,
    /// Whether the covariance is that.
    settled: bool,
}

/// The lanes of a run, settled or not.
pub(super) struct Lanes<'r> {
    settling: &'r Settling,
    program: &'r Program,
    lanes: Vec<Lane>,
    /// Of the settled lanes, from the first one on.
    group: Option<Group>,
    /// Their rows of errors.
    rows: Vec<f64>,
    /// The rows of the variances of a sample: output, column, lane.
    variances: Vec<f64>,
}

impl<'r> Lanes<'r> {
    pub fn new(settling: &'r Settling, program: &'r Program, pieces: usize) -> Self {
        let lanes = (0..pieces).map(|_| Lane::default()).collect();
        Lanes { settling, program, lanes, group: None, rows: vec![], variances: vec![] }
    }

    /// Every lane starts anew.
    pub fn restart(&mut self) {
        self.lanes.iter_mut().for_each(|lane| lane.settled = false);
    }

    /// Whether all lanes are settled that have samples left, and stay so for so many.
    pub fn stays(&self, pieces: &[Piece<'_>], after: usize, samples: usize) -> bool {
        self.lanes.iter().zip(pieces).all(|(lane, piece)| {
            after >= piece.samples.len() || lane.settled && lane.length == even(piece, after, samples)
        })
    }

    /// Before samples that are `after` the first of each piece. Where a block begins, lanes settle whose covariance has become constant, and those that miss a
    /// measurement in it, or have intervals of another length, go on with the covariance that they have. Blocks are counted from the begin of each piece,
    /// so that a lane's bits do not depend on others. Returns by bits which lanes are settled, and which have samples at all.
    pub fn enter(
        &mut self,
        group: &mut Group,
        crossing: &Crossing<'_>,
        pieces: &[Piece<'_>],
        after: usize,
    ) -> [u32; 2] {
        let (mut settled, mut active, mut changed) = (0, 0, false);
        for (number, piece) in pieces.iter().enumerate().filter(|(_, piece)| after < piece.samples.len()) {
            active |= 1 << number;
            if after.is_multiple_of(BLOCK) {
                let length = even(piece, after, BLOCK);
                if !self.lanes[number].settled {
                    let settles = length.is_some_and(|length| self.settles(group, crossing, piece, number, length));
                    changed |= settles;
                    self.lanes[number].settled = settles;
                } else if self.lanes[number].length != length {
                    let Reached { carry, slopes } = self.reached(number);
                    group.resume(number, &carry, &slopes);
                    self.lanes[number].settled = false;
                }
            }
            settled |= u32::from(self.lanes[number].settled) << number;
        }
        if changed && let Some(own) = &mut self.group {
            own.prepare();
        }
        [settled, active]
    }

    /// Whether the covariance of a lane has become constant; then the group of settled lanes takes it over.
    fn settles(
        &mut self,
        group: &Group,
        crossing: &Crossing<'_>,
        piece: &Piece<'_>,
        number: usize,
        length: f64,
    ) -> bool {
        let (states, seeds) = (self.settling.states(), self.settling.seeds.len());
        if self.lanes[number].length != Some(length) {
            let found = crossing.settled(number, length);
            let limit = found.map(|numbers| {
                let same = |limit: &&Arc<Limit>| Arc::ptr_eq(&limit.numbers, &numbers);
                let known = self.lanes.iter().filter_map(|lane| lane.limit.as_ref()).find(same).cloned();
                known.unwrap_or_else(|| Arc::new(self.settling.limit(numbers)))
            });
            (self.lanes[number].length, self.lanes[number].limit) = (Some(length), limit);
        }
        let Some(limit) = self.lanes[number].limit.clone() else { return false };
        let mut carry = vec![0.0; self.program.carried()];
        group.carry(number, &mut carry);
        if !limit.is_near(states, &carry[states..], NEAR) {
            return false;
        }
        let mut slopes = vec![0.0; carry.len() * seeds];
        group.carry_slopes(number, &mut slopes);
        if !limit.slopes_are_near(states, seeds, &slopes[states * seeds..], &piece.slopes[states * seeds..]) {
            return false;
        }
        let Some(program) = self.settling.program(self.program) else { return false };
        let own = self.group.get_or_insert_with(|| self.settling.group(program, self.lanes.len()));
        // Lanes without a piece repeat the first.
        let repeated = if number == 0 { self.lanes.len()..own.lanes() } else { 0..0 };
        for number in std::iter::once(number).chain(repeated) {
            own.set_parameters(number, &limit.numbers);
            own.set_step(number, length);
            own.resume(number, &carry[..states], &slopes[..states * seeds]);
            self.variances.resize(limit.variances.len() * own.lanes(), 0.0);
            let to = self.variances.iter_mut().skip(number).step_by(own.lanes());
            to.zip(&limit.variances).for_each(|(to, from)| *to = *from);
        }
        true
    }

    /// Runs all lanes, which are settled, over a whole window.
    pub fn run_all(&mut self, inputs: &[f64], window: &mut Window, samples: usize) {
        if let Some(group) = &mut self.group {
            group.run(inputs, window.all_rows_mut(), samples);
            window.repeat(true);
            window.variance_rows_mut().copy_from_slice(&self.variances);
        }
    }

    /// Runs the lanes over a part of a window, and replaces the rows of those that are settled: of each sample the rows of errors, then those of variances.
    pub fn run(&mut self, inputs: &[f64], rows: &mut [f64], [begin, end]: [usize; 2], settled: u32) {
        let samples = end - begin;
        let Some(group) = &mut self.group else { return };
        let (lanes, sample) = (group.lanes(), self.variances.len());
        self.rows.resize((samples * sample).max(self.rows.len()), 0.0);
        match begin {
            0 => group.run(inputs, &mut self.rows, samples),
            _ => group.go_on(inputs, &mut self.rows, samples),
        }
        let settled: Vec<f64> = (0..lanes).map(|lane| f64::from(settled >> lane & 1)).collect();
        for (rows, own) in rows.chunks_exact_mut(2 * sample).zip(self.rows.chunks_exact(sample)).take(samples) {
            let (errors, variances) = rows.split_at_mut(sample);
            for (to, from) in [(errors, own), (variances, &self.variances)] {
                wide::run(self.program.width(), Replace { to, from, settled: &settled });
            }
        }
    }

    /// Writes what the settled lanes carry: entry, lane.
    pub fn carries(&self, to: &mut [f64], lanes: usize) {
        let Some(group) = &self.group else { return };
        let states = self.settling.states();
        let mut carry = vec![0.0; states];
        for (number, lane) in self.lanes.iter().enumerate().filter(|(_, lane)| lane.settled) {
            group.carry(number, &mut carry);
            let covariance = lane.limit.iter().flat_map(|limit| &limit.covariance);
            let entries = to.iter_mut().skip(number).step_by(lanes);
            entries.zip(carry.iter().chain(covariance)).for_each(|(to, from)| *to = *from);
        }
    }

    /// What a lane carries, if it is settled.
    pub fn settled(&self, lane: usize) -> Option<Reached> {
        self.lanes.get(lane).is_some_and(|lane| lane.settled).then(|| self.reached(lane))
    }

    fn reached(&self, lane: usize) -> Reached {
        let (states, seeds) = (self.settling.states(), self.settling.seeds.len());
        let (mut carry, mut slopes) = (vec![0.0; states], vec![0.0; states * seeds]);
        if let Some(group) = &self.group {
            group.carry(lane, &mut carry);
            group.carry_slopes(lane, &mut slopes);
        }
        if let Some(limit) = &self.lanes[lane].limit {
            carry.extend(&limit.covariance);
            slopes.extend(&limit.slopes);
        }
        Reached { carry, slopes }
    }
}

impl Drop for Lanes<'_> {
    fn drop(&mut self) {
        self.settling.idle.lock().unwrap_or_else(PoisonError::into_inner).extend(self.group.take());
    }
}

/// Replaces the numbers of settled lanes, those with a one.
struct Replace<'t> {
    to: &'t mut [f64],
    from: &'t [f64],
    settled: &'t [f64],
}

impl Task for Replace<'_> {
    type Output = ();

    #[inline(always)]
    fn run<W: Wide>(self) {
        let Replace { to, from, settled } = self;
        let (lanes, one) = (settled.len(), W::splat(1.0));
        for (to, from) in to.chunks_exact_mut(lanes).zip(from.chunks_exact(lanes)) {
            if lanes % W::LANES == 0 {
                for first in (0..lanes).step_by(W::LANES) {
                    let (old, new) = (W::load(&to[first..]), W::load(&from[first..]));
                    W::load(&settled[first..]).select_eq(one, new, old).store(&mut to[first..]);
                }
            } else {
                let each = to.iter_mut().zip(from).zip(settled);
                each.filter(|(_, settled)| **settled == 1.0).for_each(|((to, from), _)| *to = *from);
            }
        }
    }
}

impl Limit {
    /// The product of the standard deviations of an entry's states.
    fn size(&self, n: usize, i: usize, j: usize) -> f64 {
        (self.covariance[entry(n, i, i)] * self.covariance[entry(n, j, j)]).sqrt()
    }

    fn is_near(&self, n: usize, covariance: &[f64], part: f64) -> bool {
        let mut pairs = (0..n).flat_map(|i| (i..n).map(move |j| (i, j)));
        pairs.all(|(i, j)| {
            let at = entry(n, i, j);
            (covariance[at] - self.covariance[at]).abs() <= part * self.size(n, i, j)
        })
    }

    /// Whether slopes have settled, too; the largest ones are those at the end, or those at the begin.
    fn slopes_are_near(&self, n: usize, seeds: usize, slopes: &[f64], begin: &[f64]) -> bool {
        let pairs = || (0..n).flat_map(|i| (i..n).map(move |j| (i, j)));
        (0..seeds).all(|seed| {
            let relative = |slopes: &[f64], (i, j): (usize, usize)| {
                let (slope, size) = (slopes[entry(n, i, j) * seeds + seed].abs(), self.size(n, i, j));
                if size > 0.0 { slope / size } else { 0.0 }
            };
            let largest = |slopes: &[f64]| pairs().map(|pair| relative(slopes, pair)).fold(0.0, f64::max);
            let largest = largest(&self.slopes).max(largest(begin));
            let difference = |(i, j)| {
                let at = entry(n, i, j) * seeds + seed;
                let difference = (slopes[at] - self.slopes[at]).abs();
                difference == 0.0 || difference <= NEAR_SLOPES * largest * self.size(n, i, j)
            };
            pairs().all(difference)
        })
    }
}
