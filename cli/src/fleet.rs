//! `fleet`: many records, each fitted by itself, as rows of one table.

mod journal;
#[cfg(feature = "arrow")]
mod parquet;
mod row;
mod table;

use crate::arguments::Fleet;
use crate::fitting::{declared, expanded, fit, model, shipped};
use crate::terminal::Terminal;
use crate::{Failure, Verdict, output, records};
use greybox::optimize::Outcome;
use greybox::record::Record;
use greybox::text::Model;
use row::{Header, Name, Row};
use std::cell::RefCell;
use std::collections::{HashMap, HashSet, VecDeque};
use std::path::{Path, PathBuf};
use table::Table;

pub fn run(one: &Fleet, terminal: &Terminal) -> Result<Verdict, Failure> {
    if let Some(name) = one.of_model.per_record.first() {
        return Err(format!(
            "--per-record {name}: each record of a fleet is fitted by itself, with all parameters its own; leave it out"
        )
        .into());
    }
    let model = model(one.model.as_deref(), &one.of_model.values.constant, terminal)?;
    let layout = model.equations().layout();
    let parameters = declared(&model, &one.of_model)?;
    let (paths, again) = distinct(expanded(&one.records)?);
    if paths.is_empty() {
        return Err("no record is named; write files or a pattern after the model: 'data/*.csv'".into());
    }
    if again > 0 {
        terminal.remark(format_args!("{again} files are named again; each is read once"));
    }
    let fleet = fit(&model, &[], &parameters, &one.of_fit)?.cancel(terminal.stop()).fleet()?;
    let mut table = Table::open(one.out.as_deref(), Header::new(layout, one.by.as_deref())?, made_by(one)?)?;
    let before = table.rows().len();
    if before > 0 {
        terminal.remark(format_args!("{before} records are in the table already"));
    }
    if table.changed > 0 {
        terminal.remark(format_args!(
            "{} files were written after the rows of their records; these are fitted again",
            table.changed
        ));
    }
    let bar = terminal.steps(paths.len(), "files");
    let reader = Reader {
        one,
        model: &model,
        quiet: &terminal.silent(),
        waiting: RefCell::default(),
        tried: RefCell::default(),
    };
    // Names already in the table or queued for a fit; a record of the same name is not fitted again.
    let mut known: HashSet<Name> = table.rows().iter().map(|row| row.name.clone()).collect();
    let mut files: HashMap<String, u32> = HashMap::new();
    let there = paths.iter().take_while(|_| !terminal.stopped()).flat_map(|path| {
        bar.inc(1);
        // Which records a file has that are told apart by a column is known only when it is read.
        if one.by.is_none() && known.contains(&name(path, None)) {
            return vec![];
        }
        let read = reader.read(path).into_iter().filter(|(name, _)| {
            if let Some(group) = &name.group {
                *files.entry(group.clone()).or_default() += 1;
            }
            known.insert(name.clone())
        });
        read.collect::<Vec<_>>()
    });
    let there = there.filter_map(|(name, record)| reader.wait(name, record));
    for answer in fleet.run(there) {
        reader.add_errors(&mut table, terminal)?;
        // What Ctrl-C ended is no answer; the same command gives it.
        let is_whole = answer.as_ref().is_ok_and(|found| found.outcome != Outcome::Cancelled);
        if let Some((name, Ok(samples))) = reader.next().filter(|_| is_whole || !terminal.stopped()) {
            let row = Row::of(name, samples, answer.as_ref().map_err(ToString::to_string));
            table.add(row, terminal)?;
            bar.set_message(format!("{} records, files", table.rows().len()));
        }
    }
    if !terminal.stopped() {
        reader.add_errors(&mut table, terminal)?;
    }
    bar.finish_and_clear();
    let several = files.values().filter(|count| **count > 1).count();
    if several > 0 {
        terminal.remark(format_args!(
            "{several} names stand in more than one file; the rows of each file are a record by themselves"
        ));
    }
    let counts = table.counts(before);
    table.finish(&reader.tried.borrow())?;
    terminal.remark(counts);
    if terminal.stopped() {
        terminal.remark("ended by Ctrl-C: the table has what was done; the same command goes on from there");
    }
    if one.out.is_none() {
        output::print(&table.csv()?)?;
    }
    let worst = table.worst();
    Ok(if terminal.stopped() { worst.max(Verdict::WithCare) } else { worst })
}

