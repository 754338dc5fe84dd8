//! [`Experiment`]: a measured record, valid by construction.

use crate::error::Error;
use crate::interval::{Hold, Interval};
use crate::model::Model;
use crate::parameter::Parameter;
use crate::scalar::Scalar;
use crate::signals::{Of, Signals};
use serde::{Deserialize, Serialize};

/// When the samples were taken (s).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Time {
    /// `start + k * step`.
    Uniform {
        /// Time of the first sample (s).
        start: f64,
        /// From sample to sample (s).
        step: f64,
    },
    /// One stamp per sample, increasing.
    Stamps(Vec<f64>),
}

impl Time {
    /// Time of sample `k` (s); not a number beyond the last stamp.
    #[inline(always)]
    pub fn at(&self, k: usize) -> f64 {
        match self {
            Time::Uniform { start, step } => start + k as f64 * step,
            Time::Stamps(stamps) => stamps.get(k).copied().unwrap_or(f64::NAN),
        }
    }
}

/// What is known of the state at the first sample.
#[derive(Clone, Copy, Debug)]
pub enum Initial<X: Signals> {
    /// It is estimated, starting from what the first sample says.
    Estimated,
    /// It is what the first sample says, taken as exact.
    FirstSample,
    /// Guess, bounds and prior of each state.
    Given(Of<X, Parameter>),
}

/// One measured record of inputs `U` and outputs `Y`, and what is known of the state `X` at its first sample.
///
/// Time increases, inputs are finite, lengths agree; an output that was not measured is `NaN`. Without a further word the
/// input is held from sample to sample, and the initial state is estimated from a start that the first sample gives.
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
        let experiment = || self.name.clone();
        if self.outputs.len() != samples {
            let (what, found, reference) = ("the output", self.outputs.len(), "the input");
            return Err(Error::Lengths { experiment: experiment(), what, found, reference, expected: samples });
        }
        match &self.time {
            Time::Uniform { start, step } => {
                if !start.is_finite() {
                    let signal = "t".to_owned();
                    return Err(Error::NotFinite {
                        experiment: experiment(),
                        signal,
                        value: *start,
                        sample: 0,
                        time: *start,
                    });
                }
                if !(*step > 0.0 && step.is_finite()) {
                    return Err(Error::NotPositive {
                        what: format!("experiment `{}`: the sample time", self.name),
                        value: *step,
                    });
                }
            }
            Time::Stamps(stamps) => {
                if stamps.len() != samples {
                    let (what, found, reference) = ("time", stamps.len(), "the input");
                    return Err(Error::Lengths { experiment: experiment(), what, found, reference, expected: samples });
                }
                if let Some((sample, &value)) = stamps.iter().enumerate().find(|(_, t)| !t.is_finite()) {
                    let signal = "t".to_owned();
                    return Err(Error::NotFinite { experiment: experiment(), signal, value, sample, time: value });
                }
                if let Some(k) = stamps.windows(2).position(|w| w[1] <= w[0]) {
                    let (before, time) = (stamps[k], stamps[k + 1]);
                    return Err(Error::TimeOrder { experiment: experiment(), sample: k + 1, before, time });
                }
            }
        }
        let needed = if X::LEN == 0 { 1 } else { 2 };
        if samples < needed {
            return Err(Error::TooFewSamples { experiment: experiment(), samples, needed, purpose: "for a fit" });
        }
        for k in 0..samples {
            let inputs = U::into_array(self.inputs[k]);
            if let Some(i) = inputs.as_ref().iter().position(|v| !v.is_finite()) {
                let (signal, value) = (U::NAMES[i].to_owned(), inputs.as_ref()[i]);
                return Err(Error::NotFinite {
                    experiment: experiment(),
                    signal,
                    value,
                    sample: k,
                    time: self.time(k),
                });
            }
            let outputs = Y::into_array(self.outputs[k]);
            if let Some(j) = outputs.as_ref().iter().position(|v| v.is_infinite()) {
                let (signal, value) = (Y::NAMES[j].to_owned(), outputs.as_ref()[j]);
                return Err(Error::NotFinite {
                    experiment: experiment(),
                    signal,
                    value,
                    sample: k,
                    time: self.time(k),
                });
            }
        }
        Ok(self)
    }

    /// What happens from sample `k` to the next.
    #[inline(always)]
    pub(crate) fn interval(&self, k: usize) -> Interval<U> {
        let u1 = if self.hold == Hold::First { self.inputs[k + 1] } else { self.inputs[k] };
        Interval { t0: self.time(k), t1: self.time(k + 1), u0: self.inputs[k], u1, hold: self.hold }
    }
}

impl<X: Signals, U: Signals, Y: Signals> AsRef<[Experiment<X, U, Y>]> for Experiment<X, U, Y> {
    fn as_ref(&self) -> &[Experiment<X, U, Y>] {
        std::slice::from_ref(self)
    }
}
