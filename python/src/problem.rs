//! [`Problem`]: equations, records, parameters and settings; what is run.

use crate::convert::raised;
use crate::diagnose::Report;
use crate::equations::Equations;
use crate::estimate::Estimate;
use crate::record::Record;
use crate::run::{Progress, interruptible};
use crate::settings::{Options, Parameter};
use argmin::core::KV;
use argmin::core::observers::{Observe, ObserverMode};
use greybox::diagnose::{self, Resampling};
use greybox::optimize::LeastSquaresState;
use numpy::PyArray1;
use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;
use std::sync::atomic::Ordering;

/// A fit that can be run, and asked about its estimate.
#[pyclass(frozen, module = "greybox._core")]
pub struct Problem {
    problem: greybox::Problem<'static>,
    progress: Progress,
}

/// Columns of an output or an input.
type Arrays<'py> = Vec<Bound<'py, PyArray1<f64>>>;

/// An end of a profile: `at`, `bound` or `open`, and where.
type End = (&'static str, f64);

#[pymethods]
impl Problem {
    #[new]
    #[expect(clippy::needless_pass_by_value, reason = "arguments of Python come as values")]
    fn new(
        equations: &Equations,
        records: Vec<Record>,
        parameters: Vec<Parameter>,
        options: Options,
    ) -> PyResult<Self> {
        let progress = Progress::default();
        let records: Vec<_> = records.into_iter().map(|record| record.record).collect();
        let fit = options.fit(&equations.0, &records, &parameters)?.cancel(progress.cancel.clone());
        let fit = fit.observe(Watch(progress.clone()), ObserverMode::Always).counter(progress.done.clone());
        Ok(Problem { problem: fit.problem().map_err(raised)?, progress })
    }

    /// Searches. Where Ctrl-C ended it, the estimate is the best so far, and says so.
    fn run(&self, py: Python<'_>, show: Option<&Bound<'_, PyAny>>) -> PyResult<Estimate> {
        self.progress.begin();
        let ended = interruptible(py, &self.progress, show, || self.problem.run())?;
        match (ended.interrupted, ended.result) {
            (None, result) => Ok(Estimate(result.map_err(raised)?)),
            (Some(stop), Ok(best)) if stop.is_instance_of::<PyKeyboardInterrupt>(py) => Ok(Estimate(best)),
            (Some(stop), _) => Err(stop),
        }
    }

    /// The report, which has no result if it is stopped; nor have the diagnoses below.
    fn report(&self, py: Python<'_>, estimate: &Estimate) -> PyResult<Report> {
        let estimate = &estimate.0;
        self.whole(py, None, || greybox::Report::new(&self.problem, estimate)).map(Report)
    }

    /// Predicted outputs and residuals of a record, a column per output, and the initial state. Of record `own` of the fit, with its own
    /// parameters and estimated initial state.
    fn predict<'py>(
        &self,
        py: Python<'py>,
        estimate: &Estimate,
        record: &Record,
        own: Option<usize>,
    ) -> PyResult<(Arrays<'py>, Arrays<'py>, Vec<f64>)> {
        let (summary, record) = of_record(estimate, record, own)?;
        let found = self.whole(py, None, || self.problem.predict(&summary, &record))?;
        let arrays = |columns: Vec<Vec<f64>>| columns.into_iter().map(|one| PyArray1::from_vec(py, one)).collect();
        Ok((arrays(found.outputs), arrays(found.residuals), found.initial_state))
    }

    /// The states of a record, filtered or smoothed, with their standard deviations, a column per state; of record `own` of the fit as
    /// `predict`.
    fn states<'py>(
        &self,
        py: Python<'py>,
        estimate: &Estimate,
        record: &Record,
        own: Option<usize>,
        smoothed: bool,
    ) -> PyResult<(Arrays<'py>, Arrays<'py>)> {
        let (summary, record) = of_record(estimate, record, own)?;
        let found = self.whole(py, None, || match smoothed {
            true => self.problem.smoothed(&summary, &record),
            false => self.problem.filtered(&summary, &record),
        })?;
        let arrays = |columns: Vec<Vec<f64>>| columns.into_iter().map(|one| PyArray1::from_vec(py, one)).collect();
        Ok((arrays(found.means), arrays(found.deviations)))
    }

    /// The profile of an unknown: ends, values, rises, threshold, remark, and the profile as JSON.
    #[expect(clippy::type_complexity, reason = "a tuple for Python")]
    fn profile(
        &self,
        py: Python<'_>,
        estimate: &Estimate,
        name: &str,
        probability: f64,
    ) -> PyResult<(End, End, Vec<f64>, Vec<f64>, f64, String, String)> {
        let found = self.whole(py, None, || diagnose::profile(&self.problem, &estimate.0, name, probability))?;
        let end = |end: diagnose::End| match end {
            diagnose::End::At(at) => ("at", at),
            diagnose::End::Bound(at) => ("bound", at),
            diagnose::End::Open(at) => ("open", at),
        };
        let json = serde_json::to_string(&found).map_err(raised)?;
        let values = found.points.iter().map(|point| point.value).collect();
        let rises = found.points.iter().map(|point| point.rise).collect();
        Ok((end(found.lower), end(found.upper), values, rises, found.threshold, found.remark, json))
    }

    /// Refits of resampled records: standard errors, biases and intervals of the unknowns, refits that were tried and that ended, and all
    /// of it as JSON. In blocks of so many residuals; without, one by one.
    #[expect(clippy::type_complexity, reason = "a tuple for Python")]
    fn bootstrap(
        &self,
        py: Python<'_>,
        estimate: &Estimate,
        blocks: Option<usize>,
        count: usize,
        seed: u64,
        show: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<(Vec<f64>, Vec<f64>, Vec<(f64, f64)>, u64, u64, String)> {
        let resampling = blocks.map_or(Resampling::Residuals, Resampling::Blocks);
        let work = || diagnose::bootstrap(&self.problem, &estimate.0, resampling, count, seed);
        let found = self.whole(py, show, work)?;
        let json = serde_json::to_string(&found).map_err(raised)?;
        Ok((found.standard_errors, found.bias, found.intervals, found.tried, found.converged, json))
    }

    /// The test of process noise: names of the levels, likelihood ratio, degrees of freedom and p-value.
    fn process_noise(&self, py: Python<'_>, estimate: &Estimate) -> PyResult<(Vec<String>, f64, u64, f64)> {
        let found = self.whole(py, None, || diagnose::process_noise(&self.problem, &estimate.0))?;
        Ok((found.levels, found.likelihood_ratio, found.degrees_of_freedom, found.p_value))
    }

    /// The half widths of the bands of a record of the fit: of the model alone, and of a new measurement.
    fn bands<'py>(
        &self,
        py: Python<'py>,
        estimate: &Estimate,
        record: usize,
        probability: f64,
    ) -> PyResult<(Arrays<'py>, Arrays<'py>)> {
        let found = self.whole(py, None, || diagnose::bands(&self.problem, &estimate.0, record, probability))?;
        let arrays = |columns: Vec<Vec<f64>>| columns.into_iter().map(|one| PyArray1::from_vec(py, one)).collect();
        Ok((arrays(found.confidence), arrays(found.prediction)))
    }
}

