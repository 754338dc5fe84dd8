//! [`Experiment`]: a record that knows its model's signals by their types.

mod edit;
#[cfg(feature = "csv")]
mod file;
#[cfg(feature = "npy")]
mod npy;

use crate::error::Error;
use crate::interval::Hold;
use crate::layout::{Layout, Quantity, quantities};
use crate::model::Model;
use crate::numeral::TimeUnit;
use crate::parameter::Parameter;
use crate::record::{Channel, Holds, Initial, Record, Series, Stored, Time};
use crate::signals::{Of, Signals};
use core::marker::PhantomData;
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// One measured record of inputs `U` and outputs `Y`, and what is known of the state `X` at its first sample.
///
/// Time does not decrease, inputs are finite, lengths agree; an output that was not measured is `NaN`. Samples may be at one instant, with
/// the same inputs: several measurements of the same state, which passes the interval between them unchanged. Unless told otherwise the
/// input is held from sample to sample, and the initial state is estimated, from a start that the first measurements give.
///
/// It is made of vectors ([`new`](Experiment::new)), of columns ([`from_columns`](Experiment::from_columns)) or of a CSV
/// file (`from_file`, `DataFile`), and cut ([`slice`](Experiment::slice), [`between`](Experiment::between),
/// [`split`](Experiment::split), [`cycles`](Experiment::cycles), [`without_gaps`](Experiment::without_gaps)),
/// [joined](Experiment::join) and [thinned](Experiment::decimate) into others; pieces share the columns of the whole. As
/// JSON it keeps everything; what is read back is checked again.
///
/// ```
/// use greybox::{Experiment, Hold, Time, fixed, pmsm::{Currents, Drive, Surface}};
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let model = Surface::new(4)?;
/// let time = Time::Uniform { start: 0.0, step: 1e-3 };
/// let inputs = (0..50).map(|k| Drive { ud: 0.0, uq: f64::from(k), w: 10.0 }).collect();
/// let outputs = (0..50).map(|k| Currents { id: 0.0, iq: if k == 7 { f64::NAN } else { 0.1 } }).collect();
/// let record = Experiment::new(&model, time, inputs, outputs)?
///     .named("ramp")
///     .hold(Hold::First)
///     .initial(Currents { id: fixed(0.0), iq: fixed(0.0) });
/// assert_eq!((record.len(), record.coverage().iq), (50, 0.98)); // one sample of iq is missing
/// let (fit, validation) = record.split(0.8)?;
/// assert_eq!((fit.len(), validation.len()), (40, 10));
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct Experiment<X: Signals, U: Signals, Y: Signals> {
    record: Record,
    signals: PhantomData<(X, U, Y)>,
}

