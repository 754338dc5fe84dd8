//! The table as Parquet: texts, then numbers that may be missing, then texts.

use super::row::{Header, Row};
use crate::Failure;
use arrow_array::cast::AsArray;
use arrow_array::types::Float64Type;
use arrow_array::{Array, ArrayRef, Float64Array, RecordBatch, StringArray};
use parquet::arrow::ArrowWriter;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use parquet::basic::Compression;
use parquet::file::properties::WriterProperties;
use std::fs::File;
use std::path::Path;
use std::sync::Arc;

/// The rows under these columns.
pub fn write(header: &Header, rows: &[Row]) -> Result<Vec<u8>, Failure> {
    let (by, first, behind) = (header.by, header.texts(), header.texts() + header.numbers());
    let column = |at: usize| -> ArrayRef {
        if at < first {
            return Arc::new(StringArray::from_iter_values(rows.iter().map(|row| row.before(by)[at])));
        }
        if at >= behind {
            return Arc::new(StringArray::from_iter_values(rows.iter().map(|row| row.behind()[at - behind])));
        }
        let number = |row: &Row| row.numbers.get(at - first).copied().flatten();
        Arc::new(rows.iter().map(number).collect::<Float64Array>())
    };
    // Numbers may be missing in any row, whether or not they are in these.
    let columns = header.names.iter().enumerate().map(|(at, name)| {
        let number = (first..behind).contains(&at);
        (name, column(at), number)
    });
    let batch = RecordBatch::try_from_iter_with_nullable(columns)?;
    let properties = WriterProperties::builder().set_compression(Compression::SNAPPY).build();
    let mut writer = ArrowWriter::try_new(vec![], batch.schema(), Some(properties))?;
    writer.write(&batch)?;
    Ok(writer.into_inner()?)
}

/// The rows of a file that [`write()`] wrote.
pub fn read(path: &Path, header: &Header) -> Result<Vec<Row>, Failure> {
    let (first, last) = (header.texts(), header.texts() + header.numbers());
    let reader = ParquetRecordBatchReaderBuilder::try_new(File::open(path)?)?.build()?;
    let mut rows = vec![];
    for batch in reader {
        let batch = batch?;
        let other = "the file is there and is no table of this model; name another";
        if batch.schema().fields().iter().map(|field| field.name()).ne(&header.names) {
            return Err(other.into());
        }
        let text = |at: usize| batch.column(at).as_string_opt::<i32>().ok_or(other);
        let before = (0..first).map(text).collect::<Result<Vec<_>, _>>()?;
        let behind = (last..header.names.len()).map(text).collect::<Result<Vec<_>, _>>()?;
        let number = |at: usize| batch.column(at).as_primitive_opt::<Float64Type>().ok_or(other);
        let numbers = (first..last).map(number).collect::<Result<Vec<_>, _>>()?;
        for at in 0..batch.num_rows() {
            let [before, behind] =
                [&before, &behind].map(|all| all.iter().map(|one| one.value(at).to_owned()).collect());
            let numbers_of = numbers.iter().map(|column| (!column.is_null(at)).then(|| column.value(at))).collect();
            let row = Row::from_parts(before, header.by, numbers_of, behind);
            rows.push(row.ok_or(other)?);
        }
    }
    Ok(rows)
}
