//! Records from CSV files as laboratories write them.
#![cfg(feature = "csv")]

use crate::pmsm::{Currents, Drive, Pmsm, Winding};
use crate::shared::shared;
use greybox::{DataFile, Experiment, Kind, Model, Nothing, Scalar, Time, signals, units};
use std::path::PathBuf;

fn file(name: &str, text: impl AsRef<[u8]>) -> PathBuf {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    std::fs::write(&path, text).unwrap();
    path
}

#[test]
fn columns_go_by_name() {
    let path = file("by_name.csv", "iq,extra,t,ud,id,w\n4,x,0,1,3,2\n40,,0.5,10,30,20\n");
    let record = Experiment::from_file(&Pmsm, path).unwrap();
    assert_eq!(record.name(), "by_name");
    assert_eq!(record.len(), 2);
    assert_eq!([record.time(0), record.time(1)], [0.0, 0.5]);
    assert_eq!(record.inputs().collect::<Vec<_>>(), [Drive { ud: 1.0, w: 2.0 }, Drive { ud: 10.0, w: 20.0 }]);
    assert_eq!(record.outputs().collect::<Vec<_>>(), [Currents { id: 3.0, iq: 4.0 }, Currents { id: 30.0, iq: 40.0 }]);
}

#[test]
fn renames_scales_shifts_and_reverses() {
    let path = file("bench.csv", "time (ms),speed,ud,id,iq\n0,60,1,3,4\n2,-30,1,3,4\n");
    let record = DataFile::new(path)
        .column("t", "time (ms)")
        .factor("t", 1e-3)
        .column("w", "speed")
        .factor("w", units::RPM)
        .offset("id", -0.5)
        .reversed("iq")
        .factor("iq", 2.0)
        .read(&Pmsm)
        .unwrap();
    assert_eq!(record.time(1), 0.002);
    approx::assert_relative_eq!(record.input(0).w, 2.0 * std::f64::consts::PI, max_relative = 1e-15);
    approx::assert_relative_eq!(record.input(1).w, -std::f64::consts::PI, max_relative = 1e-15);
    assert_eq!(record.output(0), Currents { id: 2.5, iq: -8.0 });
}

#[test]
fn reads_what_instruments_write() {
    let plain = "t,ud,w,id,iq\n0,1.5,2,3,4\n1,1.5,2,,4\n";
    let cases = [
        ("plain", plain.to_owned(), DataFile::new as fn(PathBuf) -> DataFile),
        ("crlf", plain.replace('\n', "\r\n"), DataFile::new),
        ("no_last_newline", plain.trim_end().to_owned(), DataFile::new),
        ("byte_order_mark", format!("\u{feff}{plain}"), DataFile::new),
        ("spreadsheet", format!("\u{feff}sep=;\r\n{}", plain.replace(',', ";")), |path| {
            DataFile::new(path).delimiter(b';')
        }),
        ("spaces", plain.replace(',', " ,  "), DataFile::new),
        ("quotes", plain.replace("1.5", "\" 1.5 \"").replace("ud", "\"ud\""), DataFile::new),
        ("missing_nan", plain.replace(",,", ",NaN,"), DataFile::new),
        ("missing_na", plain.replace(",,", ", NA ,"), DataFile::new),
        ("missing_null", plain.replace(",,", ",null,"), DataFile::new),
        (
            "comments",
            format!("# bench 3\n\n{}\n# end\n", plain.replace("\n1,", "\n# pause, a \" quote\n\n1,")),
            DataFile::new,
        ),
        ("numpy", format!("# bench 3\n# {plain}"), DataFile::new),
        ("numpy_gaps", format!("# note, {plain}").replace("\n0,", "\n,0,").replace("\n1,", "\nnan,1,"), DataFile::new),
        ("trailing_delimiter", plain.replace('\n', ",\n"), DataFile::new),
        ("signs", plain.replace("1.5", "+15e-1"), DataFile::new),
        ("tabs", plain.replace(',', "\t"), |p| DataFile::new(p).delimiter(b'\t')),
        ("semicolons", plain.replace(',', ";"), |p| DataFile::new(p).delimiter(b';')),
        ("decimal_comma", plain.replace(',', ";").replace('.', ","), |p| DataFile::new(p).decimal_comma()),
        ("percent", format!("% a\n{plain}"), |p| DataFile::new(p).comment(b'%')),
        ("preamble", format!("Scope\nt,ud,5\n{plain}"), |p| DataFile::new(p).preamble(2)),
        ("units_row", plain.replace("iq\n", "iq\ns,V,rad/s,A,A\n"), |p| DataFile::new(p).units_row()),
        ("sample_time", plain.replace("t,", "clock,"), |p| DataFile::new(p).sample_time(1.0)),
    ];
    for (name, text, read) in cases {
        let record = read(file(&format!("{name}.csv"), text)).read(&Pmsm).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert_eq!(record.inputs().collect::<Vec<_>>(), [Drive { ud: 1.5, w: 2.0 }; 2], "{name}");
        assert_eq!(record.output(0), Currents { id: 3.0, iq: 4.0 }, "{name}");
        assert!(record.output(1).id.is_nan(), "{name}");
        assert_eq!(record.output(1).iq, 4.0, "{name}");
        assert_eq!([record.time(0), record.time(1)], [0.0, 1.0], "{name}");
    }
}

