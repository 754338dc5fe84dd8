//! How the measured outputs of records move: range, noise and rate of change.

use crate::problem::Problem;
use crate::record::{Channel, Record};

/// The least noise of an output, as a part of half its range.
pub(super) const LEAST_NOISE: f64 = 1e-6;
/// The least noise of an output that errors of a model are compared with, as a part of half its range.
const LEAST_ERROR: f64 = 0.01;
/// Errors are near the noise where their root mean square is at most so many times the noise.
pub(super) const EXPLAINS: f64 = 1.5;
/// Errors above this part of half the range explain nothing of an output.
pub(super) const UNEXPLAINED: f64 = 0.5;
/// Predictions are near the measurements where their error is at most so many times the noise. If those from the start are not, the first memory is
/// shorter.
pub(super) const NEAR: f64 = 5.0;

/// The outputs of all records.
pub(super) struct Movement {
    pub outputs: Vec<Moves>,
    /// The record in which they move the most, by parts of their ranges.
    pub most: usize,
    /// The mean interval of its samples (s).
    pub step: f64,
    /// How fast the outputs change: by half their range in the time `1 / rate` (1/s).
    pub rate: f64,
}

impl Problem<'_> {
    /// How the outputs move, of a simulation of a model with states.
    ///
    /// # Errors
    /// Why fits of parts of its records lead nowhere: its state is corrected as it is, or no output moves.
    pub(super) fn movement(&self) -> Result<Movement, &'static str> {
        let layout = self.layout();
        if self.sweep.predicts_variance() || self.sweep.restarts().is_some() {
            return Err("the predictor corrects the state by itself");
        }
        if layout.states.is_empty() {
            return Err("the model has no state");
        }
        if self.settings.prefilter.is_some() {
            return Err("the errors are filtered");
        }
        let moves = |j: usize| Moves::of(self.records.iter().map(|record| (record, &record.outputs()[j])));
        let outputs: Vec<Moves> = (0..layout.outputs.len()).map(moves).collect();
        let rate = outputs.iter().map(|moves| moves.rate).fold(0.0, f64::max);
        let moved = |record: &Record| -> f64 {
            let parts = outputs.iter().zip(record.outputs()).filter(|(moves, _)| moves.half > 0.0);
            parts.map(|(moves, channel)| range(&channel.values) / moves.half).sum()
        };
        // Of records that move alike, the first one.
        let all = self.records.iter().map(moved).enumerate().rev();
        let most = all.max_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(e, _)| e);
        let record = self.records.get(most).filter(|record| record.len() > 1);
        let step = record.map_or(0.0, |one| (one.time(one.len() - 1) - one.time(0)) / (one.len() - 1) as f64);
        if !(rate > 0.0 && rate.is_finite() && step > 0.0) {
            return Err("no output moves");
        }
        Ok(Movement { outputs, most, step, rate })
    }
}

/// The range of what was measured.
fn range(values: &[f64]) -> f64 {
    let measured = values.iter().filter(|y| y.is_finite());
    let ends = measured.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), y| (a.min(*y), b.max(*y)));
    (ends.1 - ends.0).max(0.0)
}

/// Range, noise and rate of change of an output, from its measured samples in all records.
pub(super) struct Moves {
    /// Half its range, in its unit.
    pub half: f64,
    /// Standard deviation of its noise, from second differences, in which slow changes nearly cancel; at least a small part of `half`.
    pub noise: f64,
    /// It changes by `half` in the time `1 / rate` (1/s); 0 where it does not move.
    pub rate: f64,
}

impl Moves {
    /// The noise that errors of a model are compared with.
    pub fn level(&self) -> f64 {
        self.noise.max(LEAST_ERROR * self.half)
    }

    pub fn of<'r>(channels: impl Iterator<Item = (&'r Record, &'r Channel)>) -> Self {
        let measured = |(record, channel): (&Record, &Channel)| -> (Vec<f64>, f64) {
            let samples: Vec<usize> = (0..record.len()).filter(|&k| channel.values[k].is_finite()).collect();
            let ends = samples.first().zip(samples.last());
            let length = ends.map_or(0.0, |(first, last)| record.time(*last) - record.time(*first));
            (samples.into_iter().map(|k| channel.values[k]).collect(), length)
        };
        let all: Vec<(Vec<f64>, f64)> = channels.map(measured).collect();
        let half = 0.5 * all.iter().map(|(values, _)| range(values)).fold(0.0, f64::max);
        let mean_square = |differences: &mut dyn Iterator<Item = f64>| {
            let (sum, count) = differences.fold((0.0, 0.0), |(sum, count), d| (sum + d * d, count + 1.0));
            if count > 0.0 { sum / count } else { 0.0 }
        };
        let mut second = all.iter().flat_map(|(values, _)| values.windows(3).map(|y| y[0] - 2.0 * y[1] + y[2]));
        // A sum of independent errors with weights 1, -2 and 1 has six times their variance.
        let noise = (mean_square(&mut second) / 6.0).sqrt().max(LEAST_NOISE * half);
        // The record in which it moves the most, by lags that double.
        let most = all.iter().max_by(|a, b| range(&a.0).total_cmp(&range(&b.0)));
        let rate =
            most.filter(|(values, length)| half > 0.0 && values.len() > 1 && *length > 0.0).map(|(values, length)| {
                let interval = length / (values.len() - 1) as f64;
                let lags = std::iter::successors(Some(1), |lag| Some(2 * lag)).take_while(|lag| *lag < values.len());
                let far = |lag: &usize| {
                    let mut differences = values.iter().zip(&values[*lag..]).map(|(a, b)| b - a);
                    mean_square(&mut differences) >= 0.25 * half * half
                };
                lags.into_iter().find(far).map_or(length.recip(), |lag| 0.5 / (lag as f64 * interval))
            });
        Moves { half, noise, rate: rate.unwrap_or(0.0) }
    }
}
