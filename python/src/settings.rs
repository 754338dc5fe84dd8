//! What a fit is told: parameters, integrator, predictor, noise, loss.

use crate::convert::raised;
use crate::graph::Expression;
use greybox::equations::Equations;
use greybox::record::Record;
use greybox::{Error, Fit, fixed, free};
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use std::path::PathBuf;
use std::time::Duration;

/// What is known of a quantity before the fit.
#[pyclass(frozen, eq, module = "greybox._core", from_py_object)]
#[derive(Clone, Copy, PartialEq)]
pub struct Parameter(pub greybox::Parameter);

#[pymethods]
impl Parameter {
    #[new]
    #[pyo3(signature = (start, is_free, within=None, prior=None, log=false, positive=false, per_experiment=false))]
    fn new(
        start: f64,
        is_free: bool,
        within: Option<(f64, f64)>,
        prior: Option<(f64, f64)>,
        log: bool,
        positive: bool,
        per_experiment: bool,
    ) -> Self {
        let mut parameter = if is_free { free(start) } else { fixed(start) };
        if let Some((lower, upper)) = within {
            parameter = parameter.within(lower, upper);
        }
        if let Some((mean, std)) = prior {
            parameter = parameter.prior(mean, std);
        }
        if log {
            parameter = parameter.log();
        }
        Parameter(greybox::Parameter { positive, per_experiment, ..parameter })
    }

    fn __repr__(&self) -> String {
        let mut text = format!("{}({:?}", if self.is_free() { "free" } else { "fixed" }, self.start());
        for (name, pair) in [("within", self.within()), ("prior", self.prior())] {
            if let Some((a, b)) = pair {
                text += &format!(", {name}=({a:?}, {b:?})");
            }
        }
        for (name, said) in
            [("log", self.log()), ("positive", self.positive()), ("per_experiment", self.per_experiment())]
        {
            if said {
                text += &format!(", {name}=True");
            }
        }
        text + ")"
    }

    #[getter]
    fn start(&self) -> f64 {
        self.0.start
    }

    #[getter]
    fn is_free(&self) -> bool {
        self.0.free
    }

    #[getter]
    fn within(&self) -> Option<(f64, f64)> {
        let bounds = (self.0.lower, self.0.upper);
        (bounds != (f64::NEG_INFINITY, f64::INFINITY)).then_some(bounds)
    }

    #[getter]
    fn prior(&self) -> Option<(f64, f64)> {
        self.0.prior.map(|prior| (prior.mean, prior.std))
    }

    #[getter]
    fn log(&self) -> bool {
        self.0.transform == greybox::Transform::Log
    }

    #[getter]
    fn positive(&self) -> bool {
        self.0.positive
    }

    #[getter]
    fn per_experiment(&self) -> bool {
        self.0.per_experiment
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let this = slf.get();
        let state = (
            this.start(),
            this.is_free(),
            this.within(),
            this.prior(),
            this.log(),
            this.positive(),
            this.per_experiment(),
        );
        Ok((slf.get_type().into_any(), state.into_pyobject(slf.py())?))
    }
}

/// The settings of a fit, as Python hands them over; names as the library knows them.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Options {
    /// Standard deviation of the outputs for which it is given, by their names.
    noise: Option<Vec<(String, f64)>>,
    /// Whether the covariance of the noise of all outputs is estimated.
    noise_covariance: bool,
    /// The same of the inputs.
    input_noise: Option<Vec<(String, f64)>>,
    loss: Option<String>,
    weighting: Option<Expression>,
    prefilter: Option<String>,
    integrator: Option<String>,
    predictor: Option<String>,
    optimizer: Option<String>,
    starts: Option<usize>,
    staged: bool,
    multiple_shooting: bool,
    time_limit: Option<f64>,
    checkpoint: Option<(PathBuf, u64)>,
}

impl Options {
    /// A fit with these settings.
    pub fn fit<'a>(
        &self,
        equations: &'a Equations,
        records: &[Record],
        parameters: &[Parameter],
    ) -> PyResult<Fit<'a, Equations>> {
        let parameters = parameters.iter().map(|one| one.0).collect();
        let mut fit = Fit::new(equations, records).parameters(parameters);
        if self.noise_covariance {
            fit = fit.noise_covariance();
        }
        if let Some(Expression { graph, root }) = &self.weighting {
            fit = fit.weighting_by(graph, *root);
        }
        if let Some(count) = self.starts {
            fit = fit.starts(count);
        }
        if self.staged {
            fit = fit.staged();
        }
        if self.multiple_shooting {
            fit = fit.multiple_shooting();
        }
        if let Some(seconds) = self.time_limit {
            let limit = Duration::try_from_secs_f64(seconds);
            fit = fit.time_limit(limit.map_err(|error| raised(format!("the time limit of {seconds} s: {error}")))?);
        }
        if let Some((path, every)) = &self.checkpoint {
            fit = fit.checkpoint(path, *every);
        }
        self.named(fit).map_err(raised)
    }

    fn named<'a>(&self, mut fit: Fit<'a, Equations>) -> Result<Fit<'a, Equations>, Error> {
        if let Some(sigma) = &self.noise {
            fit = fit.noise_by_name(pairs(sigma))?;
        }
        if let Some(sigma) = &self.input_noise {
            fit = fit.input_noise_by_name(pairs(sigma))?;
        }
        if let Some(name) = &self.loss {
            fit = fit.loss_by_name(name)?;
        }
        if let Some(name) = &self.prefilter {
            fit = fit.prefilter_by_name(name)?;
        }
        if let Some(name) = &self.integrator {
            fit = fit.integrator_by_name(name)?;
        }
        if let Some(name) = &self.predictor {
            fit = fit.predictor_by_name(name)?;
        }
        if let Some(name) = &self.optimizer {
            fit = fit.optimizer_by_name(name)?;
        }
        Ok(fit)
    }
}

fn pairs(all: &[(String, f64)]) -> impl Iterator<Item = (&str, f64)> {
    all.iter().map(|(name, value)| (name.as_str(), *value))
}