/// The experiment that fits a model.
pub type ExperimentOf<M> = Experiment<<M as Model>::State, <M as Model>::Input, <M as Model>::Output>;

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
    /// A record from its rows; the model only says which signals are meant.
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
        if outputs.len() != inputs.len() {
            let (experiment, what, reference) = ("record".to_owned(), "the output".to_owned(), "the input".to_owned());
            return Err(Error::Lengths { experiment, what, found: outputs.len(), reference, expected: inputs.len() });
        }
        let record = Record::new(quantities::<X>(), time, channels::<U>(&inputs), channels::<Y>(&outputs))?;
        Ok(Experiment { record, signals: PhantomData })
    }

    /// A record from its columns, one per input and one per output in the order of their declaration.
    ///
    /// # Errors
    /// Another number of columns than signals, and as [`new`](Self::new).
    pub fn from_columns<M: Model<State = X, Input = U, Output = Y>>(
        _model: &M,
        time: Time,
        inputs: Vec<Vec<f64>>,
        outputs: Vec<Vec<f64>>,
    ) -> Result<Self, Error> {
        let named = |columns: Vec<Vec<f64>>, signals: Vec<Quantity>, what: &str| {
            if columns.len() != signals.len() {
                let (found, expected) = (columns.len(), signals.len());
                return Err(Error::Option(format!("{found} column(s) for the {expected} {what}(s) of the model")));
            }
            let channel = |(values, signal): (Vec<f64>, Quantity)| Channel::new(signal.name, signal.unit, values);
            Ok(columns.into_iter().zip(signals).map(channel).collect())
        };
        let inputs = named(inputs, quantities::<U>(), "input")?;
        let outputs = named(outputs, quantities::<Y>(), "output")?;
        Ok(Experiment { record: Record::new(quantities::<X>(), time, inputs, outputs)?, signals: PhantomData })
    }

    /// A record of signals that have instants of their own, inputs and outputs in the order of their declaration; see [`Record::from_series`].
    ///
    /// ```
    /// use greybox::{Experiment, Hold, pmsm::Surface, record::Series};
    /// let model = Surface::new(4)?;
    /// let clock = |step: f64, samples: u32| -> Vec<f64> { (0..samples).map(|k| step * f64::from(k)).collect() };
    /// let at = |step: f64, samples: u32, value: fn(f64) -> f64| {
    ///     Series::new(clock(step, samples), clock(step, samples).into_iter().map(value).collect())
    /// };
    /// let [ud, uq] = [at(1e-3, 11, |_| 0.0), at(1e-3, 11, |t| 40.0 + t)]; // commands, each ms
    /// let w = at(5e-3, 3, |t| 100.0 * t).hold(Hold::First); // measured each 5 ms
    /// let [id, iq] = [at(2e-3, 6, |_| 0.0), at(2e-3, 6, |t| t)]; // each 2 ms
    /// let record = Experiment::from_series(&model, vec![ud, uq, w], vec![id, iq])?;
    /// assert_eq!((record.len(), record.input(4).w), (11, 0.4));
    /// assert!(record.output(3).iq.is_nan() && record.output(4).iq == 4e-3);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// As [`Record::from_series`].
    pub fn from_series<M: Model<State = X, Input = U, Output = Y>>(
        _model: &M,
        inputs: Vec<Series>,
        outputs: Vec<Series>,
    ) -> Result<Self, Error> {
        Record::from_series(&Layout::of::<M>(), inputs, outputs).map(Experiment::of)
    }

    /// The record of a model's signals, as they stand in it.
    ///
    /// # Errors
    /// Other names of states, inputs or outputs than the model has.
    pub fn from_record<M: Model<State = X, Input = U, Output = Y>>(_model: &M, record: Record) -> Result<Self, Error> {
        let states: Vec<&str> = record.states.iter().map(|state| state.name.as_str()).collect();
        let names = |channels: &'_ [Channel]| channels.iter().map(|channel| channel.name.clone()).collect::<Vec<_>>();
        let (inputs, outputs) = (names(&record.inputs), names(&record.outputs));
        if states == X::NAMES && inputs == U::NAMES && outputs == Y::NAMES {
            return Ok(Experiment { record, signals: PhantomData });
        }
        Err(Error::Option(format!(
            "experiment `{}` has the states {states:?}, inputs {inputs:?} and outputs {outputs:?}, but the model has {:?}, \
             {:?} and {:?}",
            record.name,
            X::NAMES,
            U::NAMES,
            Y::NAMES
        )))
    }

    /// Names the record in reports and errors.
    pub fn named(self, name: impl Into<String>) -> Self {
        self.map(|record| record.named(name))
    }

    /// Says how all inputs behave between samples.
    pub fn hold(self, hold: Hold) -> Self {
        self.map(|record| record.hold(hold))
    }

    /// Says how each input behaves between samples: a command of a controller is held, what was measured is a straight line.
    pub fn holds(self, holds: Of<U, Hold>) -> Self {
        let holds = Holds::each(U::into_array(holds).as_ref().to_vec());
        self.map(|record| Record { holds, ..record })
    }

    /// Says what is known of the state at the first sample: `fixed` where given, `free` (with bounds or prior) where
    /// estimated, in the units of the states.
    pub fn initial(self, state: Of<X, Parameter>) -> Self {
        let initial = Initial::Given(X::into_array(state).as_ref().to_vec());
        self.map(|record| Record { initial, ..record })
    }

    /// Has the state at the first sample estimated, also where the model says it ([`Model::initial`]).
    pub fn initial_estimated(self) -> Self {
        self.map(|record| Record { initial: Initial::Free, ..record })
    }

    /// Takes the state at the first sample from its outputs, as exact. Noise of that one sample then enters the whole
    /// simulation; the default estimates the state instead.
    pub fn initial_from_first_sample(self) -> Self {
        self.map(|record| Record { initial: Initial::FirstSample, ..record })
    }

    /// Takes the plant to be at rest at the first sample, under the inputs there ([`Initial::Steady`]). Of several states of rest it takes the
    /// one near that which the outputs suggest.
    pub fn initially_at_rest(self) -> Self {
        self.map(|record| Record { initial: Initial::Steady, ..record })
    }

    /// The record by columns, its signals known by name.
    pub fn record(&self) -> &Record {
        &self.record
    }

    /// Name in reports and errors.
    pub fn name(&self) -> &str {
        self.record.name()
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.record.len()
    }

    /// Whether there is no sample; never so for an experiment that was made.
    pub fn is_empty(&self) -> bool {
        self.record.is_empty()
    }

    /// Says in which unit times are shown; the numbers stay.
    pub fn time_in(self, unit: TimeUnit) -> Self {
        Self::of(self.record.time_in(unit))
    }

    /// Time of sample `k` (s).
    ///
    /// # Panics
    /// From [`len`](Self::len) on where time was given by stamps, like a slice.
    #[inline(always)]
    pub fn time(&self, k: usize) -> f64 {
        self.record.time(k)
    }

    /// When the samples were taken.
    pub fn times(&self) -> &Time {
        self.record.times()
    }

    /// Inputs of sample `k`.
    ///
    /// # Panics
    /// From [`len`](Self::len) on, like a slice.
    #[inline(always)]
    pub fn input(&self, k: usize) -> Of<U, f64> {
        U::from_fn(|i| self.record.inputs[i].values[k])
    }

    /// Measured outputs of sample `k`; NaN where missing.
    ///
    /// # Panics
    /// From [`len`](Self::len) on, like a slice.
    #[inline(always)]
    pub fn output(&self, k: usize) -> Of<Y, f64> {
        Y::from_fn(|j| self.record.outputs[j].values[k])
    }

    /// Inputs, sample by sample.
    pub fn inputs(&self) -> impl ExactSizeIterator<Item = Of<U, f64>> {
        let columns: Vec<&[f64]> = self.record.inputs.iter().map(|channel| &*channel.values).collect();
        (0..self.len()).map(move |k| U::from_fn(|i| columns[i][k]))
    }

    /// Measured outputs, sample by sample; NaN where missing.
    pub fn outputs(&self) -> impl ExactSizeIterator<Item = Of<Y, f64>> {
        let columns: Vec<&[f64]> = self.record.outputs.iter().map(|channel| &*channel.values).collect();
        (0..self.len()).map(move |k| Y::from_fn(|j| columns[j][k]))
    }

    /// The rows of the record.
    pub fn samples<M: Model<State = X, Input = U, Output = Y>>(&self) -> impl ExactSizeIterator<Item = Sample<M>> {
        (0..self.len()).map(|k| Sample { t: self.time(k), u: self.input(k), y: self.output(k) })
    }

    /// How each input behaves between samples.
    pub fn input_holds(&self) -> Of<U, Hold> {
        U::from_fn(|i| self.record.input_hold(i))
    }

    /// Declarations of the state at the first sample.
    pub fn initial_state(&self) -> &Initial {
        self.record.initial_state()
    }

    /// Median time from sample to sample (s); of a uniform record, its sample time.
    pub fn sample_time(&self) -> f64 {
        self.record.sample_time()
    }

    fn map(self, f: impl FnOnce(Record) -> Record) -> Self {
        Experiment { record: f(self.record), signals: PhantomData }
    }

    /// A record of this model's signals.
    pub(crate) fn of(record: Record) -> Self {
        Experiment { record, signals: PhantomData }
    }
}

/// The columns of a vector of signals.
fn channels<S: Signals>(rows: &[Of<S, f64>]) -> Vec<Channel> {
    let column = |i: usize| rows.iter().map(|row| S::into_array(*row).as_ref()[i]).collect::<Vec<f64>>();
    let signals = quantities::<S>().into_iter().enumerate();
    signals.map(|(i, signal)| Channel::new(signal.name, signal.unit, column(i))).collect()
}

impl<X: Signals, U: Signals, Y: Signals> Serialize for Experiment<X, U, Y> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.record.serialize(serializer)
    }
}

impl<'de, X: Signals, U: Signals, Y: Signals> Deserialize<'de> for Experiment<X, U, Y> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let stored = Stored::deserialize(deserializer)?;
        let record = stored.into_record(quantities::<X>(), &quantities::<U>(), &quantities::<Y>());
        record.map(Self::of).map_err(D::Error::custom)
    }
}

/// Records for a fit: one, or a slice or vector of them.
impl<X: Signals, U: Signals, Y: Signals> AsRef<[Experiment<X, U, Y>]> for Experiment<X, U, Y> {
    fn as_ref(&self) -> &[Experiment<X, U, Y>] {
        std::slice::from_ref(self)
    }
}
