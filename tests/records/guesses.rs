//! CSV files of which nothing is said: what a person would see is found, and said; what nobody could know is refused.
#![cfg(feature = "csv")]

use crate::pmsm::{Currents, Drive, Pmsm};
use crate::refused::says;
use greybox::layout::Layout;
use greybox::{DataFile, Experiment, ExperimentOf, Model, Scalar, Time, TimeSource};
use std::path::PathBuf;

fn file(name: &str, text: impl AsRef<[u8]>) -> PathBuf {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("guesses").join(format!("{name}.csv"));
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    std::fs::write(&path, text).unwrap();
    path
}

fn read(name: &str, text: &str) -> ExperimentOf<Pmsm> {
    Experiment::from_file(&Pmsm, file(name, text)).unwrap_or_else(|error| panic!("{name}: {error}"))
}

fn said(record: &ExperimentOf<Pmsm>) -> String {
    record.record().reading().unwrap().to_string()
}

/// The same three rows as many programs write them.
#[test]
fn a_file_is_read_as_it_stands() {
    let plain = "t,ud,w,id,iq\n0,1.5,2,3,4\n1,1.5,2,,4\n2,1.5,2,3,4\n";
    let german = plain.replace(',', ";").replace('.', ",");
    let german_time = "cells between \";\", decimal comma, ";
    for (name, text, shown) in [
        ("plain", plain.to_owned(), "cells between \",\", time \"t\" in s"),
        ("semicolons", plain.replace(',', ";"), "cells between \";\", time \"t\" in s"),
        ("tabs", plain.replace(',', "\t"), "cells between tabs, time \"t\" in s"),
        ("bars", plain.replace(',', "|"), "cells between \"|\", time \"t\" in s"),
        ("blanks", plain.replace(",,", ",nan,").replace(',', " "), "cells between spaces, time \"t\" in s"),
        ("german", german.clone(), &format!("{german_time}time \"t\" in s")),
        ("quoted", plain.replace("1.5", "\"1,5\""), "cells between \",\", decimal comma, time \"t\" in s"),
        ("sep", format!("sep=;\r\n{german}"), &format!("{german_time}1 line above the names, time \"t\" in s")),
        (
            "preamble",
            format!("Oscilloscope;4711\nt,ud\n\n{plain}"),
            "cells between \",\", 3 lines above the names, time \"t\" in s",
        ),
        (
            "units_row",
            plain.replace("iq\n", "iq\ns,V,rad/s,A,A\n"),
            "cells between \",\", a row of units, time \"t\" in s",
        ),
        (
            "units_row_ms",
            plain
                .replace("iq\n", "iq\n[ms],[V],[rad/s],[A],[Ampere]\n")
                .replace("\n1,", "\n1000,")
                .replace("\n2,", "\n2000,"),
            "cells between \",\", a row of units, time \"t\" in ms; `iq` in \"Ampere\" taken as \"A\"",
        ),
        (
            "units_row_of_ones",
            plain.replace("iq\n", "iq\ns,V,1,A,A\n"),
            "cells between \",\", a row of units, time \"t\" in s; `w` in \"1\" taken as \"rad/s\"",
        ),
        (
            "units_row_beside_remarks",
            plain
                .replace("t,", "note,t,")
                .replace("iq\n", "iq\n,s,V,1,A,A\n")
                .replace("\n0,", "\nbegin,0,")
                .replace("\n1,", "\n,1,")
                .replace("\n2,", "\n,2,"),
            "cells between \",\", a row of units, time \"t\" in s; `w` in \"1\" taken as \"rad/s\"",
        ),
        (
            "aligned",
            format!("\n  {}", plain.replace(",,", ",nan,").replace(',', "    ").replace('\n', "  \r\n   ")),
            "cells between spaces, 1 line above the names, time \"t\" in s",
        ),
        ("spaces_around", plain.replace(',', " ,  "), "cells between \",\", time \"t\" in s"),
        (
            "indexes_in_names",
            plain.replace("t,ud,w,id,iq", "t,ud[1],w(t),id(2),iq"),
            "cells between \",\", time \"t\" in s; `ud` in \"1\" taken as \"V\"; `w` in \"t\" taken as \"rad/s\"; `id` in \"2\" taken as \"A\"",
        ),
        (
            "units_in_names",
            plain.replace("t,ud,w,id,iq", "Time [s],ud [V],w (rad/s),id [A],iq [A]"),
            "cells between \",\", time \"Time [s]\" in s",
        ),
        (
            "milliseconds",
            plain.replace("t,ud", "time_ms,ud").replace("\n1,", "\n1000,").replace("\n2,", "\n2000,"),
            "cells between \",\", time \"time_ms\" in ms",
        ),
        (
            "minutes",
            plain
                .replace("t,ud", "t (min),ud")
                .replace("\n1,", "\n0.0166666666666666667,")
                .replace("\n2,", "\n0.0333333333333333333,"),
            "cells between \",\", time \"t (min)\" in min",
        ),
        (
            "since_1970",
            plain
                .replace("\n0,", "\n1742428800000,")
                .replace("\n1,", "\n1742428801000,")
                .replace("\n2,", "\n1742428802000,"),
            "cells between \",\", time \"t\" in ms, from 1742428800000",
        ),
        (
            "other_columns",
            plain
                .replace("t,", "Zeit,note,")
                .replace("\n0,", "\n0,\"a, b\",")
                .replace("\n1,", "\n1,,")
                .replace("\n2,", "\n2,c,"),
            "cells between \",\", time \"Zeit\" in s",
        ),
    ] {
        let record = read(name, &text);
        assert_eq!(record.inputs().collect::<Vec<_>>(), [Drive { ud: 1.5, w: 2.0 }; 3], "{name}");
        assert_eq!(record.output(2), Currents { id: 3.0, iq: 4.0 }, "{name}");
        assert!(record.output(1).id.is_nan() && record.output(1).iq == 4.0, "{name}");
        let Time::Uniform { start, step } = *record.times() else { panic!("{name}: {:?}", record.times()) };
        // A third of a minute is rounded at its 17th digit.
        assert!(start == 0.0 && (step - 1.0).abs() < 1e-15, "{name}: {step}");
        assert_eq!(said(&record), shown, "{name}");
    }
}

