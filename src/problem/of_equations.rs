//! [`EquationsFit`]: from equations that are known at run time to a problem.

use super::finer::SUBSTEPS;
use super::{Control, FinerSweeps, MakeSweep, Problem, Settings};
use crate::equations::Equations;
use crate::error::Error;
use crate::integrate::{Integrator, Method, automatic, stiff};
use crate::layout::{Kind, Quantity};
use crate::parameter::{Parameter, fixed};
use crate::predict::{Prediction, Predictor, simulation};
use crate::record::{Channel, Initial, Record, Time};
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
        Ok(Problem::new(self.sweep()?, records, parameters, settings)?.refining(self.finer()))
    }

    /// Simulates the equations by this integrator (or one step per sample) from an initial state, inputs held from sample to sample, as
    /// [`simulate`](crate::simulate()) does a Rust model. Parameters, states and each sample's row of inputs are in the order of the
    /// layout. Gives a record of inputs and outputs, to which [`Record::with_noise`] adds noise; its initial state is to be estimated.
    ///
    /// # Errors
    /// As [`Record::new`]; not one number for each parameter, state and input, or one that is not finite; a simulation that fails.
    pub fn simulate(
        &self,
        parameters: &[f64],
        initial: &[f64],
        time: Time,
        inputs: &[Vec<f64>],
    ) -> Result<Record, Error> {
        let layout = self.equations.layout();
        if let Some(k) = inputs.iter().position(|row| row.len() != layout.inputs.len()) {
            let (found, expected) = (inputs[k].len(), layout.inputs.len());
            return Err(Error::Option(format!("sample {k} has {found} input(s), the equations have {expected}")));
        }
        let record = |outputs: Vec<Vec<f64>>| {
            let channel = |of: &Quantity, values: Vec<f64>| Channel::new(&of.name, &of.unit, values);
            let column = |(i, of): (usize, &Quantity)| channel(of, inputs.iter().map(|row| row[i]).collect());
            let inputs = layout.inputs.iter().enumerate().map(column).collect();
            let outputs = layout.outputs.iter().zip(outputs).map(|(of, values)| channel(of, values)).collect();
            Record::new(layout.states.clone(), time.clone(), inputs, outputs)
        };
        let given = Initial::Given(initial.iter().copied().map(fixed).collect());
        let unmeasured = record(vec![vec![0.0; inputs.len()]; layout.outputs.len()])?;
        let parameters: Vec<Parameter> = parameters.iter().copied().map(fixed).collect();
        let method = self.method.clone().unwrap_or_else(|| automatic(1));
        let sweep = of_equations(&self.equations, &method, &simulation())?;
        let records = vec![unmeasured.named("simulation").initial(given)?];
        let problem = Problem::unchecked(sweep, records, &parameters, Settings::default())?;
        record(problem.in_units(&Control::NEVER).predict(0, &[])?.outputs)
    }

    /// The equations by the integrator, or by the first of the default ones.
    pub(crate) fn sweep(&self) -> Result<Arc<dyn Sweep>, Error> {
        self.by(&self.method.clone().unwrap_or_else(|| automatic(1)))
    }

    fn by(&self, method: &Arc<dyn Method>) -> Result<Arc<dyn Sweep>, Error> {
        of_equations(&self.equations, method, &self.predictor)
    }

    /// The methods that follow the default one.
    pub(crate) fn finer(&self) -> Arc<FinerSweeps<'static>> {
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
