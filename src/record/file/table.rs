//! `Table`: the rows of a CSV file, one after the other, with the line each stands on.
//!
//! The csv crate numbers a record by where its search for it began: before blank lines, comments and the `\n` of a `\r\n`.
//! Here lines end at `\n` alone (a `\r` is white space and trimmed) and a last `\n` is added, so that the line of a
//! record is always the one before the reader's position.

use super::DataFile;
use super::bytes::Spaces;
use super::guess::Form;
use crate::error::Error;
use std::fs::File;
use std::io::{self, Chain, Cursor, Read};
use std::path::{Path, PathBuf};

const NEWLINE: &[u8] = b"\n";

/// Bytes that are looked at before the rows are read, and the most where names or remarks are longer than that.
const HEAD: u64 = 1 << 16;
const LONGEST: u64 = 1 << 24;
/// Lines that are wanted among them besides remarks.
const LINES: usize = 3;

type Bytes = Spaces<Chain<Chain<Cursor<Vec<u8>>, File>, &'static [u8]>>;

/// The rows of an open file.
pub(super) struct Table {
    path: PathBuf,
    form: Form,
    rows: csv::Reader<Bytes>,
    row: csv::ByteRecord,
}

impl Table {
    /// Opens the file and reads the names of its columns; what was not said of the file is guessed, by the names that are wanted.
    pub(super) fn open(file: &DataFile, wanted: &[&str]) -> Result<Table, Error> {
        let (mut head, bytes) = begin(file)?;
        if head.starts_with(b"\xff\xfe") || head.starts_with(b"\xfe\xff") {
            return Err(file.cannot("the file is UTF-16; save it as UTF-8"));
        }
        if head.contains(&0) {
            return Err(file.cannot("the file is no text: it has bytes of zero"));
        }
        if head.starts_with(b"\xef\xbb\xbf") {
            head.drain(..3);
        }
        let form = Form::guess(file, &head, wanted)?;
        Ok(Table::with(file, form, head, bytes))
    }

    /// This file once more, from its first row.
    pub(super) fn again(&self, file: &DataFile) -> Result<Table, Error> {
        let (head, bytes) = begin(file)?;
        Ok(Table::with(file, self.form.clone(), head, bytes))
    }

    /// The rows of a file that begins with `head` and goes on with `bytes`.
    fn with(file: &DataFile, form: Form, mut head: Vec<u8>, bytes: File) -> Table {
        let mut ends = head.iter().enumerate().filter(|(_, byte)| **byte == b'\n').map(|(at, _)| at + 1);
        let begin = if form.skipped == 0 { 0 } else { ends.nth(form.skipped - 1).unwrap_or(head.len()) };
        let rows = Cursor::new(head.split_off(begin)).chain(bytes).chain(NEWLINE);
        let rows = format(file, form.separator).buffer_capacity(1 << 16).from_reader(Spaces::new(form.separator, rows));
        Table { path: file.path.clone(), form, rows, row: csv::ByteRecord::new() }
    }

    /// How the file stands.
    pub(super) fn form(&self) -> &Form {
        &self.form
    }

    /// The names of the columns.
    pub(super) fn names(&self) -> &[String] {
        &self.form.names
    }

    /// Goes to the next row; false at the end.
    pub(super) fn next(&mut self) -> Result<bool, Error> {
        let expected = self.form.names.len();
        loop {
            if !self.rows.read_byte_record(&mut self.row).map_err(|source| cannot(&self.path, source))? {
                return Ok(false);
            }
            let blank = self.row.len() == 1 && self.cell(0).is_empty();
            if self.row.len() == expected && !blank {
                return Ok(true);
            }
            if !blank {
                return Err(Error::RowLength {
                    path: self.path.clone(),
                    line: self.line(),
                    found: self.row.len(),
                    expected,
                });
            }
        }
    }

    /// The line of the current row, from one.
    pub(super) fn line(&self) -> u64 {
        self.form.skipped as u64 + self.rows.position().line() - 1
    }

    /// The text of a cell of the current row, without white space around it.
    #[inline]
    pub(super) fn cell(&self, column: usize) -> &[u8] {
        self.row.get(column).unwrap_or_default().trim_ascii()
    }
}

/// The first bytes of a file, with its first lines, and the file behind them.
fn begin(file: &DataFile) -> Result<(Vec<u8>, File), Error> {
    let failed = |source: io::Error| file.cannot(source);
    let mut bytes = File::open(&file.path).map_err(failed)?;
    let mut head = Vec::new();
    let mut more = HEAD;
    while more > 0 {
        let read = Read::by_ref(&mut bytes).take(more).read_to_end(&mut head).map_err(failed)? as u64;
        let ended = head.iter().rposition(|byte| *byte == b'\n').map_or(&[][..], |end| &head[..end]);
        let lines = ended.split(|byte| *byte == b'\n').filter(|line| !line.is_empty() && line[0] != file.comment);
        let enough = read < more || lines.count() >= LINES || head.len() as u64 >= LONGEST;
        more = if enough { 0 } else { head.len() as u64 };
    }
    Ok((head, bytes))
}

/// How the cells of a file stand in a line.
pub(super) fn format(file: &DataFile, separator: u8) -> csv::ReaderBuilder {
    let mut format = csv::ReaderBuilder::new();
    format
        .delimiter(separator)
        .comment(Some(file.comment))
        .has_headers(false)
        .flexible(true)
        .terminator(csv::Terminator::Any(b'\n'));
    format
}

/// The error of a file that cannot be read or written.
pub(super) fn cannot(path: &Path, source: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> Error {
    Error::File { path: path.to_owned(), source: source.into() }
}
