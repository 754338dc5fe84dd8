//! [`Holds`]: how each input behaves between samples.

use super::Record;
use crate::error::{Error, find};
use crate::interval::Hold;
use std::sync::Arc;

/// The holds of the inputs of a record, in their order. Two that are the same for each input are equal.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Holds {
    /// All inputs behave alike.
    All(Hold),
    /// They do not.
    Each(Arc<[Hold]>),
}

impl Holds {
    /// Of holds input by input.
    pub fn each(holds: Vec<Hold>) -> Self {
        match holds.first() {
            Some(first) if holds.iter().any(|hold| hold != first) => Holds::Each(holds.into()),
            first => Holds::All(first.copied().unwrap_or_default()),
        }
    }

    /// The hold of an input.
    pub fn of(&self, input: usize) -> Hold {
        match self {
            Holds::All(hold) => *hold,
            Holds::Each(holds) => holds.get(input).copied().unwrap_or_default(),
        }
    }

    /// Whether every input is held from sample to sample.
    pub fn all_zero(&self) -> bool {
        *self == Holds::All(Hold::Zero)
    }
}

impl Record {
    /// Says how all inputs behave between samples.
    pub fn hold(self, hold: Hold) -> Self {
        Record { holds: Holds::All(hold), ..self }
    }

    /// Says how one input behaves between samples: a command of a controller is held, what was measured is a straight line.
    ///
    /// # Errors
    /// An input that the record does not have.
    pub fn hold_of(self, input: &str, hold: Hold) -> Result<Self, Error> {
        let names: Vec<&str> = self.inputs.iter().map(|channel| channel.name.as_str()).collect();
        let at = find("input", &names, input)?;
        let holds = (0..names.len()).map(|i| if i == at { hold } else { self.holds.of(i) }).collect();
        Ok(Record { holds: Holds::each(holds), ..self })
    }

    /// How an input behaves between samples, by its place.
    pub fn input_hold(&self, input: usize) -> Hold {
        self.holds.of(input)
    }
}
