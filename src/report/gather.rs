//! From an estimate and its problem to the plain values of a report. No other file of the report uses their types.

mod states;

use super::Report;
use super::facts::{Facts, Histogram, OutputFit, Record, Signal};
use crate::diagnose::residuals;
use crate::diagnose::{self, Widths};
use crate::error::Error;
use crate::estimate::Summary;
use crate::interval::Hold;
use crate::layout::Kind;
use crate::problem::{Problem, Simulated};
use crate::record::{Channel, ChannelInspection, Inspection, Record as Measured};
use crate::residuals::output_fit;
use crate::section::{Drawing, Keep, Line, Panel, PanelKind, Plot, Samples, Style, Timeline, identifier};
use core::ops::Range;

/// Number of pairs of a record and an output that are drawn; of more, those reproduced worst.
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
    /// measurement). They take some six passes over the data. Of a filter, the states of the records that are drawn, and a test of process noise
    /// ([`diagnose::process_noise`]) where it takes no more trial steps than the estimate did.
    ///
    /// # Errors
    /// An estimate of another problem; a prediction that fails or is not finite.
    pub fn new(problem: &Problem<'_>, estimate: &Summary) -> Result<Report, Error> {
        let identifiability = diagnose::identifiability_beside_warnings(problem, estimate)?;
        let (objective, best) = problem.at(estimate)?;
        let outputs = estimate.outputs.len();
        let has_states = objective.sweep.predicts_variance() && !problem.layout().states.is_empty();
        let numbers = NUMBERS / problem.records().len().min(DRAWN / outputs.max(1)).max(1);
        let numbers = if has_states { numbers / 2 } else { numbers };
        let (mut records, mut worst) = (vec![], vec![]);
        for (e, record) in problem.records().iter().enumerate() {
            let prediction = objective.predict(e, &best)?;
            let widths = match problem.settings.prefilter {
                Some(_) => None,
                None => Some(diagnose::widths(&objective, &best, estimate, e, BAND)?),
            };
            let of = Columns::new(&estimate.experiments[e].name, record, &prediction, widths.as_ref());
            records.push(of.gathered(problem.layout().kind, residuals::examine(&prediction, record)?, numbers));
            worst.push(of.worst);
        }
        thin(&mut records, outputs);
        for (e, record) in records.iter_mut().enumerate().filter(|(_, record)| has_states && record.timeline.is_some())
        {
            record.states = Some(states::gathered(&objective, &best, (e, &record.name), &worst[e], numbers));
        }
        let warnings = diagnose::reworded(&estimate.warnings, &estimate.directions, &estimate.unknowns);
        Ok(Report::of(&Facts {
            model: problem.sweep.identity(),
            correlation: estimate.correlation(&(0..estimate.unknowns.len()).collect::<Vec<usize>>()),
            estimate: Summary { warnings, ..estimate.clone() },
            records,
            identifiability,
            process_noise: diagnose::cheap_process_noise(problem, estimate),
        }))
    }
}

/// A record with what was predicted of it, and the half widths of the bands; these are empty if there are none.
struct Columns<'a> {
    name: &'a str,
    record: &'a Measured,
    t: Vec<f64>,
    gaps: Vec<usize>,
    prediction: &'a Simulated,
    bands: Option<&'a Widths>,
    /// Of a filter, the residuals divided by their predicted deviations.
    standardized: Vec<Vec<f64>>,
    /// The sample with the largest residual of each output.
    worst: Vec<Option<usize>>,
}

impl<'a> Columns<'a> {
    fn new(name: &'a str, record: &'a Measured, prediction: &'a Simulated, bands: Option<&'a Widths>) -> Self {
        let over = |(residuals, deviations): (&Vec<f64>, &Vec<f64>)| {
            residuals.iter().zip(deviations).map(|(residual, deviation)| residual / deviation).collect()
        };
        Columns {
            name,
            record,
            t: times(record),
            gaps: jumps(record),
            prediction,
            bands,
            standardized: prediction.residuals.iter().zip(&prediction.deviations).map(over).collect(),
            worst: prediction.residuals.iter().map(|residuals| largest(residuals)).collect(),
        }
    }

