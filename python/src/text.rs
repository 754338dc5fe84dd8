//! [`TextModel`]: a model that was read from a file.

use crate::convert::raised;
use crate::equations::Equations;
use crate::record::Record;
use crate::settings::Parameter;
use greybox::text::Model;
use pyo3::prelude::*;
use std::path::PathBuf;

/// A model file: equations, and what is declared besides.
#[pyclass(frozen, module = "greybox._core")]
pub struct TextModel(Model);

#[pymethods]
impl TextModel {
    /// Reads a file, with other values for some of its constants.
    #[staticmethod]
    #[expect(clippy::needless_pass_by_value, reason = "arguments of Python come as values")]
    fn read(path: PathBuf, constants: Vec<(String, f64)>) -> PyResult<Self> {
        TextModel(Model::read(path).map_err(raised)?).with(&constants)
    }

    /// A model from its text; `name` is for messages.
    #[staticmethod]
    fn named(name: &str, text: &str) -> PyResult<Self> {
        Ok(TextModel(Model::named(name, text).map_err(raised)?))
    }

    fn to_toml(&self) -> String {
        self.0.to_toml()
    }

    #[getter]
    fn name(&self) -> &str {
        self.0.name()
    }

    #[getter]
    fn equations(&self) -> Equations {
        Equations(self.0.equations().clone())
    }

    #[getter]
    fn declared(&self) -> Vec<Parameter> {
        self.0.parameters().iter().map(|one| Parameter(*one)).collect()
    }

    /// What is odd in the text, each with its place.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.0.warnings().iter().map(ToString::to_string).collect()
    }

    #[getter]
    fn noise(&self) -> Vec<Option<f64>> {
        self.0.noise()
    }

    #[getter]
    fn integrator(&self) -> Option<&str> {
        self.0.integrator()
    }

    #[getter]
    fn predictor(&self) -> Option<&str> {
        self.0.predictor()
    }

    /// A record with the holds and the initial state of the text.
    fn prepare(&self, record: &Record) -> PyResult<Record> {
        let prepared = self.0.prepare(record.record.clone()).map_err(raised)?;
        Ok(Record { record: prepared, equations: record.equations.clone() })
    }
}

impl TextModel {
    fn with(mut self, constants: &[(String, f64)]) -> PyResult<Self> {
        for (name, value) in constants {
            self.0.set_constant(name, *value).map_err(raised)?;
        }
        Ok(self)
    }
}
