//! `fleet`: many records, each fitted by itself, as rows of one table.

use crate::arguments::Fleet;
use crate::fitting::{declared, expanded, fit, model};
use crate::terminal::Terminal;
use crate::{Failure, Verdict, output, records};
use greybox::layout::Layout;
use greybox::{Knowledge, Severity, Summary};
use std::collections::HashSet;
use std::path::{Path, PathBuf};

/// Rows after which the table is written again.
const ROWS: usize = 500;

pub fn run(one: &Fleet, terminal: &Terminal) -> Result<Verdict, Failure> {
    let model = model(one.model.as_deref(), &one.of_model.constant, terminal)?;
    let layout = model.equations().layout();
    let parameters = declared(&model, &one.of_model)?;
    let paths = expanded(&one.records)?;
    if paths.is_empty() {
        return Err("no record is named; write files or a pattern after the model: 'data/*.csv'".into());
    }
    let mut table = Table::open(one.out.as_deref(), layout)?;
    let fleet = fit(&model, &[], &parameters, &one.of_fit)?.cancel(terminal.stop()).fleet()?;
    let left: Vec<&PathBuf> = paths.iter().filter(|path| !table.has(path)).collect();
    if left.len() < paths.len() {
        terminal.remark(format_args!(
            "{} of {} records are in the table already",
            paths.len() - left.len(),
            paths.len()
        ));
    }
    let bar = terminal.steps(left.len(), "records");
    let quiet = terminal.silent();
    for group in left.chunks(ROWS) {
        if terminal.stopped() {
            break;
        }
        let read = group.iter().map(|path| records::one(path, &model, &one.of_records, &one.of_model.initial, &quiet));
        let read: Vec<Result<_, Failure>> = read.collect();
        let (there, mut found) = (read.iter().flatten().cloned().collect::<Vec<_>>(), vec![]);
        for answer in fleet.run(there) {
            bar.inc(1);
            found.push(answer);
        }
        let mut found = found.into_iter();
        for (path, record) in group.iter().zip(&read) {
            let row = match record {
                Err(error) => Err(error.to_string()),
                Ok(_) => match found.next() {
                    Some(answer) => answer.map_err(|error| error.to_string()),
                    None => break,
                },
            };
            if let Err(error) = &row {
                terminal.remark(format_args!("{}: {error}", path.display()));
            }
            table.add(path, row.as_ref(), layout);
        }
        table.save()?;
    }
    bar.finish_and_clear();
    if terminal.stopped() {
        terminal.remark("ended by Ctrl-C: the table has what was done; the same command goes on from there");
    }
    if one.out.is_none() {
        output::print(&table.text()?)?;
    }
    Ok(table.worst)
}

/// One row for each record.
struct Table {
    path: Option<PathBuf>,
    rows: Vec<Vec<String>>,
    /// The records of the rows.
    there: HashSet<String>,
    worst: Verdict,
}

impl Table {
    /// An empty table, or that of an earlier run.
    fn open(path: Option<&Path>, layout: &Layout) -> Result<Self, Failure> {
        let (header, there) = (header(layout), HashSet::new());
        let mut table = Table { path: path.map(Path::to_owned), rows: vec![], there, worst: Verdict::Usable };
        if let Some(path) = path.filter(|path| path.is_file()) {
            let failed = |error: csv::Error| format!("{}: {error}", path.display());
            let mut file = csv::ReaderBuilder::new().has_headers(false).from_path(path).map_err(failed)?;
            for row in file.records() {
                table.rows.push(row.map_err(failed)?.iter().map(str::to_owned).collect());
            }
            if table.rows.first() != Some(&header) {
                return Err(format!(
                    "{}: the file is there and is no table of this model; name another",
                    path.display()
                )
                .into());
            }
            for row in &table.rows[1..] {
                table.there.insert(row[0].clone());
                table.worst = table.worst.max(match row[1].as_str() {
                    "with care" => Verdict::WithCare,
                    "not usable" | "error" => Verdict::NotUsable,
                    _ => Verdict::Usable,
                });
            }
            return Ok(table);
        }
        table.rows.push(header);
        Ok(table)
    }

    fn has(&self, path: &Path) -> bool {
        self.there.contains(&*path.to_string_lossy())
    }

    fn add(&mut self, path: &Path, row: Result<&Summary, &String>, layout: &Layout) {
        let (verdict, word, cells, remarks) = match row {
            Err(error) => {
                (Verdict::NotUsable, "error", vec![String::new(); 4 * layout.parameters.len()], error.clone())
            }
            Ok(found) => {
                let word = match found.severity() {
                    Severity::Usable => "usable",
                    Severity::UsableWithCare => "with care",
                    Severity::NotUsable => "not usable",
                };
                let codes: Vec<String> = found.warnings.iter().map(|one| format!("{:?}", one.code)).collect();
                (found.severity().into(), word, cells(found), codes.join(" "))
            }
        };
        let name = path.to_string_lossy().into_owned();
        self.there.insert(name.clone());
        self.rows.push([name, word.to_owned()].into_iter().chain(cells).chain([remarks]).collect());
        self.worst = self.worst.max(verdict);
    }

    fn text(&self) -> Result<Vec<u8>, Failure> {
        let mut writer = csv::Writer::from_writer(vec![]);
        for row in &self.rows {
            writer.write_record(row)?;
        }
        Ok(writer.into_inner().map_err(|error| error.to_string())?)
    }

    /// Writes the table to its file. It is whole at any time: what a kill leaves is that of the group before.
    fn save(&self) -> Result<(), Failure> {
        match &self.path {
            Some(path) => output::write(Some(path), &self.text()?),
            None => Ok(()),
        }
    }
}

fn header(layout: &Layout) -> Vec<String> {
    let columns = layout.parameters.iter().map(|one| one.name.as_str());
    let columns = columns.flat_map(|name| ["", "_std", "_lower", "_upper"].map(|end| format!("{name}{end}")));
    ["record", "verdict"].map(str::to_owned).into_iter().chain(columns).chain(["remarks".to_owned()]).collect()
}

/// Value, standard error and interval of each parameter; empty where there is none.
fn cells(found: &Summary) -> Vec<String> {
    let of = |one: &greybox::estimate::ParameterEstimate| {
        let (error, lower, upper) = match one.knowledge {
            Knowledge::Known { standard_error, lower, upper } => (Some(standard_error), Some(lower), Some(upper)),
            _ => (None, None, None),
        };
        [Some(one.value), error, lower, upper].map(|value| value.map_or(String::new(), |value| value.to_string()))
    };
    found.parameters.iter().flat_map(of).collect()
}
