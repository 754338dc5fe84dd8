//! Simulation of equations at the declared values of their parameters.

use super::Fit;
use super::fittable::{AnyStepping, Made};
use crate::equations::Equations;
use crate::error::Error;
use crate::layout::{Kind, Layout, Quantity};
use crate::parameter::{Parameter, fixed};
use crate::problem::{Control, Problem, Settings};
use crate::record::{Channel, Initial, Record};

/// Simulations whose outputs differ by this part are one: the finer one is nearer to the truth by a factor of a hundred and more.
const NEAR: f64 = 1e-6;
/// Those that differ by more are not near enough for differences that do not shrink to be taken as they are.
const ROUGH: f64 = 1e-3;

impl Fit<'_, Equations> {
    /// Simulates the equations with the starts of the parameters, by the integrator, from an initial state in the order of the layout, as
    /// [`Simulator`](crate::Simulator) does a Rust model by the same one; the records and other settings of the fit are not used. Where no integrator
    /// was chosen, linear equations with constant coefficients cross each interval exactly where one step of Runge and Kutta is not near that; of others,
    /// steps become finer until the outputs change by less than a part of 1e-6 of their size, or finer ones bring them no nearer, and implicit steps follow
    /// where none are fine enough. `inputs` is a record of the inputs, with their holds; its outputs, if it has any, are not read. Gives it with the simulated
    /// outputs, to which [`Record::with_noise`] adds noise; its initial state is to be estimated.
    ///
    /// # Errors
    /// Other inputs or states than the equations have, an initial state that is not finite; a simulation that fails.
    pub fn simulate(&self, initial: &[f64], inputs: &Record) -> Result<Record, Error> {
        let zeros = vec![vec![0.0; inputs.len()]; self.model.layout().outputs.len()];
        let outputs = self.settled(|stepping| {
            let problem = self.of_inputs(inputs, zeros.clone(), given(initial), stepping)?;
            Ok(problem.in_units(&Control::NEVER).predict(0, &[])?.outputs)
        })?;
        with_outputs(self.model.layout(), inputs, outputs)
    }

    /// The outputs of a simulation by the integrator that was chosen; without one, by steps that become finer until the outputs settle.
    pub(super) fn settled(
        &self,
        by: impl Fn(Option<&AnyStepping>) -> Result<Vec<Vec<f64>>, Error>,
    ) -> Result<Vec<Vec<f64>>, Error> {
        let (mut outputs, mut before) = (by(self.stepping.as_ref()), f64::INFINITY);
        let chosen = self.stepping.is_some() || self.model.layout().kind != Kind::Continuous;
        let finer = if chosen { vec![] } else { self.model.finer(true) };
        for (_, stepping) in &finer {
            let again = by(Some(stepping));
            let change = outputs.as_ref().ok().zip(again.as_ref().ok()).map_or(f64::INFINITY, |(a, b)| change(a, b));
            let is_exact = stepping.is_exact() && again.is_ok();
            if again.is_ok() || outputs.is_err() {
                outputs = again;
            }
            // Of a model with jumps of its derivatives, and of outputs that are rounding, finer steps are no nearer.
            if is_exact || change <= NEAR || change <= ROUGH && change > 0.5 * before {
                break;
            }
            before = change;
        }
        outputs
    }

    /// The state at the first sample of a record of inputs, as that declares it ([`Initial`]) or the model says it, with the starts of the parameters;
    /// zero of a state that neither says. From the first sample ([`Initial::FirstSample`]) it is taken by the outputs that the record has.
    ///
    /// # Errors
    /// As [`simulate`](Self::simulate); a plant that does not rest where the record begins at rest; outputs from which the state does not follow.
    pub fn initial_state(&self, inputs: &Record) -> Result<Vec<f64>, Error> {
        let zero = vec![0.0; self.model.layout().states.len()];
        let initial = match inputs.initial_state() {
            Initial::Given(given) => return Ok(given.iter().map(|state| state.start).collect()),
            Initial::Free => return Ok(zero),
            initial => initial.clone(),
        };
        let first = initial == Initial::FirstSample;
        // Of outputs that the record lacks nothing is measured.
        let measured = |of: &Quantity| inputs.outputs().iter().find(|channel| first && channel.name == of.name);
        let of = |of: &Quantity| measured(of).map_or(vec![f64::NAN; inputs.len()], |channel| channel.values.to_vec());
        let outputs = self.model.layout().outputs.iter().map(of).collect();
        let remedy = |error| match error {
            Error::StateNotMeasured { experiment, reason, .. } if first => {
                let remedy = "give the record its outputs at the first sample, or the initial state";
                Error::StateNotMeasured { experiment, reason, remedy }
            }
            other => other,
        };
        let problem = self.of_inputs(inputs, outputs, initial, self.stepping.as_ref()).map_err(remedy)?;
        let start = problem.unknowns.start();
        let values = problem.in_units(&Control::NEVER).values_of(0, &start);
        if first {
            return Ok(values.x);
        }
        let follows = problem.sweep.follows(&problem.records[0], &values.p);
        Ok(values.x.into_iter().zip(follows).map(|(x, follows)| if follows { x } else { 0.0 }).collect())
    }

    /// The problem of a record of inputs with these outputs, by an integrator.
    pub(super) fn of_inputs(
        &self,
        inputs: &Record,
        outputs: Vec<Vec<f64>>,
        initial: Initial,
        stepping: Option<&AnyStepping>,
    ) -> Result<Problem<'_>, Error> {
        let record = with_outputs(self.model.layout(), inputs, outputs)?.initial(initial)?;
        let parameters: Vec<Parameter> = self.parameters.iter().map(|parameter| fixed(parameter.start)).collect();
        let sweep = Equations::sweep(self.model.lent(), stepping, None)?;
        Problem::unchecked(sweep, vec![record], &parameters, Settings::default())
    }
}

/// An initial state as a record has it.
pub(super) fn given(initial: &[f64]) -> Initial {
    Initial::Given(initial.iter().copied().map(fixed).collect())
}

/// By which part of its largest value an output of two simulations differs most.
fn change(outputs: &[Vec<f64>], again: &[Vec<f64>]) -> f64 {
    let most = |numbers: &mut dyn Iterator<Item = f64>| numbers.fold(0.0, |most: f64, number| most.max(number.abs()));
    let part = |(output, again): (&Vec<f64>, &Vec<f64>)| {
        let apart = most(&mut output.iter().zip(again).map(|(a, b)| a - b));
        if apart == 0.0 { 0.0 } else { apart / most(&mut again.iter().copied()) }
    };
    outputs.iter().zip(again).map(part).fold(0.0, f64::max)
}

/// A record of inputs with outputs, its initial state to be estimated.
pub(super) fn with_outputs(layout: &Layout, inputs: &Record, outputs: Vec<Vec<f64>>) -> Result<Record, Error> {
    let channel = |(of, values): (&Quantity, Vec<f64>)| Channel::new(&of.name, &of.unit, values);
    let outputs = layout.outputs.iter().zip(outputs).map(channel).collect();
    let record = Record { initial: Initial::Estimated, ..inputs.clone() };
    record.with_channels(inputs.inputs().to_vec(), outputs)
}
