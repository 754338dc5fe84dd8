//! [`Record`]: measured inputs and outputs over time, by columns, valid by construction.

mod column;
mod cycles;
mod delays;
mod edit;
#[cfg(feature = "csv")]
mod file;
mod holds;
mod inspect;
mod lengths;
#[cfg(feature = "npy")]
mod npy;
mod series;
mod stored;
mod time;

pub use column::{Channel, Column};
pub use cycles::Gap;
pub(crate) use delays::{NO_DEAD_TIME, Part, ROUNDING, is_dead_time};
#[cfg(feature = "csv")]
pub use file::{DataFile, DateOrder, FileFormat, Header, Reading, TimeSource};
pub(crate) use holds::Holds;
pub(crate) use inspect::Looked;
pub use inspect::{ChannelInspection, Inspection, Suspicion};
pub(crate) use lengths::Lengths;
pub use series::Series;
pub(crate) use stored::Stored;
#[cfg(feature = "csv")]
pub(crate) use time::Clock;
pub use time::Time;
pub(crate) use time::steps;

use crate::error::Error;
use crate::interval::Hold;
use crate::layout::Quantity;
use crate::numeral::{Moment, TimeUnit};
use crate::parameter::Parameter;
use std::sync::{Arc, OnceLock};

/// Declarations of the state at the first sample.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Initial {
    /// It is what the model says ([`Model::initial`](crate::Model::initial)); a state that it does not say is estimated, starting from the first measurement of each output, and from zero where that does not determine it.
    #[default]
    Estimated,
    /// It is estimated in the same way, whatever the model says. Pieces of a record that begin after its first sample are so.
    Free,
    /// It is what the first sample says, taken as exact.
    FirstSample,
    /// The plant rests at the first sample, under the inputs there: the state whose derivative is zero and that the sample leaves as it is
    /// (continuous), or that the next sample does not change (discrete), near the one that the outputs suggest.
    Steady,
    /// Guess, bounds and prior of each state.
    Given(Vec<Parameter>),
}

/// One measured record, its signals in columns.
///
/// Time does not decrease, inputs are finite, lengths agree; an output that was not measured is `NaN`. Samples may be at one instant, with
/// the same inputs: several measurements of the same state. An
/// [`Experiment`](crate::Experiment) is a record that knows its model's signals by their types; this one knows them by
/// name. Copies and pieces share the columns.
#[derive(Clone, Debug)]
pub struct Record {
    pub(crate) name: String,
    pub(crate) states: Arc<[Quantity]>,
    pub(crate) time: Time,
    pub(crate) time_unit: TimeUnit,
    pub(crate) inputs: Arc<[Channel]>,
    pub(crate) outputs: Arc<[Channel]>,
    pub(crate) holds: Holds,
    pub(crate) initial: Initial,
    /// How its file was read, if it is from one.
    #[cfg(feature = "csv")]
    pub(crate) reading: Option<Arc<Reading>>,
    /// Result of the inspection of its channels, if there was one.
    pub(crate) looked: Arc<OnceLock<Looked>>,
}

impl Record {
    /// A record of these signals for a model with these states, held from sample to sample, its initial state estimated.
    ///
    /// # Errors
    /// No signal at all, fewer than two samples (one, without state), lengths that differ, time that decreases or stands still, samples of
    /// one instant with different inputs, a time or input that is not finite, an infinite output.
    pub fn new(states: Vec<Quantity>, time: Time, inputs: Vec<Channel>, outputs: Vec<Channel>) -> Result<Self, Error> {
        let (name, holds, initial) = ("record".to_owned(), Holds::All(Hold::default()), Initial::default());
        let (states, inputs, outputs) = (states.into(), inputs.into(), outputs.into());
        let looked = Arc::default();
        let record = Record {
            name,
            states,
            time,
            time_unit: TimeUnit::default(),
            inputs,
            outputs,
            holds,
            initial,
            #[cfg(feature = "csv")]
            reading: None,
            looked,
        };
        record.checked()
    }

    /// Names the record in reports and errors.
    pub fn named(self, name: impl Into<String>) -> Self {
        Record { name: name.into(), ..self }
    }

    /// Says what is known of the state at the first sample; of a given one, an entry per state.
    ///
    /// # Errors
    /// Another number of entries than states.
    pub fn initial(self, initial: Initial) -> Result<Self, Error> {
        match &initial {
            Initial::Given(given) if given.len() != self.states.len() => Err(Error::Option(format!(
                "experiment `{}`: the initial state has {} entries, but the model has {} states",
                self.name,
                given.len(),
                self.states.len()
            ))),
            _ => Ok(Record { initial, ..self }),
        }
    }

