//! The table of a fleet: a row for each record, as CSV or Parquet.

use super::beside;
use super::journal::Journal;
use super::row::{Header, Row};
use crate::terminal::Terminal;
use crate::{Failure, Verdict, output};
use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::time::SystemTime;

/// The end of the name of the file beside a table that says by which model and options it was made.
const RUN: &str = ".run";

/// All rows that are known, and where they go.
pub struct Table {
    header: Header,
    rows: Vec<Row>,
    /// Rows of earlier runs that are errors: their records are tried again.
    failed: Vec<Row>,
    path: Option<PathBuf>,
    journal: Option<Journal>,
    /// By which model and options the rows are made.
    made_by: String,
    /// How many files were written after the rows of their records, which are not in the table any more.
    pub changed: usize,
}

/// Whether a file was written after this; a pipe never was.
fn is_newer(path: &str, than: Option<SystemTime>) -> bool {
    let file = std::fs::metadata(path).ok().filter(|file| file.is_file());
    let written = file.and_then(|file| file.modified().ok());
    written.zip(than).is_some_and(|(written, than)| written > than)
}

impl Table {
    /// An empty table, or that of earlier runs by the same model and options: what a finished one has written, then what an unfinished one has
    /// done.
    ///
    /// # Errors
    /// A file that is something else, is of another model or other options, or cannot be written.
    pub fn open(path: Option<&Path>, header: Header, made_by: String) -> Result<Self, Failure> {
        let (path_of, rows, failed) = (path.map(Path::to_owned), vec![], vec![]);
        let mut table = Table { header, rows, failed, path: path_of, journal: None, made_by, changed: 0 };
        let Some(path) = path else { return Ok(table) };
        output::check(Some(path), &[])?;
        if path.exists() && !path.is_file() {
            return Err(format!(
                "{}: a table is a file, which this is not; name a .csv or a .parquet, or leave --out out to print it",
                path.display()
            )
            .into());
        }
        if output::ending(path) == "parquet" && cfg!(not(feature = "arrow")) {
            return Err(format!(
                "{}: this build writes no Parquet; name a .csv, or build with the feature `arrow` \
                 (cargo install --path cli --features arrow)",
                path.display()
            )
            .into());
        }
        let written = match path.is_file() {
            true => table.read(path).map_err(|error| format!("{}: {error}", path.display()))?,
            false => vec![],
        };
        let written = table.own(path, written)?;
        let journal = beside(path, ".journal");
        let written_at = std::fs::metadata(path).and_then(|file| file.modified()).ok();
        // A journal grows row by row: a file that was written after its first row may have been read before.
        let begun = std::fs::metadata(&journal).and_then(|file| file.created().or_else(|_| file.modified()));
        let begun_at = begun.ok();
        let (journal, unfinished) = Journal::open(&journal, &table.header.names, &table.made_by)?;
        table.journal = Some(journal);
        let (mut changed, mut latest) = (HashSet::new(), HashMap::new());
        let dated =
            written.into_iter().map(|row| (row, written_at)).chain(unfinished.into_iter().map(|row| (row, begun_at)));
        // The last row of a record counts: after a kill a row may stand in the table and in the journal, a record that failed may have been fitted since,
        // and so may a file that has changed.
        let mut rows: Vec<Option<Row>> = vec![];
        for (row, at) in dated {
            if is_newer(&row.name.record, at) {
                changed.insert(row.name.record);
                continue;
            }
            changed.remove(&row.name.record);
            if let Some(before) = latest.insert(row.name.clone(), rows.len()) {
                rows[before] = None;
            }
            rows.push(Some(row));
        }
        table.changed = changed.len();
        (table.failed, table.rows) = rows.into_iter().flatten().partition(Row::is_failed);
        Ok(table)
    }

    /// The rows of a table if this model and these options have made them, none if nothing but errors would be lost.
    fn own(&self, path: &Path, written: Vec<Row>) -> Result<Vec<Row>, Failure> {
        let run = beside(path, RUN);
        let made_by = std::fs::read_to_string(&run);
        if made_by.as_ref().is_ok_and(|made_by| *made_by == self.made_by) {
            return Ok(written);
        }
        if written.iter().all(Row::is_failed) {
            return Ok(vec![]);
        }
        let why = match made_by {
            Ok(_) => format!("its rows are of another model, or other options, which are in {}", run.display()),
            Err(error) => {
                format!("by which model and options its rows were made is not known ({}: {error})", run.display())
            }
        };
        Err(format!("{}: {why}; name another table, or remove this one", path.display()).into())
    }

