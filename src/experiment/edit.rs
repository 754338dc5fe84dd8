//! Cutting, joining and thinning experiments. A piece keeps the hold. What was given of the initial state holds at the first
//! sample of the whole record: a piece that begins later has its initial state estimated.

use super::{Experiment, Sample};
use crate::error::Error;
use crate::model::Model;
use crate::record::{Gap, Inspection};
use crate::signals::{Of, Signals};
use std::ops::RangeBounds;

impl<X: Signals, U: Signals, Y: Signals> Experiment<X, U, Y> {
    /// The samples of a range, by index from zero: `record.slice(1000..)`.
    ///
    /// # Errors
    /// A range that the record does not have, or too few samples in it.
    pub fn slice(&self, samples: impl RangeBounds<usize>) -> Result<Self, Error> {
        self.record.slice(samples).map(Self::of)
    }

    /// The samples of a range of time (s): `record.between(2.0..5.0)`. A sample at the begin belongs to it, one at the end
    /// only if the range is written with `..=`.
    ///
    /// # Errors
    /// A bound that is not a number, or too few samples between them.
    pub fn between(&self, seconds: impl RangeBounds<f64>) -> Result<Self, Error> {
        self.record.between(seconds).map(Self::of)
    }

    /// Two pieces, the first with `fraction` (0 to 1) of the samples: to fit on and to validate on.
    ///
    /// # Errors
    /// A fraction outside 0 to 1, or one that leaves too few samples on a side.
    pub fn split(&self, fraction: f64) -> Result<(Self, Self), Error> {
        self.record.split(fraction).map(|(a, b)| (Self::of(a), Self::of(b)))
    }

    /// Two pieces, the second beginning with the first sample at or after `time` (s).
    ///
    /// # Errors
    /// A time that is not a number, or that leaves too few samples on a side.
    pub fn split_at(&self, time: f64) -> Result<(Self, Self), Error> {
        self.record.split_at(time).map(|(a, b)| (Self::of(a), Self::of(b)))
    }

    /// This record and one that follows it, as one. Between them the input is held as between any two samples; name and
    /// initial state are those of the first.
    ///
    /// # Errors
    /// A second record that begins before the first has ended, or with another hold.
    pub fn join(self, later: &Self) -> Result<Self, Error> {
        self.record.join(&later.record).map(Self::of)
    }

    /// Every `n`-th sample, from the first.
    ///
    /// A held input ([`Hold::Zero`](crate::Hold::Zero)) becomes its mean, weighted by time, over what is thinned out: the integral of the
    /// input over each interval stays what it was, and the state follows it up to the second order in the interval. An
    /// input between straight lines ([`Hold::First`](crate::Hold::First)) and the outputs are instants, and stay those of the samples kept.
    ///
    /// Nothing is filtered. White noise on an output stays as large as it was, so that thinning loses information and
    /// gains speed; it biases nothing. What varies faster than the new samples can follow is another matter: in an input
    /// the model never sees it, and an output that depends on the input at once (a feed-through) sees the mean. Choose `n`
    /// small against the fastest time constant. An output that is measured only now and then may be lost altogether:
    /// [`coverage`](Experiment::coverage) tells. Not for models of which each sample is
    /// a step: discrete ones, and those whose samples change states ([`Model::jump`](crate::Model::jump)).
    ///
    /// # Errors
    /// `n` of zero, or too few samples left.
    pub fn decimate(&self, n: usize) -> Result<Self, Error> {
        self.record.decimate(n).map(Self::of)
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
        let at = |k| Sample { t: self.time(k), u: self.input(k), y: self.output(k) };
        self.record.cycles(shortest, |k| running(&at(k))).into_iter().map(Self::of).collect()
    }

    /// The pieces between the [`gaps`](Experiment::gaps), each a record of its own, numbered from one; a single sample
    /// between two gaps is dropped.
    pub fn without_gaps(&self) -> Vec<Self> {
        self.record.without_gaps().into_iter().map(Self::of).collect()
    }

    /// Where time jumps: in even sampling a step of more than 1.5 times the median one, so that a sample or more is lost;
    /// in uneven sampling a step far beyond the spread of the others. Over a gap the input is held as between any two
    /// samples, which is seldom what happened.
    pub fn gaps(&self) -> Vec<Gap> {
        self.record.gaps()
    }

    /// Inspection of the columns, independent of the model: constant, clipped, frozen or repeated values, sentinels, few levels, missing
    /// measurements. Every fit looks for them, too, and warns of those that its errors confirm.
    pub fn inspect(&self) -> Inspection {
        self.record.inspect()
    }

    /// The share of the samples, from 0 to 1, in which each output was measured.
    pub fn coverage(&self) -> Of<Y, f64> {
        let coverage = self.record.coverage();
        Y::from_fn(|j| coverage[j])
    }
}