    fn gathered(&self, kind: Kind, examined: Vec<residuals::Residuals>, numbers: usize) -> Record {
        let record = self.record;
        let hold = hold(kind, record);
        let Inspection { inputs, outputs } = record.inspect();
        let inputs = record.inputs().iter().zip(&inputs).map(|(channel, found)| signal(channel, found, "input"));
        let outputs = record.outputs().iter().zip(&outputs).map(|(channel, found)| signal(channel, found, "output"));
        let timeline = self.timeline(numbers);
        let single = timeline.stretches.first().is_some_and(|whole| whole.samples_per_column == 1);
        let fits = examined.into_iter().enumerate().map(|(j, residuals)| {
            let (channel, errors) = (&record.outputs()[j], &self.prediction.residuals[j]);
            let (worst, predicted) = (self.worst[j], &self.prediction.outputs[j]);
            OutputFit {
                name: channel.name.clone(),
                unit: channel.unit.clone(),
                fit_percent: output_fit(&channel.values, errors).fit_percent,
                unpredicted: predicted.iter().filter(|value| !value.is_finite()).count() as u64,
                residuals,
                largest: worst.map_or(0.0, |k| errors[k]),
                largest_at: self.t[worst.unwrap_or(0)],
                standardized: self.standardized.get(j).is_some(),
                histogram: Histogram::new(self.standardized.get(j).unwrap_or(errors)),
                closeup: worst.filter(|_| !single || self.t.len() > 4 * CLOSE).map(|worst| self.closeup(j, worst)),
            }
        });
        Record {
            name: self.name.to_owned(),
            samples: record.len() as u64,
            time_unit: record.time_unit().clone(),
            begin: self.t[0],
            end: self.t[self.t.len() - 1],
            sample_time: record.time_unit().convert(record.sample_time()),
            gaps: self.gaps.iter().map(|&k| (self.t[k - 1], self.t[k])).collect(),
            hold,
            signals: inputs.chain(outputs).collect(),
            fits: fits.collect(),
            timeline: Some(Plot::of(
                format!("record-{}", self.name),
                "",
                format!("{} over time", self.name),
                Drawing::Timeline(timeline),
            )),
            states: None,
        }
    }

    /// The panels of an output: what was measured and predicted, what is left, and that over its predicted deviation.
    fn panels(&self, j: usize) -> Vec<Panel> {
        let Channel { name, unit, .. } = &self.record.outputs()[j];
        let line = |style, name: &str| Line { style, name: name.to_owned(), held: false };
        let (percent, mut lines) = (100.0 * BAND, vec![]);
        if self.bands.is_some() {
            lines.push(line(Style::Prediction, &format!("holds {percent} % of measurements")));
            lines.push(line(Style::Confidence, &format!("{percent} % of the model alone")));
        }
        lines.extend([line(Style::Measured, "measured"), line(Style::Predicted, "predicted")]);
        let residual = |name: String, unit: &str| Panel {
            name,
            unit: unit.to_owned(),
            kind: PanelKind::Residual,
            lines: vec![line(Style::Residual, "residual")],
        };
        let response = Panel { name: name.clone(), unit: unit.clone(), kind: PanelKind::Response, lines };
        let standardized = self.standardized.get(j).map(|_| residual(format!("standardized residual of {name}"), ""));
        [response, residual(format!("residual of {name}"), unit)].into_iter().chain(standardized).collect()
    }

    /// The lines of these panels.
    fn lines(&self, j: usize) -> impl Iterator<Item = (Keep, &[f64])> {
        let bands = self.bands.into_iter().flat_map(move |bands| [&bands.prediction[j], &bands.confidence[j]]);
        let rest = [
            (Keep::Extremes, &*self.record.outputs()[j].values),
            (Keep::ExtremesAndMean, self.prediction.outputs[j].as_slice()),
            (Keep::Extremes, self.prediction.residuals[j].as_slice()),
        ];
        let standardized = self.standardized.get(j).map(|values| (Keep::Extremes, values.as_slice()));
        bands.map(|widths| (Keep::Median, widths.as_slice())).chain(rest).chain(standardized)
    }

