//! [`Header`]: the names of the columns of a frame.

use crate::convert::raised;
use greybox::layout::Quantity;
use greybox::record;
use pyo3::prelude::*;

/// The names of the columns of a frame, which may say units.
#[pyclass(frozen, module = "greybox._core")]
pub struct Header(record::Header);

#[pymethods]
impl Header {
    #[new]
    fn new(names: Vec<String>) -> Self {
        Header(record::Header::new("the frame", names))
    }

    /// The place of the column that holds a signal of this unit; none if there is none.
    fn column(&self, column: &str, signal: &str, unit: &str) -> PyResult<Option<usize>> {
        self.0.column(column, &Quantity { name: signal.to_owned(), unit: unit.to_owned() }).map_err(raised)
    }

    /// The place of the column of the time; none if there is none.
    #[pyo3(signature = (said))]
    fn time(&self, said: Option<&str>) -> PyResult<Option<usize>> {
        self.0.time(said).map_err(raised)
    }

    /// The unit of its numbers (s) and the one that is zero.
    fn seconds(&self, time: usize, first: f64) -> PyResult<(f64, f64)> {
        self.0.seconds(time, first).map_err(raised)
    }
}
