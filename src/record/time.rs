//! [`Time`]: when the samples were taken, and whether that was evenly.

use crate::error::Error;
use crate::numeral::{Moment, TimeUnit};
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// When the samples were taken (s).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Time {
    /// `start + k * step`.
    Uniform {
        /// Time of the first sample (s).
        #[serde(with = "crate::real")]
        start: f64,
        /// From sample to sample (s).
        #[serde(with = "crate::real")]
        step: f64,
    },
    /// One stamp per sample; none is smaller than the one before. Equal stamps are several measurements at one instant.
    Stamps(#[serde(with = "crate::real")] Vec<f64>),
}

impl Time {
    /// Time from stamps (s): uniform, and then without a number per sample, if no stamp is off an even grid by more than
    /// a millionth of a step (or by what rounding an `f64` of that size costs); the stamps as they are otherwise.
    ///
    /// A millionth of a step moves the edge of a held input so little that no answer changes in the digits that are
    /// printed. Clocks that jitter, and stamps printed with too few digits, are off by more and stay stamps.
    pub fn from_stamps(stamps: Vec<f64>) -> Time {
        // What is no number has no place on a grid; a record with it is refused.
        if !stamps.iter().all(|stamp| stamp.is_finite()) {
            return Time::Stamps(stamps);
        }
        let mut clock = Clock::default();
        for &stamp in &stamps {
            clock.tick(stamp);
        }
        clock.uniform().unwrap_or(Time::Stamps(stamps))
    }

    /// Time of sample `k` (s); not a number beyond the last stamp.
    #[inline(always)]
    pub fn at(&self, k: usize) -> f64 {
        match self {
            Time::Uniform { start, step } => start + k as f64 * step,
            Time::Stamps(stamps) => stamps.get(k).copied().unwrap_or(f64::NAN),
        }
    }

    /// Appends the times of samples (s).
    pub(crate) fn append(&self, samples: Range<usize>, to: &mut Vec<f64>) {
        match self {
            Time::Uniform { start, step } => to.extend(samples.map(|k| start + k as f64 * step)),
            Time::Stamps(stamps) => to.extend_from_slice(&stamps[samples]),
        }
    }

    /// Median time from instant to instant (s); zero where there are not two.
    pub(crate) fn median_step(&self) -> f64 {
        match self {
            Time::Uniform { step, .. } => *step,
            Time::Stamps(stamps) => {
                let mut steps = steps(stamps);
                if steps.is_empty() {
                    return 0.0;
                }
                let middle = steps.len() / 2;
                *steps.select_nth_unstable_by(middle, f64::total_cmp).1
            }
        }
    }

    /// The times of some of the samples.
    pub(crate) fn part(&self, samples: std::ops::Range<usize>) -> Time {
        match self {
            Time::Uniform { step, .. } => Time::Uniform { start: self.at(samples.start), step: *step },
            Time::Stamps(stamps) => Time::Stamps(stamps[samples].to_vec()),
        }
    }

    /// Refuses time that is not finite, decreases, or does not go with the samples of the channel `reference`.
    pub(crate) fn check(
        &self,
        experiment: &str,
        samples: usize,
        reference: &str,
        unit: &TimeUnit,
    ) -> Result<(), Error> {
        let shown = |time: f64| Moment { time, unit: unit.clone() };
        if let Time::Stamps(stamps) = self
            && stamps.len() != samples
        {
            let (experiment, what, found) = (experiment.to_owned(), "time".to_owned(), stamps.len());
            let reference = format!("`{reference}`");
            return Err(Error::Lengths { experiment, what, found, reference, expected: samples });
        }
        if let Time::Uniform { step: value, .. } = *self
            && !(value > 0.0 && value.is_finite())
        {
            return Err(Error::NotPositive { what: format!("experiment `{experiment}`: the sample time"), value });
        }
        // A uniform time fails, if at all, where its numbers are largest: a step below their resolution, or an overflow.
        let places = match self {
            Time::Uniform { .. } => [0..samples.min(2), samples.saturating_sub(2)..samples],
            Time::Stamps(_) => [0..samples, 0..0],
        };
        for place in places {
            let mut before = f64::NEG_INFINITY;
            for sample in place {
                let time = self.at(sample);
                if !time.is_finite() {
                    let (experiment, signal) = (experiment.to_owned(), "t".to_owned());
                    return Err(Error::NotFinite { experiment, signal, value: time, sample, time: shown(time) });
                }
                // Stamps may repeat; those of an even grid do where they have no more digits.
                if time < before || time == before && matches!(self, Time::Uniform { .. }) {
                    let (experiment, before, time) = (experiment.to_owned(), shown(before), shown(time));
                    return Err(Error::TimeOrder { experiment, sample, before, time });
                }
                before = time;
            }
        }
        Ok(())
    }
}

/// The times between instants (s): those of several measurements at one instant are left out.
pub(crate) fn steps(stamps: &[f64]) -> Vec<f64> {
    stamps.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| *step > 0.0).collect()
}

/// How far a stamp may be off an even grid, as a fraction of the step.
const EVEN: f64 = 1e-6;

/// Tells, stamp by stamp and without keeping them, whether one even grid from the first stamp on serves them all: each
/// stamp narrows the range that the step can be in.
#[derive(Debug)]
pub(crate) struct Clock {
    ticks: usize,
    start: f64,
    last: f64,
    tolerance: f64,
    shortest: f64,
    longest: f64,
}

impl Default for Clock {
    fn default() -> Self {
        Clock { ticks: 0, start: 0.0, last: 0.0, tolerance: 0.0, shortest: 0.0, longest: f64::INFINITY }
    }
}

impl Clock {
    /// Takes the next stamp; says whether all so far are even.
    pub(crate) fn tick(&mut self, stamp: f64) -> bool {
        match self.ticks {
            0 => self.start = stamp,
            1 => self.tolerance = EVEN * (stamp - self.start),
            _ => {}
        }
        if self.ticks > 0 {
            // Rounding: half a unit in the last place each for this stamp, the first, the product and the sum.
            let rounding = 2.0 * f64::EPSILON * (stamp.abs() + self.start.abs());
            let (steps, tolerance) = (self.ticks as f64, self.tolerance + rounding);
            self.shortest = self.shortest.max((stamp - self.start - tolerance) / steps);
            self.longest = self.longest.min((stamp - self.start + tolerance) / steps);
        }
        self.last = stamp;
        self.ticks += 1;
        self.shortest <= self.longest
    }

    /// The last stamp; `None` before the first.
    #[cfg(feature = "csv")]
    pub(crate) fn last(&self) -> Option<f64> {
        (self.ticks > 0).then_some(self.last)
    }

    /// The even grid, if there is one.
    pub(crate) fn uniform(&self) -> Option<Time> {
        let step = (self.last - self.start) / (self.ticks.max(2) - 1) as f64;
        let even = self.ticks > 1 && step > 0.0 && self.shortest <= self.longest;
        even.then(|| Time::Uniform { start: self.start, step: step.max(self.shortest).min(self.longest) })
    }
}
