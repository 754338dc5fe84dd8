//! Cutting, joining and thinning records.
//!
//! A piece keeps the hold. What was given of the initial state holds at the first sample of the whole record: a piece that
//! begins later has its initial state estimated. Cuts share the columns of what they keep.

use super::{Channel, Initial, Record, Time};
use crate::error::Error;
use crate::interval::Hold;
use crate::random::Random;
use std::ops::{Bound, Range, RangeBounds};
use std::sync::Arc;

/// Two times closer than this fraction of an even step are the same: `3 * 0.1` is not `0.3` in binary.
const SAME: f64 = 1e-6;

impl Record {
    /// The record with white Gaussian noise of these standard deviations added to its outputs, in their order; the same seed adds the
    /// same noise.
    pub fn with_noise(&self, sigma: &[f64], seed: u64) -> Self {
        let noisy = |(j, (channel, sigma)): (usize, (&Channel, &f64))| {
            let mut random = Random::stream(seed, j as u64);
            channel.with(channel.values.iter().map(|y| y + sigma * random.normal()).collect::<Vec<f64>>())
        };
        let mut outputs = self.outputs.to_vec();
        let found: Vec<Channel> = self.outputs.iter().zip(sigma).enumerate().map(noisy).collect();
        outputs.splice(..found.len(), found);
        Record { outputs: outputs.into(), looked: Arc::default(), ..self.clone() }
    }

    /// The samples of a range, by index from zero: `record.slice(1000..)`.
    ///
    /// # Errors
    /// A range that the record does not have, or too few samples in it.
    pub fn slice(&self, samples: impl RangeBounds<usize>) -> Result<Self, Error> {
        let begin = match samples.start_bound() {
            Bound::Included(&k) => k,
            Bound::Excluded(&k) => k.saturating_add(1),
            Bound::Unbounded => 0,
        };
        let end = match samples.end_bound() {
            Bound::Included(&k) => k.saturating_add(1),
            Bound::Excluded(&k) => k,
            Bound::Unbounded => self.len(),
        };
        if begin > end || end > self.len() {
            let (name, len) = (&self.name, self.len());
            return Err(Error::Option(format!(
                "experiment `{name}` has {len} samples; {begin}..{end} is no range of them"
            )));
        }
        self.cut(begin..end, format!("{}[{begin}..{end}]", self.name))
    }

    /// The samples of a range of time (s): `record.between(2.0..5.0)`. A sample at the begin belongs to it, one at the end
    /// only if the range is written with `..=`.
    ///
    /// # Errors
    /// A bound that is not a number, or too few samples between them.
    pub fn between(&self, seconds: impl RangeBounds<f64>) -> Result<Self, Error> {
        let begin = match seconds.start_bound() {
            Bound::Included(&t) => self.before(t)?,
            Bound::Excluded(&t) => self.until(t)?,
            Bound::Unbounded => 0,
        };
        let end = match seconds.end_bound() {
            Bound::Included(&t) => self.until(t)?,
            Bound::Excluded(&t) => self.before(t)?,
            Bound::Unbounded => self.len(),
        };
        self.cut(begin..end.max(begin), format!("{}[{begin}..{}]", self.name, end.max(begin)))
    }

    /// Two pieces, the first with `fraction` (0 to 1) of the samples: to fit on and to validate on.
    ///
    /// # Errors
    /// A fraction outside 0 to 1, or one that leaves too few samples on a side.
    pub fn split(&self, fraction: f64) -> Result<(Self, Self), Error> {
        if !(0.0..=1.0).contains(&fraction) {
            let name = &self.name;
            return Err(Error::Option(format!(
                "experiment `{name}`: {fraction} is no fraction to split at; take one between 0 and 1"
            )));
        }
        self.halves((fraction * self.len() as f64).round() as usize)
    }

    /// Two pieces, the second beginning with the first sample at or after `time` (s).
    ///
    /// # Errors
    /// A time that is not a number, or that leaves too few samples on a side.
    pub fn split_at(&self, time: f64) -> Result<(Self, Self), Error> {
        self.halves(self.before(time)?)
    }

    /// This record and one that follows it, as one. Between them the input is held as between any two samples; name and
    /// initial state are those of the first.
    ///
    /// # Errors
    /// A second record that begins before the first has ended, or with another hold.
    pub fn join(self, later: &Self) -> Result<Self, Error> {
        let of = |i: usize| (self.holds.of(i), later.holds.of(i));
        if let Some(i) = (0..self.inputs.len()).find(|i| of(*i).0 != of(*i).1) {
            let ((own, other), input) = (of(i), &self.inputs[i].name);
            return Err(Error::Option(format!(
                "experiments `{}` and `{}` cannot be joined: their holds of `{input}` are {own:?} and {other:?}",
                self.name, later.name
            )));
        }
        let stamps = (0..self.len()).map(|k| self.time(k)).chain((0..later.len()).map(|k| later.time(k)));
        let time = Time::from_stamps(stamps.collect());
        let joined = |(a, b): (&Channel, &Channel)| a.with([&*a.values, &*b.values].concat());
        let inputs = self.inputs.iter().zip(later.inputs.iter()).map(joined).collect();
        let outputs = self.outputs.iter().zip(later.outputs.iter()).map(joined).collect();
        Record { time, inputs, outputs, looked: Arc::default(), ..self }.checked()
    }

