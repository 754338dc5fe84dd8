//! Many records, each fitted by itself.

use crate::convert::raised;
use crate::equations::Equations;
use crate::estimate::Estimate;
use crate::record::Record;
use crate::remedies::in_python;
use crate::run::{Progress, interruptible};
use crate::settings::{Options, Parameter};
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
    let progress = Progress::default();
    let fit = options.fit(&equations.0, &[], &parameters)?.cancel(progress.cancel.clone());
    let fleet = fit.fleet().map_err(raised)?;
    let records = records.into_iter().map(|record| record.record);
    let ended = interruptible(py, &progress, show, || {
        let counted = fleet.run(records).inspect(|_| {
            progress.done.fetch_add(1, Ordering::Relaxed);
        });
        counted.collect::<Vec<_>>()
    })?;
    if let Some(stop) = ended.interrupted {
        return Err(stop);
    }
    let answer = |one: Result<greybox::Summary, greybox::Error>| match one {
        Ok(summary) => (Some(Estimate(summary)), None),
        Err(error) => (None, Some(in_python(&error.to_string()))),
    };
    Ok(ended.result.into_iter().map(answer).collect())
}
