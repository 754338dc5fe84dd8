//! Every way in which a record can be wrong: an error that names the thing, the number and the place.
#![cfg(feature = "csv")]

use crate::pmsm::{Currents, Drive, Pmsm, Winding};
use crate::refused::says;
use greybox::{DataFile, Error, Experiment, Model, Scalar, Time};
use std::path::PathBuf;

const U: Drive = Drive { ud: 1.0, w: 2.0 };
const Y: Currents = Currents { id: 3.0, iq: 4.0 };
const EVEN: Time = Time::Uniform { start: 0.0, step: 0.1 };

fn path(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("bad_records").join(name)
}

fn file(name: &str, text: impl AsRef<[u8]>) -> PathBuf {
    let path = path(name);
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    std::fs::write(&path, text).unwrap();
    path
}

/// Reads a file of this text and checks what the error says.
#[track_caller]
fn refused(name: &str, text: &str, parts: &[&str]) -> Error {
    says(Experiment::from_file(&Pmsm, file(name, text)), parts)
}

#[test]
fn missing_column() {
    let error = refused("columns.csv", "time,ud,speed,id,iq\n", &["columns.csv", "`w`", "time, ud, speed, id, iq"]);
    assert!(matches!(error, Error::MissingColumn { .. }));
    let renamed = DataFile::new(file("renamed.csv", "t,ud,speed,id,iq\n")).column("w", "rpm").read(&Pmsm);
    says(renamed, &["no column `rpm` for `w`", "t, ud, speed, id, iq"]);
    let bars = DataFile::new(file("bars.csv", "t|ud|w|id|iq\n0|1|2|3|4\n")).delimiter(b',').read(&Pmsm);
    says(bars, &["t|ud|w|id|iq", "DataFile::delimiter"]);
    refused("nameless.csv", "0,1,2,3,4\n1,1,2,3,4\n", &["no column `t`", "0, 1, 2, 3, 4", "must hold the names"]);
    // Of many columns the ten nearest.
    let many: Vec<String> = (0..40).map(|k| format!("channel{k}")).collect();
    let header = format!("t,{},motor_ud,UD,w,id,iq\n", many.join(","));
    let parts = ["no column `ud`", "of its 46 columns these are nearest: UD, motor_ud, id, t"];
    let error = refused("many.csv", &header, &parts);
    assert_eq!(error.to_string().matches("channel").count(), 6, "{error}");
    refused("clocks.csv", "Clock,ud,w,id,iq\n", &["no column `t`", "DataFile::column", "DataFile::sample_time"]);
}

#[test]
fn ambiguous_column() {
    let error = refused("twice.csv", "t,w,ud,w,id,iq\n", &["twice.csv", "`w`", "2 and 4"]);
    assert!(matches!(error, Error::AmbiguousColumn { .. }));
    // Twins that nobody asked for do no harm.
    Experiment::from_file(&Pmsm, file("twins.csv", "t,w,ud,a,a,id,iq\n0,1,2,,,3,4\n1,1,2,,,3,4\n")).unwrap();
}

