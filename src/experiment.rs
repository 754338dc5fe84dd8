//! [`Experiment`]: a measured record, valid by construction.

#[cfg(feature = "csv")]
mod csv;
mod cycles;
mod edit;
mod meta;
mod time;

#[cfg(feature = "csv")]
pub use csv::CsvFile;
pub use cycles::Gap;
#[cfg(feature = "csv")]
pub(crate) use time::Clock;
pub use time::Time;

use crate::by_name;
use crate::error::Error;
use crate::interval::{Hold, Interval};
use crate::model::Model;
use crate::parameter::Parameter;
use crate::signals::{Of, Signals};
use serde::{Deserialize, Serialize};

/// What is known of the state at the first sample.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[serde(bound = "")]
pub enum Initial<X: Signals> {
    /// It is estimated, starting from what the first sample says.
    Estimated,
    /// It is what the first sample says, taken as exact.
    FirstSample,
    /// Guess, bounds and prior of each state.
    Given(
        #[serde(
            serialize_with = "by_name::serialize::<X, _, _>",
            deserialize_with = "by_name::deserialize::<X, _, _>"
        )]
        Of<X, Parameter>,
    ),
}

/// One measured record of inputs `U` and outputs `Y`, and what is known of the state `X` at its first sample.
///
/// Time increases, inputs are finite, lengths agree; an output that was not measured is `NaN`. Without a further word the
/// input is held from sample to sample, and the initial state is estimated from a start that the first sample gives.
///
/// It is made of vectors ([`new`](Experiment::new)) or of a CSV file (`from_csv`, `CsvFile`), and
/// cut ([`slice`](Experiment::slice), [`between`](Experiment::between), [`split`](Experiment::split),
/// [`cycles`](Experiment::cycles), [`without_gaps`](Experiment::without_gaps)), [joined](Experiment::join) and
/// [thinned](Experiment::decimate) into others. As JSON it keeps everything; what is read back is checked again.
#[derive(Clone, Debug)]
pub struct Experiment<X: Signals, U: Signals, Y: Signals> {
    pub(crate) name: String,
    pub(crate) time: Time,
    pub(crate) inputs: Vec<Of<U, f64>>,
    pub(crate) outputs: Vec<Of<Y, f64>>,
    pub(crate) hold: Hold,
    pub(crate) initial: Initial<X>,
}

/// The experiment that fits a model.
pub type ExperimentOf<M> = Experiment<<M as Model>::State, <M as Model>::Input, <M as Model>::Output>;

/// The fewest samples of a record: a state needs an interval to move in.
pub(crate) fn least<X: Signals>() -> usize {
    if X::LEN == 0 { 1 } else { 2 }
}

/// One row of a record.
#[derive(Clone, Copy, Debug)]
pub struct Sample<M: Model> {
    /// Time (s).
    pub t: f64,
    /// Inputs.
    pub u: Of<M::Input, f64>,
    /// Measured outputs; NaN where missing.
    pub y: Of<M::Output, f64>,
}

impl<X: Signals, U: Signals, Y: Signals> Experiment<X, U, Y> {
    /// A record from its columns; the model only says which signals are meant.
    ///
    /// # Errors
    /// Fewer than two samples (one, for a model without state), lengths that differ, time that does not increase, a time
    /// or input that is not finite, an infinite output.
    pub fn new<M: Model<State = X, Input = U, Output = Y>>(
        _model: &M,
        time: Time,
        inputs: Vec<Of<U, f64>>,
        outputs: Vec<Of<Y, f64>>,
    ) -> Result<Self, Error> {
        let experiment = Experiment {
            name: "record".to_owned(),
            time,
            inputs,
            outputs,
            hold: Hold::default(),
            initial: Initial::Estimated,
        };
        experiment.checked()
    }

