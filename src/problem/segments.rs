//! Records cut into segments that run in parallel lanes, and the carries at their begins.
//!
//! A record is cut by its length alone, so that no bit of a result depends on the machine. The carry at the begin of a
//! segment follows from the segments before. For models that are affine in their carry a guess is enough, because its
//! error is corrected exactly afterwards ([`Chain`](crate::information::Chain)); the guess is extrapolated from a point
//! evaluated before. For others the correction is exact to the first order: corrected borders are simulated from anew
//! until what is left no longer matters, and simulated from the begin of the record where that does not succeed soon.

use super::Values;
use super::by_output::ByOutput;
use crate::record::Record;
use crate::sweep::{Coupling, Reached, Sweep};
use std::ops::Range;
use std::sync::{Arc, Mutex, PoisonError};

/// Least number of samples, number of segments.
const SEGMENTS: [(usize, usize); 6] =
    [(512, 8), (4_096, 16), (16_384, 32), (131_072, 64), (1_048_576, 128), (8_388_608, 256)];
/// The same for static models: nothing is carried from segment to segment, so that short records, too, are evaluated in parallel lanes.
const OF_ROWS: (usize, usize) = (16, 8);
/// From this number of records on, uncut records fill the lanes.
const MANY: usize = 8;
/// Longest carry for which cutting saves time: a segment has a slope for each of its entries.
const CARRY: usize = 16;

/// The segments of each record.
#[derive(Clone, Debug)]
pub(crate) struct Cuts {
    pub segments: Vec<Vec<Range<usize>>>,
    /// Whether anything is carried from one to the next.
    pub carried: bool,
    /// Whether guesses of the carry can be corrected exactly.
    pub affine: bool,
}

impl Cuts {
    /// Cuts records as this sweep allows; not at all if samples must be processed in order (`ordered`).
    pub fn new(sweep: &dyn Sweep, records: &[Record], ordered: bool) -> Self {
        let coupling = sweep.coupling();
        let carried = matches!(coupling, Coupling::Affine | Coupling::Nonlinear);
        let whole = ordered || records.len() >= MANY || coupling == Coupling::Uncut || carried && sweep.carry() > CARRY;
        let shortest = (coupling == Coupling::Restarted && sweep.restarts().is_none()).then_some(OF_ROWS);
        let segments = records.iter().map(|record| cut(record.len(), whole, shortest)).collect();
        Cuts { segments, carried, affine: coupling == Coupling::Affine }
    }

    /// Whether segments of this record begin with the carry at the end of the segment before.
    pub fn is_chained(&self, experiment: usize) -> bool {
        self.carried && self.segments[experiment].len() > 1
    }
}

/// The segments of a record of so many samples; `shortest` is a further least length with its number of segments, below those of [`SEGMENTS`].
fn cut(samples: usize, whole: bool, shortest: Option<(usize, usize)>) -> Vec<Range<usize>> {
    let mut lengths = SEGMENTS.iter().rev().chain(&shortest);
    let segments = lengths.find(|(least, _)| samples >= *least).map_or(1, |(_, segments)| *segments);
    if whole || segments == 1 {
        return std::iter::once(0..samples).collect();
    }
    // Rounded up: the last segment, from which nothing is carried on, is a shortest one.
    let begin = |s: usize| (s * samples).div_ceil(segments);
    (0..segments).map(|s| begin(s)..begin(s + 1)).collect()
}

/// The borders between the segments of all records at a point.
#[derive(Clone, Debug)]
pub(crate) struct Borders {
    pub point: Vec<f64>,
    pub cost: f64,
    pub values: Vec<Values>,
    /// The carries at the begins of each record's segments, from the second segment on, with slopes with respect to the quantities of the record's
    /// unknowns, row by row; without slopes where only values were simulated.
    pub of: Vec<Vec<Reached>>,
    /// Whether they need no correction: simulated ones, and those of a point that was evaluated, corrected.
    pub right: bool,
    /// Of a filter, where segments have run-ins.
    pub run_ins: Option<RunIns>,
}

/// The carries where run-ins begin, with their slopes, for each record.
#[derive(Clone, Debug)]
pub(crate) struct RunIns {
    /// The part of a segment that they take.
    pub part: usize,
    pub of: Vec<Vec<Reached>>,
}

