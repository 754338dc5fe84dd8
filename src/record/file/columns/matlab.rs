//! Files of MATLAB 5 to 7: variables, and the fields of structures as `structure.field`
//! ([MAT-File Format](https://www.mathworks.com/help/pdf_doc/matlab/matfile_format.pdf)).

mod elements;

use super::super::{DataFile, FileFormat};
use super::{Cells, Columns};
use crate::error::Error;
use elements::{Fault, Variable, each};
use std::fs::File;
use std::io::BufReader;

/// An open file.
pub(super) struct Matlab<'a> {
    file: &'a DataFile,
    names: Vec<String>,
}

impl<'a> Matlab<'a> {
    /// Opens a file and reads the names of its variables.
    ///
    /// # Errors
    /// A file that is damaged or cut off.
    pub(super) fn open(file: &'a DataFile) -> Result<Self, Error> {
        let mut names = vec![];
        variables(file, &mut |name, _| {
            names.push(name.to_owned());
            Ok(())
        })?;
        Ok(Matlab { file, names })
    }
}

impl Columns for Matlab<'_> {
    fn format(&self) -> FileFormat {
        FileFormat::Matlab
    }

    fn names(&self) -> &[String] {
        &self.names
    }

    fn read(&mut self, columns: &[usize], keys: Option<usize>) -> Result<Vec<Cells>, Error> {
        let wanted: Vec<usize> = columns.iter().copied().chain(keys).collect();
        let mut read: Vec<Option<Cells>> = wanted.iter().map(|_| None).collect();
        let mut at = 0;
        variables(self.file, &mut |name, variable| {
            let places: Vec<usize> = (0..wanted.len()).filter(|place| wanted[*place] == at).collect();
            at += 1;
            if places.is_empty() {
                return Ok(());
            }
            let numbers = variable.numbers(name)?;
            for place in places {
                let cells = Cells::Numbers(numbers.clone());
                let cells = if place == columns.len() { cells.into_keys() } else { Ok(cells) };
                let wanted = "whole numbers";
                read[place] = Some(cells.map_err(|kind| Fault::Kind { name: name.to_owned(), kind, wanted })?);
            }
            Ok(())
        })?;
        // The file has changed since it was opened if a variable is not there.
        let changed = || self.file.cannot("it changed while it was read");
        read.into_iter().map(|cells| cells.ok_or_else(changed)).collect()
    }
}

/// Passes over all variables of a file.
fn variables(file: &DataFile, visit: &mut dyn FnMut(&str, &mut Variable) -> Result<(), Fault>) -> Result<(), Error> {
    let bytes = File::open(&file.path).map_err(|error| file.cannot(error))?;
    each(&mut BufReader::with_capacity(1 << 16, bytes), visit).map_err(|fault| match fault {
        Fault::Kind { name, kind, wanted } => file.wrong_kind(&name, kind, wanted),
        Fault::Damaged(why) => file.cannot(format!("as MATLAB 5 the file is damaged or cut off: {why}")),
    })
}