#[test]
fn a_preamble_longer_than_the_file_ends_with_it() {
    let path = file("preamble_only.csv", "t,ud,w,id,iq\n0,1.5,2,3,4\n");
    let error = DataFile::new(path).preamble(usize::MAX).read(&Pmsm).unwrap_err().to_string();
    assert!(error.contains("the file ends before a line with the names of its columns"), "{error}");
}

/// Even stamps become a start and a step; a gap, a jitter or an uneven end keeps every stamp as written.
#[test]
fn time_is_uniform_only_where_it_is() {
    let record = |name: &str, stamps: &[f64]| {
        let rows: String = stamps.iter().map(|t| format!("{t},1,2,3,4\n")).collect();
        Experiment::from_file(&Pmsm, file(name, format!("t,ud,w,id,iq\n{rows}"))).unwrap()
    };
    let even: Vec<f64> = (0..2000).map(|k| 5.0 + (k * 126) as f64 / 1e6).collect();
    let uniform = record("even.csv", &even);
    let Time::Uniform { start, step } = uniform.times() else { panic!("stamps {:?}", uniform.times()) };
    assert_eq!(*start, 5.0);
    approx::assert_relative_eq!(*step, 126e-6, max_relative = 1e-12);

    let mut jitter = even.clone();
    jitter[1500] += 126e-6 * 3e-6;
    let mut gap = even.clone();
    gap.drain(1998..1999);
    let mut within = even.clone();
    within[1500] += 126e-6 * 0.5e-6;
    for (name, stamps) in [("jitter.csv", &jitter), ("gap.csv", &gap)] {
        assert_eq!(record(name, stamps).times(), &Time::Stamps(stamps.clone()), "{name}");
        assert_eq!(Time::from_stamps(stamps.clone()), Time::Stamps(stamps.clone()), "{name}");
    }
    assert!(matches!(record("within.csv", &within).times(), Time::Uniform { .. }));
    // Seconds since 1970 resolve 2.4e-7 s: rounded, but even.
    let epoch: Vec<f64> = even.iter().map(|t| 1.7e9 + t).collect();
    assert!(matches!(Time::from_stamps(epoch), Time::Uniform { .. }));
    // What is missing is on no grid.
    assert!(matches!(Time::from_stamps(vec![0.0, f64::NAN, 0.3, 5.0, 100.0]), Time::Stamps(_)));
}

