//! From an estimate and its problem to the plain values of a report. Nothing else of the report knows their types.

use super::Report;
use super::facts::{Facts, Histogram, OutputFit, Record, Signal};
use crate::diagnose::residuals;
use crate::diagnose::{self, Summary, Widths};
use crate::error::Error;
use crate::estimate::{Estimate, Prediction};
use crate::experiment::ExperimentOf;
use crate::fit::FitProblem;
use crate::integrate::Integrator;
use crate::interval::Hold;
use crate::model::{Kind, Model};
use crate::predict::Predictor;
use crate::section::{Drawing, Keep, Line, Panel, PanelKind, Plot, Samples, Style, Timeline, identifier};
use crate::signals::{Of, Signals};
use core::ops::Range;

/// So many pairs of a record and an output are drawn; of more, those reproduced worst.
const DRAWN: usize = 24;
/// Numbers kept for the drawings of all records: four bytes each, a third more in letters, they are 1.4 MB of a page.
const NUMBERS: usize = 260_000;
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
    pub fn new<M: Model, I: Integrator, P: Predictor<M>, O>(
        problem: &FitProblem<'_, M, I, P, O>,
        estimate: &Estimate<M, I, P>,
    ) -> Result<Report, Error> {
        let identifiability = diagnose::identifiability(problem, estimate)?;
        let (objective, best) = problem.at(estimate)?;
        let numbers = NUMBERS / problem.experiments().len().min(DRAWN / M::Output::LEN.max(1)).max(1);
        let mut records = vec![];
        for (e, record) in problem.experiments().iter().enumerate() {
            let prediction = problem.prediction(&objective, e, &best)?;
            let widths = match objective.prefilter {
                Some(_) => None,
                None => Some(diagnose::widths(&objective, &best, estimate, e, BAND)?),
            };
            records.push(gathered::<M>(&estimate.experiments[e].name, record, &prediction, widths.as_ref(), numbers)?);
        }
        thin(&mut records, M::Output::LEN);
        let mut summary = Summary::of("Parameter estimation", estimate);
        let reworded = |warning| diagnose::reworded(warning, &estimate.directions, &estimate.unknowns);
        summary.warnings = estimate.warnings.iter().map(reworded).collect();
        let declared = M::Parameters::into_array(estimate.declared);
        Ok(Report::of(&Facts {
            estimate: summary,
            model: core::any::type_name::<M>().to_owned(),
            declared: named::<M::Parameters>().zip(declared).map(|((name, unit), p)| (name, unit, p)).collect(),
            correlation: estimate.correlation(),
            records,
            identifiability,
        }))
    }
}

fn named<S: Signals>() -> impl Iterator<Item = (String, String)> {
    S::NAMES.iter().zip(S::UNITS).map(|(name, unit)| ((*name).to_owned(), (*unit).to_owned()))
}

/// The signals of all rows, one by one.
fn columns<S: Signals>(rows: &[Of<S, f64>]) -> Vec<Vec<f64>> {
    (0..S::LEN).map(|i| rows.iter().map(|row| S::into_array(*row).as_ref()[i]).collect()).collect()
}

/// A record as columns, with the predictions and half widths of the bands; these are empty if there are none.
struct Columns {
    t: Vec<f64>,
    gaps: Vec<usize>,
    inputs: Vec<Vec<f64>>,
    measured: Vec<Vec<f64>>,
    predicted: Vec<Vec<f64>>,
    residuals: Vec<Vec<f64>>,
    confidence: Vec<Vec<f64>>,
    prediction: Vec<Vec<f64>>,
}

fn gathered<M: Model>(
    name: &str,
    record: &ExperimentOf<M>,
    prediction: &Prediction<M>,
    widths: Option<&Widths<M>>,
    numbers: usize,
) -> Result<Record, Error> {
    let gaps = record.gaps();
    let of = Columns {
        t: prediction.t.clone(),
        gaps: gaps.iter().map(|gap| gap.sample).collect(),
        inputs: columns::<M::Input>(record.inputs()),
        measured: columns::<M::Output>(record.outputs()),
        predicted: columns::<M::Output>(&prediction.outputs),
        residuals: columns::<M::Output>(&prediction.residuals),
        confidence: widths.map_or(vec![], |widths| columns::<M::Output>(&widths.confidence)),
        prediction: widths.map_or(vec![], |widths| columns::<M::Output>(&widths.prediction)),
    };
    let held = record.input_hold() == Hold::Zero;
    let hold = match (M::KIND, held) {
        (Kind::Static, _) => "none: the model has no state",
        (_, true) => "inputs hold from sample to sample",
        (_, false) => "inputs are straight lines from sample to sample",
    };
    let inputs = named::<M::Input>().zip(&of.inputs).map(|(name, values)| signal(name, "input", values));
    let outputs = named::<M::Output>().zip(&of.measured).map(|(name, values)| signal(name, "output", values));
    let worst: Vec<Option<usize>> = of.residuals.iter().map(|residuals| largest(residuals)).collect();
    let timeline = timeline::<M>(&of, held, numbers, &worst);
    let single = timeline.stretches.first().is_some_and(|whole| whole.samples_per_column == 1);
    let quality = M::Output::into_array(prediction.quality);
    let fits = residuals::examine(prediction, record)?.into_iter().enumerate().map(|(j, residuals)| {
        let close = worst[j].filter(|_| !single || of.t.len() > 4 * CLOSE);
        OutputFit {
            name: M::Output::NAMES[j].to_owned(),
            unit: M::Output::UNITS[j].to_owned(),
            fit_percent: quality.as_ref()[j].fit_percent,
            unpredicted: of.predicted[j].iter().filter(|value| !value.is_finite()).count() as u64,
            residuals,
            largest: worst[j].map_or(0.0, |k| of.residuals[j][k]),
            largest_at: record.time(worst[j].unwrap_or(0)),
            histogram: Histogram::new(&of.residuals[j]),
            closeup: close.map(|worst| closeup::<M>(name, &of, j, worst)),
        }
    });
    let title = format!("{name} over time");
    let plot = Plot::new(format!("record-{name}"), "", title, Drawing::Timeline(timeline));
    Ok(Record {
        name: name.to_owned(),
        samples: record.len() as u64,
        begin: record.time(0),
        end: record.time(record.len().saturating_sub(1)),
        sample_time: record.sample_time(),
        gaps: gaps.iter().map(|gap| (gap.from, gap.to)).collect(),
        hold,
        signals: inputs.chain(outputs).collect(),
        fits: fits.collect(),
        timeline: Some(plot),
    })
}

