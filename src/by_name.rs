//! Named vectors in serde's data model: a map from name to entry, as the structs of `signals!` have it, for names that
//! are known at run time.

use core::fmt;
use core::marker::PhantomData;
use serde::de::{Error, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Entries under names that are known at run time; a repeated name is an error.
pub(crate) struct Entries<T>(pub Vec<(String, T)>);

impl<T> Entries<T> {
    /// The entries in the order of these names; an unknown or a missing name is an error that says it.
    pub fn in_order<'n>(self, names: impl Iterator<Item = &'n str> + Clone) -> Result<Vec<T>, String> {
        if let Some((unknown, _)) = self.0.iter().find(|(name, _)| !names.clone().any(|known| known == name)) {
            let names: Vec<String> = names.map(|name| format!("`{name}`")).collect();
            return Err(format!("unknown field `{unknown}`, expected one of {}", names.join(", ")));
        }
        let mut entries: Vec<Option<(String, T)>> = self.0.into_iter().map(Some).collect();
        let mut take = |name: &str| {
            let mut here = entries.iter_mut().filter(|entry| entry.as_ref().is_some_and(|(known, _)| known == name));
            here.next().and_then(Option::take).map(|(_, entry)| entry).ok_or_else(|| format!("missing field `{name}`"))
        };
        names.map(&mut take).collect()
    }
}

impl<T: Serialize> Serialize for Entries<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.iter().map(|(name, entry)| (name, entry)))
    }
}

impl<'de, T: Deserialize<'de>> Deserialize<'de> for Entries<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(ByName(PhantomData))
    }
}

struct ByName<T>(PhantomData<T>);

impl<'de, T: Deserialize<'de>> Visitor<'de> for ByName<T> {
    type Value = Entries<T>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a map of values by name")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Entries<T>, A::Error> {
        let mut entries: Vec<(String, T)> = vec![];
        while let Some(name) = map.next_key::<String>()? {
            if entries.iter().any(|(earlier, _)| *earlier == name) {
                return Err(A::Error::custom(format_args!("duplicate field `{name}`")));
            }
            entries.push((name, map.next_value()?));
        }
        Ok(Entries(entries))
    }
}