impl Borders {
    pub fn has_slopes(&self) -> bool {
        self.of.iter().flatten().all(|border| !border.slopes.is_empty())
    }

    /// The carry at the begin of a segment; `None` for the first one, and where there is none.
    pub fn at(&self, experiment: usize, segment: usize) -> Option<&Reached> {
        self.of[experiment].get(segment.checked_sub(1)?)
    }
}

/// The borders, and the triangles of each output, at the last point that was evaluated and at the best. A copy is independent of what it was copied
/// from.
#[derive(Debug, Default)]
pub(crate) struct Memory(Mutex<Points>);

#[derive(Clone, Debug, Default)]
struct Points {
    last: Option<Arc<Borders>>,
    best: Option<Arc<Borders>>,
    /// How many lengths of run-ins have turned out too short.
    run_in: usize,
    /// The triangles of each output at the last point and at the best.
    by_output: [Option<Arc<ByOutput>>; 2],
}

fn is_same(a: &[f64], b: &[f64]) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a.to_bits() == b.to_bits())
}

impl Memory {
    fn points(&self) -> std::sync::MutexGuard<'_, Points> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Keeps the borders of a point.
    pub fn keep(&self, borders: Arc<Borders>) {
        let Points { last, best, .. } = &mut *self.points();
        // Costs with different noise levels cannot be compared; the point is then the same as the best one.
        if best.as_ref().is_none_or(|best| borders.cost <= best.cost || borders.point == best.point) {
            *best = Some(borders.clone());
        }
        *last = Some(borders);
    }

    /// Sets the cost that is kept with the borders at a point, after the noise levels have changed.
    pub fn revalue(&self, point: &[f64], cost: f64) {
        let Points { last, best, .. } = &mut *self.points();
        for borders in [last, best].into_iter().flatten().filter(|borders| is_same(&borders.point, point)) {
            Arc::make_mut(borders).cost = cost;
        }
    }

    /// The borders at exactly this point.
    pub fn at(&self, point: &[f64]) -> Option<Arc<Borders>> {
        let Points { last, best, .. } = &*self.points();
        [last, best].into_iter().flatten().find(|borders| is_same(&borders.point, point)).cloned()
    }

    /// Keeps the triangles of a point.
    pub fn keep_by_output(&self, found: Arc<ByOutput>) {
        let [last, best] = &mut self.points().by_output;
        // Costs are compared with the same noise levels.
        if best.as_ref().is_none_or(|best| found.cost(&found.sigma) <= best.cost(&found.sigma)) {
            *best = Some(found.clone());
        }
        *last = Some(found);
    }

    /// Whether there are triangles of this point.
    pub fn knows_outputs_at(&self, point: &[f64]) -> bool {
        self.by_output_at(point).is_some()
    }

    /// The triangles of exactly this point.
    pub fn by_output_at(&self, point: &[f64]) -> Option<Arc<ByOutput>> {
        self.points().by_output.iter().flatten().find(|found| is_same(&found.point, point)).cloned()
    }

    /// The borders with slopes at the best point.
    pub fn best(&self) -> Option<Arc<Borders>> {
        self.points().best.clone().filter(|borders| borders.has_slopes())
    }

    /// How many lengths of run-ins have turned out too short.
    pub fn run_in(&self) -> usize {
        self.points().run_in
    }

    /// One more length is too short.
    pub fn lengthen_run_in(&self) {
        self.points().run_in += 1;
    }
}

impl Clone for Memory {
    fn clone(&self) -> Self {
        Memory(Mutex::new(self.points().clone()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A segment begins where the one before ends, whatever the length is divided by; short records of rows are cut, others are not.
    #[test]
    fn segments_are_the_record() {
        for samples in (1..700).chain([4_095, 4_096, 20_001]) {
            for (shortest, least) in [(None, 512), (Some(OF_ROWS), 16)] {
                let found = cut(samples, false, shortest);
                let joined = found.windows(2).all(|pair| pair[0].end == pair[1].start);
                let whole = found[0].start == 0 && found.last().is_some_and(|last| last.end == samples);
                assert!(joined && whole && found.iter().all(|one| !one.is_empty()), "{samples}: {found:?}");
                assert_eq!(found.len() > 1, samples >= least, "{samples}");
                assert_eq!(cut(samples, true, shortest).len(), 1);
            }
        }
    }
}