/// A pipe is read once; an uneven clock keeps its stamps there too.
#[cfg(unix)]
#[test]
fn reads_from_a_pipe() {
    let pipe = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("pipe_{}", std::process::id()));
    assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    for (last, even) in [(4, true), (5, false)] {
        let (to, text) = (pipe.clone(), format!("t,ud,w,id,iq\n0,1,2,3,4\n2,1,2,3,4\n{last},1,2,3,4\n"));
        let writer = std::thread::spawn(move || std::fs::write(to, text).unwrap());
        let record = Experiment::from_file(&Pmsm, &pipe).unwrap();
        writer.join().unwrap();
        assert_eq!([record.time(0), record.time(1), record.time(2)], [0.0, 2.0, last as f64]);
        assert_eq!(matches!(record.times(), Time::Uniform { .. }), even);
    }
    std::fs::remove_file(pipe).unwrap();
}

struct Line;

signals! {
    pub struct X { x: "1" }
    pub struct Y { y: "1" }
}

impl Model for Line {
    type State = Nothing;
    type Input = X;
    type Output = Y;
    type Parameters = Winding;
    const KIND: Kind = Kind::Static;

    fn output<S: Scalar>(&self, _t: S, _x: &Nothing, u: &X<S>, p: &Winding<S>) -> Y<S> {
        Y { y: u.x * p.rs }
    }
}

#[test]
fn a_static_model_needs_no_time() {
    let record = Experiment::from_file(&Line, file("static.csv", "x,y\n7,8\n9,10\n")).unwrap();
    assert_eq!(record.inputs().collect::<Vec<_>>(), [X { x: 7.0 }, X { x: 9.0 }]);
    assert_eq!([record.time(0), record.time(1)], [0.0, 1.0]);
    let timed = Experiment::from_file(&Line, file("static_t.csv", "x,t,y\n7,3,8\n")).unwrap();
    assert_eq!(timed.time(0), 3.0);
    for (name, header, rows) in [
        ("static_time.csv", "Time,x,y", "60,7,8\n120,9,10\n"),
        ("static_ms.csv", "time_ms,x,y", "60000,7,8\n120000,9,10\n"),
        ("static_date.csv", "Date,x,y", "2025-03-20 14:05,7,8\n2025-03-20 14:06,9,10\n"),
    ] {
        let record = Experiment::from_file(&Line, file(name, format!("{header}\n{rows}"))).unwrap();
        assert_eq!(record.time(1) - record.time(0), 60.0, "{header}");
    }
    // Neither the column of a signal nor a temperature is a time.
    let signal = DataFile::new(file("static_signal.csv", "time,y\n60,8\n70,10\n")).column("x", "time");
    let beside = DataFile::new(file("static_beside.csv", "x,T,y\n60,8,9\n70,10,11\n"));
    assert_eq!([signal, beside].map(|named| named.read(&Line).unwrap().time(1)), [1.0, 1.0]);
    // A time that was asked for must be there.
    let absent = DataFile::new(file("static_absent.csv", "x,y\n7,8\n")).column("t", "clock").read(&Line);
    assert!(absent.unwrap_err().to_string().contains("no column `clock` for `t`"));
}

/// Measured records that nobody here made.
#[test]
fn shared_records() {
    let (Some(path), Some(emps)) = (shared("motulator/spm_avg.csv"), shared("emps/emps.csv")) else { return };
    let record = DataFile::new(path).column("w", "omega_m").read(&Pmsm).unwrap();
    assert_eq!(record.len(), 8000);
    assert_eq!(record.times(), &Time::Uniform { start: 0.0, step: 125e-6 });
    let emps = DataFile::new(emps).column("x", "vir").column("y", "qm").read(&Line).unwrap();
    assert_eq!(emps.len(), 24_841);
    // The clock of this instrument jitters by 2.4e-5 of a step.
    assert!(matches!(emps.times(), Time::Stamps(_)));
}
