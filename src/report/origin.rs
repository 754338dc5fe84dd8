//! [`Origin`]: where the numbers of a report come from, so that it can be made again.

use super::Report;
use crate::error::Error;
use crate::hash::hexadecimal;
use crate::numeral::whole;
use crate::section::{Cell, Section, Table};
use core::fmt::Write;
use sha2::{Digest, Sha256};
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

/// The files that were read, the command that was given and the day it was: what [`Report::made_from`] writes below "To
/// reproduce".
///
/// ```no_run
/// # use greybox::{Report, report::Origin};
/// # fn show(report: Report) -> Result<Report, greybox::Error> {
/// let origin = Origin::new().file("bench3.csv")?.command(std::env::args()).at(std::time::SystemTime::now());
/// let report = report.made_from(origin);
/// # Ok(report)
/// # }
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Origin {
    /// Path, size in bytes and SHA-256 of each file.
    files: Vec<(PathBuf, u64, String)>,
    command: Option<String>,
    code: Option<String>,
    at: Option<SystemTime>,
}

impl Origin {
    /// Nothing is said yet.
    pub fn new() -> Origin {
        Origin::default()
    }

    /// Adds a file that was read, with its size and its SHA-256 (FIPS 180-4), as `sha256sum` prints it.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub fn file(mut self, path: impl AsRef<Path>) -> Result<Origin, Error> {
        let path = path.as_ref();
        let (size, hash) =
            hashed(path).map_err(|source| Error::File { path: path.to_owned(), source: source.into() })?;
        self.files.push((path.to_owned(), size, hash));
        Ok(self)
    }

    /// The command and its arguments, such as [`std::env::args`].
    pub fn command(self, words: impl IntoIterator<Item = String>) -> Origin {
        let quoted = |word: String| {
            let plain = |letter: char| letter.is_alphanumeric() || "-_./:=,+@%".contains(letter);
            let bare = !word.is_empty() && word.chars().all(plain);
            if bare { word } else { format!("'{}'", word.replace('\'', "'\\''")) }
        };
        let words: Vec<String> = words.into_iter().map(quoted).collect();
        Origin { command: Some(words.join(" ")), ..self }
    }

    /// The lines of a program that made it.
    pub fn code(self, text: impl Into<String>) -> Origin {
        Origin { code: Some(text.into()), ..self }
    }

    /// When it was made.
    pub fn at(self, time: SystemTime) -> Origin {
        Origin { at: Some(time), ..self }
    }

    /// Its table.
    fn table(&self) -> Table {
        let table = Table::new("Made from", ["what", "is"]);
        let files = self.files.iter().map(|(path, size, hash)| {
            let text = format!("{}, {} bytes, SHA-256 {hash}", path.display(), whole(*size));
            ["file".into(), text.into()]
        });
        let date = self.at.and_then(humantime_of).map(|date| ("date", date));
        let said =
            [self.command.clone().map(|text| ("command", text)), self.code.clone().map(|text| ("code", text)), date];
        table.rows(files).rows(said.into_iter().flatten().map(|(name, text)| [Cell::from(name), text.into()]))
    }
}

/// A time as RFC 3339 writes it; `None` outside the years 1970 to 9999.
fn humantime_of(time: SystemTime) -> Option<String> {
    let mut text = String::new();
    write!(text, "{}", humantime::format_rfc3339_seconds(time)).ok()?;
    Some(text)
}

fn hashed(path: &Path) -> std::io::Result<(u64, String)> {
    let (mut file, mut hash, mut size) = (File::open(path)?, Sha256::new(), 0);
    let mut buffer = vec![0; 1 << 16];
    loop {
        let read = file.read(&mut buffer)?;
        if read == 0 {
            break;
        }
        hash.update(&buffer[..read]);
        size += read as u64;
    }
    Ok((size, hexadecimal(hash)))
}

impl Report {
    /// Adds where its numbers come from to what is needed to reproduce it.
    pub fn made_from(mut self, origin: Origin) -> Report {
        match self.sections.iter_mut().find(|section| section.id == "reproduce") {
            Some(section) => section.tables.insert(0, origin.table()),
            None => self.sections.push(Section::new("reproduce", "To reproduce").table(origin.table())),
        }
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The hash of `abc` (FIPS 180-4, example B.1), words that a shell would split, a date.
    #[test]
    fn what_it_was_made_from_is_named() {
        let path = std::env::temp_dir().join(format!("greybox_origin_{}", std::process::id()));
        std::fs::write(&path, "abc").unwrap();
        let origin = Origin::new().file(&path).unwrap().at(SystemTime::UNIX_EPOCH);
        std::fs::remove_file(&path).unwrap();
        let origin = origin.command(["report", "my file.csv", "--out=it's"].map(str::to_owned));
        let text: Vec<String> = origin.table().rows.iter().map(|row| row[1].text().to_owned()).collect();
        let hash = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert!(text[0].ends_with(&format!("3 bytes, SHA-256 {hash}")), "{text:?}");
        assert_eq!(
            (text[1].as_str(), text[2].as_str()),
            (r"report 'my file.csv' '--out=it'\''s'", "1970-01-01T00:00:00Z")
        );
        assert!(matches!(Origin::new().file("no such file"), Err(Error::File { .. })));
    }
}