/// A row whose time is a number is a sample, whatever stands in it; a text in a column of no signal is no unit.
#[test]
fn the_first_sample_is_no_row_of_units() {
    let record = read("remarks", "t,ud,w,id,iq,event\n1,1,1,1,1,start\n2,2,4,1,1,0\n3,3,6,1,1,0\n");
    assert_eq!((record.len(), record.time(0), record.input(0)), (3, 1.0, Drive { ud: 1.0, w: 1.0 }));
    let record = DataFile::new(file("remarks_alone", "ud,w,id,iq,event\n1,1,1,1,start\n2,4,1,1,0\n3,6,1,1,0\n"));
    assert_eq!(record.sample_time(0.5).read(&Pmsm).unwrap().len(), 3);
    let texts = file("texts", "t,ud,w,id,iq\n0,a,b,c,d\n1,1,2,3,4\n");
    says(DataFile::new(texts).read(&Pmsm), &["line 2", "`ud`", "`a`"]);
}

/// Runs of spaces are one separator; lines are counted as they stand.
#[test]
fn aligned_columns() {
    let text = "   t      ud    w     id    iq\n\n   0.0    1.0   2.0   3.0   4.0\n\n  10.0   -1.0   x     3.0   4.0\n";
    says(DataFile::new(file("aligned_text", text)).read(&Pmsm), &["line 5", "`w`", "`x`"]);
    let row = "t ud  w id iq\n0  1  2  3  4\n1  1     3  4\n";
    says(DataFile::new(file("aligned_hole", row)).read(&Pmsm), &["line 3", "4 cell(s)", "5 column(s)"]);
    // The clock turns uneven, so that the file is read again.
    let record = read("aligned_uneven", "t ud   w id iq\n 0 1  2  3  4\n  1  1 2  3 4\n5 1 2 3 4\n");
    assert_eq!(record.times(), &Time::Stamps(vec![0.0, 1.0, 5.0]));
}

/// Letters of Latin-1 are read as those, so that degrees Fahrenheit are not taken for other degrees.
#[test]
fn letters_of_latin_1() {
    let bytes = |text: &str| text.chars().map(|letter| u8::try_from(u32::from(letter)).unwrap()).collect::<Vec<u8>>();
    let mut layout = Layout::of::<Pmsm>();
    layout.outputs[0].unit = "degC".to_owned();
    let warm = file("latin_units", bytes("Zeit (µs);ud;w;id [°F];iq\n0;1;2;32;4\n500;1;2;212;4\n"));
    let warm = DataFile::new(warm);
    says(warm.read_record(&layout), &["column `id [°F]`", "their zeros differ"]);
    let record = warm.unit("id", "°F").read_record(&layout).unwrap();
    assert_eq!(record.time(1), 5e-4);
    // Water boils at 100 degrees, up to the rounding of 459.67 F.
    assert!((record.outputs()[0].values[1] - 100.0).abs() < 1e-12);
    let shown = record.reading().unwrap().to_string();
    assert_eq!(shown, "cells between \";\", letters of Windows-1252, time \"Zeit (µs)\" in us");
    // A letter that was lost before makes the unit unknown.
    let lost = DataFile::new(file("lost_letter", "t,ud,w,id [\u{fffd}F],iq\n0,1,2,32,4\n1,1,2,212,4\n"));
    let shown = lost.read_record(&layout).unwrap().reading().unwrap().to_string();
    assert!(shown.ends_with("`id` in \"\u{fffd}F\" taken as \"degC\""), "{shown}");
}

