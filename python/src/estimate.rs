//! [`Estimate`]: what a fit found.

use crate::convert::{name_of, raised};
use crate::graph::Expression;
use crate::remedies::in_python;
use greybox::Knowledge;
use greybox::diagnose::derived_by;
use numpy::PyArray2;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

/// The result of a fit.
#[pyclass(frozen, module = "greybox._core")]
#[derive(Clone)]
pub struct Estimate(pub greybox::Summary);

/// Name, unit, value, knowledge (`known`, `fixed`, `held`, `unidentified`), standard error, 95 % interval, error index (%).
type Row = (String, String, f64, String, Option<f64>, Option<(f64, f64)>, Option<f64>);

fn interval(knowledge: &Knowledge) -> Option<(f64, f64)> {
    match *knowledge {
        Knowledge::Known { lower, upper, .. } => Some((lower, upper)),
        Knowledge::Held { bound, end: Some(end) } => Some((bound.min(end), bound.max(end))),
        _ => None,
    }
}

#[pymethods]
impl Estimate {
    #[staticmethod]
    fn from_bytes(bytes: &[u8]) -> PyResult<Self> {
        let text = std::str::from_utf8(bytes).map_err(raised)?;
        greybox::Summary::from_json(text).map(Estimate).map_err(raised)
    }

    /// The estimate as JSON.
    fn to_json(&self) -> PyResult<String> {
        self.0.to_json().map_err(raised)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, (Bound<'py, PyBytes>,))> {
        let bytes = PyBytes::new(slf.py(), slf.get().to_json()?.as_bytes());
        Ok((slf.get_type().getattr("from_bytes")?, (bytes,)))
    }

    fn __str__(&self) -> String {
        // Before lines are wrapped, which may part the words of a remedy.
        let mut said = self.0.clone();
        said.warnings.iter_mut().for_each(|warning| warning.text = in_python(&warning.text));
        in_python(&said.to_string())
    }

    /// `usable`, `usable_with_care` or `not_usable`.
    #[getter]
    fn severity(&self) -> String {
        name_of(self.0.severity())
    }

    /// How the search ended: its code, whether that is a minimum, in words, and the advice.
    #[getter]
    fn outcome(&self) -> (String, bool, String, String) {
        let outcome = self.0.outcome;
        (name_of(outcome), outcome.converged(), outcome.to_string(), in_python(outcome.advice()))
    }

    /// Code, severity and text of each.
    #[getter]
    fn warnings(&self) -> Vec<(String, String, String)> {
        let all = self.0.warnings.iter();
        all.map(|one| (name_of(one.code), name_of(one.severity), in_python(&one.text))).collect()
    }

    /// The parameters, fixed ones too.
    #[getter]
    fn parameters(&self) -> Vec<Row> {
        let row = |one: &greybox::estimate::ParameterEstimate| {
            let unknown = self.0.unknowns.iter().find(|unknown| unknown.name == one.name);
            let index = unknown.and_then(|unknown| unknown.error_index);
            let code = name_of(one.knowledge);
            let error = one.knowledge.standard_error();
            (one.name.clone(), one.unit.clone(), one.value, code, error, interval(&one.knowledge), index)
        };
        self.0.parameters.iter().map(row).collect()
    }

    /// All free quantities, initial states too.
    #[getter]
    fn unknowns(&self) -> Vec<Row> {
        let row = |one: &greybox::estimate::Unknown| {
            let code = name_of(one.knowledge);
            let error = one.knowledge.standard_error();
            (one.name.clone(), one.unit.clone(), one.value, code, error, interval(&one.knowledge), one.error_index)
        };
        self.0.unknowns.iter().map(row).collect()
    }

    /// Name, unit, measured samples, root mean squared error, fit (%), noise of each output.
    #[getter]
    fn outputs(&self) -> Vec<(String, String, u64, f64, Option<f64>, f64)> {
        let row = |one: &greybox::estimate::OutputEstimate| {
            let fit = one.fit;
            (one.name.clone(), one.unit.clone(), fit.samples, fit.rmse, fit.fit_percent, fit.sigma)
        };
        self.0.outputs.iter().map(row).collect()
    }

    /// Name, parameters and initial state of each record.
    #[getter]
    fn experiments(&self) -> Vec<(String, Vec<f64>, Vec<f64>)> {
        let all = self.0.experiments.iter();
        all.map(|one| (one.name.clone(), one.parameters.clone(), one.initial_state.clone())).collect()
    }

    /// Interval of an unknown with this probability.
    fn interval(&self, name: &str, probability: f64) -> Option<(f64, f64)> {
        let held = || self.0.unknowns.iter().find(|unknown| unknown.name == name && probability == 0.95);
        self.0.interval(name, probability).or_else(|| interval(&held()?.knowledge))
    }

    /// The places of the parameters that each record has for itself.
    #[getter]
    fn own_parameters(&self) -> Vec<usize> {
        self.0.own_parameters()
    }

    /// Value, standard error and interval of a function of the parameters, of those of one record where each has its own.
    fn derived(&self, record: usize, name: &str, expression: &Expression) -> (f64, Option<f64>, Option<(f64, f64)>) {
        let found = derived_by(&self.0, record, name, &expression.graph, expression.root);
        (found.value, found.standard_error, found.interval)
    }

    fn covariance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let all: Vec<usize> = (0..self.0.unknowns.len()).collect();
        square(py, &self.0.covariance.dense(&all))
    }

    fn correlation<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let all: Vec<usize> = (0..self.0.unknowns.len()).collect();
        square(py, &self.0.correlation(&all))
    }

    #[getter]
    fn cost(&self) -> f64 {
        self.0.cost
    }

    #[getter]
    fn log_likelihood(&self) -> Option<f64> {
        self.0.log_likelihood
    }

    #[getter]
    fn measurements(&self) -> u64 {
        self.0.measurements
    }

    #[getter]
    fn degrees_of_freedom(&self) -> f64 {
        self.0.degrees_of_freedom()
    }

    #[getter]
    fn iterations(&self) -> u64 {
        self.0.iterations
    }

    #[getter]
    fn seconds(&self) -> f64 {
        self.0.seconds
    }

    /// How the equations were evaluated.
    #[getter]
    fn engine(&self) -> &str {
        &self.0.method.engine
    }
}

fn square<'py>(py: Python<'py>, matrix: &greybox::information::SquareMatrix) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let n = matrix.size();
    let rows: Vec<Vec<f64>> = (0..n).map(|i| (0..n).map(|j| matrix[(i, j)]).collect()).collect();
    match n {
        0 => Ok(PyArray2::zeros(py, [0, 0], false)),
        _ => PyArray2::from_vec2(py, &rows).map_err(raised),
    }
}
