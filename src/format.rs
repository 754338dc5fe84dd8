//! Identification of a stored file: a format and a version, checked before anything else is read.

use serde::Deserialize;
use serde::de::DeserializeOwned;

/// Defines the types `Format` and `Version` of one kind of file. Each is a unit that is stored as the given text or number,
/// and that can be read from nothing else.
macro_rules! format {
    ($format:literal, $version:literal) => {
        /// The kind of file; another one is refused by name.
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
        #[serde(try_from = "String", into = "&'static str")]
        pub struct Format;

        /// The version of the format, raised with every change of its schema; another one is refused by number.
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
        #[serde(try_from = "u64", into = "u64")]
        pub struct Version;

        impl From<Format> for &'static str {
            fn from(_: Format) -> Self {
                $format
            }
        }

        impl TryFrom<String> for Format {
            type Error = String;
            fn try_from(found: String) -> Result<Self, String> {
                match found == $format {
                    true => Ok(Format),
                    false => Err(std::format!("the format is \"{found}\"; read a file of the format \"{}\"", $format)),
                }
            }
        }

        impl From<Version> for u64 {
            fn from(_: Version) -> Self {
                $version
            }
        }

        impl TryFrom<u64> for Version {
            type Error = String;
            fn try_from(found: u64) -> Result<Self, String> {
                match found == $version {
                    true => Ok(Version),
                    false => Err(std::format!(
                        "version {found} of the format \"{}\", but this version of the library reads {}; read it with the \
                         version of the library that wrote it",
                        $format,
                        $version
                    )),
                }
            }
        }
    };
}
pub(crate) use format;

/// The two entries of a file that are read first, wherever they stand in it.
#[derive(Deserialize)]
struct Header<F, V> {
    #[serde(rename = "format")]
    _format: F,
    #[serde(rename = "version")]
    _version: V,
}

/// Reads JSON whose `format` and `version` are `F` and `V`; another one is refused for these before its other entries are
/// looked at.
pub(crate) fn read<F: DeserializeOwned, V: DeserializeOwned, T: DeserializeOwned>(
    text: &str,
) -> Result<T, serde_json::Error> {
    serde_json::from_str::<Header<F, V>>(text)?;
    serde_json::from_str(text)
}