/// The files, each once, and how many are named again.
fn distinct(named: Vec<PathBuf>) -> (Vec<PathBuf>, usize) {
    let (count, mut known) = (named.len(), HashSet::new());
    let is_new = |path: &PathBuf| known.insert(path.canonicalize().unwrap_or_else(|_| path.clone()));
    let paths: Vec<PathBuf> = named.into_iter().filter(is_new).collect();
    let again = count - paths.len();
    (paths, again)
}

/// The options that are given and the text of the model, so that a table of other ones is not continued.
fn made_by(one: &Fleet) -> Result<String, Failure> {
    let model = one.model.as_deref().unwrap_or_default();
    let text = std::fs::read_to_string(model).or_else(|_| shipped(model).map(str::to_owned))?;
    let options = format!("{:#?}", (&one.of_model, &one.of_records, &one.of_fit));
    // Those that are not given are left out, so that one that a later version has changes nothing.
    let is_given = |line: &&str| ![": [],", ": None,", ": false,"].iter().any(|end| line.ends_with(end));
    let options: Vec<&str> = options.lines().filter(is_given).collect();
    Ok(format!("{}\n\n{text}", options.join("\n")))
}

/// Reads files, and keeps the names of the records that are being fitted in their order.
struct Reader<'a> {
    one: &'a Fleet,
    model: &'a Model,
    quiet: &'a Terminal,
    /// Records in the order read. An error: could not be read, so the fit gives no answer for it; how many samples: an answer will come.
    waiting: RefCell<VecDeque<(Name, Result<usize, String>)>>,
    /// The files that were read.
    tried: RefCell<HashSet<String>>,
}

impl Reader<'_> {
    /// The records of a file, or one error for all of it.
    fn read(&self, path: &Path) -> Vec<(Name, Result<Record, String>)> {
        let Fleet { of_model, of_records, by, .. } = self.one;
        self.tried.borrow_mut().insert(path.to_string_lossy().into_owned());
        let Some(by) = by else {
            let record = records::one(path, self.model, of_records, &of_model.values.initial, self.quiet);
            return vec![(name(path, None), record.map_err(|error| error.to_string()))];
        };
        match records::groups(path, self.model, of_records, &of_model.values.initial, by) {
            Ok(groups) => {
                // As the table has rows without a name.
                let group = |group: String| Some(group).filter(|group| !group.is_empty());
                groups.into_iter().map(|(name_of, record)| (name(path, group(name_of)), record)).collect()
            }
            Err(error) => vec![(name(path, None), Err(error.to_string()))],
        }
    }

    /// Puts a name into the queue, and hands its record on.
    fn wait(&self, name: Name, record: Result<Record, String>) -> Option<Record> {
        let samples = record.as_ref().map(Record::len).map_err(String::clone);
        self.waiting.borrow_mut().push_back((name, samples));
        record.ok()
    }

    fn next(&self) -> Option<(Name, Result<usize, String>)> {
        self.waiting.borrow_mut().pop_front()
    }

    /// Adds the rows of records that will have no answer, up to the next that will have one.
    fn add_errors(&self, table: &mut Table, terminal: &Terminal) -> Result<(), Failure> {
        let is_error = || self.waiting.borrow().front().is_some_and(|(_, samples)| samples.is_err());
        while is_error() {
            if let Some((name, Err(error))) = self.next() {
                table.add(Row::failed(name, error), terminal)?;
            }
        }
        Ok(())
    }
}

/// The name of a record of a file.
fn name(path: &Path, group: Option<String>) -> Name {
    Name { record: path.to_string_lossy().into_owned(), group }
}

/// A file beside another, with this at the end of its name.
fn beside(path: &Path, end: &str) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(end);
    name.into()
}
