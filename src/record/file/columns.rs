//! Files of columns, which are no text: their cells become a record.

#[cfg(feature = "arrow")]
mod arrow;
#[cfg(feature = "mat")]
mod hdf5;
#[cfg(feature = "mat")]
mod matlab;
#[cfg(feature = "npz")]
mod npz;
mod times;

use super::read::Plan;
use super::{DataFile, FileFormat, Reading};
use crate::error::Error;
use crate::record::Record;
use std::borrow::Cow;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// An open file of columns.
pub(super) trait Columns {
    fn format(&self) -> FileFormat;

    /// The names of its columns.
    fn names(&self) -> &[String];

    /// The unit of a column, if the file says one.
    fn unit(&self, column: usize) -> Option<&str> {
        let _ = column;
        None
    }

    /// Reads some of the columns, and one more whose cells are texts, to group by.
    ///
    /// # Errors
    /// A file that is damaged, a column of another kind of cells.
    fn read(&mut self, columns: &[usize], keys: Option<usize>) -> Result<Vec<Cells>, Error>;
}

/// The cells of a column.
#[derive(Debug)]
pub(super) enum Cells {
    /// Numbers; NaN where there is none.
    Numbers(Vec<f64>),
    /// Whole numbers of 64 bits.
    Whole(Vec<Option<i64>>),
    /// Lengths of time (s).
    Seconds(Vec<f64>),
    /// Times of day: nanoseconds since midnight.
    Clocks(Vec<Option<i64>>),
    /// Dates: nanoseconds since 1970, and whether they are in universal time or local ones.
    Instants {
        nanoseconds: Vec<Option<i64>>,
        universal: bool,
    },
    Texts(Vec<String>),
}

impl Cells {
    /// What the cells are.
    pub(super) fn kind(&self) -> &'static str {
        match self {
            Cells::Numbers(_) | Cells::Whole(_) => "numbers",
            Cells::Seconds(_) => "lengths of time",
            Cells::Clocks(_) => "times of day",
            Cells::Instants { .. } => "dates",
            Cells::Texts(_) => "text",
        }
    }

    fn len(&self) -> usize {
        match self {
            Cells::Numbers(numbers) | Cells::Seconds(numbers) => numbers.len(),
            Cells::Whole(counts) | Cells::Clocks(counts) | Cells::Instants { nanoseconds: counts, .. } => counts.len(),
            Cells::Texts(texts) => texts.len(),
        }
    }

    /// The numbers, if there are any.
    fn numbers(&self) -> Option<Cow<'_, [f64]>> {
        match self {
            Cells::Numbers(numbers) => Some(numbers.into()),
            Cells::Whole(counts) => {
                Some(counts.iter().map(|count| count.map_or(f64::NAN, |count| count as f64)).collect())
            }
            _ => None,
        }
    }

    /// Whole numbers as texts, to group by; NaN is an empty one.
    #[cfg(any(feature = "mat", feature = "npz"))]
    fn into_keys(self) -> Result<Cells, String> {
        match self {
            // Larger ones are rounded, so that two may be the same.
            Cells::Numbers(numbers) if numbers.iter().any(|number| number.abs() >= MAX_KEY) => {
                Err("numbers beyond 2^53, which are rounded".to_owned())
            }
            Cells::Numbers(numbers) if numbers.iter().any(|number| number.is_finite() && number.fract() != 0.0) => {
                Err("numbers that are not whole".to_owned())
            }
            Cells::Numbers(numbers) => {
                // Minus zero is zero.
                let key = |number: f64| if number.is_nan() { String::new() } else { (number + 0.0).to_string() };
                Ok(Cells::Texts(numbers.into_iter().map(key).collect()))
            }
            Cells::Whole(counts) => {
                let key = |count: Option<i64>| count.map_or(String::new(), |count| count.to_string());
                Ok(Cells::Texts(counts.into_iter().map(key).collect()))
            }
            Cells::Texts(_) => Ok(self),
            _ => Err(self.kind().to_owned()),
        }
    }
}

/// The length of an array of these sizes.
///
/// # Errors
/// More than one column, said as such.
#[cfg(any(feature = "mat", feature = "npz"))]
fn vector(sizes: &[u64]) -> Result<u64, String> {
    // Empty ones have a size of zero.
    let length = sizes.iter().copied().max().unwrap_or(1);
    match sizes.contains(&0) {
        true => Ok(0),
        false if sizes.iter().filter(|size| **size != 1).count() <= 1 => Ok(length),
        false => {
            let sizes: Vec<String> = sizes.iter().map(u64::to_string).collect();
            Err(format!("an array of {} cells", sizes.join(" x ")))
        }
    }
}

/// Numbers of a kind as NumPy names it, `f8` or `u2`, one after the other; none of another kind, or if the bytes do not go up.
#[cfg(any(feature = "mat", feature = "npz"))]
fn numbers(kind: &str, big: bool, data: &[u8]) -> Option<Vec<f64>> {
    fn each<const N: usize>(big: bool, data: &[u8], number: impl Fn([u8; N]) -> f64) -> Option<Vec<f64>> {
        let (numbers, rest) = data.as_chunks::<N>();
        let little = |bytes: &[u8; N]| {
            let mut bytes = *bytes;
            if big {
                bytes.reverse();
            }
            number(bytes)
        };
        rest.is_empty().then(|| numbers.iter().map(little).collect())
    }
    match kind {
        "b1" | "u1" => each(big, data, |bytes| u8::from_le_bytes(bytes).into()),
        "i1" => each(big, data, |bytes| i8::from_le_bytes(bytes).into()),
        "u2" => each(big, data, |bytes| u16::from_le_bytes(bytes).into()),
        "i2" => each(big, data, |bytes| i16::from_le_bytes(bytes).into()),
        "u4" => each(big, data, |bytes| u32::from_le_bytes(bytes).into()),
        "i4" => each(big, data, |bytes| i32::from_le_bytes(bytes).into()),
        "u8" => each(big, data, |bytes| u64::from_le_bytes(bytes) as f64),
        "i8" => each(big, data, |bytes| i64::from_le_bytes(bytes) as f64),
        "f4" => each(big, data, |bytes| f32::from_le_bytes(bytes).into()),
        "f8" => each(big, data, f64::from_le_bytes),
        _ => None,
    }
}

