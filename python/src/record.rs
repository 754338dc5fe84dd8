//! [`Record`]: measured inputs and outputs over time.

use crate::convert::raised;
use crate::equations::Equations;
use crate::settings::Parameter;
use greybox::layout::Quantity;
use greybox::record::{Channel, Column, Initial, Time};
use greybox::{DataFile, Hold, free};
use numpy::{PyArray1, PyArrayMethods, PyReadonlyArray1, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// One measured record.
#[pyclass(frozen, module = "greybox._core", from_py_object)]
#[derive(Clone)]
pub struct Record {
    pub record: greybox::record::Record,
    /// The equations that it is for.
    pub equations: Equations,
}

/// Time as a start and a step (s), or as stamps (s).
#[derive(FromPyObject)]
enum Times<'py> {
    Uniform((f64, f64)),
    Stamps(PyReadonlyArray1<'py, f64>),
}

impl Times<'_> {
    fn time(&self) -> Time {
        match self {
            Times::Uniform((start, step)) => Time::Uniform { start: *start, step: *step },
            Times::Stamps(stamps) => Time::from_stamps(stamps.as_array().to_vec()),
        }
    }
}

/// The hold of all inputs, or of each by its name.
#[derive(FromPyObject)]
enum Holds {
    All(String),
    Each(BTreeMap<String, String>),
}

/// The hold of this name.
fn hold_of(name: &str) -> PyResult<Hold> {
    match name {
        "zero" => Ok(Hold::Zero),
        "first" => Ok(Hold::First),
        other => Err(raised(format!("there is no hold `{other}`; take zero (constant) or first (straight lines)"))),
    }
}

/// The initial state: `estimated`, `first` (as the first sample says), `steady`, or a declaration of each state for which there is one.
#[derive(FromPyObject)]
enum Start {
    Named(String),
    Given(Vec<Option<Parameter>>),
}

/// The numbers of an array that Python keeps alive and that nothing can write to.
struct Shared {
    values: *const f64,
    len: usize,
    /// Keeps the memory.
    _array: Py<PyArray1<f64>>,
}

// SAFETY: the numbers are read only, and stay where they are while the array lives; a reference to it may be dropped on any thread.
unsafe impl Send for Shared {}
// SAFETY: as above; no method writes.
unsafe impl Sync for Shared {}

impl AsRef<[f64]> for Shared {
    fn as_ref(&self) -> &[f64] {
        // SAFETY: a contiguous array of this length, which `_array` keeps.
        unsafe { std::slice::from_raw_parts(self.values, self.len) }
    }
}

/// A column of an array: shared where `share` says that nothing writes to it, otherwise copied.
fn column(array: &Bound<'_, PyArray1<f64>>, share: bool) -> Column {
    if share && array.is_contiguous() && !array.is_empty() {
        let values: *const f64 = array.data();
        return Column::new(Shared { values, len: array.len(), _array: array.clone().unbind() });
    }
    Column::from(array.readonly().as_array().to_vec())
}

