//! [`Header`]: the names of the columns of a table in memory.

use super::DataFile;
use super::timing::Count;
use crate::error::Error;
use crate::layout::Quantity;

/// The names of the columns of a table in memory (a frame), which may say units as those of a [file](DataFile) do: `u`, `u [V]`, `t / ms`.
///
/// ```
/// use greybox::{layout::Quantity, record::Header};
///
/// let quantity = |name: &str, unit: &str| Quantity { name: name.into(), unit: unit.into() };
/// let header = Header::new("the frame", ["t [ms]", "speed (rpm)", "u [V]"].map(String::from).to_vec());
/// assert_eq!(header.column("u", &quantity("u", "V"))?, Some(2));
/// let refused = header.column("speed", &quantity("w", "rad/s")).unwrap_err();
/// assert!(refused.to_string().contains("`speed (rpm)` is in \"rpm\" and signal `w` in \"rad/s\""));
/// let time = header.time(None)?.unwrap();
/// assert_eq!((time, header.seconds(time, 0.0)?), (0, (1e-3, 0.0)));
/// // Of a column that is said to be that of the time, any name may have a unit behind it.
/// let header = Header::new("the frame", vec!["clock_ms".into()]);
/// assert_eq!((header.time(None)?, header.time(Some("clock_ms"))?, header.seconds(0, 0.0)?), (None, Some(0), (1e-3, 0.0)));
/// assert!(header.seconds(1, 0.0).unwrap_err().to_string().contains("no column in place 1 of 1"));
/// # Ok::<(), greybox::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Header {
    /// The rules of files.
    file: DataFile,
    names: Vec<String>,
}

impl Header {
    /// The columns of a table, which errors call `what`.
    pub fn new(what: &str, names: Vec<String>) -> Self {
        Header { file: DataFile::new(what), names }
    }

    /// The place (from zero) of the column of this name, or of this name with a unit, that holds a signal; `None` if there is none.
    ///
    /// # Errors
    /// Several such columns; a unit that is known and not that of the signal.
    pub fn column(&self, column: &str, signal: &Quantity) -> Result<Option<usize>, Error> {
        let file = self.file.clone().column(&signal.name, column);
        match file.source(&self.names, |_| None, signal, &mut Vec::new()) {
            Ok(source) => Ok(Some(source.column)),
            Err(Error::MissingColumn { .. }) => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// The place (from zero) of the column of the time: the one of the name that is said, with a unit or without, or else the one in which the time
    /// of a file is found (see [`DataFile`]); `None` if there is none.
    ///
    /// # Errors
    /// Several columns of that name.
    pub fn time(&self, said: Option<&str>) -> Result<Option<usize>, Error> {
        match self.timed(said).time_column(&self.names, &[]) {
            Ok(at) => Ok((said.is_some() || !self.names[at].is_empty()).then_some(at)),
            Err(Error::MissingColumn { .. }) => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// How the numbers in the column in this place become seconds, `(number - origin) * unit`: the unit (s), as the name or the size of the first
    /// number says, and the origin (a number of the column), zero unless they count from 1970.
    ///
    /// # Errors
    /// No column in this place; a unit that is no known unit of time; dates that are written as numbers.
    pub fn seconds(&self, time: usize, first: f64) -> Result<(f64, f64), Error> {
        let Some(name) = self.names.get(time) else {
            let columns = self.names.len();
            return Err(self.file.cannot(format!("there is no column in place {time} of {columns} (from zero)")));
        };
        let file = self.timed(Some(name));
        Ok(file
            .ticks(&self.names, None, time, Count::Number(first))?
            .map_or((1.0, 0.0), |ticks| (ticks.unit, ticks.origin)))
    }

    fn timed(&self, said: Option<&str>) -> DataFile {
        said.map_or_else(|| self.file.clone(), |said| self.file.clone().column("t", said))
    }
}
