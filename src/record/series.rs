//! [`Series`]: signals that have instants of their own become one record.

use super::{Channel, Holds, Record, Time};
use crate::error::Error;
use crate::interval::Hold;
use crate::layout::{Layout, Quantity};
use std::ops::Range;

/// Two instants closer than this part of the shortest usual step are one: `3 * 0.1` is not `0.3` in binary.
const SAME: f64 = 1e-6;

/// A signal with sample times of its own, such as a channel of a logger whose channels differ in rate: times (s) that do not decrease, and a value in the
/// unit of the signal at each. Between its samples an input is held ([`Hold::Zero`]) unless [`hold`](Series::hold) says otherwise; an output is missing.
#[derive(Clone, Debug)]
pub struct Series {
    times: Vec<f64>,
    values: Vec<f64>,
    hold: Hold,
}

impl Series {
    /// Values at these times (s).
    pub fn new(times: Vec<f64>, values: Vec<f64>) -> Self {
        Series { times, values, hold: Hold::default() }
    }

    /// Says how an input behaves between its samples; of an output it has no effect.
    pub fn hold(self, hold: Hold) -> Self {
        Series { hold, ..self }
    }

    /// Refuses other numbers of times than of values, none, and times that are not finite or decrease.
    fn check(&self, name: &str) -> Result<(), Error> {
        let experiment = "record".to_owned();
        if self.times.len() != self.values.len() {
            let (what, reference) = (format!("`{name}`"), format!("the times of `{name}`"));
            let (found, expected) = (self.values.len(), self.times.len());
            return Err(Error::Lengths { experiment, what, found, reference, expected });
        }
        if self.times.is_empty() {
            return Err(Error::Option(format!("experiment `{experiment}`: `{name}` has no sample")));
        }
        if let Some(sample) = self.times.iter().position(|time| !time.is_finite()) {
            let (signal, value) = (format!("time of `{name}`"), self.times[sample]);
            return Err(Error::NotFinite { experiment, signal, value, sample, time: value.into() });
        }
        match (1..self.times.len()).find(|k| self.times[*k] < self.times[k - 1]) {
            Some(sample) => {
                let (before, time) = (self.times[sample - 1].into(), self.times[sample].into());
                Err(Error::TimeOrder { experiment, sample, before, time })
            }
            None => Ok(()),
        }
    }

    /// The values at the instants, NaN at others; at an instant that several samples have, one after the other.
    fn at(&self, instants: &[f64], same: f64) -> Vec<f64> {
        let mut own = self.times.iter().zip(&self.values).peekable();
        let value = |instant: &f64| {
            let here = own.next_if(|(time, _)| **time <= instant + same);
            here.map_or(f64::NAN, |(_, value)| *value)
        };
        instants.iter().map(value).collect()
    }
}

impl Record {
    /// A record of signals with sample times of their own: the inputs and outputs of a layout, in its order. It has a sample at each time of any of
    /// them, from the first at which every input has had one. Where a signal was not sampled, an output is missing (NaN), and an input is filled in by its
    /// hold. A held input keeps its last value to the end of the record; with an input of straight lines ([`Hold::First`]) the record ends at that input's
    /// last sample. Samples outside are left out.
    ///
    /// # Errors
    /// Another number of signals than the layout has; a signal without samples, with times that are not finite or decrease, or with an input that is
    /// not finite; no instant at which all inputs are known.
    pub fn from_series(layout: &Layout, inputs: Vec<Series>, outputs: Vec<Series>) -> Result<Self, Error> {
        for (found, expected, what) in
            [(inputs.len(), layout.inputs.len(), "input"), (outputs.len(), layout.outputs.len(), "output")]
        {
            if found != expected {
                return Err(Error::Option(format!("{found} series for the {expected} {what}(s) of the model")));
            }
        }
        let all = || layout.inputs.iter().zip(&inputs).chain(layout.outputs.iter().zip(&outputs));
        all().try_for_each(|(signal, series)| series.check(&signal.name))?;
        for (signal, series) in layout.inputs.iter().zip(&inputs) {
            if let Some(sample) = series.values.iter().position(|value| !value.is_finite()) {
                let (experiment, signal, value) = ("record".to_owned(), signal.name.clone(), series.values[sample]);
                return Err(Error::NotFinite { experiment, signal, value, sample, time: series.times[sample].into() });
            }
        }
        let usual = |series: &Series| Time::Stamps(series.times.clone()).median_step();
        let shortest = all().map(|(_, series)| usual(series)).filter(|step| *step > 0.0).fold(f64::INFINITY, f64::min);
        let same = if shortest.is_finite() { SAME * shortest } else { 0.0 };
        let instants = instants(&all().map(|(_, series)| &series.times[..]).collect::<Vec<_>>(), same);
        let channel = |(signal, series): (&Quantity, &Series)| {
            Channel::new(&signal.name, &signal.unit, series.at(&instants, same))
        };
        let all: Vec<Channel> = all().map(channel).collect();
        let (of_inputs, of_outputs) = all.split_at(inputs.len());
        let fills: Vec<Option<Hold>> = inputs.iter().map(|series| Some(series.hold)).collect();
        let filled = Filled::new(&Time::Stamps(instants.clone()), instants.len(), of_inputs, &fills);
        let outputs = of_outputs.iter().map(|channel| channel.part(filled.range.clone())).collect();
        let time = Time::from_stamps(instants[filled.range].to_vec());
        let holds = Holds::each(inputs.iter().map(|series| series.hold).collect());
        Ok(Record { holds, ..Record::new(layout.states.clone(), time, filled.inputs, outputs)? })
    }
}