    fn samples<'s>(&'s self, lines: Vec<(Keep, &'s [f64])>) -> Samples<'s> {
        Samples { t: &self.t, time_unit: self.record.time_unit().name(), gaps: &self.gaps, lines }
    }

    /// The outputs and, below them, the inputs.
    fn timeline(&self, numbers: usize) -> Timeline {
        let (inputs, outputs) = (self.record.inputs(), 0..self.record.outputs().len());
        let input = |(i, Channel { name, unit, .. }): (usize, &Channel)| {
            let held = self.record.input_hold(i) == Hold::Zero;
            let lines = vec![Line { style: Style::Input, name: name.clone(), held }];
            Panel { name: name.clone(), unit: unit.clone(), kind: PanelKind::Input, lines }
        };
        let panels = outputs.clone().flat_map(|j| self.panels(j)).chain(inputs.iter().enumerate().map(input)).collect();
        let lines = outputs.flat_map(|j| self.lines(j));
        let lines = lines.chain(inputs.iter().map(|channel| (Keep::Extremes, &*channel.values)));
        let pieces: Vec<Range<usize>> = self.worst.iter().flatten().map(|&k| about(k, self.t.len())).collect();
        Timeline::new(panels, &self.samples(lines.collect()), numbers, &pieces)
    }

    /// One output about its largest residual.
    fn closeup(&self, j: usize, worst: usize) -> Plot {
        let (record, output) = (self.name, &self.record.outputs()[j].name);
        let samples = self.samples(self.lines(j).collect());
        let start = self.t.first().copied().unwrap_or(0.0);
        let stretches = vec![samples.stretch(about(worst, self.t.len()), CLOSE, start)];
        let (time_unit, panels) = (samples.time_unit.to_owned(), self.panels(j));
        let drawing = Drawing::Timeline(Timeline { time_unit, start, panels, stretches });
        let title = format!("Output {output} of {record} about its largest residual");
        Plot::of(identifier(&format!("closeup-{record}-{output}")), "About the largest residual", title, drawing)
    }
}

/// The time of each sample, in the unit of the record.
fn times(record: &Measured) -> Vec<f64> {
    (0..record.len()).map(|k| record.time_unit().convert(record.time(k))).collect()
}

/// The samples before which time jumps.
fn jumps(record: &Measured) -> Vec<usize> {
    record.gaps().iter().map(|gap| gap.sample).collect()
}

fn signal(channel: &Channel, found: &ChannelInspection, role: &'static str) -> Signal {
    let (name, unit, values) = (channel.name.clone(), channel.unit.clone(), &*channel.values);
    let measured = || values.iter().copied().filter(|value| !value.is_nan());
    let count = measured().count();
    let (low, high) = (measured().reduce(f64::min), measured().reduce(f64::max));
    let mean = measured().sum::<f64>() / count.max(1) as f64;
    let values_of = low.zip(high).map(|(low, high)| [low, mean, high]);
    Signal { name, unit, role, missing: (values.len() - count) as u64, remarks: found.remarks(), values: values_of }
}

/// The samples about one.
fn about(sample: usize, samples: usize) -> Range<usize> {
    let begin = sample.saturating_sub(CLOSE / 2).min(samples.saturating_sub(CLOSE));
    begin..(begin + CLOSE).min(samples)
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

/// How the inputs behave between samples, in words.
fn hold(kind: Kind, record: &Measured) -> String {
    let lines = (0..record.inputs().len()).filter(|i| record.input_hold(*i) == Hold::First);
    let lines: Vec<&str> = lines.map(|i| record.inputs()[i].name.as_str()).collect();
    match kind {
        Kind::Static => "none: the model has no state".to_owned(),
        _ if lines.is_empty() => "inputs hold from sample to sample".to_owned(),
        _ if lines.len() == record.inputs().len() => "inputs are straight lines from sample to sample".to_owned(),
        _ => format!("inputs hold from sample to sample, but {} are straight lines", lines.join(", ")),
    }
}
