//! [`Layout`]: which quantities a model has, their names and units, known at run time.

#[cfg(feature = "std")]
use crate::signals::Signals;
use serde::{Deserialize, Serialize};

/// Whether time is continuous, discrete, or plays no part.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// `dx/dt = f(t, x, u; p)`, written as [`Model::derivative`](crate::Model::derivative).
    Continuous,
    /// `x[k+1] = f(t, x[k], u[k]; p)`, written as [`Model::next`](crate::Model::next).
    Discrete,
    /// `y = g(t, u; p)`: no state; only [`Model::output`](crate::Model::output) is written.
    Static,
}

/// The name and the unit of one quantity; `""` or `"1"` for a ratio.
#[cfg(feature = "std")]
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Quantity {
    /// Name.
    pub name: String,
    /// Unit.
    pub unit: String,
}

/// The quantities of a model by role, in the order of its equations.
#[cfg(feature = "std")]
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Layout {
    /// The kind of the equations.
    pub kind: Kind,
    /// The states.
    pub states: Vec<Quantity>,
    /// The inputs.
    pub inputs: Vec<Quantity>,
    /// The outputs, in the units they are measured in.
    pub outputs: Vec<Quantity>,
    /// The parameters.
    pub parameters: Vec<Quantity>,
}

#[cfg(feature = "std")]
impl Layout {
    /// The layout of a model with these signals.
    pub fn new<X: Signals, U: Signals, Y: Signals, P: Signals>(kind: Kind) -> Self {
        Layout {
            kind,
            states: quantities::<X>(),
            inputs: quantities::<U>(),
            outputs: quantities::<Y>(),
            parameters: quantities::<P>(),
        }
    }
}

#[cfg(feature = "std")]
impl Layout {
    /// The equation of this number among those of the states, then of the outputs, in words.
    pub(crate) fn equation(&self, number: usize) -> String {
        match (self.states.get(number), self.kind) {
            (Some(state), Kind::Continuous) => format!("the derivative of state `{}`", state.name),
            (Some(state), _) => format!("the next value of state `{}`", state.name),
            (None, _) => format!("output `{}`", self.outputs[number - self.states.len()].name),
        }
    }
}

/// The quantities of a vector of signals.
#[cfg(feature = "std")]
pub(crate) fn quantities<X: Signals>() -> Vec<Quantity> {
    named(X::NAMES, X::UNITS)
}

/// Whether quantities are those of a vector of signals.
#[cfg(feature = "std")]
pub(crate) fn are_of<X: Signals>(quantities: &[Quantity]) -> bool {
    let known = quantities.iter().map(|quantity| (quantity.name.as_str(), quantity.unit.as_str()));
    known.eq(X::NAMES.iter().copied().zip(X::UNITS.iter().copied()))
}

#[cfg(feature = "std")]
fn named(names: &[&str], units: &[&str]) -> Vec<Quantity> {
    let quantity = |(name, unit): (&&str, &&str)| Quantity { name: (*name).to_owned(), unit: (*unit).to_owned() };
    names.iter().zip(units).map(quantity).collect()
}
