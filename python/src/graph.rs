//! [`Graph`]: the arithmetic of a model while Python code is read.

use crate::convert::{named, raised};
use greybox::graph::{Function, Function2, Id, Leaf};
use greybox::scalar::{Comparison, Extrapolation, Interpolation};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use serde::{Deserialize, Serialize};

/// A node of a graph.
#[pyclass(frozen, module = "greybox._core")]
#[derive(Clone, Copy)]
pub struct Node(pub Id);

/// A function of quantities: a graph and a root of it.
#[pyclass(frozen, module = "greybox._core", from_py_object)]
#[derive(Clone, Serialize, Deserialize)]
pub struct Expression {
    pub graph: greybox::graph::Graph,
    pub root: Id,
}

#[pymethods]
impl Expression {
    #[new]
    fn new(graph: &Graph, root: &Node) -> Self {
        Expression { graph: graph.0.clone(), root: root.0 }
    }

    #[staticmethod]
    fn from_bytes(bytes: &[u8]) -> PyResult<Self> {
        serde_json::from_slice(bytes).map_err(raised)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, (Bound<'py, PyBytes>,))> {
        let bytes = serde_json::to_vec(slf.get()).map_err(raised)?;
        Ok((slf.get_type().getattr("from_bytes")?, (PyBytes::new(slf.py(), &bytes),)))
    }
}

/// A function known at points, of one argument or two.
#[pyclass(frozen, module = "greybox._core")]
pub struct Table(greybox::scalar::Table);

#[pymethods]
impl Table {
    /// A table over `x`, and over `y` where that is not empty: then a value for each `x` and `y`, by rows.
    #[new]
    fn new(x: Vec<f64>, y: Vec<f64>, values: Vec<f64>, method: &str, outside: &str) -> PyResult<Self> {
        let (method, outside): (Interpolation, Extrapolation) = (named(method)?, named(outside)?);
        let table = match y.is_empty() {
            true => greybox::scalar::Table::curve(&x, &values, method, outside),
            false => greybox::scalar::Table::surface(&x, &y, &values, method, outside),
        };
        table.map(Table).map_err(raised)
    }

    /// The value at a place.
    fn at(&self, x: f64, y: f64) -> f64 {
        self.0.at2(x, y)
    }
}

/// Arithmetic as a value.
#[pyclass(module = "greybox._core")]
#[derive(Default)]
pub struct Graph(pub greybox::graph::Graph);

#[pymethods]
impl Graph {
    #[new]
    fn new() -> Self {
        Graph::default()
    }

    fn __len__(&self) -> usize {
        self.0.len()
    }

    fn constant(&mut self, value: f64) -> Node {
        Node(self.0.constant(value))
    }

    fn time(&mut self) -> Node {
        Node(self.0.leaf(Leaf::Time))
    }

    fn state(&mut self, i: u32) -> Node {
        Node(self.0.leaf(Leaf::State(i)))
    }

    fn input(&mut self, i: u32) -> Node {
        Node(self.0.leaf(Leaf::Input(i)))
    }

    fn measured(&mut self, i: u32) -> Node {
        Node(self.0.leaf(Leaf::Measured(i)))
    }

    fn parameter(&mut self, i: u32) -> Node {
        Node(self.0.leaf(Leaf::Parameter(i)))
    }

    /// The number that a node is, if it is known.
    fn known(&self, a: &Node) -> Option<f64> {
        self.0.known(a.0)
    }

    fn neg(&mut self, a: &Node) -> Node {
        Node(self.0.neg(a.0))
    }

    fn add(&mut self, a: &Node, b: &Node) -> Node {
        Node(self.0.add(a.0, b.0))
    }

    fn sub(&mut self, a: &Node, b: &Node) -> Node {
        Node(self.0.sub(a.0, b.0))
    }

    fn mul(&mut self, a: &Node, b: &Node) -> Node {
        Node(self.0.mul(a.0, b.0))
    }

    fn div(&mut self, a: &Node, b: &Node) -> Node {
        Node(self.0.div(a.0, b.0))
    }

    fn power(&mut self, a: &Node, n: i32) -> Node {
        Node(self.0.power(a.0, n))
    }

    fn function(&mut self, name: &str, a: &Node) -> PyResult<Node> {
        let function: Function = named(name)?;
        Ok(Node(self.0.function(function, a.0)))
    }

    fn function2(&mut self, name: &str, a: &Node, b: &Node) -> PyResult<Node> {
        let function: Function2 = named(name)?;
        Ok(Node(self.0.function2(function, a.0, b.0)))
    }

    fn table(&mut self, table: &Table, x: &Node, y: &Node) -> Node {
        Node(self.0.table(&table.0, [0, 0], [x.0, y.0]))
    }

    /// `then` where the comparison of `a` with `b` holds, else `otherwise`.
    fn select(&mut self, comparison: &str, a: &Node, b: &Node, then: &Node, otherwise: &Node) -> PyResult<Node> {
        let comparison: Comparison = named(comparison)?;
        Ok(Node(self.0.select(comparison, a.0, b.0, then.0, otherwise.0)))
    }
}
