//! Files that are no text, as pandas, polars, pyarrow, NumPy, SciPy, h5py and hdf5storage wrote them (`files/make.py`).
#![cfg(all(feature = "arrow", feature = "mat", feature = "npz"))]

use crate::pmsm::Pmsm;
use crate::refused::says;
use greybox::layout::Layout;
use greybox::record::{Channel, Record};
use greybox::{DataFile, Error, FileFormat, Time};
use std::path::{Path, PathBuf};

fn file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/records/files").join(name)
}

fn read(name: &str) -> Result<Record, Error> {
    DataFile::new(file(name)).read_record(&Layout::of::<Pmsm>())
}

/// The four samples that the files hold, to the last bit.
#[track_caller]
fn is_the_record(name: &str, record: Result<Record, Error>, said: &str) {
    let record = record.unwrap_or_else(|error| panic!("{name}: {error}"));
    assert_eq!(record.times(), &Time::Uniform { start: 0.0, step: 0.5 }, "{name}");
    let values = |channels: &[Channel]| -> Vec<Vec<String>> {
        channels.iter().map(|channel| channel.values.iter().map(f64::to_string).collect()).collect()
    };
    assert_eq!(values(record.inputs()), [["1.5", "2.5", "-3.5", "4"], ["10", "20", "30", "40"]], "{name}");
    assert_eq!(values(record.outputs()), [["0.25", "NaN", "0.5", "0.75"], ["-1", "-2", "-3", "-4"]], "{name}");
    assert_eq!(record.reading().unwrap().to_string(), said, "{name}");
    assert!(name.starts_with(record.name()), "{name}");
}

#[test]
fn files_of_other_programs_are_records() {
    let local = "time \"time\": dates, from 2025-03-20T14:00:00";
    for (name, said) in [
        ("pandas.parquet", format!("Parquet, {local}")),
        ("pandas_index.parquet", format!("Parquet, {local}")),
        // The clock stood at 02:59:59 summer time, and a second later at 02:00:00 winter time.
        ("polars.parquet", "Parquet, time \"time\": dates, from 2025-10-26T00:59:59Z".to_owned()),
        ("polars.arrow", "Arrow IPC, time \"t_ms\" in ms".to_owned()),
        ("texts.arrow", "Arrow IPC, time \"time\": dates, from 2025-03-20 14:00:00.0".to_owned()),
        ("pyarrow.parquet", "Parquet, time \"t\" in s".to_owned()),
        ("pyarrow.feather", "Arrow IPC, time \"t\" in s".to_owned()),
        ("pyarrow.arrows", "Arrow IPC, time \"t\" in s".to_owned()),
        ("numpy.npz", "a NumPy archive, time \"t\" in s".to_owned()),
        ("scipy.mat", "MATLAB 5, time \"t\" in s".to_owned()),
        ("scipy_compressed.mat", "MATLAB 5, time \"t\" in s".to_owned()),
        ("matlab_73.mat", "HDF5, time \"t\" in s".to_owned()),
    ] {
        is_the_record(name, read(name), &said);
    }
    let record = read("numpy_dates.npz").unwrap();
    assert_eq!(record.times(), &Time::Uniform { start: 0.0, step: 0.5 });
    assert_eq!((record.inputs()[1].values[3], record.reading().unwrap().format), (1.0, FileFormat::Npz));
}

/// Fields of structures and datasets in groups have names with a point.
#[test]
fn columns_within_others_are_named() {
    let within = |name: &str, group: &str| {
        let file = DataFile::new(file(name));
        let said = |file: DataFile, signal: &str| file.column(signal, &format!("{group}.{signal}"));
        ["t", "ud", "w", "id", "iq"].into_iter().fold(file, said)
    };
    let plain = ["t", "ud", "w", "id"];
    let inner = plain
        .iter()
        .fold(DataFile::new(file("scipy_structure.mat")), |file, signal| file.column(signal, &format!("log.{signal}")));
    let said = "MATLAB 5, time \"log.t\" in s";
    is_the_record("scipy_structure.mat", within("scipy_structure.mat", "log").read_record(&Layout::of::<Pmsm>()), said);
    is_the_record("scipy_structure.mat", inner.column("iq", "log.inner.q").read_record(&Layout::of::<Pmsm>()), said);
    for name in ["h5py_earliest.h5", "h5py_v110.h5"] {
        is_the_record(name, within(name, "bench").read_record(&Layout::of::<Pmsm>()), "HDF5, time \"bench.t\" in s");
    }
    says(read("scipy_structure.mat"), &["no column", "log.ud", "log.inner.q"]);
    let file = within("h5py_v110.h5", "bench");
    says(
        file.clone().column("ud", "bench.names").read_record(&Layout::of::<Pmsm>()),
        &["`bench.names` holds", "numbers are wanted"],
    );
    says(
        file.column("ud", "bench.both").read_record(&Layout::of::<Pmsm>()),
        &["`bench.both` holds an array of 4 x 2 cells"],
    );
    says(
        DataFile::new(self::file("matlab_73.mat")).column("ud", "remark").read_record(&Layout::of::<Pmsm>()),
        &["`remark` holds", "char"],
    );
}