/// A decimal comma that first shows after thousands of rows; the clock turns uneven there, too, so that the file is read again.
#[test]
fn a_decimal_comma_may_show_late() {
    let rows: String = (0..9_000).map(|k| format!("{k};1;2;3;4\n")).collect();
    let record = read("late", &format!("t;ud;w;id;iq\n{rows}9000,5;1,25;2;3;4\n"));
    assert_eq!((record.len(), record.input(9_000).ud, record.time(9_000)), (9_001, 1.25, 9000.5));
    assert_eq!(record.time(8_999), 8999.0);
}

/// Units that are known and are not the model's are neither converted nor passed over.
#[test]
fn a_column_in_another_unit_is_refused() {
    for (header, column, factor) in [
        ("t,ud,w [rpm],id,iq", "w [rpm]", "DataFile::factor(\"w\", 0.10471975511965977)"),
        ("t,ud [mV],w,id,iq", "ud [mV]", "DataFile::factor(\"ud\", 0.001)"),
        ("t,ud,w,id (kA),iq", "id (kA)", "DataFile::factor(\"id\", 1000)"),
        ("t,ud,w [Hz],id,iq", "w [Hz]", "DataFile::factor(\"w\", 6.283185307179586)"),
        (
            "t,ud,w [1/s],id,iq",
            "w [1/s]",
            "6.283185307179586) if it counts revolutions, or DataFile::factor(\"w\", 1) if",
        ),
        ("t / s,ud / mV,w / (rad/s),id / A,iq", "ud / mV", "DataFile::factor(\"ud\", 0.001)"),
        ("t/s,ud/V,w/rpm,id/A,iq", "w/rpm", "DataFile::factor(\"w\", 0.10471975511965977)"),
        ("t,ud,w [V],id,iq", "w [V]", "neither is a multiple of the other"),
        ("t,ud [N m],w,id,iq", "ud [N m]", "DataFile::factor(\"ud\", 1) if the file's unit is wrong"),
    ] {
        let path = file("units", format!("{header}\n0,1,2,3,4\n1,1,2,3,4\n"));
        says(DataFile::new(&path).read(&Pmsm), &[&format!("column `{column}`"), factor]);
    }
    let path = file("units", "t,ud,w [rpm],id,iq\n0,1,2,3,4\n1,1,2,3,4\n");
    // Also where the column is named with its unit.
    says(DataFile::new(&path).column("w", "w [rpm]").read(&Pmsm), &["column `w [rpm]`", "0.10471975511965977"]);
    assert_eq!(DataFile::new(path).factor("w", 0.5).read(&Pmsm).unwrap().input(0).w, 1.0);
    // And behind an underscore; letters that are no unit of another size than the signal's are a part of the name.
    let path = file("units", "t,u_ref,speed_rpm,i_d,i_in\n0,1,2,3,4\n1,1,2,3,4\n");
    let columns = [("ud", "u_ref"), ("w", "speed_rpm"), ("id", "i_d"), ("iq", "i_in")];
    let named = columns.iter().fold(DataFile::new(path), |file, (signal, column)| file.column(signal, column));
    says(named.clone().read(&Pmsm), &["column `speed_rpm` is in \"rpm\"", "0.10471975511965977"]);
    assert_eq!(named.unit("w", "rad/s").read(&Pmsm).unwrap().input(0).w, 2.0);
}

/// A quantity over its unit, as standards write it, and a unit of time behind a space.
#[test]
fn units_behind_a_bar_and_times_behind_a_space() {
    for (time, shown) in
        [("t / ms", "ms"), ("t/ms", "ms"), ("Zeit / ms", "ms"), ("time ms", "ms"), ("Time / (ms)", "ms")]
    {
        let path = file("bars", format!("{time};ud / V;w / (rad/s);id/A;iq/A\n0;1;2;3;4\n500;1;2;3;5\n"));
        let record = DataFile::new(path).read(&Pmsm).unwrap();
        assert_eq!((record.time(1), record.output(1).iq), (0.5, 5.0), "{time}");
        let said = record.record().reading().unwrap().to_string();
        assert_eq!(said, format!("cells between \";\", time \"{time}\" in {shown}"));
    }
    // A column without a bar is preferred, and one that is named in full has no unit by its bar.
    let path = file("barred", "t [s],t / ms,ud [V],ud/mV,w,id m/s,A/F,Time / h\n0,7,1,9,2,3,4,0\n0.5,8,1,9,2,3,4,0\n");
    let record = DataFile::new(path).column("id", "id m/s").column("iq", "A/F").read(&Pmsm).unwrap();
    assert_eq!((record.time(1), record.input(1).ud, record.output(1).id, record.output(1).iq), (0.5, 1.0, 3.0, 4.0));
    // What is no unit stays part of the name.
    let path = file("ratios", "t,ud/uq,w,id,iq\n0,1,2,3,4\n1,1,2,3,4\n");
    says(DataFile::new(path).read(&Pmsm), &["no column `ud`", "ud/uq"]);
}

