//! The compiled part of the Python package `greybox`: graphs, records, fits and reports of the library as Python objects.
//!
//! Python code in `greybox/` reads models and frames, and shows results; what is computed is computed here.

mod convert;
mod diagnose;
mod equations;
mod estimate;
mod fleet;
mod graph;
mod header;
mod problem;
mod record;
mod remedies;
mod run;
mod settings;
mod text;

use pyo3::prelude::*;

#[pymodule]
fn _core(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_class::<graph::Graph>()?;
    module.add_class::<graph::Node>()?;
    module.add_class::<graph::Table>()?;
    module.add_class::<graph::Expression>()?;
    module.add_class::<equations::Equations>()?;
    module.add_class::<header::Header>()?;
    module.add_class::<record::Record>()?;
    module.add_class::<text::TextModel>()?;
    module.add_class::<settings::Parameter>()?;
    module.add_class::<problem::Problem>()?;
    module.add_class::<estimate::Estimate>()?;
    module.add_class::<diagnose::Report>()?;
    module.add_function(wrap_pyfunction!(fleet::fleet, module)?)?;
    module.add_function(wrap_pyfunction!(equations::surface, module)?)
}
