//! Files that are no text, made here: keys that are no names, counts of nanoseconds, times of day, attributes of HDF5.
#![cfg(all(feature = "arrow", feature = "mat", feature = "npz"))]

use crate::pmsm::Pmsm;
use crate::refused::says;
use arrow_array::{ArrayRef, DurationMillisecondArray, Float64Array, Int64Array, RecordBatch, Time32MillisecondArray};
use greybox::layout::Layout;
use greybox::record::Record;
use greybox::{DataFile, Error, Time};
use hdf5_pure::{AttrValue, FileBuilder};
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use zip::ZipWriter;
use zip::write::SimpleFileOptions;

const SIGNALS: [&str; 4] = ["ud", "w", "id", "iq"];

fn path(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("made");
    std::fs::create_dir_all(&folder).unwrap();
    folder.join(name)
}

fn read(file: &DataFile) -> Result<Record, Error> {
    file.read_record(&Layout::of::<Pmsm>())
}

fn floats(values: &[f64]) -> Vec<[u8; 8]> {
    values.iter().map(|value| value.to_le_bytes()).collect()
}

/// A NumPy archive of the signals and of one more column, of 8 bytes a cell.
fn archive(name: &str, column: &str, kind: &str, cells: &[[u8; 8]]) -> DataFile {
    let path = path(name);
    let mut archive = ZipWriter::new(File::create(&path).unwrap());
    let numbers = floats(&(0..cells.len()).map(|k| k as f64).collect::<Vec<_>>());
    for (column, kind, cells) in
        SIGNALS.iter().map(|signal| (*signal, "<f8", &numbers[..])).chain([(column, kind, cells)])
    {
        archive.start_file(format!("{column}.npy"), SimpleFileOptions::default()).unwrap();
        let header = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': ({},), }}", cells.len());
        let header = format!("{header:117}\n");
        archive.write_all(b"\x93NUMPY\x01\x00").unwrap();
        archive.write_all(&(header.len() as u16).to_le_bytes()).unwrap();
        archive.write_all(header.as_bytes()).unwrap();
        archive.write_all(cells.as_flattened()).unwrap();
    }
    archive.finish().unwrap();
    DataFile::new(path)
}

#[test]
fn keys_are_whole_numbers_or_nothing() {
    let layout = Layout::of::<Pmsm>();
    let file = archive("keys.npz", "key", "<f8", &floats(&[7.0, 0.0, f64::NAN, -0.0, 7.0])).sample_time(1.0);
    let groups = file.read_groups(&layout, "key").unwrap();
    assert_eq!(groups.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>(), ["7", "0", ""]);
    says(groups[2].1.as_ref().map(|_| ()), &["column `key` holds an empty cell"]);
    let file = archive("fractions.npz", "key", "<f8", &floats(&[1.0, 0.1, 1.0])).sample_time(1.0);
    says(file.read_groups(&layout, "key"), &["`key` holds numbers that are not whole", "whole numbers"]);
}

/// An Arrow file of the signals and a column of time.
fn arrow(name: &str, times: ArrayRef) -> DataFile {
    let path = path(name);
    let numbers: ArrayRef = Arc::new((0..times.len()).map(|k| Some(k as f64)).collect::<Float64Array>());
    let columns = SIGNALS.iter().map(|signal| (*signal, numbers.clone())).chain([("time", times)]);
    let batch = RecordBatch::try_from_iter(columns).unwrap();
    let mut writer = arrow_ipc::writer::FileWriter::try_new(File::create(&path).unwrap(), &batch.schema()).unwrap();
    writer.write(&batch).unwrap();
    writer.finish().unwrap();
    DataFile::new(path)
}

/// As `f64` they are multiples of 256.
#[test]
fn whole_nanoseconds_since_1970_are_not_rounded() {
    let count = |k: i64| 1_742_479_500_000_000_123 + 126_000 * k;
    let cells: Vec<[u8; 8]> = (0..100).map(|k| count(k).to_le_bytes()).collect();
    let files = [
        archive("nanoseconds.npz", "time", "<i8", &cells),
        arrow("nanoseconds.arrow", Arc::new((0..100).map(|k| Some(count(k))).collect::<Int64Array>())),
    ];
    for file in files {
        let record = read(&file).unwrap();
        let Time::Uniform { start, step } = record.times() else { panic!("{:?}", record.times()) };
        // Rounding of a hundred sums.
        assert!(*start == 0.0 && (step / 126e-6 - 1.0).abs() < 1e-14, "{start} {step}");
    }
    // Keys beyond 2^53 keep all their digits.
    let file = archive("counts.npz", "key", "<i8", &cells).sample_time(1.0);
    assert_eq!(file.read_groups(&Layout::of::<Pmsm>(), "key").unwrap().len(), 100);
}

/// As those of a text: from the first, on past midnight.
#[test]
fn times_of_day_begin_at_zero_and_go_on_at_midnight() {
    let clocks = |name: &str, times: [i32; 4]| arrow(name, Arc::new(Time32MillisecondArray::from(times.to_vec())));
    let file = clocks("midnight.arrow", [86_399_000, 86_399_500, 0, 500]);
    assert_eq!(read(&file).unwrap().times(), &Time::Uniform { start: 0.0, step: 0.5 });
    let back = clocks("clock_back.arrow", [43_200_000, 43_201_000, 43_200_500, 43_202_000]);
    says(read(&back), &["column `time`", "sample 2, `12:00:00.5`", "0.5 s before the row above", "sort the record"]);
}

#[test]
fn lengths_of_time_take_an_offset_but_no_factor() {
    let file = arrow("lengths.arrow", Arc::new(DurationMillisecondArray::from(vec![0, 500, 1000])));
    let moved = read(&file.clone().offset("t", 2.0)).unwrap();
    assert_eq!(moved.times(), &Time::Uniform { start: 2.0, step: 0.5 });
    says(read(&file.clone().unit("t", "ms")), &["the unit of `t`", "holds lengths of time", "give none"]);
    says(read(&file.clone().zone("UTC")), &["column `time`", "no dates", "DataFile::zone"]);
    says(read(&file.factor("t", 1e-3)), &["the factor of `t`", "column `time` holds lengths of time", "give none"]);
}

/// A netCDF file has numbers of another unit where it has these attributes.
#[test]
fn packed_datasets_are_refused() {
    let file = |name: &str, attribute: &str, value: f64| {
        let mut builder = FileBuilder::new();
        for signal in ["t", "ud", "w", "id", "iq"] {
            let dataset = builder.create_dataset(signal);
            dataset.with_f64_data(&[0.0, 1.0, 2.0]);
            if signal == "w" {
                dataset.set_attr(attribute, AttrValue::F64(value));
            }
        }
        let path = path(name);
        builder.write(&path).unwrap();
        read(&DataFile::new(path))
    };
    says(file("scaled.h5", "scale_factor", 0.1), &["column `w` holds", "`scale_factor`"]);
    says(file("shifted.h5", "add_offset", 273.15), &["column `w` holds", "`add_offset`"]);
    says(file("filled.h5", "_FillValue", -999.0), &["column `w` holds", "`_FillValue`"]);
    // What is missing is NaN here, too.
    file("nan.h5", "_FillValue", f64::NAN).unwrap();
    file("other.h5", "valid_max", 4.0).unwrap();
}
