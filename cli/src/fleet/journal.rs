//! The journal of a table that is being made: a line for each row, written as soon as the row is known, so that after a kill at any point the
//! same command goes on from there.

use super::row::{BEHIND, Name, Row};
use crate::Failure;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// An open journal, which no other process writes meanwhile.
pub struct Journal {
    path: PathBuf,
    file: File,
}

/// A row as JSON has it. Numbers are texts: JSON has none that is infinite.
type Line = (String, Option<String>, Vec<Option<String>>, [String; BEHIND]);

/// The row of a line; `None` if it is none.
fn row(line: &[u8]) -> Option<Row> {
    let (record, group, numbers, [verdict, outcome, warnings, reason]) = serde_json::from_slice::<Line>(line).ok()?;
    let number = |text: Option<String>| text.map(|text| text.parse()).transpose().ok();
    let numbers = numbers.into_iter().map(number).collect::<Option<_>>()?;
    Some(Row { name: Name { record, group }, numbers, verdict, outcome, warnings, reason })
}

impl Journal {
    /// Opens the journal, and reads the rows that an earlier run left there. What something else has made that is nothing but errors is begun
    /// anew.
    ///
    /// # Errors
    /// A file that cannot be written; one of another table, or of rows that were made by something else; one that another process writes.
    pub fn open(path: &Path, header: &[String], made_by: &str) -> Result<(Self, Vec<Row>), Failure> {
        let failed = |error: std::io::Error| format!("{}: {error}", path.display());
        let mut file =
            OpenOptions::new().read(true).write(true).create(true).truncate(false).open(path).map_err(failed)?;
        if let Err(TryLockError::WouldBlock) = file.try_lock() {
            return Err(format!("{}: another run is writing this table", path.display()).into());
        }
        let mut bytes = vec![];
        file.read_to_end(&mut bytes).map_err(failed)?;
        // A kill may have cut off the last line.
        let whole = bytes.iter().rposition(|byte| *byte == b'\n').map_or(0, |end| end + 1);
        file.set_len(whole as u64).map_err(failed)?;
        file.seek(SeekFrom::End(0)).map_err(failed)?;
        let mut journal = Journal { path: path.to_owned(), file };
        let of = |what: &str| format!("{}: it is of {what}; remove it, or name another table", path.display());
        let other = || of("another table");
        let mut lines = bytes[..whole].split_inclusive(|byte| *byte == b'\n');
        let Some(first) = lines.next() else {
            journal.write(&(header, made_by))?;
            return Ok((journal, vec![]));
        };
        let (names, by) = serde_json::from_slice::<(Vec<String>, String)>(first).map_err(|_| other())?;
        let rows = lines.map(row).collect::<Option<Vec<Row>>>().ok_or_else(other)?;
        if names == header && by == made_by {
            return Ok((journal, rows));
        }
        if rows.iter().any(|row| !row.is_failed()) {
            return Err(if names == header { of("another model, or other options") } else { other() }.into());
        }
        journal.file.set_len(0).and_then(|()| journal.file.rewind()).map_err(failed)?;
        journal.write(&(header, made_by))?;
        Ok((journal, vec![]))
    }

    /// Adds a row.
    pub fn add(&mut self, row: &Row) -> Result<(), Failure> {
        let numbers: Vec<_> = row.numbers.iter().map(|number| number.map(|number| number.to_string())).collect();
        self.write(&(&row.name.record, &row.name.group, numbers, row.behind()))
    }

    fn write(&mut self, line: &impl greybox::serde::Serialize) -> Result<(), Failure> {
        let mut text = serde_json::to_vec(line)?;
        text.push(b'\n');
        Ok(self.file.write_all(&text).map_err(|error| format!("{}: {error}", self.path.display()))?)
    }

    /// Removes the journal: its rows are in the table.
    pub fn remove(self) -> Result<(), Failure> {
        drop(self.file);
        Ok(std::fs::remove_file(&self.path).map_err(|error| format!("{}: {error}", self.path.display()))?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Intervals that are open to one side, too: what JSON has as a number is finite.
    #[test]
    fn rows_come_back_as_they_were() {
        let path = std::env::temp_dir().join(format!("greybox_journal_{}", std::process::id()));
        let header = ["record".to_owned()];
        let numbers = vec![Some(0.1), None, Some(f64::NEG_INFINITY), Some(f64::INFINITY)];
        let name = Name { record: "a.csv".to_owned(), group: None };
        let row = Row { numbers, verdict: "usable".to_owned(), ..Row::failed(name, String::new()) };
        Journal::open(&path, &header, "a").unwrap().0.add(&row).unwrap();
        let error = Journal::open(&path, &header, "b").err().unwrap().to_string();
        assert!(error.contains("another model, or other options"), "{error}");
        let (journal, rows) = Journal::open(&path, &header, "a").unwrap();
        assert_eq!(rows, [row]);
        journal.remove().unwrap();
    }

    #[test]
    fn errors_of_other_options_are_begun_anew() {
        let path = std::env::temp_dir().join(format!("greybox_journal_errors_{}", std::process::id()));
        let header = ["record".to_owned()];
        let failed = Row::failed(Name { record: "a.csv".to_owned(), group: None }, "no column `w`".to_owned());
        Journal::open(&path, &header, "a").unwrap().0.add(&failed).unwrap();
        assert_eq!(Journal::open(&path, &header, "a").unwrap().1, [failed]);
        assert_eq!(Journal::open(&path, &header, "b").unwrap().1, []);
        let (journal, rows) = Journal::open(&path, &header, "b").unwrap();
        assert_eq!(rows, []);
        journal.remove().unwrap();
    }
}