fn signal((name, unit): (String, String), role: &'static str, values: &[f64]) -> Signal {
    let measured = || values.iter().copied().filter(|value| !value.is_nan());
    let count = measured().count();
    let (low, high) = (measured().reduce(f64::min), measured().reduce(f64::max));
    let mean = measured().sum::<f64>() / count.max(1) as f64;
    let values_of = low.zip(high).map(|(low, high)| [low, mean, high]);
    Signal { name, unit, role, missing: (values.len() - count) as u64, values: values_of }
}

/// The panels of an output: what was measured and predicted, and what is left.
fn output_panels<M: Model>(j: usize, bands: bool) -> [Panel; 2] {
    let (name, unit) = (M::Output::NAMES[j].to_owned(), M::Output::UNITS[j].to_owned());
    let line = |style, name: &str| Line { style, name: name.to_owned(), held: false };
    let (percent, mut lines) = (100.0 * BAND, vec![]);
    if bands {
        lines.push(line(Style::Prediction, &format!("holds {percent} % of measurements")));
        lines.push(line(Style::Confidence, &format!("{percent} % of the model alone")));
    }
    lines.extend([line(Style::Measured, "measured"), line(Style::Predicted, "predicted")]);
    let residual = Panel {
        name: format!("residual of {name}"),
        unit: unit.clone(),
        kind: PanelKind::Residual,
        lines: vec![line(Style::Residual, "residual")],
    };
    [Panel { name, unit, kind: PanelKind::Response, lines }, residual]
}

/// The lines of these panels.
fn output_lines(of: &Columns, j: usize) -> impl Iterator<Item = (Keep, &[f64])> {
    let bands = [of.prediction.get(j), of.confidence.get(j)].into_iter().flatten();
    let rest = [(Keep::Extremes, &of.measured[j]), (Keep::ExtremesAndMean, &of.predicted[j])];
    let rest = rest.into_iter().chain([(Keep::Extremes, &of.residuals[j])]);
    bands.map(|widths| (Keep::Median, widths)).chain(rest).map(|(keep, values)| (keep, values.as_slice()))
}

/// The outputs and, below them, the inputs of a record.
fn timeline<M: Model>(of: &Columns, held: bool, numbers: usize, worst: &[Option<usize>]) -> Timeline {
    let bands = !of.confidence.is_empty();
    let input = |(name, unit): (String, String)| {
        let lines = vec![Line { style: Style::Input, name: name.clone(), held }];
        Panel { name, unit, kind: PanelKind::Input, lines }
    };
    let outputs = (0..M::Output::LEN).flat_map(|j| output_panels::<M>(j, bands));
    let panels = outputs.chain(named::<M::Input>().map(input)).collect();
    let lines = (0..M::Output::LEN).flat_map(|j| output_lines(of, j));
    let lines = lines.chain(of.inputs.iter().map(|values| (Keep::Extremes, values.as_slice())));
    let pieces: Vec<Range<usize>> = worst.iter().flatten().map(|&k| about(k, of.t.len())).collect();
    Timeline::new(panels, &Samples { t: &of.t, gaps: &of.gaps, lines: lines.collect() }, numbers, &pieces)
}

/// The samples about one.
fn about(sample: usize, samples: usize) -> Range<usize> {
    let begin = sample.saturating_sub(CLOSE / 2).min(samples.saturating_sub(CLOSE));
    begin..(begin + CLOSE).min(samples)
}

/// One output about its largest residual.
fn closeup<M: Model>(record: &str, of: &Columns, j: usize, worst: usize) -> Plot {
    let output = M::Output::NAMES[j];
    let samples = Samples { t: &of.t, gaps: &of.gaps, lines: output_lines(of, j).collect() };
    let start = of.t.first().copied().unwrap_or(0.0);
    let stretches = vec![samples.stretch(about(worst, of.t.len()), CLOSE, start)];
    let panels = output_panels::<M>(j, !of.confidence.is_empty()).to_vec();
    let drawing = Drawing::Timeline(Timeline { start, panels, stretches });
    let title = format!("Output {output} of {record} about its largest residual");
    Plot::new(identifier(&format!("closeup-{record}-{output}")), "About the largest residual", title, drawing)
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
        records[record].timeline = None;
        records[record].fits.iter_mut().for_each(|fit| fit.closeup = None);
    }
}
