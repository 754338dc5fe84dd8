//! [`FileFormat`]: which program's kind of file it is, by its first bytes and its ending.

use super::DataFile;
use crate::error::Error;
use core::fmt;
use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

/// The kind of a file, by its first bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum FileFormat {
    /// A text with rows of cells.
    Text,
    /// Apache Parquet.
    Parquet,
    /// Arrow IPC, as a file (Feather 2) or as a stream.
    Arrow,
    /// An archive of NumPy arrays.
    Npz,
    /// MATLAB, versions 5 to 7.
    Matlab,
    /// HDF5, and MATLAB 7.3.
    Hdf5,
}

/// First bytes of files, where they stand, and whose they are.
const BEGINS: [(usize, &[u8], FileFormat); 8] = [
    (0, b"PAR1", FileFormat::Parquet),
    (0, b"ARROW1", FileFormat::Arrow),
    (0, b"\xff\xff\xff\xff", FileFormat::Arrow),
    (0, b"PK\x03\x04", FileFormat::Npz),
    (0, b"PK\x05\x06", FileFormat::Npz),
    (0, b"MATLAB 5.0", FileFormat::Matlab),
    (0, b"\x89HDF\r\n\x1a\n", FileFormat::Hdf5),
    // MATLAB writes a text of its own before.
    (512, b"\x89HDF\r\n\x1a\n", FileFormat::Hdf5),
];

/// Endings of files that are no text.
const ENDINGS: [(&str, FileFormat); 11] = [
    ("parquet", FileFormat::Parquet),
    ("pq", FileFormat::Parquet),
    ("arrow", FileFormat::Arrow),
    ("arrows", FileFormat::Arrow),
    ("feather", FileFormat::Arrow),
    ("ipc", FileFormat::Arrow),
    ("npz", FileFormat::Npz),
    ("mat", FileFormat::Matlab),
    ("h5", FileFormat::Hdf5),
    ("hdf5", FileFormat::Hdf5),
    ("hdf", FileFormat::Hdf5),
];

/// Other programs' files, and what to do with them.
const OTHERS: [(&[u8], &str); 3] = [
    (b"\x93NUMPY", "it is one NumPy array: save the columns by their names, numpy.savez(\"record.npz\", t=t, ...)"),
    (b"FEA1", "it is Feather of version 1: save it as version 2 or as Parquet"),
    (b"\xd0\xcf\x11\xe0", "it is a spreadsheet or document of Office: save it as CSV"),
];

impl FileFormat {
    /// The format of a file. What is no regular file, such as a pipe, is read as text.
    ///
    /// # Errors
    /// A file that cannot be read, is not what its ending says, or is of another program.
    pub(super) fn of(file: &DataFile) -> Result<FileFormat, Error> {
        if !file.path.is_file() {
            return Ok(FileFormat::Text);
        }
        let head = head(&file.path).map_err(|error| file.cannot(error))?;
        let begins =
            |(at, begin, _): &&(usize, &[u8], FileFormat)| head.get(*at..).is_some_and(|rest| rest.starts_with(begin));
        if let Some((.., found)) = BEGINS.iter().find(begins) {
            return Ok(*found);
        }
        if let Some((_, remedy)) = OTHERS.iter().find(|(begin, _)| head.starts_with(begin)) {
            return Err(file.cannot(*remedy));
        }
        let ending = file.path.extension().map(|ending| ending.to_string_lossy().to_lowercase());
        match ENDINGS.iter().find(|(known, _)| ending.as_deref() == Some(known)) {
            None => Ok(FileFormat::Text),
            Some((_, _)) if head.is_empty() => Err(file.cannot("the file is empty")),
            Some((_, FileFormat::Matlab)) => {
                Err(file.cannot("it does not begin as a file of MATLAB 5 or later: save it with -v7"))
            }
            Some((_, format)) => Err(file.cannot(format!("it does not begin as {format}: write it again"))),
        }
    }
}

impl fmt::Display for FileFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            FileFormat::Text => "text",
            FileFormat::Parquet => "Parquet",
            FileFormat::Arrow => "Arrow IPC",
            FileFormat::Npz => "a NumPy archive",
            FileFormat::Matlab => "MATLAB 5",
            FileFormat::Hdf5 => "HDF5",
        })
    }
}

fn head(path: &Path) -> io::Result<Vec<u8>> {
    let mut head = Vec::new();
    File::open(path)?.take(520).read_to_end(&mut head)?;
    Ok(head)
}
