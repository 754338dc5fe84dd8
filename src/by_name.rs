//! Signals of a generic type in serde's data model: a map from name to entry, as the structs of `signals!` have it.
//!
//! For fields of type `Of<X, T>`, where `X` is only known to be [`Signals`]:
//! `#[serde(serialize_with = "by_name::serialize::<X, _, _>", deserialize_with = "by_name::deserialize::<X, _, _>")]`.

use crate::signals::{Entry, Of, Signals};
use core::fmt;
use core::marker::PhantomData;
use serde::de::{Error, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Writes the entries under their names.
pub(crate) fn serialize<X: Signals, T: Entry + Serialize, S: Serializer>(
    signals: &Of<X, T>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    serializer.collect_map(X::NAMES.iter().zip(X::into_array(*signals)))
}

/// Reads the entries; a missing, unknown or repeated name is an error that says it.
pub(crate) fn deserialize<'de, X: Signals, T: Entry + Deserialize<'de>, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<Of<X, T>, D::Error> {
    let entries: Vec<T> = in_order::<X, T, D>(deserializer)?;
    Ok(X::from_fn(|i| entries[i]))
}

/// Reads one value for each name of `X`, in the order of declaration.
pub(crate) fn in_order<'de, X: Signals, T: Deserialize<'de>, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<Vec<T>, D::Error> {
    deserializer.deserialize_map(ByName::<X, T>(PhantomData))
}

struct ByName<X, T>(PhantomData<(X, T)>);

impl<'de, X: Signals, T: Deserialize<'de>> Visitor<'de> for ByName<X, T> {
    type Value = Vec<T>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "one value for each of: {}", X::NAMES.join(", "))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Vec<T>, A::Error> {
        let mut values: Vec<Option<T>> = X::NAMES.iter().map(|_| None).collect();
        while let Some(name) = map.next_key::<String>()? {
            let Some(i) = X::position(&name) else { return Err(A::Error::unknown_field(&name, X::NAMES)) };
            if values[i].replace(map.next_value()?).is_some() {
                return Err(A::Error::duplicate_field(X::NAMES[i]));
            }
        }
        let named = values.into_iter().zip(X::NAMES);
        named.map(|(value, name)| value.ok_or_else(|| A::Error::missing_field(name))).collect()
    }
}