/// The times of all signals in order. One that a signal has several times (repeated measurements) stands as often.
fn instants(all: &[&[f64]], same: f64) -> Vec<f64> {
    let mut places = vec![0; all.len()];
    let mut found = vec![];
    loop {
        let next =
            all.iter().zip(&places).filter_map(|(times, at)| times.get(*at)).copied().fold(f64::INFINITY, f64::min);
        if next == f64::INFINITY {
            return found;
        }
        let mut most = 0;
        for (times, at) in all.iter().zip(&mut places) {
            let here = times[*at..].iter().take_while(|time| **time <= next + same).count();
            (most, *at) = (most.max(here), *at + here);
        }
        found.extend(std::iter::repeat_n(next, most));
    }
}

/// Inputs that were filled in where they were not sampled.
pub(super) struct Filled {
    /// The inputs, of the samples at which all are known.
    pub inputs: Vec<Channel>,
    /// These samples.
    pub range: Range<usize>,
    /// How many numbers there were, of each input that is filled in.
    #[cfg_attr(not(feature = "csv"), allow(dead_code, reason = "files say it"))]
    pub given: Vec<(String, usize)>,
}

impl Filled {
    /// Fills in the inputs that have a hold where they are NaN.
    pub fn new(time: &Time, samples: usize, inputs: &[Channel], holds: &[Option<Hold>]) -> Self {
        let (mut range, mut given) = (0..samples, vec![]);
        let filled = |(channel, hold): (&Channel, &Option<Hold>)| {
            let Some(hold) = hold else { return channel.clone() };
            let mut values = channel.values.to_vec();
            given.push((channel.name.clone(), values.iter().filter(|value| !value.is_nan()).count()));
            let known = fill(&mut values, *hold, |k| time.at(k));
            range = range.start.max(known.start)..range.end.min(known.end);
            channel.with(values)
        };
        let whole: Vec<Channel> = inputs.iter().zip(holds).map(filled).collect();
        range.end = range.end.max(range.start);
        Filled { inputs: whole.iter().map(|channel| channel.part(range.clone())).collect(), range, given }
    }
}

/// Fills in a signal where it is NaN, and returns the range of samples in which it is known: from its first number on; up to its last one if it is a
/// straight line between numbers, else to the end.
fn fill(values: &mut [f64], hold: Hold, time: impl Fn(usize) -> f64) -> Range<usize> {
    // At one instant a signal has one value.
    let mut begin = 0;
    while begin < values.len() {
        let end = (begin..values.len()).find(|k| time(*k) > time(begin)).unwrap_or(values.len());
        let instant = &mut values[begin..end];
        if let Some(given) = instant.iter().copied().find(|value| !value.is_nan()) {
            instant.iter_mut().filter(|value| value.is_nan()).for_each(|value| *value = given);
        }
        begin = end;
    }
    let known: Vec<usize> = (0..values.len()).filter(|k| !values[*k].is_nan()).collect();
    let (Some(first), Some(last)) = (known.first(), known.last()) else { return 0..0 };
    for pair in known.windows(2) {
        let (a, b) = (pair[0], pair[1]);
        for k in a + 1..b {
            values[k] = match hold {
                Hold::Zero => values[a],
                Hold::First => values[a] + (values[b] - values[a]) * ((time(k) - time(a)) / (time(b) - time(a))),
            };
        }
    }
    match hold {
        Hold::Zero => {
            let held = values[*last];
            values[last + 1..].fill(held);
            *first..values.len()
        }
        Hold::First => *first..last + 1,
    }
}
