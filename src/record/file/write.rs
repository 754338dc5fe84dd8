//! Writing: a record becomes rows of numbers that read back to the last bit.

use super::table::cannot;
use crate::error::Error;
use crate::record::{Channel, Record};
use std::fs::{self, File};
use std::path::Path;

/// Writes the record to `path`: beside it first, so that there is never half a file.
pub(super) fn write(record: &Record, path: &Path) -> Result<(), Error> {
    let channels: Vec<&Channel> = record.inputs.iter().chain(record.outputs.iter()).collect();
    let names: Vec<&str> = ["t"].into_iter().chain(channels.iter().map(|channel| channel.name.as_str())).collect();
    for (second, name) in names.iter().enumerate() {
        if let Some(first) = names[..second].iter().position(|earlier| earlier == name) {
            let (path, column) = (path.to_owned(), (*name).to_owned());
            return Err(Error::AmbiguousColumn { path, column, first: first + 1, second: second + 1 });
        }
    }
    // A pipe or a device is written to as it stands.
    if path.exists() && !path.is_file() {
        return rows(record, &names, path).map_err(|source| cannot(path, source));
    }
    let mut beside = path.as_os_str().to_owned();
    beside.push(".part");
    let beside = Path::new(&beside);
    let written = rows(record, &names, beside).and_then(|()| Ok(fs::rename(beside, path)?));
    written.map_err(|source| {
        // The error to report is that of writing, not one of removing the partial file.
        let _ = fs::remove_file(beside);
        cannot(path, source)
    })
}

fn rows(record: &Record, names: &[&str], path: &Path) -> Result<(), csv::Error> {
    let mut file =
        csv::WriterBuilder::new().has_headers(false).buffer_capacity(1 << 16).from_writer(File::create(path)?);
    file.write_record(names)?;
    let columns: Vec<&[f64]> =
        record.inputs.iter().chain(record.outputs.iter()).map(|channel| &*channel.values).collect();
    for k in 0..record.len() {
        let row = columns.iter().map(|column| Some(column[k]).filter(|value| !value.is_nan()));
        file.serialize([Some(record.time(k))].into_iter().chain(row).collect::<Vec<Option<f64>>>())?;
    }
    Ok(file.flush()?)
}
