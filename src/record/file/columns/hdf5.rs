//! HDF5 files, among them those of MATLAB 7.3: datasets, and those in groups as `group.dataset`.

use super::super::{DataFile, FileFormat};
use super::{Cells, Columns, vector};
use crate::error::Error;
use hdf5_pure::{AttrValue, DType, Dataset, File, Group};

/// Groups within groups that are looked into.
const DEPTH: usize = 8;

/// An open file.
pub(super) struct Hdf5<'a> {
    file: &'a DataFile,
    opened: File,
    names: Vec<String>,
    /// Where the datasets are.
    paths: Vec<String>,
    units: Vec<Option<String>>,
}

impl<'a> Hdf5<'a> {
    /// Opens a file and reads the names of its datasets.
    ///
    /// # Errors
    /// A file that is damaged or cut off.
    pub(super) fn open(file: &'a DataFile) -> Result<Self, Error> {
        let failed = |error| damaged(file, &error);
        let opened = File::open_streaming(&file.path).map_err(failed)?;
        let mut paths = vec![];
        datasets(&opened.root(), "", 0, &mut paths).map_err(failed)?;
        let names = paths.iter().map(|path: &String| path.replace('/', ".")).collect();
        let units = paths.iter().map(|path| unit(&opened.dataset(path).ok()?)).collect();
        Ok(Hdf5 { file, opened, names, paths, units })
    }

    fn dataset(&self, at: usize) -> Result<Vec<f64>, Error> {
        let failed = |error| damaged(self.file, &error);
        let other = |kind: String| self.file.wrong_kind(&self.names[at], kind, "columns of numbers");
        let dataset = self.opened.dataset(&self.paths[at]).map_err(failed)?;
        if let Some(class) = class(&dataset).map_err(failed)? {
            return Err(other(class));
        }
        if let Some(attribute) = packed(&dataset).map_err(failed)? {
            return Err(other(format!("packed numbers (attribute `{attribute}`)")));
        }
        let kind = dataset.dtype().map_err(failed)?;
        if !is_number(&kind) {
            return Err(other(format!("cells of type {kind}")));
        }
        let length = vector(&dataset.shape().map_err(failed)?).map_err(other)?;
        let numbers = dataset.read_f64().map_err(failed)?;
        match numbers.len() as u64 == length {
            true => Ok(numbers),
            false => Err(self.file.cannot(format!("`{}` has {} of {length} cells", self.names[at], numbers.len()))),
        }
    }
}

impl Columns for Hdf5<'_> {
    fn format(&self) -> FileFormat {
        FileFormat::Hdf5
    }

    fn names(&self) -> &[String] {
        &self.names
    }

    fn unit(&self, column: usize) -> Option<&str> {
        self.units.get(column)?.as_deref()
    }

    fn read(&mut self, columns: &[usize], keys: Option<usize>) -> Result<Vec<Cells>, Error> {
        let mut read = columns.iter().map(|at| self.dataset(*at).map(Cells::Numbers)).collect::<Result<Vec<_>, _>>()?;
        if let Some(at) = keys {
            let keys = Cells::Numbers(self.dataset(at)?).into_keys();
            read.push(keys.map_err(|kind| self.file.wrong_kind(&self.names[at], kind, "whole numbers"))?);
        }
        Ok(read)
    }
}

/// The paths of all datasets in a group. What MATLAB keeps for itself is left out.
fn datasets(group: &Group, within: &str, depth: usize, paths: &mut Vec<String>) -> Result<(), hdf5_pure::Error> {
    paths.extend(group.datasets()?.into_iter().map(|name| format!("{within}{name}")));
    if depth < DEPTH {
        for name in group.groups()?.iter().filter(|name| !name.starts_with('#')) {
            datasets(&group.group(name)?, &format!("{within}{name}/"), depth + 1, paths)?;
        }
    }
    Ok(())
}

/// MATLAB's class of a dataset, if it is none of numbers.
fn class(dataset: &Dataset) -> Result<Option<String>, hdf5_pure::Error> {
    const NUMBERS: [&str; 11] =
        ["double", "single", "logical", "int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64"];
    let attributes = dataset.attrs()?;
    // What is empty has its sizes for values.
    if attributes.contains_key("MATLAB_empty") {
        return Ok(Some("nothing".to_owned()));
    }
    Ok(match attributes.get("MATLAB_class") {
        Some(AttrValue::String(class) | AttrValue::AsciiString(class)) if !NUMBERS.contains(&class.as_str()) => {
            Some(format!("a variable of class {class}"))
        }
        _ => None,
    })
}

/// The unit of a dataset, as netCDF has it; of times without the date that they are counted from.
fn unit(dataset: &Dataset) -> Option<String> {
    let attributes = dataset.attrs().ok()?;
    match attributes.get("units").or_else(|| attributes.get("unit"))? {
        AttrValue::String(text) | AttrValue::AsciiString(text) => {
            text.split(" since ").next().map(|unit| unit.trim().to_owned())
        }
        _ => None,
    }
}

/// The attribute that says how the numbers of a dataset become values, as netCDF has it, or which number stands for none; NaN does so here, too.
fn packed(dataset: &Dataset) -> Result<Option<&'static str>, hdf5_pure::Error> {
    let attributes = dataset.attrs()?;
    let fills = match attributes.get("_FillValue") {
        Some(AttrValue::F64(number)) => !number.is_nan(),
        Some(AttrValue::F32(number)) => !number.is_nan(),
        Some(AttrValue::F64Array(numbers)) => numbers.iter().any(|number| !number.is_nan()),
        Some(AttrValue::F32Array(numbers)) => numbers.iter().any(|number| !number.is_nan()),
        other => other.is_some(),
    };
    let scaled = ["scale_factor", "add_offset"].into_iter().find(|name| attributes.contains_key(*name));
    Ok(scaled.or(fills.then_some("_FillValue")))
}

fn is_number(kind: &DType) -> bool {
    use DType::{F32, F64, I8, I16, I32, I64, U8, U16, U32, U64};
    matches!(kind, F32 | F64 | I8 | I16 | I32 | I64 | U8 | U16 | U32 | U64)
}

fn damaged(file: &DataFile, error: &hdf5_pure::Error) -> Error {
    file.cannot(format!("as HDF5 the file is damaged or cut off: {error}"))
}