/// Factor, offset, another column of time, a constant step: as with text.
#[test]
fn what_is_said_of_a_file_holds_for_columns() {
    let file = DataFile::new(file("polars.arrow"));
    let record =
        file.clone().factor("ud", 2.0).offset("ud", 1.0).reversed("w").read_record(&Layout::of::<Pmsm>()).unwrap();
    assert_eq!([0, 1].map(|input: usize| record.inputs()[input].values[3]), [9.0, -40.0]);
    let record = file.clone().sample_time(0.5).read_record(&Layout::of::<Pmsm>()).unwrap();
    assert_eq!(record.times(), &Time::Uniform { start: 0.0, step: 0.5 });
    let record = file.column("t", "w").read_record(&Layout::of::<Pmsm>()).unwrap();
    assert_eq!(record.times(), &Time::Uniform { start: 10.0, step: 10.0 });
}

/// Of another one that is not read, the compression does not matter.
#[test]
fn a_column_whose_compression_is_not_read_is_refused() {
    let file = DataFile::new(file("brotli.parquet"));
    assert_eq!(file.clone().column("ud", "iq").read_record(&Layout::of::<Pmsm>()).unwrap().inputs()[0].values[3], -4.0);
    let error = says(
        file.read_record(&Layout::of::<Pmsm>()),
        &["brotli.parquet", "column `ud` is compressed by BROTLI", "write the file with zstd, snappy, gzip, lz4"],
    );
    assert!(!error.to_string().contains("damaged"), "{error}");
}

#[test]
fn mistakes_name_the_column_and_the_remedy() {
    let wrong = "numbers are wanted; convert it where the file is written";
    for (name, parts) in [
        ("text.parquet", &["text.parquet", "column `ud` holds text", wrong][..]),
        ("wide.parquet", &["column `iq` holds cells of type LargeList", "numbers or dates"]),
        ("missing.parquet", &["no column `ud`", "time, w, id, iq, remark"]),
        ("no_rows.parquet", &["0 sample(s)"]),
        ("hole.parquet", &["`w` is NaN at sample 1", "only outputs may be missing"]),
        ("no_date.parquet", &["column `time` holds nothing in sample 1", "dates are wanted"]),
        ("backwards.parquet", &["column `time`: sample 2, `2025-03-20T14:00:00.5`", "backwards", "sort the record"]),
        ("feather_1.feather", &["Feather of version 1", "version 2 or as Parquet"]),
        ("single.npy", &["one NumPy array", "numpy.savez"]),
        ("matrix.npz", &["column `ud` holds an array of 4 x 2 cells"]),
        ("complex.npz", &["column `ud` holds cells of type <c16"]),
        ("lengths.npz", &["`w` has 4 rows, but `ud` has 3"]),
        ("version_4.mat", &["MATLAB 5 or later", "-v7"]),
        ("kinds.mat", &["column `ud` holds complex numbers"]),
    ] {
        says(read(name), parts);
    }
    // Another column of `w` than the matrix, which would be met first.
    let kinds = DataFile::new(file("kinds.mat"));
    says(
        kinds.clone().column("ud", "w").read_record(&Layout::of::<Pmsm>()),
        &["column `w` holds an array of 4 x 2 cells"],
    );
    says(
        kinds.column("w", "t").column("t", "t").column("ud", "id").read_record(&Layout::of::<Pmsm>()),
        &["column `id` holds a cell array"],
    );
    says(
        DataFile::new(file("scipy.mat")).column("ud", "remark").read_record(&Layout::of::<Pmsm>()),
        &["column `remark` holds text"],
    );
}

fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