    /// A record of inputs alone, to be simulated: every output is missing.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn of_inputs<M: Model<State = X, Input = U, Output = Y>>(
        model: &M,
        time: Time,
        inputs: Vec<Of<U, f64>>,
    ) -> Result<Self, Error> {
        let outputs = vec![Y::splat(f64::NAN); inputs.len()];
        Experiment::new(model, time, inputs, outputs)
    }

    /// Names the record in reports and errors.
    pub fn named(self, name: impl Into<String>) -> Self {
        Experiment { name: name.into(), ..self }
    }

    /// Says how the input behaves between samples.
    pub fn hold(self, hold: Hold) -> Self {
        Experiment { hold, ..self }
    }

    /// Says what is known of the state at the first sample: `fixed` where given, `free` (with bounds or prior) where
    /// estimated, in the units of the states.
    pub fn initial(self, state: Of<X, Parameter>) -> Self {
        Experiment { initial: Initial::Given(state), ..self }
    }

    /// Takes the state at the first sample from its outputs, as exact. Noise of that one sample then enters the whole
    /// simulation; the default estimates the state instead.
    pub fn initial_from_first_sample(self) -> Self {
        Experiment { initial: Initial::FirstSample, ..self }
    }

    /// Name in reports and errors.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.inputs.len()
    }

    /// Whether there is no sample; never so for an experiment that was made.
    pub fn is_empty(&self) -> bool {
        self.inputs.is_empty()
    }

    /// Time of sample `k` (s).
    #[inline(always)]
    pub fn time(&self, k: usize) -> f64 {
        self.time.at(k)
    }

    /// When the samples were taken.
    pub fn times(&self) -> &Time {
        &self.time
    }

    /// Inputs, one row per sample.
    pub fn inputs(&self) -> &[Of<U, f64>] {
        &self.inputs
    }

    /// Measured outputs, one row per sample; NaN where missing.
    pub fn outputs(&self) -> &[Of<Y, f64>] {
        &self.outputs
    }

    /// How the input behaves between samples.
    pub fn input_hold(&self) -> Hold {
        self.hold
    }

    /// What is known of the state at the first sample.
    pub fn initial_state(&self) -> &Initial<X> {
        &self.initial
    }

    /// Median time from sample to sample (s); of a uniform record, its sample time.
    pub fn sample_time(&self) -> f64 {
        match &self.time {
            Time::Uniform { step, .. } => *step,
            Time::Stamps(stamps) => {
                let mut steps: Vec<f64> = stamps.windows(2).map(|w| w[1] - w[0]).collect();
                if steps.is_empty() {
                    return 0.0;
                }
                let middle = steps.len() / 2;
                *steps.select_nth_unstable_by(middle, f64::total_cmp).1
            }
        }
    }

    /// The record, if it keeps its promises.
    pub(crate) fn checked(self) -> Result<Self, Error> {
        let samples = self.inputs.len();
        if self.outputs.len() != samples {
            let (what, found, reference) = ("the output", self.outputs.len(), "the input");
            let experiment = self.name;
            return Err(Error::Lengths { experiment, what, found, reference, expected: samples });
        }
        self.time.check(&self.name, samples)?;
        let needed = least::<X>();
        if samples < needed {
            return Err(Error::TooFewSamples { experiment: self.name, samples, needed, purpose: "for a fit" });
        }
        for sample in 0..samples {
            let (u, y) = (U::into_array(self.inputs[sample]), Y::into_array(self.outputs[sample]));
            let inputs = U::NAMES.iter().zip(u.as_ref()).find(|(_, value)| !value.is_finite());
            let outputs = || Y::NAMES.iter().zip(y.as_ref()).find(|(_, value)| value.is_infinite());
            if let Some((signal, &value)) = inputs.or_else(outputs) {
                let (experiment, signal, time) = (self.name.clone(), (*signal).to_owned(), self.time(sample));
                return Err(Error::NotFinite { experiment, signal, value, sample, time });
            }
        }
        Ok(self)
    }

    /// The samples of a range that the record has, and that is long enough, under a name of their own.
    pub(crate) fn piece(&self, samples: std::ops::Range<usize>, name: String) -> Self {
        let time = match &self.time {
            Time::Uniform { step, .. } => Time::Uniform { start: self.time(samples.start), step: *step },
            Time::Stamps(stamps) => Time::Stamps(stamps[samples.clone()].to_vec()),
        };
        let initial = match self.initial {
            Initial::Given(_) if samples.start > 0 => Initial::Estimated,
            initial => initial,
        };
        let (inputs, outputs) = (self.inputs[samples.clone()].to_vec(), self.outputs[samples].to_vec());
        Experiment { name, time, inputs, outputs, hold: self.hold, initial }
    }

    /// What happens from sample `k` to the next.
    #[inline(always)]
    pub(crate) fn interval(&self, k: usize, hold: Hold) -> Interval<U> {
        let u1 = if hold == Hold::First { self.inputs[k + 1] } else { self.inputs[k] };
        Interval { t0: self.time(k), t1: self.time(k + 1), u0: self.inputs[k], u1, hold }
    }
}

impl<X: Signals, U: Signals, Y: Signals> AsRef<[Experiment<X, U, Y>]> for Experiment<X, U, Y> {
    fn as_ref(&self) -> &[Experiment<X, U, Y>] {
        std::slice::from_ref(self)
    }
}