#[test]
fn not_a_number() {
    let text = "t,ud,w,id,iq\n0,1,2,3,4\n# pause\n\n1,1,2,3 A,4\n";
    for (name, text) in [("text.csv", text.to_owned()), ("text_crlf.csv", text.replace('\n', "\r\n"))] {
        let error = refused(name, &text, &[name, "line 5", "`id`", "`3 A`"]);
        assert!(matches!(error, Error::NotANumber { .. }));
    }
    refused("clock.csv", "t,ud,w,id,iq\n12:30,1,2,3,4\n", &["line 2", "`t`", "`12:30`", "14:05:00"]);
    refused("last.csv", "t,ud,w,id,iq\n0,1,2,3,4\n1,x,2,3,4", &["line 3", "`ud`", "`x`"]);
    refused("comma.csv", "t;ud;w;id;iq\n0;1.5;2;3;4\n1;1,5;2;3;4\n", &["line 3", "`1,5`", "DataFile::decimal_comma"]);
    refused("point.csv", "t;ud;w;id;iq\n0;1,5;2;3;4\n1;1.5;2;3;4\n", &["line 3", "`ud`", "`1.5`"]);
    refused("thousand.csv", "t,ud,w,id,iq\n0,\"1,500\",2,3,4\n", &["line 2", "`1,500`", "DataFile::decimal_comma"]);
    let renamed = DataFile::new(file("x.csv", "t,u,w,id,iq\n0,x,2,3,4\n")).column("ud", "u").read(&Pmsm);
    says(renamed, &["line 2", "column `u`", "`x`"]);
    let units = ["line 2", "`t`", "`a`", "DataFile::units_row"];
    refused("units.csv", "t,ud,w,id,iq\na,b,c,d,e\ns,V,rad/s,A,A\n0,1,2,3,4\n", &units);
    refused("dash.csv", "t,ud,w,id,iq\n0,1,2,---,4\n", &["line 2", "`---`", "is empty, NaN, NA or null"]);
    let thousands = DataFile::new(file("thousands.csv", "t;ud;w;id;iq\n0;1.234,5;2;3;4\n"));
    says(thousands.decimal_comma().read(&Pmsm), &["line 2", "`1.234,5`", "separators of thousands"]);
    let latin = Experiment::from_file(&Pmsm, file("latin.csv", b"t,ud,w,F\xfcllstand,iq\n0,1,2,3,4\n"));
    says(latin, &["no column `id`", "Füllstand"]);
    let long = DataFile::new(file("long.csv", format!("t;ud;w;id;iq\n0;{};2;3;4\n", "1".repeat(65))));
    says(long.decimal_comma().read(&Pmsm), &["line 2", "`ud`"]);
}

#[test]
fn counts_lines_below_what_it_skips() {
    let skipped = DataFile::new(file("skipped.csv", "a\nb\nt,ud,w,id,iq\ns,V,,A,A\n0,1,2,3,4\n1,1,2,?,4\n"));
    says(skipped.preamble(2).units_row().read(&Pmsm), &["line 6", "`id`", "`?`"]);
    refused("numpy.csv", "# a\n# t,ud,w,id,iq\n0,1,2,3,4\n1,1,2,?,4\n", &["line 4", "`id`", "`?`"]);
}

#[test]
fn missing_inputs_and_time() {
    for cell in ["", "NaN", "na", "inf", "1e999"] {
        let parts = ["input.csv, line 3", "`input`", "`w`", "sample 1", "t = 0.1 s", "only outputs may be missing"];
        let error = refused("input.csv", &format!("t,ud,w,id,iq\n0,1,2,3,4\n0.1,1,{cell},3,4\n"), &parts);
        let Error::AtLine { problem, .. } = error else { panic!("{error}") };
        assert!(matches!(*problem, Error::NotFinite { .. }));
        let parts = ["time.csv, line 3", "`time`", "`t`", "sample 1"];
        refused("time.csv", &format!("t,ud,w,id,iq\n0,1,2,3,4\n{cell},1,2,3,4\n"), &parts);
    }
    refused("output.csv", "t,ud,w,id,iq\n0,1,2,-inf,4\n", &["line 2", "`id`", "-inf", "sample 0"]);
    let large = DataFile::new(file("large.csv", "t,ud,w,id,iq\n0,1,2,1e200,4\n")).factor("id", 1e200).read(&Pmsm);
    says(large, &["line 2", "`id`", "inf"]);
}

#[test]
fn time_runs_backwards_or_stands_still() {
    let text = "t,ud,w,id,iq\n0,1,2,3,4\n1,1,2,3,4\n0.5,1,2,3,4\n";
    let error = refused("order.csv", text, &["order.csv, line 4", "`order`", "sample 2", "1 s is followed by 0.5 s"]);
    let Error::AtLine { problem, .. } = error else { panic!("{error}") };
    assert!(matches!(*problem, Error::TimeOrder { .. }));
    let error = refused("still.csv", "t,ud,w,id,iq\n1,1,2,3,4\n1,1,2,3,5\n", &["sample 1", "1 s is followed by 1 s"]);
    assert!(matches!(error, Error::TimeOrder { .. }));
}

