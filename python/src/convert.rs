//! Errors of the library as the package's exception, and names as the library's enumerations.

use crate::remedies::in_python;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::PyType;
use serde::Deserialize;
use serde::de::IntoDeserializer;
use serde::de::value::{Error as NameError, StrDeserializer};
use std::fmt::Display;

/// The exception `greybox.Error` with a sentence of the library.
pub fn raised(error: impl Display) -> PyErr {
    static CLASS: PyOnceLock<Py<PyType>> = PyOnceLock::new();
    let text = in_python(&error.to_string());
    Python::attach(|py| match CLASS.import(py, "greybox.errors", "Error") {
        Ok(class) => PyErr::from_type(class.clone(), text),
        Err(_) => PyValueError::new_err(text),
    })
}

/// The variant of this name.
pub fn named<'de, T: Deserialize<'de>>(name: &'de str) -> PyResult<T> {
    let name: StrDeserializer<'de, NameError> = name.into_deserializer();
    T::deserialize(name).map_err(raised)
}

/// The name that a variant is stored by.
pub fn name_of(variant: impl serde::Serialize) -> String {
    match serde_json::to_value(variant) {
        Ok(serde_json::Value::String(name)) => name,
        Ok(serde_json::Value::Object(fields)) => {
            fields.get("code").and_then(|code| code.as_str()).unwrap_or_default().to_owned()
        }
        _ => String::new(),
    }
}
