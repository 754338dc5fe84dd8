//! From an estimate and its records to a [`Report`].

use super::residuals::largest;
use super::trace::{COLUMNS, Rows};
use super::{Declared, Figures, Format, Output, OutputFit, Record, Report, Residuals, Role, Signal, Trace, words};
use crate::error::Error;
use crate::estimate::{Estimate, Prediction, Warning};
use crate::experiment::ExperimentOf;
use crate::integrate::Integrator;
use crate::model::Model;
use crate::predict::Predictor;
use crate::signals::{Of, Signals};

/// So many pictures of records a reader will look at; of more, the worst are drawn.
const DRAWN: usize = 12;
/// Samples of a closeup.
const CLOSE: usize = 400;

impl Report {
    /// The report of an estimate on the records it was fitted to, in their order.
    ///
    /// # Errors
    /// Records that are not those of the fit; a prediction that fails.
    pub fn new<M: Model, I: Integrator<M>, P: Predictor<M>, R: AsRef<[ExperimentOf<M>]> + ?Sized>(
        model: &M,
        estimate: &Estimate<M, I, P>,
        records: &R,
    ) -> Result<Report, Error> {
        let records = records.as_ref();
        check(estimate, records)?;
        let mut summaries = vec![];
        for (e, record) in records.iter().enumerate() {
            if let Some(prediction) = estimate.predict_own(model, record, e) {
                summaries.push(summary::<M>(record, &prediction?));
            }
        }
        thin(&mut summaries, M::Output::LEN);
        let quality = M::Output::into_array(estimate.quality);
        let declared = M::Parameters::into_array(estimate.declared);
        Ok(Report {
            format: Format,
            title: "Parameter estimation".to_owned(),
            severity: estimate.severity(),
            outcome: estimate.outcome,
            warnings: estimate.warnings.iter().map(|warning| reworded(warning, estimate)).collect(),
            unknowns: estimate.unknowns.clone(),
            declared: named::<M::Parameters>()
                .zip(declared)
                .map(|((name, unit), parameter)| Declared { name, unit, parameter })
                .collect(),
            correlation: estimate.correlation(),
            directions: estimate.directions.clone(),
            outputs: named::<M::Output>()
                .zip(quality)
                .map(|((name, unit), quality)| Output { name, unit, quality })
                .collect(),
            records: summaries,
            findings: vec![],
            profiles: vec![],
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
        })
    }
}

/// A warning about a direction says in a report what kind of direction it is.
fn reworded<M: Model, I, P>(warning: &Warning, estimate: &Estimate<M, I, P>) -> Warning {
    let reworded = estimate.directions.iter().find_map(|direction| {
        let advice = warning.text.strip_prefix(&direction.to_string())?;
        Some(words::together(direction, &estimate.unknowns) + advice)
    });
    Warning { severity: warning.severity, text: reworded.unwrap_or_else(|| warning.text.clone()) }
}

fn check<M: Model, I, P>(estimate: &Estimate<M, I, P>, records: &[ExperimentOf<M>]) -> Result<(), Error> {
    let (found, expected) = (records.len(), estimate.experiments.len());
    if found != expected {
        return Err(Error::Option(format!(
            "report: the estimate is of {expected} experiment(s), but {found} record(s) were given; give those of the fit"
        )));
    }
    for (record, share) in records.iter().zip(&estimate.experiments) {
        if (record.name(), record.len()) != (share.name.as_str(), share.samples) {
            return Err(Error::Option(format!(
                "report: the estimate has experiment `{}` with {} samples where record `{}` with {} was given; give the \
                 records of the fit in its order",
                share.name,
                share.samples,
                record.name(),
                record.len()
            )));
        }
    }
    Ok(())
}

fn named<S: Signals>() -> impl Iterator<Item = (String, String)> {
    S::NAMES.iter().zip(S::UNITS).map(|(name, unit)| ((*name).to_owned(), (*unit).to_owned()))
}

/// One signal of each row.
fn column<S: Signals>(rows: &[Of<S, f64>], signal: usize) -> Vec<f64> {
    rows.iter().map(|row| S::into_array(*row).as_ref()[signal]).collect()
}

fn summary<M: Model>(record: &ExperimentOf<M>, prediction: &Prediction<M>) -> Record {
    let inputs = named::<M::Input>().enumerate();
    let inputs = inputs.map(|(i, name)| signal(name, Role::Input, &column::<M::Input>(record.inputs(), i)));
    let outputs = named::<M::Output>().enumerate();
    let outputs = outputs.map(|(j, name)| signal(name, Role::Output, &column::<M::Output>(record.outputs(), j)));
    Record {
        name: record.name().to_owned(),
        samples: record.len() as u64,
        begin: record.time(0),
        end: record.time(record.len().saturating_sub(1)),
        sample_time: record.sample_time(),
        gaps: record.gaps().len() as u64,
        signals: inputs.chain(outputs).collect(),
        fits: (0..M::Output::LEN).map(|j| output_fit::<M>(record, prediction, j)).collect(),
    }
}

fn signal((name, unit): (String, String), role: Role, values: &[f64]) -> Signal {
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

fn output_fit<M: Model>(record: &ExperimentOf<M>, prediction: &Prediction<M>, j: usize) -> OutputFit {
    let measured = column::<M::Output>(record.outputs(), j);
    let predicted = column::<M::Output>(&prediction.outputs, j);
    let residuals = column::<M::Output>(&prediction.residuals, j);
    let rows = Rows { t: &prediction.t, measured: &measured, predicted: &predicted };
    let overview = Trace::new(&rows, 0..measured.len(), COLUMNS);
    let closeup = largest(&residuals).filter(|_| overview.samples_per_column > 1).map(|worst| {
        let begin = worst.saturating_sub(CLOSE / 2).min(measured.len().saturating_sub(CLOSE));
        Trace::new(&rows, begin..(begin + CLOSE).min(measured.len()), CLOSE)
    });
    OutputFit {
        name: M::Output::NAMES[j].to_owned(),
        unit: M::Output::UNITS[j].to_owned(),
        fit_percent: M::Output::into_array(prediction.quality).as_ref()[j].fit_percent,
        unpredicted: predicted.iter().filter(|value| !value.is_finite()).count() as u64,
        residuals: Residuals::new(&prediction.t, &residuals),
        overview: Some(overview),
        closeup,
    }
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
