//! The models that ship as texts.

use super::{Error, Model};

/// A model that ships with the library.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shipped {
    /// Its name for programs, such as `pmsm`.
    pub name: &'static str,
    /// Its file.
    pub text: &'static str,
}

macro_rules! shipped {
    ($($name:literal),*) => {
        &[$(Shipped { name: $name, text: include_str!(concat!("../../models/", $name, ".toml")) }),*]
    };
}

const SHIPPED: &[Shipped] = shipped!(
    "pmsm",
    "salient",
    "saturated",
    "flux_mapped",
    "flux_linkage",
    "cabled",
    "emf_harmonic",
    "compensated",
    "inverter_fed",
    "misaligned",
    "machine",
    "shaft",
    "exact_surface",
    "exact_salient",
    "positioning",
    "positioning_loop"
);

/// The models that ship as texts, each of which has a twin in Rust in [`pmsm`](crate::pmsm) or [`models`](crate::models).
pub fn shipped() -> &'static [Shipped] {
    SHIPPED
}

impl Model {
    /// A model that ships, by its name: `pmsm`, `salient`, `machine`, ...
    ///
    /// # Errors
    /// A name that none has.
    pub fn shipped(name: &str) -> Result<Self, Error> {
        let Some(found) = SHIPPED.iter().find(|shipped| shipped.name == name) else {
            let known = SHIPPED.iter().map(|shipped| shipped.name.to_owned()).collect();
            return Err(Error::Unknown { what: "model that ships", name: name.to_owned(), known });
        };
        Model::named(found.name, found.text)
    }
}