    /// This record with other signals.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub(crate) fn with_channels(self, inputs: Vec<Channel>, outputs: Vec<Channel>) -> Result<Self, Error> {
        Record { inputs: inputs.into(), outputs: outputs.into(), looked: Arc::default(), ..self }.checked()
    }

    /// Says in which unit its times are shown; the numbers stay.
    pub fn time_in(self, time_unit: TimeUnit) -> Self {
        Record { time_unit, ..self }
    }

    /// Name in reports and errors.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// How its file was read, if it is from one: what was said, and what was guessed.
    #[cfg(feature = "csv")]
    pub fn reading(&self) -> Option<&Reading> {
        self.reading.as_deref()
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.inputs.iter().chain(self.outputs.iter()).map(|channel| channel.values.len()).next().unwrap_or(0)
    }

    /// Whether there is no sample; never so for a record that was made.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// When the samples were taken.
    pub fn times(&self) -> &Time {
        &self.time
    }

    /// Time of sample `k` (s).
    #[inline(always)]
    pub fn time(&self, k: usize) -> f64 {
        self.time.at(k)
    }

    /// The unit in which its times are shown: that of its file, seconds where none is said.
    pub fn time_unit(&self) -> &TimeUnit {
        &self.time_unit
    }

    /// Time of sample `k`, as it is shown.
    pub fn moment(&self, k: usize) -> Moment {
        self.shown(self.time(k))
    }

    /// A time, or a length of time, as it is shown.
    pub(crate) fn shown(&self, time: f64) -> Moment {
        Moment { time, unit: self.time_unit.clone() }
    }

    /// The inputs.
    pub fn inputs(&self) -> &[Channel] {
        &self.inputs
    }

    /// The measured outputs; NaN where missing.
    pub fn outputs(&self) -> &[Channel] {
        &self.outputs
    }

    /// Declarations of the state at the first sample.
    pub fn initial_state(&self) -> &Initial {
        &self.initial
    }

    /// Median time from sample to sample (s); of a uniform record, its sample time.
    pub fn sample_time(&self) -> f64 {
        self.time.median_step()
    }

    /// Inputs of sample `k`.
    pub(crate) fn input(&self, k: usize) -> Vec<f64> {
        self.inputs.iter().map(|channel| channel.values[k]).collect()
    }

    /// Measured outputs of sample `k`.
    pub(crate) fn output(&self, k: usize) -> Vec<f64> {
        self.outputs.iter().map(|channel| channel.values[k]).collect()
    }

    /// The fewest samples of a record: a state needs an interval to move in.
    pub(crate) fn least(&self) -> usize {
        if self.states.is_empty() { 1 } else { 2 }
    }

    /// Refuses samples of one instant with different inputs, and a record of a model with states that has one instant only.
    fn check_instants(&self) -> Result<(), Error> {
        let Time::Stamps(stamps) = &self.time else { return Ok(()) };
        for (sample, pair) in (1..).zip(stamps.windows(2)) {
            let changed = |channel: &&Channel| channel.values[sample - 1] != channel.values[sample];
            if pair[0] == pair[1]
                && let Some(channel) = self.inputs.iter().find(changed)
            {
                let (experiment, input) = (self.name.clone(), channel.name.clone());
                let (before, value, time) = (channel.values[sample - 1], channel.values[sample], self.moment(sample));
                return Err(Error::InputsAtOneInstant { experiment, sample, time, input, before, value });
            }
        }
        match stamps.as_slice() {
            [first, .., last] if first == last && !self.states.is_empty() => {
                let (experiment, sample) = (self.name.clone(), stamps.len() - 1);
                let (before, time) = (self.shown(*first), self.shown(*last));
                Err(Error::TimeOrder { experiment, sample, before, time })
            }
            _ => Ok(()),
        }
    }

    /// The record, if it is valid.
    pub(crate) fn checked(self) -> Result<Self, Error> {
        let mut channels = self.inputs.iter().chain(self.outputs.iter());
        let Some(first) = channels.next() else {
            return Err(Error::Option(format!("experiment `{}` has neither an input nor an output", self.name)));
        };
        let samples = first.values.len();
        if let Some(other) = channels.find(|channel| channel.values.len() != samples) {
            let (what, found) = (format!("`{}`", other.name), other.values.len());
            let (experiment, reference) = (self.name.clone(), format!("`{}`", first.name));
            return Err(Error::Lengths { experiment, what, found, reference, expected: samples });
        }
        self.time.check(&self.name, samples, &first.name, &self.time_unit)?;
        let needed = self.least();
        if samples < needed {
            return Err(Error::TooFewSamples { experiment: self.name, samples, needed, purpose: "for a fit" });
        }
        self.check_instants()?;
        let bad_input = |channel: &Channel| channel.values.iter().position(|value| !value.is_finite());
        let bad_output = |channel: &Channel| channel.values.iter().position(|value| value.is_infinite());
        let inputs = self.inputs.iter().filter_map(|channel| Some((bad_input(channel)?, channel)));
        let outputs = self.outputs.iter().filter_map(|channel| Some((bad_output(channel)?, channel)));
        if let Some((sample, channel)) = inputs.chain(outputs).min_by_key(|(sample, _)| *sample) {
            let (experiment, signal, time) = (self.name.clone(), channel.name.clone(), self.moment(sample));
            return Err(Error::NotFinite { experiment, signal, value: channel.values[sample], sample, time });
        }
        Ok(self)
    }
}

/// Records for a fit: one, or a slice or vector of them.
impl AsRef<[Record]> for Record {
    fn as_ref(&self) -> &[Record] {
        std::slice::from_ref(self)
    }
}
