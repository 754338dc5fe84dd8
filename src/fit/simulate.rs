//! Simulation of equations at the declared values of their parameters.

use super::Fit;
use super::fittable::Made;
use crate::equations::Equations;
use crate::error::Error;
use crate::layout::Quantity;
use crate::parameter::{Parameter, fixed};
use crate::problem::{Control, Problem, Settings};
use crate::record::{Channel, Initial, Record};

impl Fit<'_, Equations> {
    /// Simulates the equations with the starts of the parameters, by the integrator (or one step per sample), from an initial state in
    /// the order of the layout, as [`simulate`](crate::simulate()) does a Rust model; the records and other settings of the fit are not
    /// used. `inputs` is a record of the inputs, with their holds; its outputs, if it has any, are not read. Gives it with the simulated
    /// outputs, to which [`Record::with_noise`] adds noise; its initial state is to be estimated.
    ///
    /// # Errors
    /// Other inputs or states than the equations have, an initial state that is not finite; a simulation that fails.
    pub fn simulate(&self, initial: &[f64], inputs: &Record) -> Result<Record, Error> {
        let layout = self.model.layout();
        let record = |outputs: Vec<Vec<f64>>| {
            let channel = |(of, values): (&Quantity, Vec<f64>)| Channel::new(&of.name, &of.unit, values);
            let outputs = layout.outputs.iter().zip(outputs).map(channel).collect();
            let record = Record { initial: Initial::Estimated, ..inputs.clone() };
            record.with_channels(inputs.inputs().to_vec(), outputs)
        };
        let given = Initial::Given(initial.iter().copied().map(fixed).collect());
        let unmeasured = record(vec![vec![0.0; inputs.len()]; layout.outputs.len()])?.initial(given)?;
        let parameters: Vec<Parameter> = self.parameters.iter().map(|parameter| fixed(parameter.start)).collect();
        let sweep = Equations::sweep(self.model.lent(), self.stepping.as_ref(), None)?;
        let problem = Problem::unchecked(sweep, vec![unmeasured], &parameters, Settings::default())?;
        record(problem.in_units(&Control::NEVER).predict(0, &[])?.outputs)
    }
}
