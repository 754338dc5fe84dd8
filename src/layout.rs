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
            (None, _) => match self.outputs.get(number - self.states.len()) {
                Some(output) => format!("output `{}`", output.name),
                None => format!(
                    "state `{}` after a sample",
                    self.states[number - self.states.len() - self.outputs.len()].name
                ),
            },
        }
    }
}

/// A name in a layout that cannot stand.
#[cfg(feature = "std")]
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum InvalidLayout {
    /// A name without a visible character.
    #[error("{role} {} of the layout has no name; name it", place + 1)]
    Unnamed {
        /// The group.
        role: &'static str,
        /// Its place in the group, from zero.
        place: usize,
    },
    /// Two quantities of one group that have the same name.
    #[error("{role} `{name}` stands twice in the layout, in places {} and {}; rename one", first + 1, second + 1)]
    Repeated {
        /// The group.
        role: &'static str,
        /// The name.
        name: String,
        /// Place of the first in the group, from zero.
        first: usize,
        /// Place of the second.
        second: usize,
    },
    /// A line end, a tab or another control character in a name or a unit.
    #[error("the name or the unit of {role} {name:?} has the control character {character:?}; leave it out")]
    Control {
        /// The group.
        role: &'static str,
        /// The name.
        name: String,
        /// The character.
        character: char,
    },
}

#[cfg(feature = "std")]
impl Layout {
    /// Whether each quantity has a name of its own in its group, which can be printed in one line.
    ///
    /// # Errors
    /// The first name that is empty, stands twice, or has a control character.
    pub fn check(&self) -> Result<(), InvalidLayout> {
        let groups = [
            ("state", &self.states),
            ("input", &self.inputs),
            ("output", &self.outputs),
            ("parameter", &self.parameters),
        ];
        groups.into_iter().try_for_each(|(role, quantities)| check_names(role, quantities))
    }
}

#[cfg(feature = "std")]
fn check_names(role: &'static str, quantities: &[Quantity]) -> Result<(), InvalidLayout> {
    let mut places = std::collections::HashMap::new();
    for (place, Quantity { name, unit }) in quantities.iter().enumerate() {
        if name.trim().is_empty() {
            return Err(InvalidLayout::Unnamed { role, place });
        }
        if let Some(character) = name.chars().chain(unit.chars()).find(|character| character.is_control()) {
            return Err(InvalidLayout::Control { role, name: name.clone(), character });
        }
        if let Some(first) = places.insert(name.as_str(), place) {
            return Err(InvalidLayout::Repeated { role, name: name.clone(), first, second: place });
        }
    }
    Ok(())
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
