//! Prediction of a record at given values of its unknowns.

use super::unknowns::names;
use super::{Objective, Problem};
use crate::error::Error;
use crate::record::{Column, Record};
use crate::sweep::RunError;

/// The outputs of one record, predicted.
#[derive(Clone, Debug)]
pub struct Simulated {
    /// Name of each output.
    pub names: Vec<String>,
    /// Predicted outputs, a column each; NaN where there is no prediction.
    pub outputs: Vec<Vec<f64>>,
    /// Measured minus predicted; NaN where either is missing.
    pub residuals: Vec<Vec<f64>>,
    /// Standard deviation that a filter predicts for each residual, in the unit of the output, a column for each output; empty of other predictors.
    pub deviations: Vec<Vec<f64>>,
    /// The state at the first sample.
    pub initial_state: Vec<f64>,
}

impl AsRef<Simulated> for Simulated {
    fn as_ref(&self) -> &Simulated {
        self
    }
}

impl Objective<'_> {
    /// Predicts the outputs of one record.
    pub(crate) fn predict(&self, e: usize, coordinates: &[f64]) -> Result<Simulated, Error> {
        let record = &self.problem.records[e];
        let measured: Vec<&[f64]> = record.outputs().iter().map(|channel| &*channel.values).collect();
        // A filter needs the measurements; otherwise outputs are predicted where nothing was measured, too.
        let filters = self.sweep.predicts_variance();
        let compared = if filters { self.problem.clone() } else { self.problem.against_zero() };
        let objective = self.of(&compared, self.sweep);
        let mut outputs = vec![vec![f64::NAN; record.len()]; measured.len()];
        let mut deviations = if filters { outputs.clone() } else { vec![] };
        let mut failed = None;
        let result = objective.run_alone(e, coordinates, false, &mut |window| {
            for k in 0..window.samples[0] {
                for (j, output) in outputs.iter_mut().enumerate() {
                    if window.is_measured(k, j, 0) {
                        let at = window.begin[0] + k;
                        if let Some(deviations) = deviations.get_mut(j) {
                            deviations[at] = window.variance(k, j, 0).sqrt();
                        }
                        output[at] = if filters { measured[j][at] } else { 0.0 } - window.error(k, j, 0);
                        if !output[at].is_finite() {
                            failed = Some(at);
                            return false;
                        }
                    }
                }
            }
            true
        });
        let failed = match result {
            Err(RunError::Failed { sample }) => Some(sample),
            _ => failed,
        };
        if let Some(sample) = failed {
            return Err(Error::Simulation(self.locate(e, coordinates, sample)));
        }
        let residual = |(measured, predicted): (&&[f64], &Vec<f64>)| {
            measured.iter().zip(predicted).map(|(y, predicted)| y - predicted).collect()
        };
        let residuals = measured.iter().zip(&outputs).map(residual).collect();
        let initial_state = self.values_of(e, coordinates).x;
        let names = names(&self.problem.layout().outputs);
        Ok(Simulated { names, outputs, residuals, deviations, initial_state })
    }
}

impl Problem<'_> {
    /// A problem with outputs that were measured as zero throughout.
    pub(crate) fn against_zero(&self) -> Self {
        let zero = |record: &Record| {
            let zeros = Column::from(vec![0.0; record.len()]);
            let outputs = record.outputs.iter().map(|channel| channel.with(zeros.clone())).collect();
            Record { outputs, ..record.clone() }
        };
        Problem { records: self.records.iter().map(zero).collect(), ..self.clone() }
    }
}
