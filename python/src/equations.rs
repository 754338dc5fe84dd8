//! [`Equations`]: a model as data.

use crate::convert::{name_of, named, raised};
use crate::graph::{Graph, Node};
use crate::record::Record;
use greybox::equations::Roots;
use greybox::graph::Id;
use greybox::layout::{Layout, Quantity};
use greybox::{Fit, fixed};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use std::sync::Arc;

/// Names and units.
pub type Names = Vec<(String, String)>;

/// A model's quantities and its arithmetic.
#[pyclass(frozen, eq, module = "greybox._core", from_py_object)]
#[derive(Clone, PartialEq)]
pub struct Equations(pub Arc<greybox::equations::Equations>);

fn quantities(names: Names) -> Vec<Quantity> {
    names.into_iter().map(|(name, unit)| Quantity { name, unit }).collect()
}

fn names(of: &[Quantity]) -> Names {
    of.iter().map(|one| (one.name.clone(), one.unit.clone())).collect()
}

#[pymethods]
impl Equations {
    /// Equations of quantities (states, inputs, outputs, parameters) and roots of a graph (derivatives or next states, outputs,
    /// diffusions, noises, initial noises, initial states, dead times, states after a sample).
    #[new]
    fn new(
        kind: &str,
        quantities_by_role: [Names; 4],
        graph: &Graph,
        roots: [Vec<PyRef<'_, Node>>; 8],
    ) -> PyResult<Self> {
        let [states, inputs, outputs, parameters] = quantities_by_role.map(quantities);
        let layout = Layout { kind: named(kind)?, states, inputs, outputs, parameters };
        let ids = |nodes: Vec<PyRef<'_, Node>>| nodes.iter().map(|node| node.0).collect::<Vec<Id>>();
        let [state, output, diffusion, noise, initial_noise, initial, delay, jump] = roots.map(ids);
        let roots = Roots { state, output, diffusion, noise, initial_noise, initial, delay, jump };
        let equations = greybox::equations::Equations::complete(layout, &graph.0, &roots);
        Ok(Equations(Arc::new(equations.map_err(raised)?)))
    }

    /// Equations from the bytes that pickle keeps.
    #[staticmethod]
    fn from_bytes(bytes: &[u8]) -> PyResult<Self> {
        Ok(Equations(Arc::new(serde_json::from_slice(bytes).map_err(raised)?)))
    }

    fn to_bytes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        Ok(PyBytes::new(py, &serde_json::to_vec(&*self.0).map_err(raised)?))
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, (Bound<'py, PyBytes>,))> {
        let from = slf.get_type().getattr("from_bytes")?;
        Ok((from, (slf.get().to_bytes(slf.py())?,)))
    }

    fn __str__(&self) -> String {
        self.0.to_string()
    }

    #[getter]
    fn kind(&self) -> String {
        name_of(self.0.layout().kind)
    }

    #[getter]
    fn states(&self) -> Names {
        names(&self.0.layout().states)
    }

    #[getter]
    fn inputs(&self) -> Names {
        names(&self.0.layout().inputs)
    }

    #[getter]
    fn outputs(&self) -> Names {
        names(&self.0.layout().outputs)
    }

    #[getter]
    fn parameters(&self) -> Names {
        names(&self.0.layout().parameters)
    }

    /// Simulates with the inputs of a record, and gives it with the outputs; of a state that is not given, from what the record or the model says. With a
    /// seed, with the noise that the model has, and that of `noise` in its place.
    #[expect(clippy::needless_pass_by_value, clippy::too_many_arguments, reason = "arguments of Python come as values")]
    fn simulate(
        &self,
        py: Python<'_>,
        parameters: Vec<f64>,
        initial: Vec<Option<f64>>,
        inputs: &Record,
        integrator: Option<&str>,
        noise: Vec<Option<f64>>,
        noisy: Option<u64>,
    ) -> PyResult<Record> {
        let none: [greybox::record::Record; 0] = [];
        let mut fit = Fit::new(&*self.0, &none).parameters(parameters.into_iter().map(fixed).collect());
        if let Some(name) = integrator {
            fit = fit.integrator_by_name(name).map_err(raised)?;
        }
        let simulated = py.detach(|| {
            let said = if initial.contains(&None) { fit.initial_state(&inputs.record)? } else { vec![] };
            let state = |(i, given): (usize, &Option<f64>)| given.unwrap_or_else(|| said[i]);
            let initial: Vec<f64> = initial.iter().enumerate().map(state).collect();
            match noisy {
                Some(seed) => fit.simulate_noisy(&initial, &inputs.record, &noise, seed),
                None => fit.simulate(&initial, &inputs.record),
            }
        });
        Ok(Record { record: simulated.map_err(raised)?, equations: self.clone() })
    }
}

/// The equations of the library's motor with surface magnets.
#[pyfunction]
pub fn surface(pole_pairs: u32) -> PyResult<Equations> {
    let model = greybox::pmsm::Surface::new(pole_pairs).map_err(raised)?;
    let equations = greybox::equations::Equations::trace(&model).map_err(raised)?;
    Ok(Equations(Arc::new(equations)))
}
