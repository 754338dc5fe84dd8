//! Times are shown in the unit of their file.
#![cfg(feature = "csv")]

use crate::pmsm::Pmsm;
use crate::refused::says;
use greybox::{DataFile, Experiment, ExperimentOf, TimeUnit};
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
    assert_eq!(read("ticks", "time", Some(0.125)), (0.125, "0.125 s".to_owned()));
    let record =
        Experiment::from_file(&Pmsm, file("cycles", "t", &TIMES)).unwrap().time_in(TimeUnit::of_model("cycles"));
    assert_eq!(record.record().moment(3).to_string(), "5 cycles");
}
