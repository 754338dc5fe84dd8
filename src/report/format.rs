//! [`Format`] and [`Version`]: what a file of a report says that it is.

use serde::{Deserialize, Serialize};

/// The kind of file; another one is refused by name.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "&'static str")]
pub struct Format;

/// The version of the format, raised with every change of its schema; another one is refused by number.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "u32", into = "u32")]
pub struct Version;

const FORMAT: &str = "greybox report";
const VERSION: u32 = 3;

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
            false => Err(format!("the format is \"{found}\", but a report says \"{FORMAT}\"")),
        }
    }
}

impl From<Version> for u32 {
    fn from(_: Version) -> Self {
        VERSION
    }
}

impl TryFrom<u32> for Version {
    type Error = String;
    fn try_from(found: u32) -> Result<Self, String> {
        match found == VERSION {
            true => Ok(Version),
            false => Err(format!("the report has version {found}, but this version of the library reads {VERSION}")),
        }
    }
}
