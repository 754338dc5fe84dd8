//! A file of NIST's Statistical Reference Datasets: two starts, certified values, data.

use super::problems::{self, Predictors, Response, Task};
use greybox::{Error, Estimate, Experiment, ExperimentOf, Fit, Model, Nothing, Signals, Time, free};
use std::path::Path;

/// What a file says.
pub struct File {
    /// Name of the problem.
    pub name: String,
    /// For each parameter: the two starts, the certified value and its certified standard error.
    pub parameters: Vec<[f64; 4]>,
    /// The certified residual standard deviation.
    pub residual: f64,
    /// What was measured: the response, then the predictors.
    pub data: Vec<Vec<f64>>,
}

/// What a fit found.
pub struct Found {
    /// Name of the problem.
    pub name: String,
    /// 1 (far) or 2 (near).
    pub start: usize,
    /// How the search ended.
    pub outcome: greybox::optimize::Outcome,
    /// Trial steps.
    pub iterations: u64,
    /// Fewest correct digits of a parameter.
    pub parameters: f64,
    /// Fewest correct digits of a standard error.
    pub standard_errors: f64,
    /// Correct digits of the residual standard deviation.
    pub residual: f64,
}

impl File {
    /// Reads a file.
    pub fn read(path: &Path) -> Result<File, String> {
        let text = std::fs::read_to_string(path).map_err(|error| format!("{}: {error}", path.display()))?;
        let numbers = |line: &str| line.split_whitespace().map(|word| word.parse().ok()).collect::<Option<Vec<f64>>>();
        let name = text.lines().find_map(|line| line.strip_prefix("Dataset Name:")?.split_whitespace().next());
        let name = name.ok_or_else(|| format!("{}: no line `Dataset Name:`", path.display()))?.to_owned();
        let parameter = |line: &str| {
            let (name, values) = line.split_once('=')?;
            name.trim().strip_prefix('b')?.parse::<usize>().ok()?;
            <[f64; 4]>::try_from(numbers(values)?).ok()
        };
        let parameters = text.lines().filter_map(parameter).collect();
        let residual =
            text.lines().find_map(|line| line.strip_prefix("Residual Standard Deviation:")?.trim().parse().ok());
        let residual = residual.ok_or_else(|| format!("{}: no residual standard deviation", path.display()))?;
        let (_, data) = text.rsplit_once("\nData:").ok_or_else(|| format!("{}: no line `Data:`", path.display()))?;
        let data = data.lines().skip(1).filter_map(numbers).filter(|row| row.len() > 1).collect();
        Ok(File { name, parameters, residual, data })
    }

    /// Fits it from both starts.
    pub fn fit(&self) -> Result<Vec<Found>, String> {
        let results =
            problems::by_name(&self.name, self).ok_or_else(|| format!("{}: not a known problem", self.name))?;
        results.map_err(|error| format!("{}: {error}", self.name))
    }

    /// Its data as a record of this model.
    ///
    /// # Errors
    /// Data that are no record.
    pub fn record<M: Model<State = Nothing, Input = Predictors, Output = Response>>(
        &self,
        model: &M,
    ) -> Result<ExperimentOf<M>, Error> {
        let input = |row: &Vec<f64>| Predictors { x: row[1], x2: row.get(2).copied().unwrap_or(0.0) };
        let output = |row: &Vec<f64>| Response { y: if self.name == "Nelson" { row[0].ln() } else { row[0] } };
        let (inputs, outputs) = (self.data.iter().map(input).collect(), self.data.iter().map(output).collect());
        let time = Time::Uniform { start: 0.0, step: 1.0 };
        Ok(Experiment::new(model, time, inputs, outputs)?.named(&self.name))
    }

    fn found<M: Model>(&self, start: usize, estimate: &Estimate<M>) -> Found {
        let parameters = M::Parameters::into_array(estimate.parameters);
        let errors = M::Parameters::into_array(estimate.knowledge);
        let of = |i: usize| {
            let [.., value, error] = self.parameters[i];
            let found = errors.as_ref()[i].standard_error().unwrap_or(f64::NAN);
            (digits(parameters.as_ref()[i], value), digits(found, error))
        };
        let least = (0..self.parameters.len()).map(of).fold((11.0f64, 11.0f64), |a, b| (a.0.min(b.0), a.1.min(b.1)));
        Found {
            name: self.name.clone(),
            start,
            outcome: estimate.outcome,
            iterations: estimate.iterations,
            parameters: least.0,
            standard_errors: least.1,
            residual: digits(estimate.outputs[0].fit.sigma, self.residual),
        }
    }
}

/// Correct digits: the negative logarithm of the relative error, between 0 and the 11 digits that are certified.
fn digits(found: f64, certified: f64) -> f64 {
    let error = ((found - certified) / certified).abs();
    if error.is_nan() { 0.0 } else { (-error.log10()).clamp(0.0, 11.0) }
}

impl Task for &File {
    type Answer = Result<Vec<Found>, Error>;

    fn run<M: Model<State = Nothing, Input = Predictors, Output = Response> + Clone>(self, model: &M) -> Self::Answer {
        let record = self.record(model)?;
        let fit = |start: usize| {
            let parameters = M::Parameters::from_fn(|i| free(self.parameters.get(i).map_or(f64::NAN, |p| p[start])));
            let estimate = Fit::new(model, &record).parameters(parameters).run()?;
            Ok(self.found(start + 1, &estimate))
        };
        (0..2).map(fit).collect()
    }
}
