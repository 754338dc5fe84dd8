//! Records in serde's data model: everything that was said of one, its signals as columns by name, a missing output as
//! null. What is read is checked like any other record.

use super::{Channel, Holds, Initial, Record, Time};
use crate::by_name::Entries;
use crate::interval::Hold;
use crate::layout::Quantity;
use crate::numeral::TimeUnit;
use crate::parameter::Parameter;
use crate::real::{Read, Written};
use core::fmt;
use serde::de::value::MapAccessDeserializer;
use serde::de::{Error, IntoDeserializer, MapAccess, Visitor};
use serde::ser::SerializeStruct;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::sync::Arc;

impl Serialize for Record {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut record = serializer.serialize_struct("Experiment", 7)?;
        record.serialize_field("name", &self.name)?;
        record.serialize_field("hold", &StoredHold::of(self))?;
        record.serialize_field("initial", &StoredInitial::of(&self.initial, &self.states))?;
        record.serialize_field("time", &self.time)?;
        record.serialize_field("time_unit", &self.time_unit)?;
        record.serialize_field("inputs", &Columns(&self.inputs))?;
        record.serialize_field("outputs", &Columns(&self.outputs))?;
        record.end()
    }
}

/// Signals, to be written as columns by name.
struct Columns<'a>(&'a [Channel]);

/// One of them.
struct Values<'a>(&'a [f64]);

impl Serialize for Columns<'_> {
    fn serialize<Z: Serializer>(&self, serializer: Z) -> Result<Z::Ok, Z::Error> {
        serializer.collect_map(self.0.iter().map(|channel| (&channel.name, Values(&channel.values))))
    }
}

impl Serialize for Values<'_> {
    fn serialize<Z: Serializer>(&self, serializer: Z) -> Result<Z::Ok, Z::Error> {
        serializer.collect_seq(self.0.iter().map(Written))
    }
}

/// [`Initial`] with its states by name.
#[derive(Serialize, Deserialize)]
#[serde(rename = "Initial")]
enum StoredInitial {
    Estimated,
    Free,
    FirstSample,
    Steady,
    Given(Entries<Parameter>),
}

impl StoredInitial {
    fn of(initial: &Initial, states: &[Quantity]) -> Self {
        match initial {
            Initial::Estimated => StoredInitial::Estimated,
            Initial::Free => StoredInitial::Free,
            Initial::FirstSample => StoredInitial::FirstSample,
            Initial::Steady => StoredInitial::Steady,
            Initial::Given(given) => {
                let named = states.iter().map(|state| state.name.clone()).zip(given.iter().copied());
                StoredInitial::Given(Entries(named.collect()))
            }
        }
    }

    fn into_initial(self, states: &[Quantity]) -> Result<Initial, String> {
        let given = match self {
            StoredInitial::Estimated => return Ok(Initial::Estimated),
            StoredInitial::Free => return Ok(Initial::Free),
            StoredInitial::FirstSample => return Ok(Initial::FirstSample),
            StoredInitial::Steady => return Ok(Initial::Steady),
            StoredInitial::Given(given) => given,
        };
        given.in_order(names(states)).map(Initial::Given)
    }
}

fn names(quantities: &[Quantity]) -> impl Iterator<Item = &str> + Clone {
    quantities.iter().map(|quantity| quantity.name.as_str())
}

/// One hold of all inputs, or one of each by name.
#[derive(Serialize)]
#[serde(untagged)]
enum StoredHold {
    All(Hold),
    Each(Entries<Hold>),
}

impl StoredHold {
    fn of(record: &Record) -> Self {
        match &record.holds {
            Holds::All(hold) => StoredHold::All(*hold),
            Holds::Each(holds) => {
                let names = record.inputs.iter().map(|channel| channel.name.clone());
                StoredHold::Each(Entries(names.zip(holds.iter().copied()).collect()))
            }
        }
    }

    fn into_holds(self, inputs: &[Quantity]) -> Result<Holds, String> {
        match self {
            StoredHold::All(hold) => Ok(Holds::All(hold)),
            StoredHold::Each(holds) => holds.in_order(names(inputs)).map(Holds::each),
        }
    }
}

impl<'de> Deserialize<'de> for StoredHold {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(HoldOrEach)
    }
}

struct HoldOrEach;

impl<'de> Visitor<'de> for HoldOrEach {
    type Value = StoredHold;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a hold of all inputs, or a map of holds by name")
    }

    fn visit_str<E: Error>(self, name: &str) -> Result<StoredHold, E> {
        Hold::deserialize(name.into_deserializer()).map(StoredHold::All)
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<StoredHold, A::Error> {
        Entries::deserialize(MapAccessDeserializer::new(map)).map(StoredHold::Each)
    }
}

/// Contents of a file, before they are checked against a model.
#[derive(Deserialize)]
#[serde(rename = "Experiment", deny_unknown_fields)]
pub(crate) struct Stored {
    name: String,
    hold: StoredHold,
    initial: StoredInitial,
    time: Time,
    #[serde(default)]
    time_unit: TimeUnit,
    inputs: Entries<Read<Vec<f64>>>,
    outputs: Entries<Read<Vec<f64>>>,
}

impl Stored {
    /// The record, if it has these signals and is valid.
    pub fn into_record(
        self,
        states: Vec<Quantity>,
        inputs: &[Quantity],
        outputs: &[Quantity],
    ) -> Result<Record, String> {
        let (initial, holds) = (self.initial.into_initial(&states)?, self.hold.into_holds(inputs)?);
        let channels = |columns: Entries<Read<Vec<f64>>>, quantities: &[Quantity]| {
            let columns = columns.in_order(names(quantities))?.into_iter().zip(quantities);
            let channel = |(Read(values), quantity): (Read<Vec<f64>>, &Quantity)| {
                Channel::new(&quantity.name, &quantity.unit, values)
            };
            Ok::<_, String>(columns.map(channel).collect::<Vec<Channel>>())
        };
        let (inputs, outputs) = (channels(self.inputs, inputs)?, channels(self.outputs, outputs)?);
        let Stored { name, time, time_unit, .. } = self;
        let (states, inputs, outputs) = (states.into(), inputs.into(), outputs.into());
        let record = Record {
            name,
            states,
            time,
            time_unit,
            inputs,
            outputs,
            holds,
            initial,
            #[cfg(feature = "csv")]
            reading: None,
            looked: Arc::default(),
        };
        record.checked().map_err(|error| error.to_string())
    }
}