/// The estimate and the record that a question is about: record `own` of the fit has its own parameters and estimated initial state.
fn of_record(
    estimate: &Estimate,
    record: &Record,
    own: Option<usize>,
) -> PyResult<(greybox::Summary, greybox::record::Record)> {
    let (mut summary, mut record) = (estimate.0.clone(), record.record.clone());
    if let Some(one) = own.and_then(|own| estimate.0.experiments.get(own)) {
        let initial = one.initial_state.iter().copied().map(greybox::fixed).collect();
        record = record.initial(greybox::record::Initial::Given(initial)).map_err(raised)?;
        summary = own.and_then(|own| summary.of_experiment(own)).unwrap_or(summary);
    }
    Ok((summary, record))
}

impl Problem {
    /// Work that is whole or an exception.
    fn whole<T: Send>(
        &self,
        py: Python<'_>,
        show: Option<&Bound<'_, PyAny>>,
        work: impl FnOnce() -> Result<T, greybox::Error> + Send,
    ) -> PyResult<T> {
        self.progress.begin();
        let ended = interruptible(py, &self.progress, show, work)?;
        ended.interrupted.map_or(ended.result.map_err(raised), Err)
    }
}

/// Notes how far a search is.
struct Watch(Progress);

impl Observe<LeastSquaresState> for Watch {
    fn observe_iter(&mut self, state: &LeastSquaresState, _: &KV) -> Result<(), argmin::core::Error> {
        self.0.done.fetch_add(1, Ordering::Relaxed);
        self.0.cost.store(state.get_best_cost().to_bits(), Ordering::Relaxed);
        Ok(())
    }
}
