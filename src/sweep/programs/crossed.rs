//! [`Crossed`]: the transition of linear equations in the lanes of a program.
//!
//! A program reads the entries of a transition as numbers that follow the parameters, the same at every sample. Where the length of the interval
//! changes, the run stops and those lanes get the numbers of the new length. Where a clock jitters, each interval has a length of its own; then the numbers are
//! computed at some lengths, and are a polynomial between them ([`Band`]).

use super::band::{Band, NODES};
use crate::engine::Group;
use crate::equations::Linear;
use crate::record::Lengths;
use crate::sweep::Piece;
use rustc_hash::FxHashMap;
use std::ops::Range;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Lengths of a record in one band from which on a polynomial is worth it.
const MANY: usize = 2 * NODES;
/// Largest error of the polynomial that is accepted, at the begin of its band, where it is largest. It is that of rounding, but for plants that
/// oscillate more than once between two samples.
const NEAR: f64 = 1e-11;
/// Largest count of numbers that are cached for a set of parameters; those of further lengths are computed each time.
const KEPT: usize = 1_000_000;

/// Linear equations, and the numbers that were computed last: the pieces of a record share them.
pub(super) struct Crossed {
    linear: Linear,
    last: Mutex<Arc<Known>>,
}

/// Parameters, and what follows from them and the length of an interval.
pub(super) type Numbers = Arc<Vec<f64>>;

/// The numbers of a set of parameters.
#[derive(Default)]
struct Known {
    parameters: Vec<f64>,
    /// By the bits of the length of an interval (s), and whether they are those of a polynomial.
    numbers: Mutex<FxHashMap<(u64, bool), Numbers>>,
    /// By the same: these numbers followed by the constant covariance of a filter, if it has one.
    settled: Mutex<FxHashMap<(u64, bool), Option<Numbers>>>,
    /// By their number; none where a polynomial is no good.
    bands: Mutex<FxHashMap<i32, Option<Arc<Band>>>>,
}

impl Crossed {
    pub fn new(linear: Linear) -> Self {
        Crossed { linear, last: Mutex::default() }
    }

    fn known(&self, parameters: &[f64]) -> Arc<Known> {
        let mut last = lock(&self.last);
        if last.parameters != parameters {
            *last = Arc::new(Known { parameters: parameters.to_vec(), ..Known::default() });
        }
        last.clone()
    }

    /// What numbers are kept by, and the band of a length.
    fn key(lengths: &Lengths, length: f64) -> ((u64, bool), i32) {
        let band = Band::of(length);
        let many = length > 0.0 && lengths.between(Band::bounds(band)) >= MANY;
        ((length.to_bits(), many), band)
    }

    /// The parameters as a program has them: after them what follows from them and the length of an interval, one of these.
    fn numbers(&self, known: &Known, lengths: &Lengths, length: f64) -> Numbers {
        let (key, band) = Self::key(lengths, length);
        let (_, many) = key;
        if let Some(numbers) = lock(&known.numbers).get(&key) {
            return numbers.clone();
        }
        // Without the lock: other threads compute those of other lengths.
        let numbers = match many.then(|| self.band(known, band)).flatten() {
            Some(band) => {
                let mut numbers = band.numbers(length);
                numbers.iter_mut().zip(&known.parameters).for_each(|(number, parameter)| *number = *parameter);
                numbers
            }
            None => self.linear.numbers(&known.parameters, length),
        };
        let numbers = Arc::new(numbers);
        let mut kept = lock(&known.numbers);
        if kept.len() * numbers.len() < KEPT {
            kept.insert(key, numbers.clone());
        }
        numbers
    }

    /// The parameters, what follows from them and the length of an interval, and the constant covariance of a filter.
    fn settled(&self, known: &Known, lengths: &Lengths, length: f64) -> Option<Numbers> {
        let (key, _) = Self::key(lengths, length);
        if let Some(settled) = lock(&known.settled).get(&key) {
            return settled.clone();
        }
        let numbers = self.numbers(known, lengths, length);
        let covariance = self.linear.settled(&numbers);
        let settled = covariance.map(|covariance| Arc::new([&numbers[..], &covariance].concat()));
        let mut kept = lock(&known.settled);
        if kept.len() * numbers.len() < KEPT {
            kept.insert(key, settled.clone());
        }
        settled
    }

