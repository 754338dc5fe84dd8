//! [`EquationsFit`]: from equations that are known at run time to a problem.

use super::finer::SUBSTEPS;
use super::{FinerSweeps, MakeSweep, Problem, Settings};
use crate::equations::Equations;
use crate::error::Error;
use crate::integrate::{Integrator, Method, automatic, stiff};
use crate::layout::Kind;
use crate::parameter::Parameter;
use crate::predict::{Prediction, Predictor, simulation};
use crate::record::Record;
use crate::sweep::{Sweep, of_equations};
use std::sync::Arc;

/// A fit of [`Equations`]: a model that was made at run time or read from a file, with any number of quantities.
///
/// What is made of it is a [`Problem`] as a typed [`Fit`](crate::Fit) makes one: search, judgement, [`diagnose`](crate::diagnose) and
/// [`Report`](crate::Report) are the same, and so are the answers. The equations are compiled where they can be; an integrator whose steps
/// depend on the state evaluates them node by node, which is several times slower than a Rust model's own code.
///
/// ```
/// use greybox::equations::Equations;
/// use greybox::graph::{Graph, Leaf};
/// use greybox::layout::{Layout, Quantity};
/// use greybox::problem::{EquationsFit, Settings};
/// use greybox::record::{Channel, Record};
/// use greybox::{Kind, Time, free};
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// // dx/dt = (u - x) / tau, y = x
/// let named = |name: &str, unit: &str| Quantity { name: name.to_owned(), unit: unit.to_owned() };
/// let layout = Layout {
///     kind: Kind::Continuous,
///     states: vec![named("x", "V")],
///     inputs: vec![named("u", "V")],
///     outputs: vec![named("y", "V")],
///     parameters: vec![named("tau", "s")],
/// };
/// let mut graph = Graph::default();
/// let [x, u, tau] = [Leaf::State(0), Leaf::Input(0), Leaf::Parameter(0)].map(|leaf| graph.leaf(leaf));
/// let rest = graph.sub(u, x);
/// let slope = graph.div(rest, tau);
/// let equations = Equations::new(layout, &graph, &[slope], &[x])?;
///
/// // A step response of 0.5 s, sampled every 10 ms.
/// let y: Vec<f64> = (0..200).map(|k| 1.0 - (-0.01 * f64::from(k) / 0.5).exp()).collect();
/// let (time, states) = (Time::Uniform { start: 0.0, step: 0.01 }, equations.layout().states.clone());
/// let inputs = vec![Channel::new("u", "V", vec![1.0; 200])];
/// let record = Record::new(states, time, inputs, vec![Channel::new("y", "V", y)])?;
///
/// let problem = EquationsFit::new(equations).problem(vec![record], &[free(1.0)], Settings::default())?;
/// let found = problem.run()?;
/// assert!((found.parameters[0].value - 0.5).abs() < 1e-6);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct EquationsFit {
    equations: Arc<Equations>,
    /// `None` if it was not chosen.
    method: Option<Arc<dyn Method>>,
    predictor: Arc<dyn Prediction>,
}

impl EquationsFit {
    /// A fit by the default integrator, which is refined as that of a [`Fit`](crate::Fit::integrator), of the simulation error.
    pub fn new(equations: impl Into<Arc<Equations>>) -> Self {
        EquationsFit { equations: equations.into(), method: None, predictor: simulation() }
    }

    /// Sets the integrator. It is kept, with a warning if its step moves the answer.
    pub fn integrator(self, integrator: impl Integrator) -> Self {
        EquationsFit { method: Some(Arc::new(integrator)), ..self }
    }

    /// Sets the predictor, whose prediction error is minimized.
    pub fn predictor(self, predictor: impl Predictor) -> Self {
        EquationsFit { predictor: Arc::new(predictor), ..self }
    }

    /// The problem of these records, whose states and signals are those of the equations' layout, in its order, and of a parameter for
    /// each that it has.
    ///
    /// # Errors
    /// As [`Problem::new`]; an integrator or a predictor that does not serve the equations.
    pub fn problem(
        &self,
        records: Vec<Record>,
        parameters: &[Parameter],
        settings: Settings,
    ) -> Result<Problem<'static>, Error> {
        let sweep = self.by(&self.method.clone().unwrap_or_else(|| automatic(1)))?;
        Ok(Problem::new(sweep, records, parameters, settings)?.refining(self.finer()))
    }

    fn by(&self, method: &Arc<dyn Method>) -> Result<Arc<dyn Sweep>, Error> {
        of_equations(&self.equations, method, &self.predictor)
    }

    /// The methods that follow the default one.
    fn finer(&self) -> Arc<FinerSweeps<'static>> {
        if self.method.is_some() || self.equations.layout().kind != Kind::Continuous {
            return FinerSweeps::new(vec![]);
        }
        let by = |method: Arc<dyn Method>| -> MakeSweep<'static> {
            let fit = self.clone();
            Arc::new(move || fit.by(&method))
        };
        FinerSweeps::new(SUBSTEPS.map(automatic).into_iter().chain([stiff()]).map(by).collect())
    }
}
