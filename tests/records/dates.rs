//! Columns of dates and of times of day, as seconds from the first; where nobody could know, an error that says why.
#![cfg(feature = "csv")]

use crate::pmsm::Pmsm;
use crate::refused::says;
use greybox::{DataFile, DateOrder, Error, ExperimentOf};
use std::path::PathBuf;

/// A file with a row for each date.
fn file(name: &str, header: &str, stamps: &[&str]) -> DataFile {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("dates").join(format!("{name}.csv"));
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    let rows: String = stamps.iter().map(|stamp| format!("{stamp};1;2;3;4\n")).collect();
    std::fs::write(&path, format!("{header};ud;w;id;iq\n{rows}")).unwrap();
    DataFile::new(path)
}

fn times(record: Result<ExperimentOf<Pmsm>, Error>) -> Vec<f64> {
    let record = record.unwrap();
    (0..record.len()).map(|k| record.time(k)).collect()
}

#[test]
fn dates_are_seconds_from_the_first() {
    for (name, header, stamps, seconds) in [
        (
            "iso",
            "t",
            &["2025-03-20 00:00:00", "2025-03-20 00:00:30", "2025-03-20 00:01:00"][..],
            &[0.0, 30.0, 60.0][..],
        ),
        ("iso_t", "timestamp", &["2025-03-20T23:59:59.5", "2025-03-21T00:00:00,5"], &[0.0, 1.0]),
        ("utc", "t", &["2025-03-20T00:00:00Z", "2025-03-20T00:00:00.001Z"], &[0.0, 0.001]),
        // Where clocks are set back, offsets tell the hours apart.
        ("offsets", "t", &["2025-10-26 02:30:00+02:00", "2025-10-26 02:00:00+01:00"], &[0.0, 1800.0]),
        ("days", "date", &["2024-02-28", "2024-02-29", "2024-03-01"], &[0.0, 86_400.0, 172_800.0]),
        ("points", "Zeit", &["31.12.2024 23:59", "01.01.2025 00:00"], &[0.0, 60.0]),
        ("short_year", "Zeit", &["01.02.25 12:00:00", "02.02.25 12:00:00"], &[0.0, 86_400.0]),
        ("matlab", "t", &["20-Mar-2025 12:00:00", "20-Mar-2025 12:00:01"], &[0.0, 1.0]),
        ("noon", "t", &["3/20/2025 11:59:59 AM", "3/20/2025 12:00:00 PM", "3/20/2025 1:00:00 PM"], &[0.0, 1.0, 3601.0]),
        ("month_first", "t", &["03/31/2025 00:00:00", "04/01/2025 00:00:00"], &[0.0, 86_400.0]),
        ("day_first", "t", &["28/02/2025 23:00:00", "01/03/2025 00:00:00"], &[0.0, 3600.0]),
        // On one day the order does not matter.
        ("one_day", "t", &["03/04/2025 00:00:00", "03/04/2025 12:00:00"], &[0.0, 43_200.0]),
        // With the month first, time would run backwards.
        ("order", "t", &["05/01/2025 00:00", "04/02/2025 00:00"], &[0.0, 30.0 * 86_400.0]),
        // With the day first, steps would be months.
        (
            "steps",
            "t",
            &["03/04/2025", "03/05/2025", "03/06/2025", "03/07/2025"],
            &[0.0, 86_400.0, 172_800.0, 259_200.0],
        ),
        ("clock", "t", &["23:59:59", "00:00:00", "00:00:01"], &[0.0, 1.0, 2.0]),
        ("elapsed", "t", &["23:59:59", "24:00:00", "24:00:01.5"], &[0.0, 1.0, 2.5]),
        ("stopwatch", "t", &["59:59.5", "60:00.0"], &[0.0, 0.5]),
        ("index", "", &["2025-03-20 00:00:00", "2025-03-20 00:00:01"], &[0.0, 1.0]),
        ("two_columns", "Date;Time", &["20.03.2025;23:59", "21.03.2025;00:00"], &[0.0, 60.0]),
    ] {
        assert_eq!(times(file(name, header, stamps).read(&Pmsm)), seconds, "{name}");
    }
}

#[test]
fn what_was_read_is_said() {
    let shown = |file: DataFile| file.read(&Pmsm).unwrap().record().reading().unwrap().to_string();
    let points = file("said", "Zeit", &["20.03.2025 14:00", "21.03.2025 14:00"]);
    assert_eq!(shown(points), "cells between \";\", time \"Zeit\": dates, day first, from 20.03.2025 14:00");
    let zoned = file("said_zone", "t", &["2025-03-20 14:00", "2025-03-21 14:00"]).zone("Europe/Berlin");
    assert_eq!(shown(zoned), "cells between \";\", time \"t\": dates, in Europe/Berlin, from 2025-03-20 14:00");
    // Dates that have a zone, and times of day, are not in the one that was said.
    for (name, first, second) in
        [("own_zone", "2025-03-20T14:00Z", "2025-03-20T15:00Z"), ("no_day", "14:00:00", "15:00:00")]
    {
        let said = shown(file(name, "t", &[first, second]).zone("Europe/Berlin"));
        assert_eq!(said, format!("cells between \";\", time \"t\": dates, from {first}"));
    }
}