/// Scales of temperature begin at other zeros: none is taken for another, and the unit that is said converts it. Other units likewise.
#[test]
fn a_unit_that_is_said_converts() {
    greybox::signals! { struct Warmth { temp: "degC" } }
    let layout = |unit: &str| {
        let mut layout = Layout::of::<Room>();
        layout.outputs[0].unit = unit.to_owned();
        layout
    };
    struct Room;
    impl Model for Room {
        type State = greybox::Nothing;
        type Input = greybox::Nothing;
        type Output = Warmth;
        type Parameters = Warmth;
        fn output<S: Scalar>(&self, _t: S, _x: &greybox::Nothing, _u: &greybox::Nothing, p: &Warmth<S>) -> Warmth<S> {
            *p
        }
    }
    let read = |unit: &str| DataFile::new(file("temperature", format!("t,temp [{unit}]\n0,300\n1,301\n2,302\n")));
    for (unit, model, cell) in [("K", "degC", 300.0 - 273.15), ("degC", "K", 573.15), ("degF", "degC", 268.0 / 1.8)] {
        let remedy = format!("their zeros differ: give DataFile::unit(\"temp\", \"{unit}\"), which converts it");
        says(read(unit).read_record(&layout(model)), &[&format!("column `temp [{unit}]`"), &remedy]);
        let converted = read(unit).unit("temp", unit).read_record(&layout(model)).unwrap();
        assert!((converted.outputs()[0].values[0] - cell).abs() < 1e-12, "{unit} {model}");
    }
    let shifted = read("K").offset("temp", -273.15).read_record(&layout("degC")).unwrap();
    assert_eq!(shifted.outputs()[0].values[0], 300.0 - 273.15);
    // A degree Fahrenheit is smaller.
    let offset = || read("degF").offset("temp", -17.8);
    let without = ["offset of -17.8", "give DataFile::unit(\"temp\", \"degF\")", "leave out DataFile::offset"];
    says(offset().read_record(&layout("degC")), &without);
    // The conversion has the offset already.
    says(offset().unit("temp", "degF").read_record(&layout("degC")), &without);
    let path = file("said_units", "t,ud,w,id,iq\n0,1,60,3,4\n1000,1,60,3,4\n");
    let drive = || DataFile::new(&path);
    let record = drive().unit("w", "rpm").unit("t", "ms").read(&Pmsm).unwrap();
    assert!((record.input(0).w / std::f64::consts::TAU - 1.0).abs() < 1e-15 && record.time(1) == 1.0);
    says(drive().unit("w", "V").read(&Pmsm), &["column `w` is in \"V\"", "neither is a multiple"]);
    // Revolutions or radians: nobody knows.
    let plain =
        ["DataFile::factor(\"w\", 0.10471975511965977) if it counts revolutions", "0.016666666666666666) if radians"];
    says(drive().unit("w", "1/min").read(&Pmsm), &plain);
    says(drive().unit("w", "ticks").read(&Pmsm), &["is not known: give DataFile::factor(\"w\", ..)"]);
    says(drive().unit("w", "rpm").factor("w", 2.0).read(&Pmsm), &["a factor, 2, and a unit, rpm"]);
}

#[test]
fn two_columns_of_time_are_not_guessed() {
    let path = file("two_times", "time,timestamp,ud,w,id,iq\n0,0,1,2,3,4\n1,1,1,2,3,4\n");
    says(DataFile::new(&path).read(&Pmsm), &["no column `t`", "time, timestamp"]);
    let record = DataFile::new(path).column("t", "timestamp").read(&Pmsm).unwrap();
    let source = TimeSource::Numbers { column: "timestamp".into(), unit: 1.0, origin: 0.0 };
    assert_eq!(record.record().reading().unwrap().time, source);
    let none = DataFile::new(file("no_time", "ud,w,id,iq\n1,2,3,4\n1,2,3,4\n")).sample_time(0.5).read(&Pmsm).unwrap();
    assert_eq!(none.record().reading().unwrap().time, TimeSource::Even { step: 0.5 });
}