    fn band(&self, known: &Known, number: i32) -> Option<Arc<Band>> {
        if let Some(band) = lock(&known.bands).get(&number) {
            return band.clone();
        }
        let numbers = |length: f64| self.linear.numbers(&known.parameters, length);
        let crossing = |numbers: Vec<f64>| self.linear.crossing(|following| numbers[following.number as usize]);
        let (band, [begin, _]) = (Band::new(number, numbers), Band::bounds(number));
        let exact = crossing(numbers(begin));
        // What overflows at the begin does so in the whole band. Slopes are not asked: that of a square root at zero is infinite.
        let is_near = !exact.is_finite() || crossing(band.numbers(begin)).is_near(&exact, NEAR);
        let band = is_near.then(|| Arc::new(band));
        lock(&known.bands).insert(number, band.clone());
        band
    }
}

fn lock<T>(of: &Mutex<T>) -> MutexGuard<'_, T> {
    of.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The lanes of a run, each with the numbers of the interval that it is in.
pub(super) struct Crossing<'r> {
    crossed: &'r Crossed,
    lanes: Vec<Lane<'r>>,
}

struct Lane<'r> {
    known: Arc<Known>,
    lengths: &'r Lengths,
    /// Whose numbers the group has.
    length: Option<f64>,
}

impl<'r> Crossing<'r> {
    pub fn new(crossed: &'r Crossed, pieces: &[&Piece<'r>]) -> Self {
        let mut lanes: Vec<Lane<'r>> = Vec::with_capacity(pieces.len());
        for piece in pieces {
            // Lanes without a piece repeat the first.
            let same = lanes.iter().find(|lane| lane.known.parameters == piece.parameters);
            let known = same.map_or_else(|| crossed.known(piece.parameters), |lane| lane.known.clone());
            lanes.push(Lane { known, lengths: piece.prepared.lengths(piece.record), length: None });
        }
        Crossing { crossed, lanes }
    }

    /// Gives each lane the numbers of the interval that begins so many samples after the first of its piece.
    pub fn enter(&mut self, group: &mut Group, pieces: &[Piece<'_>], after: usize) {
        let mut changed = false;
        for (number, lane) in self.lanes.iter_mut().enumerate() {
            let length = lane.lengths.after(samples(pieces, number, after..after).start);
            if lane.length != Some(length) {
                group.set_parameters(number, &self.crossed.numbers(&lane.known, lane.lengths, length));
                group.set_step(number, length);
                (lane.length, changed) = (Some(length), true);
            }
        }
        if changed {
            group.prepare();
        }
    }

    /// The numbers of a lane whose covariance has settled, if it does with intervals of this length.
    pub fn settled(&self, lane: usize, length: f64) -> Option<Numbers> {
        let Lane { known, lengths, .. } = &self.lanes[lane];
        self.crossed.settled(known, lengths, length)
    }

    /// At which offsets into `counted`, a range of samples after the first of each lane's piece, the length of the interval changes in a lane.
    pub fn changes(&self, pieces: &[Piece<'_>], counted: Range<usize>) -> Vec<usize> {
        let mut found = vec![];
        for (number, Lane { lengths, .. }) in self.lanes.iter().enumerate().filter(|(_, lane)| lane.lengths.count() > 1)
        {
            let here = samples(pieces, number, counted.clone());
            let first = here.start;
            let changed = here.skip(1).filter(|k| lengths.after(*k) != lengths.after(k - 1));
            found.extend(changed.map(|k| k - first));
        }
        found
    }
}

/// The samples of a lane, without those after the end of its piece; lanes without a piece repeat the first.
fn samples(pieces: &[Piece<'_>], lane: usize, counted: Range<usize>) -> Range<usize> {
    let Range { start, end } = pieces.get(lane).unwrap_or(&pieces[0]).samples.clone();
    let at = |counted: usize| (start + counted).min(end);
    at(counted.start).min(end.max(start + 1) - 1)..at(counted.end)
}
