//! `convert`: a record as CSV.

use crate::arguments::Convert;
use crate::fitting::{expanded, model};
use crate::terminal::Terminal;
use crate::{Failure, Verdict, output, records};
use greybox::record::Record;
use std::path::{Path, PathBuf};

pub fn run(one: &Convert, terminal: &Terminal) -> Result<Verdict, Failure> {
    output::check(one.out.as_deref(), &output::RECORDS)?;
    let model = model(one.model.as_deref(), &[], terminal)?;
    let path = only(&one.records, "record")?;
    output::apart([&one.out], one.model.iter().map(PathBuf::from).chain([path.clone()]))?;
    let record = records::one(&path, &model, &one.of_records, &[], terminal)?;
    write(&record, one.out.as_deref())?;
    Ok(Verdict::Usable)
}

/// The file where one is to be named.
pub fn only(named: &[PathBuf], what: &str) -> Result<PathBuf, Failure> {
    match <[PathBuf; 1]>::try_from(expanded(named)?) {
        Ok([path]) => Ok(path),
        Err(paths) => Err(format!("name one {what}, after the model; {} are named", paths.len()).into()),
    }
}

/// Writes a record as CSV; without a path to standard output.
pub fn write(record: &Record, path: Option<&Path>) -> Result<(), Failure> {
    match path {
        Some(path) => Ok(record.to_csv(output::target(path))?),
        None => {
            let file = std::env::temp_dir().join(format!("greybox_{}.csv", std::process::id()));
            record.to_csv(&file)?;
            let text = std::fs::read(&file);
            std::fs::remove_file(&file)?;
            output::print(&text?)
        }
    }
}
