//! Simulation of equations at the declared values of their parameters.

use super::Fit;
use super::fittable::Made;
use crate::equations::Equations;
use crate::error::Error;
use crate::interval::Hold;
use crate::layout::Quantity;
use crate::parameter::{Parameter, fixed};
use crate::problem::{Control, Problem, Settings};
use crate::record::{Channel, Initial, Record, Time};

impl Fit<'_, Equations> {
    /// Simulates the equations with the starts of the parameters, by the integrator (or one step per sample), from an initial state,
    /// as [`simulate`](crate::simulate()) does a Rust model; the records and other settings of the fit are not used. States and each
    /// sample's row of inputs are in the order of the layout. Gives a record of inputs and outputs, to which
    /// [`Record::with_noise`] adds noise; its initial state is to be estimated.
    ///
    /// # Errors
    /// As [`Record::new`]; not one number for each state and input, or one that is not finite; a simulation that fails.
    pub fn simulate(&self, initial: &[f64], time: Time, hold: Hold, inputs: &[Vec<f64>]) -> Result<Record, Error> {
        let layout = self.model.layout();
        if let Some(k) = inputs.iter().position(|row| row.len() != layout.inputs.len()) {
            let (found, expected) = (inputs[k].len(), layout.inputs.len());
            return Err(Error::Option(format!("sample {k} has {found} input(s), the equations have {expected}")));
        }
        let record = |outputs: Vec<Vec<f64>>| {
            let channel = |of: &Quantity, values: Vec<f64>| Channel::new(&of.name, &of.unit, values);
            let column = |(i, of): (usize, &Quantity)| channel(of, inputs.iter().map(|row| row[i]).collect());
            let inputs = layout.inputs.iter().enumerate().map(column).collect();
            let outputs = layout.outputs.iter().zip(outputs).map(|(of, values)| channel(of, values)).collect();
            Record::new(layout.states.clone(), time.clone(), inputs, outputs).map(|record| record.hold(hold))
        };
        let given = Initial::Given(initial.iter().copied().map(fixed).collect());
        let unmeasured = record(vec![vec![0.0; inputs.len()]; layout.outputs.len()])?;
        let parameters: Vec<Parameter> = self.parameters.iter().map(|parameter| fixed(parameter.start)).collect();
        let sweep = Equations::sweep(self.model.lent(), self.stepping.as_ref(), None)?;
        let records = vec![unmeasured.named("simulation").initial(given)?];
        let problem = Problem::unchecked(sweep, records, &parameters, Settings::default())?;
        record(problem.in_units(&Control::NEVER).predict(0, &[])?.outputs)
    }
}