#[test]
fn dates_that_can_be_read_both_ways_are_refused() {
    let stamps = ["03/04/2025 00:00", "03/04/2025 01:00", "04/05/2025 00:00"];
    says(
        file("both", "t", &stamps).read(&Pmsm),
        &["both.csv, column `t`", "day first", "month first", "DataFile::dates"],
    );
    let days = |order| times(file("both", "t", &stamps).dates(order).read(&Pmsm))[2] / 86_400.0;
    // From 3 April to 4 May, and from 4 March to 5 April.
    assert_eq!((days(DateOrder::DayFirst), days(DateOrder::MonthFirst)), (31.0, 32.0));
    let neither = file("neither", "t", &["13/01/2025 00:00", "14/01/2025 00:00", "01/15/2025 00:00"]);
    says(neither.read(&Pmsm), &["line 4, `01/15/2025 00:00`", "no such date"]);
    let mixed = file("mixed", "t", &["2025-03-20 00:00:00", "2025-03-20T00:00:01Z"]);
    says(mixed.read(&Pmsm), &["line 3", "do not mix"]);
    let back = file("back", "t", &["2025-03-20 00:00:05", "2025-03-20 00:00:04"]);
    says(back.read(&Pmsm), &["line 3, `2025-03-20 00:00:04`", "1 s before the row above", "sort the record"]);
    says(file("short", "t", &["03/20/25 00:00", "03/21/25 00:00"]).read(&Pmsm), &["line 2", "`03/20/25 00:00`"]);
}

/// Clocks that are set forward and back: followed in a zone, named without one.
#[test]
fn daylight_saving_is_followed_or_named() {
    let spring = || {
        file(
            "spring",
            "t",
            &["2025-03-30 01:40:00", "2025-03-30 01:50:00", "2025-03-30 03:00:00", "2025-03-30 03:10:00"],
        )
    };
    says(spring().read(&Pmsm), &["line 4, `2025-03-30 03:00:00`", "daylight saving begins", "DataFile::zone"]);
    assert_eq!(times(spring().zone("Europe/Berlin").read(&Pmsm)), [0.0, 600.0, 1200.0, 1800.0]);
    assert_eq!(times(spring().zone("UTC").read(&Pmsm)), [0.0, 600.0, 4800.0, 5400.0]);
    let autumn = || {
        file(
            "autumn",
            "t",
            &["2025-10-26 02:30:00", "2025-10-26 02:50:00", "2025-10-26 02:10:00", "2025-10-26 03:10:00"],
        )
    };
    says(autumn().read(&Pmsm), &["line 4", "2400 s before the row above", "daylight saving ends", "DataFile::zone"]);
    assert_eq!(times(autumn().zone("Europe/Berlin").read(&Pmsm)), [0.0, 1200.0, 2400.0, 6000.0]);
    // Each hour, the time of the second row after the change is that of the one before.
    let hours =
        || file("hours", "t", &["2025-10-26 01:00", "2025-10-26 02:00", "2025-10-26 02:00", "2025-10-26 03:00"]);
    assert_eq!(times(hours().zone("Europe/Berlin").read(&Pmsm)), [0.0, 3600.0, 7200.0, 10800.0]);
    says(hours().read(&Pmsm), &["line 4", "it is the time of the row above", "daylight saving ends", "DataFile::zone"]);
    let lost = file("lost", "t", &["2025-03-30 02:30:00", "2025-03-30 03:00:00"]).zone("Europe/Berlin");
    says(lost.read(&Pmsm), &["line 2", "no such time in the zone"]);
    says(spring().zone("Middle/Earth").read(&Pmsm), &["DataFile::zone(\"Middle/Earth\")"]);
}

/// What is said of numbers has no effect on dates, and the other way round.
#[test]
fn options_without_effect() {
    let dates = || file("with_dates", "t", &["2025-03-20 14:00", "2025-03-20 14:01"]);
    let refused = [
        (dates().unit("t", "min"), "DataFile::unit"),
        (dates().factor("t", 60.0), "DataFile::factor"),
        (dates().offset("t", 1.0), "DataFile::offset"),
        (dates().reversed("t"), "DataFile::reversed"),
        (file("with_clocks", "t", &["14:00:00", "14:00:01"]).factor("t", 60.0), "DataFile::factor"),
    ];
    for (file, option) in refused {
        says(file.read(&Pmsm), &["column `t` has dates", option, "has no effect"]);
    }
    let numbers = || file("with_numbers", "t", &["0", "1"]);
    says(numbers().zone("Europe/Berlin").read(&Pmsm), &["column `t`", "DataFile::zone has no effect"]);
    says(numbers().dates(DateOrder::DayFirst).read(&Pmsm), &["column `t`", "DataFile::dates has no effect"]);
}
