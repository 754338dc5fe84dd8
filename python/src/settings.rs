//! What a fit is told: parameters, integrator, predictor, noise, loss.

use crate::convert::raised;
use greybox::loss::{Cauchy, Huber, SoftL1, Tukey};
use greybox::problem::{EquationsFit, Settings};
use greybox::{Butterworth, Discrete, Esdirk, Horizon, Kalman, Rk4, Rk45, fixed, free};
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use std::time::Duration;

/// A name and its numbers: `("huber", [1.345])`.
pub type Named = (String, Vec<f64>);

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
        for (name, said) in [("log", self.log()), ("positive", self.positive()), ("per_experiment", self.per_experiment())] {
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

/// The settings of a fit, as Python hands them over.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Options {
    /// Standard deviation per output, where given.
    pub noise: Option<Vec<f64>>,
    /// Whether the covariance of the noise of all outputs is estimated.
    pub noise_covariance: bool,
    pub input_noise: Option<Vec<f64>>,
    pub loss: Option<Named>,
    /// `low_pass` or `high_pass`, with order, cutoff (Hz) and sample time (s).
    pub prefilter: Option<Named>,
    pub integrator: Option<Named>,
    pub predictor: Option<Named>,
    pub starts: Option<usize>,
    pub time_limit: Option<f64>,
    pub checkpoint: Option<(std::path::PathBuf, u64)>,
}

/// A whole number among those of a name.
fn whole(of: &Named, least: u32) -> PyResult<Option<u32>> {
    let (name, numbers) = of;
    match numbers[..] {
        [] => Ok(None),
        [n] if n.fract() == 0.0 && (f64::from(least)..=f64::from(u32::MAX)).contains(&n) => Ok(Some(n as u32)),
        _ => Err(raised(format!("`{name}` takes one whole number of {least} or more, found {numbers:?}"))),
    }
}

/// The number of a name, or its default.
fn number(of: &Named, default: f64) -> PyResult<f64> {
    let (name, numbers) = of;
    match numbers[..] {
        [] => Ok(default),
        [x] => Ok(x),
        _ => Err(raised(format!("`{name}` takes one number, found {numbers:?}"))),
    }
}

/// A fit of equations with this integrator and predictor.
pub fn stepping(fit: EquationsFit, integrator: Option<&Named>, predictor: Option<&Named>) -> PyResult<EquationsFit> {
    let fit = match integrator {
        None => fit,
        Some(of) => match of.0.as_str() {
            "rk4" => fit.integrator(Rk4 { substeps: whole(of, 1)?.unwrap_or(1) }),
            "rk45" => fit.integrator(Rk45::default()),
            "esdirk" => fit.integrator(Esdirk::default()),
            "discrete" => fit.integrator(Discrete),
            other => return Err(raised(format!("there is no integrator `{other}`; take rk4, rk4:4, rk45, esdirk or discrete"))),
        },
    };
    Ok(match predictor {
        None => fit,
        Some(of) => match of.0.as_str() {
            "simulation" => fit,
            "horizon" => fit.predictor(Horizon::new(whole(of, 1)?.unwrap_or(1) as usize)),
            "kalman" => fit.predictor(Kalman),
            other => return Err(raised(format!("there is no predictor `{other}`; take simulation, horizon:5 or kalman"))),
        },
    })
}

impl Options {
    /// The settings, without integrator and predictor.
    pub fn settings(&self) -> PyResult<Settings> {
        let mut settings = Settings::default();
        if let Some(sigma) = &self.noise {
            settings = settings.noise(sigma.clone());
        }
        if self.noise_covariance {
            settings = settings.noise_covariance();
        }
        if let Some(sigma) = &self.input_noise {
            settings = settings.input_noise(sigma.clone());
        }
        if let Some(of) = &self.loss {
            settings = match of.0.as_str() {
                "squared" => settings,
                "huber" => settings.loss(Huber(number(of, Huber::default().0)?)),
                "soft_l1" => settings.loss(SoftL1(number(of, SoftL1::default().0)?)),
                "cauchy" => settings.loss(Cauchy(number(of, Cauchy::default().0)?)),
                "tukey" => settings.loss(Tukey(number(of, Tukey::default().0)?)),
                other => {
                    let text = format!("there is no loss `{other}`; take squared, huber, soft_l1, cauchy or tukey");
                    return Err(raised(text));
                }
            };
        }
        if let Some((name, numbers)) = &self.prefilter {
            let [order, cutoff, sample_time] = numbers[..] else {
                return Err(raised("a pre-filter takes an order, a cutoff (Hz) and the sample time (s)"));
            };
            let order = whole(&(name.clone(), vec![order]), 1)?.unwrap_or(1);
            settings = settings.prefilter(
                match name.as_str() {
                    "low_pass" => Butterworth::low_pass(order, cutoff, sample_time),
                    "high_pass" => Butterworth::high_pass(order, cutoff, sample_time),
                    other => {
                        return Err(raised(format!("there is no pre-filter `{other}`; take low_pass or high_pass")));
                    }
                }
                .map_err(raised)?,
            );
        }
        if let Some(count) = self.starts {
            settings = settings.starts(count);
        }
        if let Some(seconds) = self.time_limit {
            let limit = Duration::try_from_secs_f64(seconds);
            settings = settings.time_limit(limit.map_err(|error| raised(format!("the time limit of {seconds} s: {error}")))?);
        }
        if let Some((path, every)) = &self.checkpoint {
            settings = settings.checkpoint(path, *every);
        }
        Ok(settings)
    }
}
