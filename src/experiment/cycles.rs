//! What a record consists of: operating cycles, gaps, and how much of each output was measured.

use super::{Experiment, Sample, Time, least};
use crate::model::Model;
use crate::numeral::exact;
use crate::signals::{Of, Signals};
use core::fmt;
use std::ops::Range;

/// A time without samples, inside a record.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gap {
    /// Index of the first sample after it.
    pub sample: usize,
    /// Time of the last sample before it (s).
    pub from: f64,
    /// Time of the first sample after it (s).
    pub to: f64,
}

impl fmt::Display for Gap {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "no sample from {} s to {} s (before sample {})", exact(self.from), exact(self.to), self.sample)
    }
}

/// A step this much longer than the median one is a gap: half way to one lost sample.
const GAP: f64 = 1.5;

impl<X: Signals, U: Signals, Y: Signals> Experiment<X, U, Y> {
    /// The rows of the record.
    pub fn samples<M: Model<State = X, Input = U, Output = Y>>(&self) -> impl ExactSizeIterator<Item = Sample<M>> {
        (0..self.len()).map(|k| Sample { t: self.time(k), u: self.inputs[k], y: self.outputs[k] })
    }

    /// The operating cycles: each run of samples for which `running` holds, if it is at least `shortest` samples long, as
    /// a record of its own, numbered from one.
    ///
    /// ```
    /// # use greybox::{Error, Experiment, Kind, Model, Nothing, Sample, Scalar, Time, signals};
    /// # signals! { pub struct Speed { w: "rad/s" } pub struct Torque { m: "N m" } pub struct Friction { b: "N m s" } }
    /// # struct Bearing;
    /// # impl Model for Bearing {
    /// #     type State = Nothing; type Input = Speed; type Output = Torque; type Parameters = Friction;
    /// #     const KIND: Kind = Kind::Static;
    /// #     fn output<S: Scalar>(&self, _: S, _: &Nothing, u: &Speed<S>, p: &Friction<S>) -> Torque<S> {
    /// #         Torque { m: u.w * p.b }
    /// #     }
    /// # }
    /// # let u = [0.0, 9.0, 8.0, 9.0, 0.0, 9.0, 0.0].map(|w| Speed { w }).to_vec();
    /// # let y = vec![Torque { m: 1.0 }; 7];
    /// # let record = Experiment::new(&Bearing, Time::Uniform { start: 0.0, step: 0.1 }, u, y)?;
    /// let cycles = record.cycles(2, |s: &Sample<Bearing>| s.u.w.abs() > 5.0);
    /// assert_eq!(cycles[0].name(), "record, cycle 1");
    /// # assert_eq!((cycles.len(), cycles[0].len(), cycles[0].time(0)), (1, 3, 0.1));
    /// # Ok::<(), Error>(())
    /// ```
    pub fn cycles<M: Model<State = X, Input = U, Output = Y>>(
        &self,
        shortest: usize,
        mut running: impl FnMut(&Sample<M>) -> bool,
    ) -> Vec<Self> {
        let mut runs = Vec::new();
        let mut begin = None;
        for (k, sample) in self.samples().enumerate() {
            match (running(&sample), begin) {
                (true, None) => begin = Some(k),
                (false, Some(first)) => {
                    runs.push(first..k);
                    begin = None;
                }
                _ => {}
            }
        }
        runs.extend(begin.map(|first| first..self.len()));
        self.pieces(runs, shortest, "cycle")
    }

    /// The pieces between the [`gaps`](Experiment::gaps), each a record of its own, numbered from one; a single sample
    /// between two gaps is dropped.
    pub fn without_gaps(&self) -> Vec<Self> {
        let begins: Vec<usize> = [0].into_iter().chain(self.gaps().iter().map(|gap| gap.sample)).collect();
        let ends = begins.iter().skip(1).copied().chain([self.len()]);
        let runs = begins.iter().zip(ends).map(|(&begin, end)| begin..end).collect();
        self.pieces(runs, 0, "piece")
    }

    /// Where time jumps: a step of more than 1.5 times the median one, so that a sample or more is lost. Over a gap the
    /// input is held as between any two samples, which is seldom what happened.
    pub fn gaps(&self) -> Vec<Gap> {
        let Time::Stamps(stamps) = &self.time else { return Vec::new() };
        let longest = self.sample_time() * GAP;
        let steps = stamps.windows(2).enumerate();
        steps.filter(|(_, t)| t[1] - t[0] > longest).map(|(k, t)| Gap { sample: k + 1, from: t[0], to: t[1] }).collect()
    }

    /// The share of the samples, from 0 to 1, in which each output was measured.
    pub fn coverage(&self) -> Of<Y, f64> {
        let mut measured = Y::array_from_fn(|_| 0);
        for y in &self.outputs {
            for (count, value) in measured.as_mut().iter_mut().zip(Y::into_array(*y)) {
                *count += usize::from(!value.is_nan());
            }
        }
        Y::from_fn(|i| measured.as_ref()[i] as f64 / self.len() as f64)
    }

    fn pieces(&self, runs: Vec<Range<usize>>, shortest: usize, what: &str) -> Vec<Self> {
        let runs = runs.into_iter().filter(|run| run.len() >= shortest.max(least::<X>()));
        runs.enumerate().map(|(i, run)| self.piece(run, format!("{}, {what} {}", self.name, i + 1))).collect()
    }
}
