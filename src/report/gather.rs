//! From an estimate and its problem to a [`Report`].

use super::trace::{COLUMNS, Rows};
use super::{Declared, Figures, Format, Histogram, Output, OutputFit, Record, Report, Role, Signal, Trace, words};
use crate::diagnose::residuals::{self, Residuals};
use crate::diagnose::{self, Widths};
use crate::error::Error;
use crate::estimate::{ParameterEstimate, Summary};
use crate::judge::output_fit as output_fit_of;
use crate::problem::{Problem, Simulated};
use crate::record::{Channel, Record as Measured};

/// So many pictures of records a reader will look at; of more, the worst are drawn.
const DRAWN: usize = 12;
/// Samples of a closeup.
const CLOSE: usize = 400;
/// The probability with which bands hold a measurement.
const BAND: f64 = 0.95;

impl Report {
    /// The report of an estimate and of its problem, with the diagnoses that cost little: tests of the residuals,
    /// identifiability, and predictions with 95 % bands (none with a pre-filter, whose noise is not that of the
    /// measurement). They take some six passes over the data.
    ///
    /// # Errors
    /// An estimate of another problem; a prediction that fails or is not finite.
    pub fn new(problem: &Problem<'_>, estimate: &Summary) -> Result<Report, Error> {
        let identifiability = diagnose::identifiability(problem, estimate)?;
        let (objective, best) = problem.at(estimate)?;
        let mut records = vec![];
        for (e, record) in problem.records().iter().enumerate() {
            let prediction = objective.predict(e, &best)?;
            let widths = match problem.settings.prefilter {
                Some(_) => None,
                None => Some(diagnose::widths(&objective, &best, estimate, e, BAND)?),
            };
            let name = &estimate.experiments[e].name;
            records.push(summary(name, record, &prediction, widths.as_ref())?);
        }
        thin(&mut records, estimate.outputs.len());
        let reworded = |warning| diagnose::reworded(warning, &estimate.directions, &estimate.unknowns);
        let report = Report {
            format: Format,
            title: "Parameter estimation".to_owned(),
            severity: estimate.severity(),
            outcome: estimate.outcome,
            warnings: estimate.warnings.iter().map(reworded).collect(),
            unknowns: estimate.unknowns.clone(),
            declared: estimate.parameters.iter().map(declared).collect(),
            correlation: estimate.correlation(&(0..estimate.unknowns.len()).collect::<Vec<usize>>()),
            directions: estimate.directions.clone(),
            outputs: estimate
                .outputs
                .iter()
                .map(|output| Output { name: output.name.clone(), unit: output.unit.clone(), quality: output.fit })
                .collect(),
            records,
            identifiability,
            profiles: vec![],
            bootstrap: None,
            restarts: None,
            findings: vec![],
            figures: Figures {
                cost: estimate.cost,
                measurements: estimate.measurements,
                degrees_of_freedom: estimate.degrees_of_freedom(),
                deviance: estimate.deviance,
                aic: estimate.aic(),
                aicc: estimate.aicc(),
                bic: estimate.bic(),
                fpe: estimate.fpe(),
                iterations: estimate.iterations,
                evaluations: estimate.evaluations,
                seconds: estimate.seconds,
            },
            method: estimate.method.clone(),
        };
        let tested = words::failed(&report).map_or(report.severity, |(severity, _)| severity);
        Ok(Report { severity: report.severity.max(tested), ..report })
    }
}

fn declared(parameter: &ParameterEstimate) -> Declared {
    let ParameterEstimate { name, unit, declared, .. } = parameter.clone();
    Declared { name, unit, parameter: declared }
}

fn summary(name: &str, record: &Measured, prediction: &Simulated, widths: Option<&Widths>) -> Result<Record, Error> {
    let inputs = record.inputs().iter().map(|channel| signal(channel, Role::Input));
    let outputs = record.outputs().iter().map(|channel| signal(channel, Role::Output));
    let examined = residuals::examine(prediction, record)?.into_iter().enumerate();
    Ok(Record {
        name: name.to_owned(),
        samples: record.len() as u64,
        begin: record.time(0),
        end: record.time(record.len().saturating_sub(1)),
        sample_time: record.sample_time(),
        gaps: record.gaps().len() as u64,
        signals: inputs.chain(outputs).collect(),
        fits: examined.map(|(j, residuals)| output_fit(record, prediction, widths, residuals, j)).collect(),
    })
}

fn signal(channel: &Channel, role: Role) -> Signal {
    let (name, unit, values) = (channel.name.clone(), channel.unit.clone(), &*channel.values);
    let measured = || values.iter().copied().filter(|value| !value.is_nan());
    let count = measured().count();
    Signal {
        name,
        unit,
        role,
        missing: (values.len() - count) as u64,
        min: measured().reduce(f64::min),
        mean: (count > 0).then(|| measured().sum::<f64>() / count as f64),
        max: measured().reduce(f64::max),
    }
}

fn output_fit(
    record: &Measured,
    prediction: &Simulated,
    widths: Option<&Widths>,
    examined: Residuals,
    j: usize,
) -> OutputFit {
    let channel = &record.outputs()[j];
    let (measured, predicted, residuals) = (&*channel.values, &prediction.outputs[j], &prediction.residuals[j]);
    let width = |column: fn(&Widths) -> &Vec<Vec<f64>>| widths.map_or(&[][..], |widths| &column(widths)[j]);
    let (confidence, prediction) = (width(|widths| &widths.confidence), width(|widths| &widths.prediction));
    let t: Vec<f64> = (0..record.len()).map(|k| record.time(k)).collect();
    let rows = Rows { t: &t, measured, predicted, confidence, prediction };
    let overview = Trace::new(&rows, 0..measured.len(), COLUMNS);
    let largest = largest(residuals);
    let closeup = largest.filter(|_| overview.samples_per_column > 1).map(|worst| {
        let begin = worst.saturating_sub(CLOSE / 2).min(measured.len().saturating_sub(CLOSE));
        Trace::new(&rows, begin..(begin + CLOSE).min(measured.len()), CLOSE)
    });
    OutputFit {
        name: channel.name.clone(),
        unit: channel.unit.clone(),
        fit_percent: output_fit_of(measured, residuals).fit_percent,
        unpredicted: predicted.iter().filter(|value| !value.is_finite()).count() as u64,
        residuals: examined,
        largest: largest.map_or(0.0, |k| residuals[k]),
        largest_at: record.time(largest.unwrap_or(0)),
        histogram: Histogram::new(residuals),
        overview: Some(overview),
        closeup,
    }
}

/// Index of the largest residual in size.
fn largest(residuals: &[f64]) -> Option<usize> {
    let finite = residuals.iter().enumerate().filter(|(_, e)| e.is_finite());
    finite.max_by(|a, b| a.1.abs().total_cmp(&b.1.abs())).map(|(k, _)| k)
}

/// Keeps the drawings of the records that are reproduced worst.
fn thin(records: &mut [Record], outputs: usize) {
    let keep = (DRAWN / outputs.max(1)).max(1);
    let worst = |record: &Record| record.fits.iter().filter_map(|fit| fit.fit_percent).fold(f64::INFINITY, f64::min);
    let mut order: Vec<usize> = (0..records.len()).collect();
    order.sort_by(|&a, &b| worst(&records[a]).total_cmp(&worst(&records[b])));
    for &record in order.iter().skip(keep) {
        for fit in &mut records[record].fits {
            (fit.overview, fit.closeup) = (None, None);
        }
    }
}
