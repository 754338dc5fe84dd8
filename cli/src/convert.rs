//! `convert`: a record in another format.

use crate::arguments::Convert;
use crate::fitting::model;
use crate::terminal::Terminal;
use crate::{Failure, Verdict, output, records};
use greybox::record::Record;
use std::path::Path;

pub fn run(one: &Convert, terminal: &Terminal) -> Result<Verdict, Failure> {
    let model = model(one.model.as_deref(), &[], terminal)?;
    let [path] = &one.records[..] else { return Err("name one record, after the model".into()) };
    let record = records::one(path, &model, &one.of_records, &[], terminal)?;
    write(&record, one.out.as_deref())?;
    Ok(Verdict::Usable)
}

/// Writes a record as its ending says; to standard output as CSV.
pub fn write(record: &Record, path: Option<&Path>) -> Result<(), Failure> {
    match path {
        Some(path) => match output::ending(path).as_str() {
            "csv" => Ok(record.to_csv(path)?),
            "json" => output::write(Some(path), serde_json::to_string(record)?.as_bytes()),
            _ => {
                Err(format!("{}: a record is written as .csv or .json; give the path that ending", path.display())
                    .into())
            }
        },
        None => {
            let file = std::env::temp_dir().join(format!("greybox_{}.csv", std::process::id()));
            record.to_csv(&file)?;
            let text = std::fs::read(&file);
            std::fs::remove_file(&file)?;
            output::print(&text?)
        }
    }
}
