//! Inputs that follow the measurements of the same sample, as those of a controller do.
//!
//! Each input is regressed on the prediction errors of the same sample, after the inputs and measurements of the samples before. A
//! significant coefficient is the gain of a controller that acts without delay (instantaneous causality: Granger, Econometrica 37 (1969) 424).

use super::*;
use crate::estimate::student::quantile;
use crate::information::{Gathering, Information};
use crate::layout::Layout;
use crate::problem::Problem;
use crate::record::{Channel, Record};
use crate::residuals::first_errors::errors;

/// Samples before that are regressors, too: two tell level and trend of an input.
const BEFORE: usize = 2;
/// Significance level of a gain; one that is not significant counts as zero.
const LEVEL: f64 = 0.01;

/// By how much each input follows the measurement of each output, at the same sample.
pub(crate) struct Feedback {
    /// `gains[input][output]`.
    gains: Vec<Vec<f64>>,
}

impl Feedback {
    /// From the errors of the first records.
    pub fn of(evidence: &Evidence<'_>) -> Self {
        let problem = evidence.point.objective.problem;
        let (inputs, outputs) = (problem.layout().inputs.len(), evidence.point.objective.outputs());
        let controls = 1 + BEFORE * (inputs + outputs);
        let mut found: Vec<Gathering> = (0..inputs).map(|_| Gathering::new(controls + outputs)).collect();
        for (record, errors) in problem.records.iter().zip(&evidence.residuals.first_errors) {
            let rows = (BEFORE..errors[0].len()).map(|k| {
                let now: Vec<f64> = errors.iter().map(|errors| errors[k]).collect();
                (k, [before(record, k), now].concat())
            });
            let rows: Vec<_> = rows.filter(|(_, row)| row.iter().all(|value| value.is_finite())).collect();
            for (found, input) in found.iter_mut().zip(record.inputs.iter()) {
                rows.iter().for_each(|(k, row)| found.take(row, input.values[*k]));
            }
        }
        let gains = |all: Gathering| significant(&all.triangle().eliminate(controls), controls);
        let gains = found.into_iter().map(gains).collect();
        Feedback { gains }
    }

    fn is_fed_back(gains: &[f64]) -> bool {
        gains.iter().any(|gain| *gain != 0.0)
    }

    /// The inputs that are fed back.
    pub fn names(&self, layout: &Layout) -> Vec<String> {
        let inputs = layout.inputs.iter().zip(&self.gains).filter(|(_, gains)| Self::is_fed_back(gains));
        inputs.map(|(input, _)| format!("`{}`", input.name)).collect()
    }

    /// The inputs of a record as they would be after other measurements.
    pub fn inputs(&self, record: &Record, outputs: &[Channel]) -> Vec<Channel> {
        let one = |(input, gains): (&Channel, &Vec<f64>)| {
            let mut values = input.values.to_vec();
            let measured = outputs.iter().zip(record.outputs.iter());
            for ((other, measured), gain) in measured.zip(gains).filter(|(_, gain)| **gain != 0.0) {
                let changes = other.values.iter().zip(measured.values.iter()).map(|(other, measured)| other - measured);
                let changes = values.iter_mut().zip(changes).filter(|(_, change)| change.is_finite());
                changes.for_each(|(value, change)| *value += gain * change);
            }
            input.with(values)
        };
        record.inputs.iter().zip(&self.gains).map(one).collect()
    }

    /// Records with these inputs, and the measurements that the plant would have had with them by the model.
    pub fn outputs(&self, evidence: &Evidence<'_>, with: &[Record]) -> Vec<Record> {
        let problem = evidence.point.objective.problem;
        let records = with.iter().zip(&problem.records);
        let as_measured = records.map(|(with, record)| Record { outputs: record.outputs.clone(), ..with.clone() });
        let driven = Problem { records: as_measured.collect(), ..problem.clone() };
        if !self.gains.iter().any(|gains| Self::is_fed_back(gains)) {
            return driven.records;
        }
        let objective = evidence.point.objective.of(&driven, evidence.point.objective.sweep);
        let respond = |(e, record): (usize, &Record)| {
            let all = |objective| errors(objective, &evidence.point.end.coordinates, e);
            let (before, after) = (all(evidence.point.objective), all(&objective));
            let outputs = record.outputs.iter().zip(before.iter().zip(&after)).map(|(output, (before, after))| {
                let changes = before.iter().zip(after).map(|(before, after)| before - after);
                let changes = changes.map(|change| if change.is_nan() { 0.0 } else { change });
                output
                    .with(output.values.iter().zip(changes).map(|(value, change)| value + change).collect::<Vec<f64>>())
            });
            Record { outputs: outputs.collect(), ..record.clone() }
        };
        driven.records.iter().enumerate().map(respond).collect()
    }
}

/// A constant, and the signals of the samples before this one.
fn before(record: &Record, k: usize) -> Vec<f64> {
    let channels = || record.inputs.iter().chain(record.outputs.iter());
    let at = |lag: usize| channels().map(move |channel| channel.values[k - lag]);
    std::iter::once(1.0).chain((1..=BEFORE).flat_map(at)).collect()
}

/// The solution where it is significant, after so many others were eliminated, and zeros elsewhere.
fn significant(information: &Information, eliminated: usize) -> Vec<f64> {
    let none = vec![0.0; information.columns()];
    let free = information.rows() as f64 - (eliminated + information.columns()) as f64;
    let (Ok(gains), Ok(inverse)) = (information.solve(), information.covariance()) else { return none };
    if free < 1.0 {
        return none;
    }
    let least = quantile(1.0 - 0.5 * LEVEL, free) * (information.residual() / free).sqrt();
    let one = |(i, gain): (usize, &f64)| if gain.abs() > least * inverse[(i, i)].sqrt() { *gain } else { 0.0 };
    gains.iter().enumerate().map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::significant;
    use crate::information::Information;

    /// A hundred rows of a slope of +-10 and errors of +-0.01 orthogonal to it: a standard error of `0.01 / sqrt(100 10^2)`, 1e-4, and
    /// Student's quantile at 99 % with 98 degrees of freedom, 2.63. None is with no degree of freedom.
    #[test]
    fn gains_are_significant_by_their_standard_errors() {
        let of = |gain: f64, rows: usize| {
            let mut information = Information::new(1);
            for k in 0..rows {
                let slope = if k % 2 == 0 { 10.0 } else { -10.0 };
                let error = if k % 4 < 2 { 0.01 } else { -0.01 };
                information.absorb_row(&[slope], gain * slope + error);
            }
            significant(&information, 1)[0]
        };
        for gain in [2.7e-4, -2.7e-4, 0.02] {
            assert!((of(gain, 100) - gain).abs() < 1e-15, "{gain}");
        }
        assert_eq!([2.5e-4, -2.5e-4].map(|gain| of(gain, 100)), [0.0; 2]);
        assert_eq!(of(0.02, 2), 0.0);
    }
}