    pub fn rows(&self) -> &[Row] {
        &self.rows
    }

    /// Adds a row, and says why a record has no estimate.
    pub fn add(&mut self, row: Row, terminal: &Terminal) -> Result<(), Failure> {
        if row.is_failed() {
            terminal.remark(row.failure());
        }
        if let Some(journal) = &mut self.journal {
            journal.add(&row)?;
        }
        self.rows.push(row);
        Ok(())
    }

    /// Writes the table to its file, which is whole at any time, with the errors of earlier runs but for those of files that were tried
    /// again.
    pub fn finish(&mut self, tried: &HashSet<String>) -> Result<(), Failure> {
        let failed = std::mem::take(&mut self.failed);
        self.rows.extend(failed.into_iter().filter(|row| !tried.contains(&row.name.record)));
        let Some(path) = &self.path else { return Ok(()) };
        output::write(Some(&beside(path, RUN)), self.made_by.as_bytes())?;
        output::write(Some(path), &self.content(path)?)?;
        self.journal.take().map_or(Ok(()), Journal::remove)
    }

    /// How many rows are new, and their verdicts.
    pub fn counts(&self, before: usize) -> String {
        let new = &self.rows[before..];
        let count = |verdict: &str| new.iter().filter(|row| row.verdict == verdict).count();
        let verdicts =
            ["usable", "usable with care", "not usable", "failed"].map(|one| format!("{} {one}", count(one)));
        format!("{} records: {}", new.len(), verdicts.join(", "))
    }

    /// The worst verdict of all rows.
    pub fn worst(&self) -> Verdict {
        self.rows.iter().map(Row::verdict).max().unwrap_or(Verdict::Usable)
    }

    fn content(&self, path: &Path) -> Result<Vec<u8>, Failure> {
        match output::ending(path).as_str() {
            #[cfg(feature = "arrow")]
            "parquet" => super::parquet::write(&self.header, &self.rows),
            _ => self.csv(),
        }
    }

    fn read(&self, path: &Path) -> Result<Vec<Row>, Failure> {
        match output::ending(path).as_str() {
            #[cfg(feature = "arrow")]
            "parquet" => super::parquet::read(path, &self.header),
            _ => self.read_csv(path),
        }
    }

    pub fn csv(&self) -> Result<Vec<u8>, Failure> {
        let mut writer = csv::Writer::from_writer(vec![]);
        writer.write_record(&self.header.names)?;
        for row in &self.rows {
            let number = |at: usize| row.numbers.get(at).copied().flatten().map_or(String::new(), |x| x.to_string());
            let before = row.before(self.header.by).into_iter().map(str::to_owned);
            let behind = row.behind().map(str::to_owned);
            writer.write_record(before.chain((0..self.header.numbers()).map(number)).chain(behind))?;
        }
        Ok(writer.into_inner().map_err(|error| error.to_string())?)
    }

    fn read_csv(&self, path: &Path) -> Result<Vec<Row>, Failure> {
        let mut file = csv::Reader::from_path(path)?;
        if file.headers()?.iter().ne(&self.header.names) {
            return Err("the file is there and is no table of this model; name another".into());
        }
        let row = |record: csv::StringRecord| {
            let mut cells: Vec<String> = record.iter().map(str::to_owned).collect();
            let mut numbers = cells.split_off(self.header.texts());
            let behind = numbers.split_off(self.header.numbers());
            let number = |cell: &String| if cell.is_empty() { Some(None) } else { cell.parse().ok().map(Some) };
            Row::from_parts(cells, self.header.by, numbers.iter().map(number).collect::<Option<_>>()?, behind)
        };
        let damaged = |at: usize| format!("row {} is damaged; name another table", at + 1);
        file.records().enumerate().map(|(at, record)| Ok(row(record?).ok_or_else(|| damaged(at))?)).collect()
    }
}
