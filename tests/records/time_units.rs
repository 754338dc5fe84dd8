//! Times are shown in the unit of their file.
#![cfg(feature = "csv")]

use crate::pmsm::Pmsm;
use crate::refused::says;
use greybox::{DataFile, Experiment, ExperimentOf, Time, TimeUnit};
use std::path::PathBuf;

fn file(name: &str, header: &str, times: &[f64]) -> PathBuf {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("time_unit_{name}.csv"));
    let rows: String = times.iter().map(|t| format!("{t},1,2,3,4\n")).collect();
    std::fs::write(&path, format!("{header},ud,w,id,iq\n{rows}")).unwrap();
    path
}

const TIMES: [f64; 10] = [0.0, 1.0, 2.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0];

/// Minutes of a file become seconds, and are shown as minutes, in each piece of the record and after a way through JSON.
#[test]
fn the_unit_of_the_file_is_shown() {
    let record = Experiment::from_file(&Pmsm, file("minutes", "t [min]", &TIMES)).unwrap();
    assert_eq!((record.time(1), record.record().moment(1).to_string()), (60.0, "1 min".to_owned()));
    let gap = |record: &ExperimentOf<Pmsm>| record.gaps()[0].to_string();
    assert_eq!(gap(&record), "no sample from 2 min to 5 min (before sample 3)");
    assert_eq!(gap(&record.slice(1..9).unwrap()), "no sample from 2 min to 5 min (before sample 2)");
    let text = serde_json::to_string(&record).unwrap();
    let again: ExperimentOf<Pmsm> = serde_json::from_str(&text).unwrap();
    assert_eq!(again.record().time_unit(), record.record().time_unit());
    says(
        DataFile::new(file("order", "t [min]", &[0.0, 2.0, 1.0])).read(&Pmsm),
        &["2 min is followed by 1 min", "line 4"],
    );
}

/// Units of time that are not known, and dates that are written as numbers, are refused until a factor is given.
#[test]
fn what_is_no_unit_of_time_is_refused() {
    let read = |name: &str, header: &str, times: &[f64]| DataFile::new(file(name, header, times)).column("t", header);
    assert_eq!(read("mins", "t (mins)", &TIMES).read(&Pmsm).unwrap().time(1), 60.0);
    let unknown = || read("unknown", "t [fortnights]", &TIMES);
    says(unknown().read(&Pmsm), &["column `t [fortnights]`", "DataFile::factor(\"t\""]);
    assert_eq!(unknown().factor("t", 2.0).read(&Pmsm).unwrap().time(1), 2.0);
    assert_eq!(read("zone", "t (UTC)", &TIMES).read(&Pmsm).unwrap().time(1), 1.0);
    for (name, compact) in [("compact", 20_250_320_140_500.0), ("minutes_of_day", 202_503_201_405.0)] {
        let times: Vec<f64> = (0..3).map(|k| compact + f64::from(k)).collect();
        says(read(name, "timestamp", &times).read(&Pmsm), &["dates that are written as numbers", "2025-03-20"]);
    }
    // Milliseconds since 1970.
    let now: Vec<f64> = (0..3).map(|k| 1_742_479_500_000.0 + f64::from(k)).collect();
    assert!((read("epoch", "timestamp", &now).read(&Pmsm).unwrap().time(1) - 1e-3).abs() < 1e-12);
    says(read("serial", "date", &[45_736.0, 45_737.0]).read(&Pmsm), &["column `date`", "written as numbers"]);
}

/// As `f64` nanoseconds since 1970 are multiples of 256; the steps of 126,000 stay even, whether the header names the unit or not.
#[test]
fn whole_nanoseconds_since_1970_are_not_rounded() {
    for (name, header) in [("nanoseconds", "time [ns]"), ("counts", "time")] {
        let rows: String =
            (0..100).map(|k| format!("{},1,2,3,4\n", 1_742_479_500_000_000_123i64 + 126_000 * k)).collect();
        let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("time_unit_{name}.csv"));
        std::fs::write(&path, format!("{header},ud,w,id,iq\n{rows}")).unwrap();
        let record = Experiment::from_file(&Pmsm, path).unwrap();
        let Time::Uniform { start, step } = record.times() else { panic!("{:?}", record.times()) };
        assert_eq!(*start, 0.0);
        // Rounding of a hundred sums.
        assert!((step / 126e-6 - 1.0).abs() < 1e-14, "{step}");
    }
}

/// The unit is that of the numbers where these are not converted, and that of the factor where the file names none.
#[test]
fn a_factor_decides_the_unit() {
    let read = |name: &str, header: &str, factor: Option<f64>| {
        let file = DataFile::new(file(name, header, &TIMES)).column("t", header);
        let file = if let Some(factor) = factor { file.factor("t", factor) } else { file };
        let record = file.read(&Pmsm).unwrap();
        (record.time(1), record.record().moment(1).to_string())
    };
    assert_eq!(read("kept", "t [min]", Some(1.0)), (1.0, "1 min".to_owned()));
    assert_eq!(read("hours", "time", Some(3600.0)), (3600.0, "1 h".to_owned()));
    assert_eq!(read("milliseconds", "time_ms", None), (1e-3, "1 ms".to_owned()));
    assert_eq!(read("clock", "clock_ms", None), (1e-3, "1 ms".to_owned()));
    assert_eq!(read("ticks", "time", Some(0.125)), (0.125, "0.125 s".to_owned()));
    let record =
        Experiment::from_file(&Pmsm, file("cycles", "t", &TIMES)).unwrap().time_in(TimeUnit::of_model("cycles"));
    assert_eq!(record.record().moment(3).to_string(), "5 cycles");
}
