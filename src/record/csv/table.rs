//! `Table`: the rows of a CSV file, one after the other, with the line each stands on.
//!
//! The csv crate numbers a record by where its search for it began: before blank lines, comments and the `\n` of a `\r\n`.
//! Here lines end at `\n` alone (a `\r` is white space and trimmed) and a last `\n` is added, so that the line of a
//! record is always the one before the reader's position.

use super::CsvFile;
use crate::error::Error;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Chain, Cursor, Read};
use std::path::{Path, PathBuf};

const NEWLINE: &[u8] = b"\n";

type Bytes = Chain<Chain<Cursor<Vec<u8>>, BufReader<File>>, &'static [u8]>;

/// The rows of an open file.
pub(super) struct Table {
    path: PathBuf,
    names: Vec<String>,
    /// Lines above those that `rows` sees.
    above: u64,
    rows: csv::Reader<Bytes>,
    row: csv::ByteRecord,
}

impl Table {
    /// Opens the file and reads the names of its columns.
    pub(super) fn open(file: &CsvFile) -> Result<Table, Error> {
        let failed = |source: io::Error| cannot(&file.path, source);
        let mut bytes = BufReader::new(File::open(&file.path).map_err(failed)?);
        let mut line = Vec::new();
        for _ in 0..file.preamble {
            line.clear();
            if bytes.read_until(b'\n', &mut line).map_err(failed)? == 0 {
                break;
            }
        }
        let mut above = file.preamble as u64;
        let mut remark = None;
        loop {
            line.clear();
            if bytes.read_until(b'\n', &mut line).map_err(failed)? == 0 {
                return Err(cannot(&file.path, "the file ends before a line with the names of its columns"));
            }
            above += 1;
            if line.starts_with(b"\xff\xfe") || line.starts_with(b"\xfe\xff") {
                return Err(cannot(&file.path, "the file is UTF-16; save it as UTF-8"));
            }
            if line.starts_with(b"\xef\xbb\xbf") {
                line.drain(..3);
            }
            let text = line.trim_ascii();
            if text.first() == Some(&file.comment) {
                remark = Some(text[1..].to_vec());
            } else if !text.is_empty() && !names_separator(text) {
                break;
            }
        }
        let mut names = cells(file, &line)?;
        let mut first = Vec::new();
        // Names in a comment right above the numbers, as numpy writes them.
        if let Some(remark) = remark
            && names.iter().all(|name| file.number(name.as_bytes()).is_some())
        {
            names = cells(file, &remark)?;
            first = std::mem::take(&mut line);
            above -= 1;
        }
        if file.units_row {
            line.clear();
            bytes.read_until(b'\n', &mut line).map_err(failed)?;
            above += 1;
        }
        let rows = format(file).buffer_capacity(1 << 16).from_reader(Cursor::new(first).chain(bytes).chain(NEWLINE));
        Ok(Table { path: file.path.clone(), names, above, rows, row: csv::ByteRecord::new() })
    }

    /// The names of the columns.
    pub(super) fn names(&self) -> &[String] {
        &self.names
    }

    /// Goes to the next row; false at the end.
    pub(super) fn next(&mut self) -> Result<bool, Error> {
        loop {
            if !self.rows.read_byte_record(&mut self.row).map_err(|source| cannot(&self.path, source))? {
                return Ok(false);
            }
            let blank = self.row.len() == 1 && self.cell(0).is_empty();
            if self.row.len() == self.names.len() && !blank {
                return Ok(true);
            }
            if !blank {
                let (path, line) = (self.path.clone(), self.line());
                return Err(Error::RowLength { path, line, found: self.row.len(), expected: self.names.len() });
            }
        }
    }

    /// The line of the current row, from one.
    pub(super) fn line(&self) -> u64 {
        self.above + self.rows.position().line() - 1
    }

    /// The text of a cell of the current row, without white space around it.
    #[inline]
    pub(super) fn cell(&self, column: usize) -> &[u8] {
        self.row.get(column).unwrap_or_default().trim_ascii()
    }
}

/// Whether a line above the names gives the separator of the cells, as in `sep=;`.
fn names_separator(text: &[u8]) -> bool {
    text.len() <= 5 && text.get(..4).is_some_and(|begin| begin.eq_ignore_ascii_case(b"sep="))
}

/// How the cells of a file stand in a line.
fn format(file: &CsvFile) -> csv::ReaderBuilder {
    let mut format = csv::ReaderBuilder::new();
    format
        .delimiter(file.delimiter)
        .comment(Some(file.comment))
        .has_headers(false)
        .flexible(true)
        .terminator(csv::Terminator::Any(b'\n'));
    format
}

/// The cells of one line.
fn cells(file: &CsvFile, line: &[u8]) -> Result<Vec<String>, Error> {
    let mut record = csv::ByteRecord::new();
    format(file).from_reader(line).read_byte_record(&mut record).map_err(|source| cannot(&file.path, source))?;
    Ok(record.iter().map(|cell| String::from_utf8_lossy(cell.trim_ascii()).into_owned()).collect())
}

/// The error of a file that cannot be read or written.
pub(super) fn cannot(path: &Path, source: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> Error {
    Error::File { path: path.to_owned(), source: source.into() }
}