/// Integers below are exact as `f64`.
#[cfg(any(feature = "mat", feature = "npz"))]
const MAX_KEY: f64 = 9_007_199_254_740_992.0;

/// Opens a file of columns; none if it is a text.
///
/// # Errors
/// A file that cannot be read, or whose format this build cannot read.
pub(super) fn open(file: &DataFile) -> Result<Option<Box<dyn Columns + '_>>, Error> {
    let format = FileFormat::of(file)?;
    guarded(file, format, || open_as(file, format))
}

fn open_as(file: &DataFile, format: FileFormat) -> Result<Option<Box<dyn Columns + '_>>, Error> {
    match format {
        FileFormat::Text => Ok(None),
        #[cfg(feature = "arrow")]
        FileFormat::Parquet | FileFormat::Arrow => Ok(Some(Box::new(arrow::ArrowFile::open(file, format)?))),
        #[cfg(feature = "npz")]
        FileFormat::Npz => Ok(Some(Box::new(npz::Npz::open(file)?))),
        #[cfg(feature = "mat")]
        FileFormat::Matlab => Ok(Some(Box::new(matlab::Matlab::open(file)?))),
        #[cfg(feature = "mat")]
        FileFormat::Hdf5 => Ok(Some(Box::new(hdf5::Hdf5::open(file)?))),
        #[cfg(not(all(feature = "arrow", feature = "npz", feature = "mat")))]
        _ => {
            let feature = match format {
                FileFormat::Npz => "npz",
                FileFormat::Matlab | FileFormat::Hdf5 => "mat",
                _ => "arrow",
            };
            Err(file.cannot(format!(
                "the file is {format}, which this build does not read: build with the feature `{feature}` \
                 (cargo install --path cli --features {feature}), or save it as CSV"
            )))
        }
    }
}

/// The result of a reader of another crate, which may panic at a file that is damaged.
fn guarded<T>(file: &DataFile, format: FileFormat, read: impl FnOnce() -> Result<T, Error>) -> Result<T, Error> {
    let damaged = || file.cannot(format!("as {format} the file is damaged: its parts do not go together"));
    catch_unwind(AssertUnwindSafe(read)).unwrap_or_else(|_| Err(damaged()))
}

/// Reads the signals of a plan, then its time, then the column to group by. A column that cannot be read tells no time beside a sample time that was said, and is
/// left out of the plan.
///
/// # Errors
/// As [`Columns::read`]; columns that differ in length.
pub(super) fn read(
    of: &DataFile,
    file: &mut (dyn Columns + '_),
    plan: &mut Plan,
    keys: Option<usize>,
) -> Result<Vec<Cells>, Error> {
    let cells = read_planned(of, file, plan, keys);
    match cells {
        Err(_) if of.sample_time.is_some() && plan.time.take().is_some() => read_planned(of, file, plan, keys),
        cells => cells,
    }
}

fn read_planned(
    of: &DataFile,
    file: &mut (dyn Columns + '_),
    plan: &Plan,
    keys: Option<usize>,
) -> Result<Vec<Cells>, Error> {
    let columns: Vec<usize> = plan.sources.iter().map(|source| source.column).chain(plan.time).collect();
    let cells = guarded(of, file.format(), || file.read(&columns, keys))?;
    let expected = cells.first().map_or(0, Cells::len);
    if let Some(place) = cells.iter().position(|cells| cells.len() != expected) {
        let all: Vec<usize> = columns.into_iter().chain(keys).collect();
        let [reference, what] = [0, place].map(|place| format!("`{}`", file.names()[all[place]]));
        return Err(Error::Lengths { experiment: of.name(), what, found: cells[place].len(), reference, expected });
    }
    Ok(cells)
}

impl DataFile {
    /// The error of a column whose kind of cells is not what is wanted.
    pub(super) fn wrong_kind(&self, column: &str, kind: impl Into<String>, wanted: &'static str) -> Error {
        Error::ColumnKind { path: self.path.clone(), column: column.to_owned(), kind: kind.into(), wanted }
    }

    /// The record of cells that were read, or of some of their rows.
    pub(super) fn of_columns(
        &self,
        plan: &Plan,
        file: &dyn Columns,
        cells: &[Cells],
        rows: Option<&[usize]>,
    ) -> Result<Record, Error> {
        let name = |column: usize| file.names()[column].as_str();
        let mut columns = Vec::with_capacity(plan.sources.len());
        for (source, cells) in plan.sources.iter().zip(cells) {
            let Some(numbers) = cells.numbers() else {
                return Err(self.wrong_kind(name(source.column), cells.kind(), "numbers"));
            };
            columns.push(match rows {
                None => numbers.iter().map(|number| source.value(*number)).collect(),
                Some(rows) => rows.iter().map(|row| source.value(numbers[*row])).collect(),
            });
        }
        let (time, source) = self.column_times(plan, file, cells, rows)?;
        let reading = Reading {
            format: file.format(),
            separator: None,
            decimal_comma: false,
            preamble: 0,
            units_row: false,
            windows: false,
            time: source,
            units: plan.units.clone(),
            filled: vec![],
            left_out: 0,
        };
        self.record(plan, columns, time, reading)
    }
}
