//! Archives of NumPy arrays, as `numpy.savez` and `numpy.savez_compressed` write them.

use super::super::{DataFile, FileFormat};
use super::{Cells, Columns, numbers, vector};
use crate::error::Error;
use crate::record::npy::Header;
use std::borrow::Cow;
use std::fs::File;
use std::io::{BufReader, Read};
use zip::ZipArchive;

/// What NumPy writes for a date that is none.
const NOT_A_TIME: i64 = i64::MIN;

/// Units of dates and lengths of time (ns).
const UNITS: [(&str, i64); 7] = [
    ("ns", 1),
    ("us", 1_000),
    ("ms", 1_000_000),
    ("s", 1_000_000_000),
    ("m", 60_000_000_000),
    ("h", 3_600_000_000_000),
    ("D", 86_400_000_000_000),
];

/// An open archive.
pub(super) struct Npz<'a> {
    file: &'a DataFile,
    archive: ZipArchive<BufReader<File>>,
    names: Vec<String>,
}

impl<'a> Npz<'a> {
    /// Opens an archive and reads the names of its arrays.
    ///
    /// # Errors
    /// A file that is damaged or cut off, or an archive of something else.
    pub(super) fn open(file: &'a DataFile) -> Result<Self, Error> {
        let bytes = File::open(&file.path).map_err(|error| file.cannot(error))?;
        let archive = ZipArchive::new(BufReader::new(bytes))
            .map_err(|error| file.cannot(format!("as an archive the file is damaged or cut off: {error}")))?;
        let names: Result<Vec<String>, _> = (0..archive.len())
            .filter_map(|at| archive.name_for_index(at))
            .map(|name| name.map(Cow::into_owned))
            .collect();
        let mut names = names.map_err(|error| file.cannot(error))?;
        if names.iter().any(|name| name.starts_with("xl/")) {
            return Err(file.cannot("it is a spreadsheet: save it as CSV"));
        }
        for name in &mut names {
            if let Some(array) = name.strip_suffix(".npy") {
                *name = array.to_owned();
            }
        }
        Ok(Npz { file, archive, names })
    }

    fn array(&mut self, at: usize) -> Result<Cells, Error> {
        let name = &self.names[at];
        let damaged = |error: &dyn std::fmt::Display| self.file.cannot(format!("array `{name}`: {error}"));
        let mut bytes = self.archive.by_index(at).map_err(|error| damaged(&error))?;
        let header = Header::read(&mut bytes).map_err(|error| damaged(&error))?;
        let other = |kind: String| self.file.wrong_kind(name, kind, "columns of numbers or dates");
        let length = vector(&header.shape).map_err(other)?;
        let mut data = Vec::new();
        bytes.read_to_end(&mut data).map_err(|error| damaged(&error))?;
        let cells = cells(&header.kind, &data).ok_or_else(|| other(format!("cells of type {}", header.kind)))?;
        if cells.len() as u64 != length {
            return Err(damaged(&format!("{} of {length} cells are there", cells.len())));
        }
        Ok(cells)
    }
}

impl Columns for Npz<'_> {
    fn format(&self) -> FileFormat {
        FileFormat::Npz
    }

    fn names(&self) -> &[String] {
        &self.names
    }

    fn read(&mut self, columns: &[usize], keys: Option<usize>) -> Result<Vec<Cells>, Error> {
        let mut read: Vec<Cells> = columns.iter().map(|at| self.array(*at)).collect::<Result<_, _>>()?;
        if let Some(at) = keys {
            let keys = self.array(at)?.into_keys();
            read.push(keys.map_err(|kind| self.file.wrong_kind(&self.names[at], kind, "whole numbers"))?);
        }
        Ok(read)
    }
}

fn whole(bytes: [u8; 8], big: bool) -> i64 {
    if big { i64::from_be_bytes(bytes) } else { i64::from_le_bytes(bytes) }
}

/// The cells of an array of this kind, as NumPy names it: `<f8`, `|b1`, `<M8[ns]`.
fn cells(kind: &str, data: &[u8]) -> Option<Cells> {
    let (order, kind) = kind.split_at_checked(1)?;
    let big = order == ">";
    if let Some(unit) = kind.strip_prefix("M8[").or(kind.strip_prefix("m8[")) {
        let (_, unit) = UNITS.iter().find(|(name, _)| Some(*name) == unit.strip_suffix(']'))?;
        let (counts, rest) = data.as_chunks::<8>();
        let counts = counts.iter().map(|count| whole(*count, big));
        return rest.is_empty().then(|| match kind.starts_with('M') {
            true => {
                let nanoseconds =
                    counts.map(|count| Some(count).filter(|count| *count != NOT_A_TIME)?.checked_mul(*unit));
                Cells::Instants { nanoseconds: nanoseconds.collect(), universal: false }
            }
            false => {
                let seconds = |count| if count == NOT_A_TIME { f64::NAN } else { count as f64 * (*unit as f64 / 1e9) };
                Cells::Seconds(counts.map(seconds).collect())
            }
        });
    }
    if kind == "i8" {
        let (counts, rest) = data.as_chunks::<8>();
        return rest.is_empty().then(|| Cells::Whole(counts.iter().map(|count| Some(whole(*count, big))).collect()));
    }
    numbers(kind, big, data).map(Cells::Numbers)
}
