//! [`Format`]: what a file of a report says that it is.

use serde::{Deserialize, Serialize};

/// The name of the schema; a file of another one is refused by name.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "&'static str")]
pub struct Format;

const FORMAT: &str = "greybox report 3";

impl From<Format> for &'static str {
    fn from(_: Format) -> Self {
        FORMAT
    }
}

impl TryFrom<String> for Format {
    type Error = String;
    fn try_from(found: String) -> Result<Self, String> {
        match found == FORMAT {
            true => Ok(Format),
            false => Err(format!("the format is \"{found}\", but this version of the library reads \"{FORMAT}\"")),
        }
    }
}