    /// Every `n`-th sample, from the first.
    ///
    /// A held input ([`Hold::Zero`]) becomes its mean, weighted by time, over what is thinned out: the integral of the
    /// input over each interval stays what it was, and the state follows it up to the second order in the interval. An
    /// input between straight lines ([`Hold::First`]) and the outputs are instants, and stay those of the samples kept.
    ///
    /// Nothing is filtered. White noise on an output stays as large as it was, so that thinning loses information and
    /// gains speed; it biases nothing. What varies faster than the new samples can follow is another matter: in an input
    /// the model never sees it, and an output that depends on the input at once (a feed-through) sees the mean. Choose `n`
    /// small against the fastest time constant. An output that is measured only now and then may be lost altogether:
    /// [`coverage`](Record::coverage) tells. Not for models of which each sample is
    /// a step: discrete ones, and those whose samples change states ([`Model::jump`](crate::Model::jump)).
    ///
    /// # Errors
    /// `n` of zero, or too few samples left.
    pub fn decimate(&self, n: usize) -> Result<Self, Error> {
        if n == 0 {
            let name = &self.name;
            return Err(Error::Option(format!(
                "experiment `{name}`: every 0-th sample makes no sense; take 1 or more"
            )));
        }
        let kept = || (0..self.len()).step_by(n);
        let time = match &self.time {
            Time::Uniform { start, step } => Time::Uniform { start: *start, step: step * n as f64 },
            Time::Stamps(stamps) => Time::Stamps(stamps.iter().step_by(n).copied().collect()),
        };
        let instants = |channel: &Channel| channel.with(kept().map(|k| channel.values[k]).collect::<Vec<f64>>());
        let means = |channel: &Channel| {
            let mean = |k: usize| self.mean(&channel.values, k..self.len().min(k.saturating_add(n)));
            channel.with(kept().map(mean).collect::<Vec<f64>>())
        };
        let thinned = |(i, channel): (usize, &Channel)| match self.holds.of(i) {
            Hold::Zero => means(channel),
            Hold::First => instants(channel),
        };
        let inputs = self.inputs.iter().enumerate().map(thinned).collect();
        let outputs = self.outputs.iter().map(instants).collect();
        Record { time, inputs, outputs, looked: Arc::default(), ..self.clone() }.checked()
    }

    /// The mean of an input, held from sample to sample, over the intervals that begin with these samples. The last sample
    /// of the record begins none.
    fn mean(&self, values: &[f64], samples: Range<usize>) -> f64 {
        let first = values[samples.start];
        let (mut excess, mut total) = (0.0, 0.0);
        for k in samples.start..samples.end.min(self.len() - 1) {
            // Even steps all weigh the same, without the rounding of their times.
            let span = if let Time::Stamps(stamps) = &self.time { stamps[k + 1] - stamps[k] } else { 1.0 };
            excess += (values[k] - first) * span;
            total += span;
        }
        // The excess over the first sample, so that a constant input stays what it is to the last bit.
        first + if total > 0.0 { excess / total } else { 0.0 }
    }

    fn halves(&self, cut: usize) -> Result<(Self, Self), Error> {
        let first = self.cut(0..cut, format!("{}, part 1", self.name))?;
        Ok((first, self.cut(cut..self.len(), format!("{}, part 2", self.name))?))
    }

    fn cut(&self, samples: Range<usize>, name: String) -> Result<Self, Error> {
        let (found, needed) = (samples.len(), self.least());
        if found < needed {
            return Err(Error::TooFewSamples { experiment: name, samples: found, needed, purpose: "in a piece" });
        }
        Ok(self.piece(samples, name))
    }

    /// The samples of a range that the record has, and that is long enough, under a name of their own.
    pub(super) fn piece(&self, samples: Range<usize>, name: String) -> Self {
        let initial = match &self.initial {
            initial @ (Initial::FirstSample | Initial::Free) => initial.clone(),
            _ if samples.start > 0 => Initial::Free,
            initial => initial.clone(),
        };
        let part = |channel: &Channel| channel.part(samples.clone());
        Record {
            name,
            states: self.states.clone(),
            time: self.time.part(samples.clone()),
            time_unit: self.time_unit.clone(),
            inputs: self.inputs.iter().map(part).collect(),
            outputs: self.outputs.iter().map(part).collect(),
            holds: self.holds.clone(),
            initial,
            #[cfg(feature = "csv")]
            reading: self.reading.clone(),
            looked: Arc::default(),
        }
    }

    /// How many samples lie before `time`.
    fn before(&self, time: f64) -> Result<usize, Error> {
        let edge = time - self.slack();
        self.count_while(time, |t| t < edge)
    }

    /// How many samples lie before or at `time`.
    fn until(&self, time: f64) -> Result<usize, Error> {
        let edge = time + self.slack();
        self.count_while(time, |t| t <= edge)
    }

    fn slack(&self) -> f64 {
        if let Time::Uniform { step, .. } = self.time { step * SAME } else { 0.0 }
    }

    fn count_while(&self, bound: f64, holds: impl Fn(f64) -> bool) -> Result<usize, Error> {
        if bound.is_nan() {
            return Err(Error::Option(format!("experiment `{}`: NaN s is no time to cut at", self.name)));
        }
        let (mut low, mut high) = (0, self.len());
        while low < high {
            let middle = low + (high - low) / 2;
            if holds(self.time(middle)) { low = middle + 1 } else { high = middle }
        }
        Ok(low)
    }
}
