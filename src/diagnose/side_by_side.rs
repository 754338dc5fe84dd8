//! A record beside what several models make of it: data of the fit and data for validation, fit by fit.

use crate::error::Error;
use crate::problem::Simulated;
use crate::record::{Channel, Record};
use crate::section::{Cell, Keep, Line, Panel, PanelKind, Samples, Section, Style, Table, Timeline, identifier};
use crate::section::{Drawing, Plot};

/// One record, and what each of several models predicts of it.
///
/// ```
/// # use greybox::diagnose::Compared;
/// # use greybox::{Estimate, Experiment, ExperimentOf, Fit, Report, fixed, free, pmsm::{Surface, Winding}};
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// # let model = Surface::new(4)?;
/// let (fitted, other) = Experiment::from_file(&model, "examples/data/pmsm.csv")?.split(0.6)?;
/// let start = Winding { rs: free(1.0), ls: free(2e-3), ke: free(0.7) };
/// let problem = Fit::new(&model, &fitted).parameters(start).problem()?;
/// let free = Estimate::of(problem.run()?)?;
/// let given = Fit::new(&model, &fitted).parameters(Winding { ls: fixed(2e-3), ..start }).run()?;
/// let predicted = |compared: Compared, record: &ExperimentOf<Surface>| {
///     let (free, given) = (free.predict(&model, record)?, given.predict(&model, record)?);
///     compared.with("all free", &free)?.with("ls given", &given)
/// };
/// let (estimation, validation) = (Compared::estimation(fitted.record()), Compared::validation(other.record()));
/// let both = vec![predicted(estimation, &fitted)?, predicted(validation, &other)?];
/// # let fits = &both[1].fit_percent()[0].1;
/// # assert!(fits[0] > Some(98.0) && fits[1] < Some(95.0), "{fits:?}");
/// let report = Report::new(&problem, &free)?.with(both); // a table of all fits, and all curves over time
/// # assert!(report.to_markdown().contains("ls given"));
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Compared {
    /// Name of the record.
    record: String,
    /// Its use: estimation or validation.
    data: &'static str,
    /// Time of each sample, and its unit.
    t: Vec<f64>,
    time_unit: String,
    /// Samples before which time jumps.
    gaps: Vec<usize>,
    outputs: Vec<Output>,
}

/// One output of a record, measured and predicted; not a number where missing.
#[derive(Clone, Debug, PartialEq)]
struct Output {
    name: String,
    unit: String,
    measured: Vec<f64>,
    /// Name of each model, and what it predicts.
    predicted: Vec<(String, Vec<f64>)>,
}

impl Compared {
    /// A record that the parameters were estimated from; no model has predicted it yet.
    pub fn estimation(record: &Record) -> Compared {
        Compared::new(record, "estimation")
    }

    /// A record that they were not estimated from.
    pub fn validation(record: &Record) -> Compared {
        Compared::new(record, "validation")
    }

    fn new(record: &Record, data: &'static str) -> Compared {
        let output = |channel: &Channel| Output {
            name: channel.name.clone(),
            unit: channel.unit.clone(),
            measured: channel.values.to_vec(),
            predicted: vec![],
        };
        Compared {
            record: record.name().to_owned(),
            data,
            t: (0..record.len()).map(|k| record.time_unit().convert(record.time(k))).collect(),
            time_unit: record.time_unit().name().to_owned(),
            gaps: record.gaps().iter().map(|gap| gap.sample).collect(),
            outputs: record.outputs().iter().map(output).collect(),
        }
    }

    /// Adds what a model predicts, which may be another one with outputs of the same names.
    ///
    /// # Errors
    /// A prediction of another number of samples, or without one of the outputs.
    pub fn with(mut self, model: &str, prediction: &impl AsRef<Simulated>) -> Result<Self, Error> {
        let prediction = prediction.as_ref();
        let found = prediction.outputs.first().map_or(self.t.len(), Vec::len);
        if found != self.t.len() {
            return Err(Error::Lengths {
                experiment: self.record,
                what: "the prediction".to_owned(),
                found,
                reference: "the record".to_owned(),
                expected: self.t.len(),
            });
        }
        for output in &mut self.outputs {
            let names = &prediction.names;
            let Some(j) = names.iter().position(|name| *name == output.name) else {
                return Err(Error::UnknownSignal { signal: output.name.clone(), available: names.clone() });
            };
            output.predicted.push((model.to_owned(), prediction.outputs[j].clone()));
        }
        Ok(self)
    }

    /// Name of each output, and the fit (%) of each model: `100 (1 - |y - y_hat| / |y - mean y|)` over the samples that
    /// are measured and predicted; `None` if the measurement is constant there.
    pub fn fit_percent(&self) -> Vec<(&str, Vec<Option<f64>>)> {
        self.outputs.iter().map(|output| (output.name.as_str(), output.fit_percent())).collect()
    }
}

