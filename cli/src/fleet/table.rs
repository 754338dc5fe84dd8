//! The table of a fleet: a row for each record, as CSV or Parquet.

use super::beside;
use super::journal::Journal;
use super::row::{Header, Row};
use crate::terminal::Terminal;
use crate::{Failure, Verdict, output};
use std::collections::HashSet;
use std::path::{Path, PathBuf};

/// All rows that are known, and where they go.
pub struct Table {
    header: Header,
    rows: Vec<Row>,
    path: Option<PathBuf>,
    journal: Option<Journal>,
}

impl Table {
    /// An empty table, or that of earlier runs: what a finished one has written, then what an unfinished one has done by the same model and options.
    ///
    /// # Errors
    /// A file that is something else, or cannot be written.
    pub fn open(path: Option<&Path>, header: Header, made_by: &str) -> Result<Self, Failure> {
        let mut table = Table { header, rows: vec![], path: path.map(Path::to_owned), journal: None };
        let Some(path) = path else { return Ok(table) };
        if output::ending(path) == "parquet" && cfg!(not(feature = "arrow")) {
            return Err(format!(
                "{}: this build writes no Parquet; name a .csv, or build with the feature `arrow` \
                 (cargo install --path cli --features arrow)",
                path.display()
            )
            .into());
        }
        if path.is_file() {
            table.rows = table.read(path).map_err(|error| format!("{}: {error}", path.display()))?;
        }
        let (journal, rows) = Journal::open(&beside(path, ".journal"), &table.header.names, made_by)?;
        // A run that was killed between writing the table and removing its journal has the rows twice.
        let there: HashSet<_> = table.rows.iter().map(|row| row.name.clone()).collect();
        table.rows.extend(rows.into_iter().filter(|row| !there.contains(&row.name)));
        table.journal = Some(journal);
        Ok(table)
    }

    pub fn rows(&self) -> &[Row] {
        &self.rows
    }

    /// Adds a row, and says why a record has no estimate.
    pub fn add(&mut self, row: Row, terminal: &Terminal) -> Result<(), Failure> {
        if row.verdict == "error" {
            let group = row.name.group.as_ref().map_or(String::new(), |group| format!(", {group}"));
            terminal.remark(format_args!("{}{group}: {}", row.name.record, row.remarks));
        }
        if let Some(journal) = &mut self.journal {
            journal.add(&row)?;
        }
        self.rows.push(row);
        Ok(())
    }

    /// Writes the table to its file, which is whole at any time.
    pub fn finish(&mut self) -> Result<(), Failure> {
        let Some(path) = &self.path else { return Ok(()) };
        output::write(Some(path), &self.content(path)?)?;
        self.journal.take().map_or(Ok(()), Journal::remove)
    }

    /// How many rows are new, and their verdicts.
    pub fn counts(&self, before: usize) -> String {
        let new = &self.rows[before..];
        let count = |verdict: &str| new.iter().filter(|row| row.verdict == verdict).count();
        let verdicts = ["usable", "with care", "not usable", "error"].map(|one| format!("{} {one}", count(one)));
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
            let (before, remarks) = row.texts(self.header.by);
            let number = |at: usize| row.numbers.get(at).copied().flatten().map_or(String::new(), |x| x.to_string());
            let cells = before.into_iter().map(str::to_owned).chain((0..self.header.numbers()).map(number));
            writer.write_record(cells.chain([remarks.to_owned()]))?;
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
            let remarks = cells.pop()?;
            let numbers = cells.split_off(self.header.texts());
            let number = |cell: &String| if cell.is_empty() { Some(None) } else { cell.parse().ok().map(Some) };
            Row::from_parts(cells, self.header.by, numbers.iter().map(number).collect::<Option<_>>()?, remarks)
        };
        let damaged = |at: usize| format!("row {} is damaged; name another table", at + 1);
        file.records().enumerate().map(|(at, record)| Ok(row(record?).ok_or_else(|| damaged(at))?)).collect()
    }
}