/// Measurements may repeat at an instant, inputs may not.
#[test]
fn inputs_that_differ_at_one_instant() {
    Experiment::from_file(&Pmsm, file("instant.csv", "t,ud,w,id,iq\n0,1,2,3,4\n1,1,2,3,4\n1,1,2,5,4\n")).unwrap();
    let parts = ["samples 1 and 2", "t = 1 s", "`w` is 2 and 2.5", "times of their own"];
    let error = refused("jump.csv", "t,ud,w,id,iq\n0,1,2,3,4\n1,1,2,3,4\n1,1,2.5,5,4\n", &parts);
    assert!(matches!(error, Error::InputsAtOneInstant { .. }));
}

#[test]
fn unequal_rows() {
    let error =
        refused("short.csv", "t,ud,w,id,iq\n0,1,2,3,4\n1,1,2,3\n", &["short.csv, line 3", "4 cell", "5 column"]);
    assert!(matches!(error, Error::RowLength { .. }));
    refused("long.csv", "t,ud,w,id,iq\n0,1,2,3,4,5\n", &["line 2", "6 cell", "5 column"]);
}

#[test]
fn unreadable() {
    let error = says(Experiment::from_file(&Pmsm, path("absent.csv")), &["absent.csv"]);
    assert!(matches!(error, Error::File { .. }));
    says(Experiment::from_file(&Pmsm, env!("CARGO_TARGET_TMPDIR")), &[env!("CARGO_TARGET_TMPDIR")]);
    refused("empty.csv", "", &["empty.csv", "names of its columns"]);
    refused("comments.csv", "# only\n\n# talk\n", &["comments.csv", "names of its columns"]);
    says(DataFile::new(file("preamble.csv", "t,ud,w,id,iq\n")).preamble(3).read(&Pmsm), &["names of its columns"]);
    let wide: Vec<u8> = "\u{feff}t,ud\n".encode_utf16().flat_map(u16::to_le_bytes).collect();
    says(Experiment::from_file(&Pmsm, file("wide.csv", wide)), &["wide.csv", "UTF-16", "UTF-8"]);
    let bytes: Vec<u8> = (0..=255).collect();
    says(Experiment::from_file(&Pmsm, file("bytes.csv", bytes)), &["bytes.csv"]);
}

#[test]
fn too_few_samples() {
    for (name, rows, count) in [("none.csv", "", "0 sample"), ("one.csv", "0,1,2,3,4\n", "1 sample")] {
        let error =
            refused(name, &format!("t,ud,w,id,iq\n{rows}"), &[name.trim_end_matches(".csv"), count, "2 or more"]);
        assert!(matches!(error, Error::TooFewSamples { .. }), "{error}");
    }
}

#[test]
fn settings_without_sense() {
    let file = || DataFile::new(file("fine.csv", "t,ud,w,id,iq\n0,1,2,3,4\n1,1,2,3,4\n"));
    for factor in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let error = says(file().factor("w", factor).read(&Pmsm), &["factor of `w`", &factor.to_string(), "reversed"]);
        assert!(matches!(error, Error::NotPositive { .. }));
        says(file().sample_time(factor).read(&Pmsm), &["sample_time", &factor.to_string()]);
    }
    says(file().offset("w", f64::NAN).read(&Pmsm), &["offset of `w`", "NaN"]);
    let unknown = [file().column("speed", "w"), file().factor("speed", 2.0), file().offset("speed", 2.0)];
    for unknown in unknown.into_iter().chain([file().reversed("speed")]) {
        let error = says(unknown.read(&Pmsm), &["`speed`", "ud, w, id, iq, t"]);
        assert!(matches!(error, Error::UnknownSignal { .. }));
    }
    file().read(&Pmsm).unwrap();
}