impl Output {
    fn fit_percent(&self) -> Vec<Option<f64>> {
        let fit = |predicted: &Vec<f64>| {
            let pairs = || self.measured.iter().zip(predicted).filter(|(y, p)| y.is_finite() && p.is_finite());
            let count = pairs().count() as f64;
            let mean = pairs().map(|(y, _)| y).sum::<f64>() / count;
            let (errors, spread) =
                pairs().fold((0.0, 0.0), |(e, s), (y, p)| (e + (y - p).powi(2), s + (y - mean).powi(2)));
            (spread > 0.0).then(|| 100.0 * (1.0 - (errors / spread).sqrt()))
        };
        self.predicted.iter().map(|(_, predicted)| fit(predicted)).collect()
    }
}

/// Numbers kept for the drawing of one record.
const NUMBERS: usize = 40_000;
/// Records drawn.
const DRAWN: usize = 6;

impl From<&[Compared]> for Section {
    fn from(records: &[Compared]) -> Section {
        let mut models: Vec<&str> = vec![];
        for (model, _) in records.iter().flat_map(|record| &record.outputs).flat_map(|output| &output.predicted) {
            if !models.contains(&model.as_str()) {
                models.push(model);
            }
        }
        let columns = ["record", "data", "output"].into_iter().chain(models.iter().copied()).map(str::to_owned);
        let mut table = Table { columns: columns.collect(), ..Table::new("Fit of each model", []) };
        for record in records {
            for output in &record.outputs {
                let fits = output.fit_percent();
                let of = |model: &&str| {
                    let at = output.predicted.iter().position(|(name, _)| name == model);
                    at.and_then(|at| fits[at]).map_or("-".into(), |fit| Cell::fit(Some(fit)))
                };
                let head: [Cell; 3] = [record.record.as_str().into(), record.data.into(), output.name.as_str().into()];
                table = table.row(head.into_iter().chain(models.iter().map(of)));
            }
        }
        let section = Section::new("compare", "Measured, and what each model predicts").table(table.at_most(60));
        records.iter().take(DRAWN).fold(section, |section, record| section.plot(record.plot()))
    }
}

impl From<Vec<Compared>> for Section {
    fn from(records: Vec<Compared>) -> Section {
        Section::from(records.as_slice())
    }
}

impl From<Compared> for Section {
    fn from(record: Compared) -> Section {
        Section::from(core::slice::from_ref(&record))
    }
}

impl Compared {
    fn plot(&self) -> Plot {
        let styles = [Style::Predicted, Style::Reference].into_iter().chain(core::iter::repeat(Style::Quiet));
        let panel = |output: &Output| {
            let models = output.predicted.iter().map(|(model, _)| model.clone()).zip(styles.clone());
            let lines = [("measured".to_owned(), Style::Measured)].into_iter().chain(models);
            let lines = lines.map(|(name, style)| Line { style, name, held: false }).collect();
            Panel { name: output.name.clone(), unit: output.unit.clone(), kind: PanelKind::Response, lines }
        };
        let lines = self.outputs.iter().flat_map(|output| {
            let predicted = output.predicted.iter().map(|(_, values)| values.as_slice());
            [output.measured.as_slice()].into_iter().chain(predicted).map(|values| (Keep::Extremes, values))
        });
        let samples = Samples { t: &self.t, time_unit: &self.time_unit, gaps: &self.gaps, lines: lines.collect() };
        let timeline = Timeline::new(self.outputs.iter().map(panel).collect(), &samples, NUMBERS, &[]);
        let title = format!("Measured and predicted outputs of {} over time, model by model", self.record);
        let name = identifier(&format!("compare-{}", self.record));
        let caption = format!("{} ({})", self.record, self.data);
        Plot::of(name, caption, title, Drawing::Timeline(timeline))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Over the samples that are measured and predicted, by hand: measured 1 and 5 about 3, errors 1 and -1.
    #[test]
    fn fit_of_what_is_there() {
        let nan = f64::NAN;
        let output = Output {
            name: "y".to_owned(),
            unit: "V".to_owned(),
            measured: vec![1.0, nan, 5.0, 7.0],
            predicted: vec![
                ("one".to_owned(), vec![0.0, 2.0, 6.0, nan]),
                ("none".to_owned(), vec![1.0, 2.0, nan, nan]),
            ],
        };
        assert_eq!(output.fit_percent(), [Some(50.0), None]);
        let all = Compared {
            record: String::new(),
            data: "validation",
            t: vec![],
            time_unit: "s".to_owned(),
            gaps: vec![],
            outputs: vec![output],
        };
        assert_eq!(all.fit_percent(), [("y", vec![Some(50.0), None])]);
    }
}
