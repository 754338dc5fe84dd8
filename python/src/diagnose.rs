//! [`Report`]: an estimate as something to read.

use crate::convert::{name_of, raised};
use crate::remedies::in_python;
use greybox::diagnose::{Bootstrap, Profile};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use std::path::PathBuf;

/// A report on an estimate.
#[pyclass(frozen, module = "greybox._core")]
pub struct Report(pub greybox::Report);

#[pymethods]
impl Report {
    #[staticmethod]
    fn from_bytes(bytes: &[u8]) -> PyResult<Self> {
        let text = std::str::from_utf8(bytes).map_err(raised)?;
        greybox::Report::from_json(text).map(Report).map_err(raised)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, (Bound<'py, PyBytes>,))> {
        let text = slf.get().0.to_json_with_drawings().map_err(raised)?;
        Ok((slf.get_type().getattr("from_bytes")?, (PyBytes::new(slf.py(), text.as_bytes()),)))
    }

    /// The report with a title and with the sections of these profiles and of this bootstrap, which are JSON.
    #[expect(clippy::needless_pass_by_value, reason = "arguments of Python come as values")]
    fn extended(&self, title: Option<&str>, profiles: Vec<String>, bootstrap: Option<&str>) -> PyResult<Self> {
        let mut report = self.0.clone();
        if let Some(title) = title {
            report = report.titled(title);
        }
        for profile in &profiles {
            let profile: Profile = serde_json::from_str(profile).map_err(raised)?;
            report = report.with(profile);
        }
        if let Some(bootstrap) = bootstrap {
            let bootstrap: Bootstrap = serde_json::from_str(bootstrap).map_err(raised)?;
            report = report.with(bootstrap);
        }
        Ok(Report(report))
    }

    #[getter]
    fn severity(&self) -> String {
        name_of(self.0.severity)
    }

    /// Severity and text of each reason why the estimate is not simply usable.
    #[getter]
    fn reasons(&self) -> Vec<(String, String)> {
        self.0.reasons().into_iter().map(|(severity, text)| (name_of(severity), in_python(text))).collect()
    }

    /// Title and picture (SVG) of each plot.
    fn pictures(&self) -> Vec<(String, String)> {
        self.0.plots().into_iter().map(|plot| (plot.title.clone(), plot.to_svg())).collect()
    }

    fn to_html(&self) -> String {
        in_python(&self.0.to_html())
    }

    fn to_markdown(&self) -> String {
        in_python(&self.0.to_markdown())
    }

    fn to_json(&self) -> PyResult<String> {
        self.0.to_json().map_err(raised)
    }

    fn __str__(&self) -> String {
        in_python(&self.0.to_string())
    }

    /// Writes the report, whole or not at all, as the path ends in `.html`, `.md`, `.json` or `.txt`.
    fn save(&self, path: PathBuf) -> PyResult<()> {
        self.0.save_in_words(path, in_python).map_err(raised)
    }
}
