//! Parquet files, and Arrow IPC files and streams.

mod cells;

use super::super::{DataFile, FileFormat};
use super::{Cells, Columns};
use crate::error::Error;
use arrow_array::RecordBatch;
use arrow_ipc::reader::{FileReader, StreamReader};
use arrow_schema::{ArrowError, SchemaRef};
use parquet::arrow::ProjectionMask;
use parquet::arrow::arrow_reader::{ArrowReaderMetadata, ParquetRecordBatchReaderBuilder};
use parquet::basic::CompressionCodec;
use std::fs::File;
use std::io::{BufReader, Read, Seek};

/// Rows that are decoded together.
const ROWS: usize = 1 << 14;

type Bytes = BufReader<File>;

/// An open file.
pub(super) struct ArrowFile<'a> {
    file: &'a DataFile,
    names: Vec<String>,
    kind: Kind,
}

/// What is known of a file before its rows are read.
enum Kind {
    Parquet(Box<ArrowReaderMetadata>),
    File,
    Stream,
}

type Batches = Box<dyn Iterator<Item = Result<RecordBatch, ArrowError>>>;

impl<'a> ArrowFile<'a> {
    /// Opens a file and reads the names of its columns.
    ///
    /// # Errors
    /// A file that is damaged or cut off.
    pub(super) fn open(file: &'a DataFile, format: FileFormat) -> Result<Self, Error> {
        let damaged = |error: Box<dyn std::error::Error + Send + Sync>| damaged(file, format, error);
        let mut bytes = bytes(file)?;
        let (schema, kind): (SchemaRef, Kind) = if format == FileFormat::Parquet {
            let metadata =
                ArrowReaderMetadata::load(bytes.get_ref(), Default::default()).map_err(|e| damaged(e.into()))?;
            (metadata.schema().clone(), Kind::Parquet(Box::new(metadata)))
        } else if is_file(&mut bytes).map_err(|error| file.cannot(error))? {
            (FileReader::try_new(bytes, None).map_err(|e| damaged(e.into()))?.schema(), Kind::File)
        } else {
            (StreamReader::try_new(bytes, None).map_err(|e| damaged(e.into()))?.schema(), Kind::Stream)
        };
        let names = schema.fields().iter().map(|field| field.name().clone()).collect();
        Ok(ArrowFile { file, names, kind })
    }

    /// The rows of some columns, in ascending order without repetition.
    fn batches(&self, columns: Vec<usize>) -> Result<Batches, Error> {
        let damaged = |error: Box<dyn std::error::Error + Send + Sync>| damaged(self.file, self.format(), error);
        let bytes = bytes(self.file)?;
        Ok(match &self.kind {
            Kind::Parquet(metadata) => {
                let mask = ProjectionMask::roots(metadata.parquet_schema(), columns);
                self.check_compression(metadata, &mask)?;
                let reader =
                    ParquetRecordBatchReaderBuilder::new_with_metadata(bytes.into_inner(), (**metadata).clone());
                Box::new(reader.with_projection(mask).with_batch_size(ROWS).build().map_err(|e| damaged(e.into()))?)
            }
            Kind::File => Box::new(FileReader::try_new(bytes, Some(columns)).map_err(|e| damaged(e.into()))?),
            Kind::Stream => Box::new(StreamReader::try_new(bytes, Some(columns)).map_err(|e| damaged(e.into()))?),
        })
    }
}

impl ArrowFile<'_> {
    /// Refuses columns whose compression this library is built without.
    fn check_compression(&self, metadata: &ArrowReaderMetadata, mask: &ProjectionMask) -> Result<(), Error> {
        let groups = metadata.metadata().row_groups().iter();
        let mut chunks = groups.flat_map(|group| group.columns().iter().enumerate());
        let is_unread = |codec| matches!(codec, CompressionCodec::BROTLI | CompressionCodec::LZO);
        match chunks.find(|(leaf, chunk)| mask.leaf_included(*leaf) && is_unread(chunk.compression_codec())) {
            None => Ok(()),
            Some((_, chunk)) => Err(self.file.cannot(format!(
                "column `{}` is compressed by {:?}, which is not read; write the file with zstd, snappy, gzip, lz4 or no compression",
                chunk.column_path().parts().first().map_or("", String::as_str),
                chunk.compression_codec()
            ))),
        }
    }
}

impl Columns for ArrowFile<'_> {
    fn format(&self) -> FileFormat {
        if let Kind::Parquet(_) = self.kind { FileFormat::Parquet } else { FileFormat::Arrow }
    }

    fn names(&self) -> &[String] {
        &self.names
    }

    fn read(&mut self, columns: &[usize], keys: Option<usize>) -> Result<Vec<Cells>, Error> {
        let wanted: Vec<usize> = columns.iter().copied().chain(keys).collect();
        let mut once = wanted.clone();
        once.sort_unstable();
        once.dedup();
        let mut read: Vec<Option<Cells>> = wanted.iter().map(|_| None).collect();
        if keys.is_some() {
            read[columns.len()] = Some(Cells::Texts(vec![]));
        }
        for batch in self.batches(once.clone())? {
            let batch = batch.map_err(|error| damaged(self.file, self.format(), error.into()))?;
            for (place, (cells, column)) in read.iter_mut().zip(&wanted).enumerate() {
                let array = batch.column(once.partition_point(|earlier| earlier < column));
                let wanted = if place == columns.len() { "text or whole numbers" } else { "numbers or dates" };
                cells::append(cells, array).map_err(|kind| self.file.wrong_kind(&self.names[*column], kind, wanted))?;
            }
        }
        // Without a row, the kind of the cells does not matter.
        Ok(read.into_iter().map(|cells| cells.unwrap_or(Cells::Numbers(vec![]))).collect())
    }
}

fn bytes(file: &DataFile) -> Result<Bytes, Error> {
    Ok(BufReader::with_capacity(1 << 16, File::open(&file.path).map_err(|error| file.cannot(error))?))
}

/// Whether an Arrow file is one with an index of its batches, and no stream.
fn is_file(bytes: &mut Bytes) -> std::io::Result<bool> {
    let mut begin = [0; 6];
    bytes.read_exact(&mut begin)?;
    bytes.rewind()?;
    Ok(&begin == b"ARROW1")
}

fn damaged(file: &DataFile, format: FileFormat, error: Box<dyn std::error::Error + Send + Sync>) -> Error {
    file.cannot(format!("as {format} the file is damaged or cut off: {error}"))
}
