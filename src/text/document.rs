//! [`Document`]: what a model file declares, as it is written.

use super::expression::Expression;
use super::remark::Span;
use crate::interval::Hold;
use crate::layout::Kind;
use crate::parameter::Parameter;
use crate::scalar::Table;
use crate::unit::Unit;

/// A name with its place, its unit and a remark for readers.
#[derive(Clone, Debug)]
pub(super) struct Declared {
    pub name: String,
    pub at: Span,
    /// As it is written; empty where it is not.
    pub unit: String,
    /// What was read of it; `None` where there is none or a symbol of it is unknown.
    pub dimension: Option<Unit>,
    pub description: String,
}

#[derive(Clone, Debug)]
pub(super) struct Constant {
    pub quantity: Declared,
    pub value: Expression,
    /// The value that was set in place of the one that is written.
    pub set: Option<f64>,
}

#[derive(Clone, Debug)]
pub(super) struct Input {
    pub quantity: Declared,
    pub hold: Option<Hold>,
    pub delay: Option<Expression>,
}

#[derive(Clone, Debug)]
pub(super) struct DeclaredParameter {
    pub quantity: Declared,
    pub parameter: Parameter,
}

/// What `[let]` names.
#[derive(Clone, Debug)]
pub(super) struct Definition {
    pub quantity: Declared,
    pub value: Expression,
}

#[derive(Clone, Debug)]
pub(super) struct NamedTable {
    pub quantity: Declared,
    pub table: Table,
    /// Of its arguments.
    pub axes: [Option<Unit>; 2],
}

/// What is known of a state at the first sample.
#[derive(Clone, Debug)]
pub(super) enum Begin {
    Estimated,
    FirstSample,
    Steady,
    Given(Parameter),
    /// A function of parameters and inputs.
    Said(Expression),
}

#[derive(Clone, Debug)]
pub(super) struct State {
    pub quantity: Declared,
    /// The derivative, or the next state; `None` of a state that samples alone change.
    pub rate: Option<Expression>,
    /// The state after a sample, where that changes it.
    pub jump: Option<Expression>,
    pub begin: Option<(Begin, Span)>,
    pub diffusion: Option<Expression>,
    /// Standard deviation at the first sample.
    pub initial_noise: Option<Expression>,
}

impl State {
    /// The state at the first sample, where it is a function.
    pub fn initial(&self) -> Option<&Expression> {
        match &self.begin {
            Some((Begin::Said(initial), _)) => Some(initial),
            _ => None,
        }
    }
}

#[derive(Clone, Debug)]
pub(super) struct Output {
    pub quantity: Declared,
    pub value: Expression,
    pub noise: Option<Expression>,
}

/// How it is to be simulated and compared, where the file says so: names as `rk4:4` and `horizon:5`, with their places.
#[derive(Clone, Debug, Default)]
pub(super) struct Solver {
    pub integrator: Option<(String, Span)>,
    pub predictor: Option<(String, Span)>,
}

#[derive(Clone, Debug)]
pub(super) struct Document {
    pub name: String,
    pub description: String,
    pub kind: Kind,
    pub constants: Vec<Constant>,
    pub inputs: Vec<Input>,
    pub parameters: Vec<DeclaredParameter>,
    pub definitions: Vec<Definition>,
    pub tables: Vec<NamedTable>,
    pub states: Vec<State>,
    pub outputs: Vec<Output>,
    pub solver: Solver,
}

impl Document {
    /// Everything that an expression may name, with its role in a sentence.
    pub fn named(&self) -> impl Iterator<Item = (&'static str, &Declared)> {
        let constants = self.constants.iter().map(|one| ("a constant", &one.quantity));
        let inputs = self.inputs.iter().map(|one| ("an input", &one.quantity));
        let parameters = self.parameters.iter().map(|one| ("a parameter", &one.quantity));
        let tables = self.tables.iter().map(|one| ("a table", &one.quantity));
        let definitions = self.definitions.iter().map(|one| ("a definition in [let]", &one.quantity));
        let states = self.states.iter().map(|one| ("a state", &one.quantity));
        constants.chain(inputs).chain(parameters).chain(tables).chain(definitions).chain(states)
    }
}
