//! Records in serde's data model: everything that was said of one, its signals as columns by name, a missing output as
//! null. What is read is checked like any other record.

use super::{Experiment, Initial, Time};
use crate::by_name;
use crate::interval::Hold;
use crate::signals::{Of, Signals};
use serde::de::Error as _;
use serde::ser::SerializeStruct;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::marker::PhantomData;

impl<X: Signals, U: Signals, Y: Signals> Serialize for Experiment<X, U, Y> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut record = serializer.serialize_struct("Experiment", 6)?;
        record.serialize_field("name", &self.name)?;
        record.serialize_field("hold", &self.hold)?;
        record.serialize_field("initial", &self.initial)?;
        record.serialize_field("time", &self.time)?;
        record.serialize_field("inputs", &Columns::<U>(&self.inputs))?;
        record.serialize_field("outputs", &Columns::<Y>(&self.outputs))?;
        record.end()
    }
}

/// The rows of a signal vector, to be written as columns by name.
struct Columns<'a, S: Signals>(&'a [Of<S, f64>]);

/// One of them.
struct Column<'a, S: Signals>(&'a [Of<S, f64>], usize);

impl<S: Signals> Serialize for Columns<'_, S> {
    fn serialize<Z: Serializer>(&self, serializer: Z) -> Result<Z::Ok, Z::Error> {
        serializer.collect_map(S::NAMES.iter().enumerate().map(|(i, name)| (name, Column::<S>(self.0, i))))
    }
}

impl<S: Signals> Serialize for Column<'_, S> {
    fn serialize<Z: Serializer>(&self, serializer: Z) -> Result<Z::Ok, Z::Error> {
        let values = self.0.iter().map(|row| S::into_array(*row).as_ref()[self.1]);
        serializer.collect_seq(values.map(|value| Some(value).filter(|value| !value.is_nan())))
    }
}

/// What stands in a file, before it is checked.
#[derive(Deserialize)]
#[serde(rename = "Experiment", deny_unknown_fields, bound = "")]
struct Unchecked<X: Signals, U: Signals, Y: Signals> {
    name: String,
    hold: Hold,
    initial: Initial<X>,
    time: Time,
    #[serde(deserialize_with = "by_name::in_order::<U, _, _>")]
    inputs: Vec<Vec<Option<f64>>>,
    #[serde(deserialize_with = "by_name::in_order::<Y, _, _>")]
    outputs: Vec<Vec<Option<f64>>>,
    #[serde(skip)]
    signals: PhantomData<(U, Y)>,
}

impl<'de, X: Signals, U: Signals, Y: Signals> Deserialize<'de> for Experiment<X, U, Y> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let Unchecked { name, hold, initial, time, inputs, outputs, .. } =
            Unchecked::<X, U, Y>::deserialize(deserializer)?;
        let columns = U::NAMES.iter().zip(&inputs).chain(Y::NAMES.iter().zip(&outputs));
        let lengths: Vec<_> = columns.map(|(name, column)| (name, column.len())).collect();
        let samples = lengths.first().map_or(0, |(_, samples)| *samples);
        if let Some((column, found)) = lengths.iter().find(|(_, found)| *found != samples) {
            let (reference, _) = lengths[0];
            return Err(D::Error::custom(format_args!(
                "experiment `{name}`: `{column}` has {found} rows, but `{reference}` has {samples}; every sample needs both"
            )));
        }
        let (inputs, outputs) = (rows::<U>(&inputs, samples), rows::<Y>(&outputs, samples));
        Experiment { name, time, inputs, outputs, hold, initial }.checked().map_err(D::Error::custom)
    }
}

fn rows<S: Signals>(columns: &[Vec<Option<f64>>], samples: usize) -> Vec<Of<S, f64>> {
    (0..samples).map(|k| S::from_fn(|i| columns[i][k].unwrap_or(f64::NAN))).collect()
}