fn channels(of: &[Quantity], columns: &[(Bound<'_, PyArray1<f64>>, bool)]) -> Vec<Channel> {
    let channel = |(of, (array, share)): (&Quantity, &(Bound<'_, PyArray1<f64>>, bool))| {
        Channel::new(&of.name, &of.unit, column(array, *share))
    };
    of.iter().zip(columns).map(channel).collect()
}

impl Start {
    /// The state at the first sample. A state that is not said stays as it was declared, or is estimated, from zero on: as in the shell.
    fn initial(&self, before: &Initial) -> PyResult<Initial> {
        match self {
            Start::Given(given) => {
                let mut all = match before {
                    Initial::Given(before) => before.clone(),
                    _ => vec![free(0.0); given.len()],
                };
                for (one, said) in all.iter_mut().zip(given) {
                    *one = said.map_or(*one, |said| said.0);
                }
                Ok(Initial::Given(all))
            }
            Start::Named(name) if name == "estimated" => Ok(Initial::Free),
            Start::Named(name) if name == "first" => Ok(Initial::FirstSample),
            Start::Named(name) if name == "steady" => Ok(Initial::Steady),
            Start::Named(name) => Err(raised(format!(
                "there is no initial state `{name}`; take estimated, first, steady, or a declaration for each state"
            ))),
        }
    }
}

/// Arrays, each with whether nothing can write to it.
type Columns<'py> = Vec<(Bound<'py, PyArray1<f64>>, bool)>;

#[pymethods]
impl Record {
    /// A record for these equations: time, and a column per input and output, in their order.
    #[new]
    #[pyo3(signature = (equations, name, time, inputs, outputs, holds=None, initial=None))]
    #[expect(clippy::needless_pass_by_value, reason = "arguments of Python come as values")]
    fn new(
        equations: Equations,
        name: &str,
        time: Times<'_>,
        inputs: Columns<'_>,
        outputs: Columns<'_>,
        holds: Option<Holds>,
        initial: Option<Start>,
    ) -> PyResult<Self> {
        let layout = equations.0.layout();
        let (inputs, outputs) = (channels(&layout.inputs, &inputs), channels(&layout.outputs, &outputs));
        let record = greybox::record::Record::new(layout.states.clone(), time.time(), inputs, outputs);
        let record = record.map_err(raised)?.named(name);
        Record { record, equations }.said(holds, initial)
    }

    /// A record from a text file, of which the library finds what is not said; `columns` has the column of a signal or of the time `t`
    /// where it has another name.
    #[staticmethod]
    #[pyo3(signature = (equations, name, path, columns, sample_time))]
    fn from_csv(
        equations: Equations,
        name: &str,
        path: PathBuf,
        columns: BTreeMap<String, String>,
        sample_time: Option<f64>,
    ) -> PyResult<Self> {
        let mut file = columns.iter().fold(DataFile::new(path), |file, (signal, column)| file.column(signal, column));
        if let Some(step) = sample_time {
            file = file.sample_time(step);
        }
        let record = file.read_record(equations.0.layout()).map_err(raised)?.named(name);
        Ok(Record { record, equations })
    }

    /// The same with holds and initial state, where they are given.
    #[pyo3(signature = (holds, initial))]
    fn said(&self, holds: Option<Holds>, initial: Option<Start>) -> PyResult<Self> {
        let mut record = self.record.clone();
        match holds {
            None => {}
            Some(Holds::All(hold)) => record = record.hold(hold_of(&hold)?),
            Some(Holds::Each(each)) => {
                for (input, hold) in &each {
                    record = record.hold_of(input, hold_of(hold)?).map_err(raised)?;
                }
            }
        }
        if let Some(initial) = initial {
            let initial = initial.initial(record.initial_state())?;
            record = record.initial(initial).map_err(raised)?;
        }
        Ok(Record { record, equations: self.equations.clone() })
    }

    /// What a record is made of, for pickle.
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let (py, Record { record, equations }) = (slf.py(), slf.get());
        let shared =
            |columns: Vec<Bound<'py, PyArray1<f64>>>| columns.into_iter().map(|one| (one, false)).collect::<Vec<_>>();
        let time = match record.times() {
            Time::Uniform { start, step } => (*start, *step).into_pyobject(py)?.into_any(),
            Time::Stamps(stamps) => PyArray1::from_slice(py, stamps).into_any(),
        };
        let hold = |(i, channel): (usize, &Channel)| {
            let hold = if record.input_hold(i) == Hold::First { "first" } else { "zero" };
            (channel.name.clone(), hold)
        };
        let holds: BTreeMap<String, &str> = record.inputs().iter().enumerate().map(hold).collect();
        let initial = match record.initial_state() {
            Initial::Estimated => py.None().into_bound(py),
            Initial::Free => "estimated".into_pyobject(py)?.into_any(),
            Initial::FirstSample => "first".into_pyobject(py)?.into_any(),
            Initial::Steady => "steady".into_pyobject(py)?.into_any(),
            Initial::Given(given) => given.iter().map(|one| Parameter(*one)).collect::<Vec<_>>().into_pyobject(py)?,
        };
        let (inputs, outputs) = (shared(slf.get().inputs(py)), shared(slf.get().outputs(py)));
        let state = (equations.clone(), record.name(), time, inputs, outputs, holds, initial);
        Ok((slf.get_type().into_any(), state.into_pyobject(py)?))
    }

    fn __len__(&self) -> usize {
        self.record.len()
    }

    #[getter]
    fn name(&self) -> &str {
        self.record.name()
    }

    fn time<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_iter(py, (0..self.record.len()).map(|k| self.record.time(k)))
    }

    fn inputs<'py>(&self, py: Python<'py>) -> Vec<Bound<'py, PyArray1<f64>>> {
        self.record.inputs().iter().map(|channel| PyArray1::from_slice(py, &channel.values)).collect()
    }

    fn outputs<'py>(&self, py: Python<'py>) -> Vec<Bound<'py, PyArray1<f64>>> {
        self.record.outputs().iter().map(|channel| PyArray1::from_slice(py, &channel.values)).collect()
    }

    /// The record with white noise of these standard deviations added to its outputs.
    #[expect(clippy::needless_pass_by_value, reason = "arguments of Python come as values")]
    fn with_noise(&self, sigma: Vec<f64>, seed: u64) -> Self {
        Record { record: self.record.with_noise(&sigma, seed), ..self.clone() }
    }
}
