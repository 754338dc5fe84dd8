//! Motor parameters from a record, after the fact, by linear least squares (thesis 5.2).
//!
//! A record becomes [`Spans`]: per sample interval the currents at both ends, the voltage commanded in between, and the
//! *mean* speed. Misaligned by half a sample, a record at 350 rad/s is wrong by degrees of electrical angle. From spans,
//! [`Spans::plain`] and [`Spans::extended`] make [`Equations`]; these are filtered, weighted and solved.

mod equations;
mod extended;
mod grey_box;
mod mechanics;
mod plain;
mod validate;

pub use equations::Equations;
pub use extended::{Extended, ExtendedWithI0};
pub use plain::{Axes, Form};
pub use validate::Validation;

use super::drive::Log;
use super::{AngledDrive, Currents, Drive, MotorError, PolePairs, SQRT_2_3};
use crate::error::Error;
use crate::experiment::Experiment;
use crate::signals::Signals;
use core::ops::Range;

/// One sample interval of a record.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Span {
    /// Currents at its begin.
    pub i0: Currents,
    /// Currents at its end.
    pub i1: Currents,
    /// Commanded voltage along the flux, in the rotor's frame at mid-interval (V).
    pub ud: f64,
    /// Commanded voltage 90 electrical degrees ahead, likewise (V).
    pub uq: f64,
    /// Mean speed (rad/s, mechanical).
    pub w: f64,
    /// Angle at mid-interval (rad, mechanical).
    pub theta: f64,
    /// By how much the mean current along the flux is below that of a straight line between its ends (A); see [`Spans::bent`].
    pub bend: f64,
}

impl Span {
    /// Mean of the currents at both ends.
    pub fn mean(&self) -> Currents {
        Currents { id: 0.5 * (self.i0.id + self.i1.id), iq: 0.5 * (self.i0.iq + self.i1.iq) }
    }

    /// The input of a motor behind an inverter in this interval.
    pub fn angled(&self) -> AngledDrive {
        AngledDrive { ud: self.ud, uq: self.uq, w: self.w, theta: self.theta }
    }
}

/// Meaning of the speed in a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Speed {
    /// The value at the sample; the mean of an interval is that of its ends.
    AtSample,
    /// The mean over the interval that begins at the sample.
    OverInterval,
}

/// A record, interval by interval.
#[derive(Clone, Debug, PartialEq)]
pub struct Spans {
    /// Sample time (s).
    pub ts: f64,
    /// Pole pairs of the motor.
    pub pole_pairs: PolePairs,
    /// The intervals in order.
    pub spans: Vec<Span>,
}

impl Spans {
    /// The intervals of a drive's log: the speed of an interval is the difference of the angles at its ends.
    pub fn from_log(log: &Log, pole_pairs: PolePairs) -> Spans {
        let spans = log.rows.windows(2).map(|pair| {
            let [a, b] = [pair[0], pair[1]];
            Span {
                i0: Currents { id: a.id, iq: a.iq },
                i1: Currents { id: b.id, iq: b.iq },
                ud: a.ud,
                uq: a.uq,
                w: b.w,
                theta: 0.5 * (a.theta + b.theta),
                bend: 0.0,
            }
        });
        Spans { ts: log.ts, pole_pairs, spans: spans.collect() }
    }

    /// The intervals of a record without angle, which is added up from the speed and starts at `theta` (rad, mechanical;
    /// it matters to the dead time only). The outputs must be there in every sample and the samples evenly spaced.
    ///
    /// # Errors
    /// An output that is missing, samples that are not evenly spaced.
    pub fn from_experiment<X: Signals>(
        experiment: &Experiment<X, Drive, Currents>,
        pole_pairs: PolePairs,
        speed: Speed,
        mut theta: f64,
    ) -> Result<Spans, Error> {
        let ts = experiment.sample_time();
        let inputs: Vec<Drive> = experiment.inputs().collect();
        let outputs: Vec<Currents> = experiment.outputs().collect();
        if let Some(sample) = outputs.iter().position(|y| !(y.id.is_finite() && y.iq.is_finite())) {
            return Err(Error::NotFinite {
                experiment: experiment.name().to_owned(),
                signal: if outputs[sample].id.is_finite() { "iq" } else { "id" }.to_owned(),
                value: f64::NAN,
                sample,
                time: experiment.record().moment(sample),
            });
        }
        let jump = (1..experiment.len()).find(|&k| {
            let step = experiment.time(k) - experiment.time(k - 1);
            (step - ts).abs() > 0.01 * ts
        });
        if let Some(k) = jump {
            return Err(Error::Option(format!(
                "experiment `{}`: the sample time jumps from {ts} s to {} s at sample {k}; cut the record there",
                experiment.name(),
                experiment.time(k) - experiment.time(k - 1)
            )));
        }
        let spans = (1..experiment.len()).map(|k| {
            let (u, next) = (inputs[k - 1], inputs[k]);
            let w = if speed == Speed::AtSample { 0.5 * (u.w + next.w) } else { u.w };
            let middle = theta + 0.5 * w * ts;
            theta += w * ts;
            Span { i0: outputs[k - 1], i1: outputs[k], ud: u.ud, uq: u.uq, w, theta: middle, bend: 0.0 }
        });
        Ok(Spans { ts, pole_pairs, spans: spans.collect() })
    }

    /// The same with the bend of the currents within an interval, for a motor of about this `ke` (V s/rad) and inductance `l`
    /// (H), such as those of the data sheet or of a first estimate.
    ///
    /// The inverter's voltage stands still for an interval while the EMF turns on with the rotor. Seen from the stator, in axes
    /// that stand where the rotor's are at mid-interval, the currents therefore have the second derivative `we E / l` along the
    /// flux, with the EMF's amplitude `E = sqrt(2/3) ke w`: the sample times see a parabola at its ends only, and the mean is below
    /// theirs by `Ts E sin(x) / (6 l)`, `x = we Ts/2`. Axis 5 of the reference robot at 450 rad/s: 0.09 A, beside 0.15 A at which
    /// the dead time turns over.
    ///
    /// # Errors
    /// An inductance that is not positive, a `ke` that is not finite.
    pub fn bent(mut self, ke: f64, l: f64) -> Result<Spans, MotorError> {
        let emf = SQRT_2_3 * MotorError::finite("Ke", ke, "V s/rad")?;
        let l = MotorError::positive("inductance", l, "H")?;
        for span in &mut self.spans {
            let x = 0.5 * self.pole_pairs.electrical(span.w) * self.ts;
            span.bend = self.ts * emf * span.w * x.sin() / (6.0 * l);
        }
        Ok(self)
    }

    /// The intervals whose both ends lie within these samples.
    pub fn cut(&self, samples: Range<usize>) -> Spans {
        let end = samples.end.saturating_sub(1).min(self.spans.len());
        let spans = self.spans.get(samples.start.min(end)..end).unwrap_or_default().to_vec();
        Spans { spans, ..*self }
    }
}