/// Files cut off anywhere, or with a byte exchanged, are errors or records, and never a panic. Cut off within what is read, they are errors.
#[test]
fn damaged_files_are_refused() {
    let folder = folder("damaged");
    // Up to where a cut must be an error: the end of the index that stands at the end; all variables that are read; the superblock.
    for (name, within) in [
        ("pandas.parquet", usize::MAX),
        ("polars.arrow", usize::MAX),
        ("pyarrow.arrows", 300),
        ("numpy.npz", usize::MAX),
        ("scipy.mat", 300),
        ("scipy_compressed.mat", 200),
        ("h5py_v110.h5", 48),
        ("matlab_73.mat", 560),
    ] {
        let bytes = std::fs::read(file(name)).unwrap();
        let path = folder.join(name);
        let damaged = |bytes: &[u8]| {
            std::fs::write(&path, bytes).unwrap();
            let file = DataFile::new(&path);
            let within = |file: DataFile, signal: &str| file.column(signal, &format!("bench.{signal}"));
            let file = if name.starts_with("h5py") {
                ["t", "ud", "w", "id", "iq"].into_iter().fold(file, within)
            } else {
                file
            };
            file.read_record(&Layout::of::<Pmsm>())
        };
        for end in (0..bytes.len()).step_by(1 + bytes.len() / 60) {
            let cut = damaged(&bytes[..end]);
            if end < within {
                let error = says(cut, &[name.split('.').next().unwrap()]);
                // A stream that ends between two parts has fewer rows.
                let known =
                    matches!(error, Error::File { .. } | Error::MissingColumn { .. } | Error::TooFewSamples { .. });
                assert!(known, "{name}, {end}: {error}");
            }
        }
        for at in (0..bytes.len()).step_by(1 + bytes.len() / 60) {
            for byte in [0, 0xff, bytes[at] ^ 1, bytes[at].wrapping_add(64)] {
                let mut bytes = bytes.clone();
                bytes[at] = byte;
                if let Err(error) = damaged(&bytes) {
                    assert!(error.to_string().len() > name.len());
                }
            }
        }
    }
    for ending in ["parquet", "arrow", "npz", "mat", "h5"] {
        let path = folder.join(format!("empty.{ending}"));
        std::fs::write(&path, "").unwrap();
        says(DataFile::new(&path).read_record(&Layout::of::<Pmsm>()), &["empty.", "the file is empty"]);
        std::fs::write(&path, "t,ud,w,id,iq\n").unwrap();
        says(DataFile::new(&path).read_record(&Layout::of::<Pmsm>()), &["does not begin as"]);
    }
}

#[test]
fn records_of_one_file_are_told_apart_by_a_column() {
    let layout = Layout::of::<Pmsm>();
    let by = |name: &str, column: &str| DataFile::new(file(name)).read_groups(&layout, column).unwrap();
    for (name, column, names) in [
        ("motors.parquet", "motor", ["b", "a", "c"]),
        // Whole numbers that an `f64` does not tell apart.
        ("motors.parquet", "serial", ["4611686018427387906", "4611686018427387905", "4611686018427387907"]),
        ("motors.csv", "motor", ["b", "a", "c"]),
        ("motors.npz", "motor", ["1", "0", "2"]),
        ("motors.npz", "serial", ["4611686018427387906", "4611686018427387905", "4611686018427387907"]),
    ] {
        let mut groups = by(name, column);
        assert_eq!(groups.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>(), names);
        says(groups.remove(2).1, &["1 sample(s)"]);
        for (group, record) in groups {
            let record = record.unwrap_or_else(|error| panic!("{name}, {group}: {error}"));
            assert_eq!(record.name(), group.as_str());
            let said = record.reading().unwrap().to_string();
            is_the_record(&group, Ok(record), &said);
        }
    }
    says(
        DataFile::new(file("motors.parquet")).read_groups(&layout, "ud"),
        &["`ud` holds cells of type Float64", "whole numbers"],
    );
    says(DataFile::new(file("motors.csv")).read_groups(&layout, "engine"), &["no column `engine`", "motor"]);
}

#[test]
fn columns_that_differ_in_length_are_no_groups() {
    let groups = DataFile::new(file("lengths.npz")).read_groups(&Layout::of::<Pmsm>(), "w");
    says(groups, &["`w` has 4 rows, but `ud` has 3"]);
}

/// A row that is wrong spoils its own record; rows without a name are one that is refused; uneven times and units of time are each record's own.
#[test]
fn a_record_that_cannot_be_read_spoils_no_other() {
    let path = folder("groups").join("mixed.csv");
    let rows =
        "a,0,1,2,3,4\nb,0,1,x,3,4\na,1,1,2,3,4\n,0,1,2,3,4\na,3,1,2,3,4\nb,1,1,2,3,4\nc,7,1,2,3,4\nc,8,1,2,3,4\n";
    std::fs::write(&path, format!("motor,t_ms,ud,w,id,iq\n{rows}")).unwrap();
    let groups = DataFile::new(&path).read_groups(&Layout::of::<Pmsm>(), "motor").unwrap();
    assert_eq!(groups.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>(), ["a", "b", "", "c"]);
    assert_eq!(groups[0].1.as_ref().unwrap().times(), &Time::Stamps(vec![0.0, 1e-3, 3e-3]));
    says(groups[1].1.as_ref().map(|_| ()), &["line 3, column `w`: `x` is not a number"]);
    says(groups[2].1.as_ref().map(|_| ()), &["column `motor` holds an empty cell"]);
    assert_eq!(groups[3].1.as_ref().unwrap().times(), &Time::Uniform { start: 7e-3, step: 1e-3 });
}