#[test]
fn vectors_that_make_no_record() {
    let new = |time, u: &[Drive], y: &[Currents]| Experiment::new(&Pmsm, time, u.to_vec(), y.to_vec());
    says(new(EVEN, &[], &[]), &["`record`", "0 sample", "2 or more"]);
    says(new(EVEN, &[U], &[Y]), &["1 sample"]);
    says(new(Time::Stamps(vec![0.0]), &[U], &[Y]), &["1 sample"]);
    says(new(EVEN, &[U; 3], &[Y; 2]), &["output has 2 rows", "input has 3"]);
    says(new(Time::Stamps(vec![0.0, 1.0]), &[U; 3], &[Y; 3]), &["time has 2 rows", "`ud` has 3"]);
    says(new(Time::Stamps(vec![0.0, 1.0, 0.5]), &[U; 3], &[Y; 3]), &["sample 2", "1 s is followed by 0.5 s"]);
    says(new(Time::Stamps(vec![0.0, f64::NAN, 1.0]), &[U; 3], &[Y; 3]), &["`t` is NaN at sample 1"]);
    says(new(Time::Uniform { start: f64::NAN, step: 0.1 }, &[U; 3], &[Y; 3]), &["`t` is NaN"]);
    says(
        new(Time::Uniform { start: 1e300, step: 0.1 }, &[U; 3], &[Y; 3]),
        &["sample 1", "1e300 s is followed by 1e300 s"],
    );
    says(new(Time::Uniform { start: 0.0, step: 1e308 }, &[U; 3], &[Y; 3]), &["`t` is inf", "sample 2"]);
    for step in [0.0, -0.1, f64::NAN, f64::INFINITY] {
        says(new(Time::Uniform { start: 0.0, step }, &[U; 3], &[Y; 3]), &["sample time", &step.to_string()]);
    }
    for bad in [f64::NAN, f64::INFINITY] {
        let (number, inputs) = (bad.to_string(), [U, U, Drive { w: bad, ..U }]);
        says(new(EVEN, &inputs, &[Y; 3]), &["`w`", &number, "sample 2", "0.2 s"]);
    }
    says(new(EVEN, &[U; 3], &[Y, Currents { iq: f64::INFINITY, ..Y }, Y]), &["`iq` is inf", "sample 1", "0.1 s"]);
}

#[test]
fn unwritable() {
    let record = Experiment::new(&Pmsm, EVEN, vec![U; 3], vec![Y; 3]).unwrap();
    says(record.to_csv(path("no_such_folder/record.csv")), &["no_such_folder", "record.csv"]);
    says(record.to_csv(env!("CARGO_TARGET_TMPDIR")), &[env!("CARGO_TARGET_TMPDIR")]);
    if std::path::Path::new("/dev/full").exists() {
        let long = Experiment::new(&Pmsm, EVEN, vec![U; 100_000], vec![Y; 100_000]).unwrap();
        says(long.to_csv("/dev/full"), &["/dev/full", "space"]);
        says(record.to_csv("/dev/full"), &["/dev/full", "space"]);
    }
    // A folder stands where the file would be written first: the old file stays as it was.
    let old = file("kept.csv", "old");
    std::fs::create_dir_all(path("kept.csv.part")).unwrap();
    says(record.to_csv(&old), &["kept.csv"]);
    assert_eq!(std::fs::read_to_string(old).unwrap(), "old");
}

#[test]
fn writing_two_columns_of_one_name() {
    struct Twice;
    impl Model for Twice {
        type State = Currents;
        type Input = Drive;
        type Output = Drive;
        type Parameters = Winding;

        fn output<S: Scalar>(&self, _t: S, _x: &Currents<S>, u: &Drive<S>, _p: &Winding<S>) -> Drive<S> {
            *u
        }
    }
    let record = Experiment::new(&Twice, EVEN, vec![U; 3], vec![U; 3]).unwrap();
    says(record.to_csv(path("twice_written.csv")), &["twice_written.csv", "`ud`", "2 and 4"]);
}
