//! Many records, each fitted by itself.

use crate::convert::raised;
use crate::equations::Equations;
use crate::estimate::Estimate;
use crate::record::Record;
use crate::run::{Progress, interruptible};
use crate::settings::{Options, Parameter, stepping};
use greybox::problem::EquationsFit;
use pyo3::prelude::*;
use std::sync::atomic::Ordering;

/// An estimate or a reason for each record, in their order.
#[pyfunction]
#[expect(clippy::needless_pass_by_value, reason = "arguments of Python come as values")]
pub fn fleet(
    py: Python<'_>,
    equations: &Equations,
    records: Vec<Record>,
    parameters: Vec<Parameter>,
    options: Options,
    show: Option<&Bound<'_, PyAny>>,
) -> PyResult<Vec<(Option<Estimate>, Option<String>)>> {
    let fit = EquationsFit::new(equations.0.clone());
    let fit = stepping(fit, options.integrator.as_ref(), options.predictor.as_ref())?;
    let progress = Progress::default();
    let settings = options.settings()?.cancel(progress.cancel.clone());
    let parameters: Vec<greybox::Parameter> = parameters.iter().map(|one| one.0).collect();
    let records = records.into_iter().map(|record| record.record);
    let ended = interruptible(py, &progress, show, || {
        let answers = fit.fleet(&parameters, settings, records)?;
        let counted = answers.map(|answer| {
            progress.done.fetch_add(1, Ordering::Relaxed);
            answer
        });
        Ok(counted.collect::<Vec<_>>())
    })?;
    if let Some(stop) = ended.interrupted {
        return Err(stop);
    }
    let answers = ended.result.map_err(|error: greybox::Error| raised(error))?;
    let answer = |one: Result<greybox::Summary, greybox::Error>| match one {
        Ok(summary) => (Some(Estimate(summary)), None),
        Err(error) => (None, Some(error.to_string())),
    };
    Ok(answers.into_iter().map(answer).collect())
}
