//! Filtering without delay, forward and then backward, for records.

use super::{Butterworth, Design, warped};
use crate::error::Error;
use crate::experiment::Experiment;
use crate::record::{Channel, Record, Time};
use crate::signals::Signals;

impl Butterworth {
    /// Filters a whole record in place, forward and then backward: no delay at any frequency, and the gain squared (-6 dB
    /// at the cut-off).
    ///
    /// Missing values (NaN) stay missing, and each piece between them is filtered separately. At both ends a piece is continued by
    /// its point reflection until the filter has settled, or as far as the piece reaches (F. Gustafsson, IEEE Transactions
    /// on Signal Processing 44, 1996, 988-992, section II).
    pub fn zero_phase(&self, values: &mut [f64]) {
        for piece in values.split_mut(|v| v.is_nan()) {
            let (Some(&first), Some(&last)) = (piece.first(), piece.last()) else { continue };
            let padding = self.settling().min(piece.len() - 1);
            let before = piece.iter().skip(1).take(padding).rev().map(|v| 2.0 * first - v);
            let after = piece.iter().rev().skip(1).take(padding).map(|v| 2.0 * last - v);
            let mut extended: Vec<f64> = before.chain(piece.iter().copied()).chain(after).collect();
            for _direction in ["forward", "backward"] {
                let mut state = self.settled(extended.first().copied().unwrap_or(first));
                self.filter_rows(&mut extended, 1, &mut state);
                extended.reverse();
            }
            for (value, filtered) in piece.iter_mut().zip(extended.iter().skip(padding)) {
                *value = *filtered;
            }
        }
    }

    /// Refuses a record whose samples are, in the median, not the filter's sample time apart (to 1 %): its cut-off would be
    /// another.
    pub(crate) fn check(&self, record: &Record) -> Result<(), Error> {
        let (step, found) = (self.design.sample_time, record.sample_time());
        if close(found, step) {
            return Ok(());
        }
        Err(Error::Filter(format!(
            "it is made for samples every {}, but those of experiment `{}` are {} apart; make it for that sample time, or \
             resample the record",
            record.shown(step),
            record.name(),
            record.shown(found)
        )))
    }

    /// Samples until the slowest pole has decayed to 1e-9.
    fn settling(&self) -> usize {
        let Design { order, cutoff, sample_time, .. } = self.design;
        let g = warped(cutoff, sample_time);
        let damping = (core::f64::consts::FRAC_PI_2 / f64::from(order)).sin();
        let modulus_squared = (1.0 - 2.0 * damping * g + g * g) / (1.0 + 2.0 * damping * g + g * g);
        (1e-9f64.ln() / (0.5 * modulus_squared.ln())).ceil() as usize
    }
}

impl<X: Signals, U: Signals, Y: Signals> Experiment<X, U, Y> {
    /// The record with every input and output filtered by [`Butterworth::zero_phase`].
    ///
    /// The same filter on both sides leaves a linear model with constant coefficients as it is, but for what the input does
    /// between samples; where coefficients vary (with speed, say), keep the cut-off well above the variation.
    ///
    /// # Errors
    /// A record whose samples are not the filter's sample time apart (to 1 %).
    pub fn filtered(&self, filter: &Butterworth) -> Result<Self, Error> {
        filtered(self.record(), filter).map(Self::of)
    }
}

/// The same of a record whose signals are known by name.
pub(crate) fn filtered(record: &Record, filter: &Butterworth) -> Result<Record, Error> {
    let step = filter.design.sample_time;
    let other = match record.times() {
        Time::Uniform { step, .. } => Some((0, *step)),
        Time::Stamps(stamps) => stamps.windows(2).map(|w| w[1] - w[0]).enumerate().find(|(_, s)| !close(*s, step)),
    };
    if let Some((sample, found)) = other.filter(|(_, found)| !close(*found, step)) {
        return Err(Error::Filter(format!(
            "it is made for samples every {}, but in experiment `{}` the sample after number {sample} comes {} later; make it \
             for that sample time, or resample the record",
            record.shown(step),
            record.name(),
            record.shown(found)
        )));
    }
    let smooth = |channel: &Channel| {
        let mut values = channel.values.to_vec();
        filter.zero_phase(&mut values);
        channel.with(values)
    };
    let (inputs, outputs) =
        (record.inputs().iter().map(smooth).collect(), record.outputs().iter().map(smooth).collect());
    record.clone().with_channels(inputs, outputs)
}

fn close(found: f64, expected: f64) -> bool {
    (found - expected).abs() <= 0.01 * expected
}
