//! `fleet`: tables of many records, which go on where they were.

use crate::bench::{Bench, MODEL, record};
use std::collections::BTreeSet;
use std::fmt::Write;
use std::process::Stdio;
use std::time::{Duration, Instant};

#[test]
fn a_fleet_is_a_table_that_goes_on_where_it_was() {
    let bench = Bench::new();
    for name in ["a.csv", "b.csv", "c.csv"] {
        std::fs::copy(record(), bench.path(name)).unwrap();
    }
    std::fs::write(bench.path("b.csv"), "t,ud,uq,w,id,iq\n0,1,2\n").unwrap();
    let (_, error) = bench.ends(3, &["fleet", "pmsm.toml", "[abc].csv", "--out", "motors.csv"]);
    assert!(error.lines().any(|line| line.starts_with("b.csv, line 2: ")), "{error}");
    let table = std::fs::read_to_string(bench.path("motors.csv")).unwrap();
    let rows: Vec<&str> = table.lines().collect();
    assert_eq!(rows.len(), 4, "{table}");
    // The columns of a fleet in Python, and its words.
    let parameters = ["rs", "ls", "ke"].map(|name| format!("{name},{name}_error,{name}_lower,{name}_upper")).join(",");
    let header = format!("record,samples,{parameters},id_rmse,iq_rmse,verdict,outcome,warnings,reason");
    assert_eq!(rows[0], header);
    let cells: Vec<&str> = rows[1].split(',').collect();
    let number = |at: usize| cells[at].parse::<f64>().unwrap();
    assert_eq!((cells[0], cells[1], &cells[16..]), ("a.csv", "2000", &["usable", "converged", "", ""][..]));
    // Standard errors and noise as in the README.
    assert!((number(2) - 0.63).abs() < 1e-3 && (number(3) - 2e-4).abs() < 1e-4, "{table}");
    assert!(number(4) < number(2) && number(2) < number(5), "{table}");
    assert!((number(14) / 0.05 - 1.0).abs() < 0.1 && (number(15) / 0.05 - 1.0).abs() < 0.1, "{table}");
    assert!(
        rows[2].starts_with(&format!("b.csv,{}failed,,,", ",".repeat(15))) && rows[2].contains("line 2"),
        "{table}"
    );
    // A row that is there is kept as it stands.
    std::fs::write(bench.path("motors.csv"), table.replacen(",usable,", ",kept,", 1)).unwrap();
    bench.ends(3, &["fleet", "pmsm.toml", "[abc].csv", "--out", "motors.csv"]);
    let again = std::fs::read_to_string(bench.path("motors.csv")).unwrap();
    assert!(again.contains(",kept,") && again.lines().count() == 4, "{again}");
}

/// A file that was written after the row of its record is fitted again, whatever the table has; one row stays one row.
#[test]
fn a_file_that_has_changed_is_fitted_again() {
    let bench = Bench::new();
    let text = std::fs::read_to_string(record()).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    let written = |name: &str, lines: &[&str]| std::fs::write(bench.path(name), lines.join("\n") + "\n").unwrap();
    written("a.csv", &lines[..1001]);
    written("b.csv", &lines[..1001]);
    bench.ends(0, &["fleet", "pmsm.toml", "a.csv", "b.csv", "--out", "motors.csv"]);
    // Clocks of file systems tick every few milliseconds.
    std::thread::sleep(Duration::from_millis(50));
    written("b.csv", &lines[..1501]);
    let (_, error) = bench.ends(0, &["fleet", "pmsm.toml", "a.csv", "b.csv", "--out", "motors.csv"]);
    assert!(error.contains("1 records are in the table already"), "{error}");
    assert!(error.contains("1 files were written after the rows of their records"), "{error}");
    let table = std::fs::read_to_string(bench.path("motors.csv")).unwrap();
    let rows: Vec<String> =
        table.lines().skip(1).map(|row| row.split(',').take(2).collect::<Vec<_>>().join(" ")).collect();
    assert_eq!(rows, ["a.csv 1000", "b.csv 1500"]);
    let (_, error) = bench.ends(0, &["fleet", "pmsm.toml", "a.csv", "b.csv", "--out", "motors.csv"]);
    assert!(error.contains("2 records are in the table already") && !error.contains("were written after"), "{error}");
}

/// Parts of the shipped record as so many motors in one file, their rows mixed.
fn motors(bench: &Bench, name: &str, count: usize) {
    let text = std::fs::read_to_string(record()).unwrap();
    let rows: Vec<&str> = text.lines().skip(1).collect();
    let mut mixed = "motor,t,ud,uq,w,id,iq\n".to_owned();
    for k in 0..200 {
        for motor in 0..count {
            writeln!(mixed, "m{motor},{}", rows[(motor * 37) % (rows.len() - 200) + k]).unwrap();
        }
    }
    std::fs::write(bench.path(name), mixed).unwrap();
}

#[test]
fn a_column_tells_the_records_of_a_file_apart() {
    let bench = Bench::new();
    motors(&bench, "motors.csv", 3);
    let text = std::fs::read_to_string(bench.path("motors.csv")).unwrap();
    // A value that is none spoils one motor.
    std::fs::write(bench.path("motors.csv"), text.replacen("m1,", "m1,x", 1)).unwrap();
    let words = ["fleet", "pmsm.toml", "motors.csv", "--by", "motor", "--out", "t.csv"];
    let (_, error) = bench.ends(3, &words);
    // The file is named once.
    assert!(error.contains("motors.csv, m1, line 3, column `t`: ") && !error.contains("motors.csv: "), "{error}");
    assert!(error.lines().last().unwrap().starts_with("3 records: ") && error.contains("1 failed"), "{error}");
    let table = std::fs::read_to_string(bench.path("t.csv")).unwrap();
    let rows: Vec<&str> = table.lines().collect();
    assert!(rows.len() == 4 && rows[0].starts_with("record,motor,samples,rs,rs_error"), "{table}");
    assert!(
        rows[1].starts_with("motors.csv,m0,")
            && rows[2].starts_with("motors.csv,m1,,")
            && rows[2].contains(",failed,,,"),
        "{table}"
    );
    assert_eq!(bench.names(), ["motors.csv", "pmsm.toml", "record.csv", "t.csv", "t.csv.run"], "no journal is left");
    // Each by itself is the same as in a file of its own, to the bit.
    let alone: Vec<&str> = text.lines().filter(|line| line.starts_with("m2,") || line.starts_with("motor,")).collect();
    std::fs::write(bench.path("m2.csv"), alone.join("\n")).unwrap();
    let (out, _) = bench
        .ends(bench.run(&["fleet", "pmsm.toml", "m2.csv"]).status.code().unwrap(), &["fleet", "pmsm.toml", "m2.csv"]);
    assert_eq!(out.lines().nth(1).unwrap().split_once(',').unwrap().1, rows[3].split_once(",m2,").unwrap().1);
    let (_, error) = bench.ends(1, &["fleet", "pmsm.toml", "motors.csv", "--by", "rs"]);
    assert!(error.contains("two columns `rs`"), "{error}");
}

/// As of other kinds of files: a column of measurements is none of names.
#[test]
fn numbers_that_are_not_whole_tell_no_records_apart() {
    let bench = Bench::new();
    let (_, error) = bench.ends(3, &["fleet", "pmsm.toml", "record.csv", "--by", "ud"]);
    assert!(
        error.contains("column `ud` holds numbers that are not whole, where text or whole numbers are wanted"),
        "{error}"
    );
    assert!(error.contains("1 records: ") && error.contains("1 failed"), "{error}");
    // Names may be numbers with a part behind the point where others are none.
    motors(&bench, "motors.csv", 2);
    let text = std::fs::read_to_string(bench.path("motors.csv")).unwrap().replace("m0,", "1.5,");
    std::fs::write(bench.path("motors.csv"), text).unwrap();
    let (out, _) = bench.ends(0, &["fleet", "pmsm.toml", "motors.csv", "--by", "motor"]);
    assert!(out.lines().count() == 3 && out.contains("motors.csv,1.5,"), "{out}");
}

/// Killed at any point, and started again until it ends: each motor once, and the numbers of a run that was not killed.
#[test]
fn a_killed_fleet_goes_on_with_nothing_twice() {
    let bench = Bench::new();
    motors(&bench, "motors.csv", 200);
    let words = |out: &'static str| ["fleet", "pmsm.toml", "motors.csv", "motors.csv", "--by", "motor", "--out", out];
    bench.run(&words("whole.csv"));
    let whole = std::fs::read_to_string(bench.path("whole.csv")).unwrap();
    assert_eq!(whole.lines().count(), 201);
    let journal = bench.path("t.csv.journal");
    let (mut kills, mut rows, mut tables) = (0, 0, 0);
    let mut killed = String::new();
    // A run may end before it is killed; then once more from the start. One that is killed between writing the table and removing the journal
    // has not ended.
    while kills == 0 || journal.exists() || !bench.path("t.csv").exists() {
        if kills == 0 && bench.path("t.csv").exists() {
            std::fs::remove_file(bench.path("t.csv")).unwrap();
            tables += 1;
            assert!(tables < 50, "no run was killed before its end");
        }
        let quiet = |words: &[&str]| bench.command(words).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        let mut run = quiet(&words("t.csv"));
        let begin = Instant::now();
        // Until there is another row, or it has ended.
        loop {
            let there = std::fs::read_to_string(&journal).unwrap_or_default().lines().count();
            if there > rows + 1 || run.try_wait().unwrap().is_some() {
                break;
            }
            assert!(begin.elapsed() < Duration::from_secs(300), "{there} lines");
            std::thread::yield_now();
        }
        run.kill().unwrap();
        run.wait().unwrap();
        if let Ok(text) = std::fs::read_to_string(&journal) {
            rows = text.lines().count();
            kills += 1;
            // As if it had been killed while it wrote the next row.
            killed = text + "[\"motors.csv\",\"m";
            std::fs::write(&journal, &killed).unwrap();
        }
        assert!(kills < 100);
    }
    assert_eq!(std::fs::read_to_string(bench.path("t.csv")).unwrap(), whole);
    // A journal that was not removed: each of its rows is in the table, too, and is taken once; rows may change their order.
    std::fs::write(&journal, killed).unwrap();
    bench.run(&words("t.csv"));
    let sorted = |text: &str| text.lines().map(str::to_owned).collect::<BTreeSet<_>>();
    let table = std::fs::read_to_string(bench.path("t.csv")).unwrap();
    assert!(
        sorted(&table) == sorted(&whole) && table.lines().count() == 201 && !journal.exists(),
        "{}",
        table.lines().count()
    );
    // A journal of something else is not touched.
    std::fs::write(&journal, "[\"record\"]\n").unwrap();
    let (_, error) = bench.ends(1, &words("t.csv"));
    assert!(error.contains("t.csv.journal: it is of another table; remove it"), "{error}");
}

/// Rows without a name are one error, once, however often the command runs.
#[test]
fn rows_without_a_name_are_in_the_table_once() {
    let bench = Bench::new();
    std::fs::write(bench.path("motors.csv"), "motor,t,ud,uq,w,id,iq\n,0,1,2,3,4,5\n,1,1,2,3,4,5\n").unwrap();
    let outs: &[&str] = if cfg!(feature = "arrow") { &["t.csv", "t.parquet"] } else { &["t.csv"] };
    for out in outs {
        let words = ["fleet", "pmsm.toml", "motors.csv", "--by", "motor", "--out", out];
        let (_, error) = bench.ends(3, &words);
        assert!(error.contains("1 records: ") && error.contains("1 failed"), "{error}");
        // As of any error, it is tried again.
        let (_, error) = bench.ends(3, &words);
        assert!(error.contains("1 records: ") && !error.contains("in the table already"), "{error}");
    }
    assert_eq!(std::fs::read_to_string(bench.path("t.csv")).unwrap().lines().count(), 2);
}

/// By whatever the command differs, and where it is not known by what the rows were made.
#[test]
fn a_table_is_of_one_model_and_its_options() {
    let bench = Bench::new();
    std::fs::copy(record(), bench.path("more.csv")).unwrap();
    std::fs::write(bench.path("other.toml"), MODEL.replace("start = 0.7", "start = 0.8")).unwrap();
    let outs: &[&str] = if cfg!(feature = "arrow") { &["t.csv", "t.parquet"] } else { &["t.csv"] };
    for out in outs {
        bench.ends(0, &["fleet", "pmsm.toml", "record.csv", "--out", out]);
        let table = std::fs::read(bench.path(out)).unwrap();
        let refused = |words: &[&str], why: &str| {
            let words = [&["fleet"], words, &["*.csv", "--out", out]].concat();
            let (_, error) = bench.ends(1, &words);
            assert!(error.contains(why) && error.contains("name another table, or remove this one"), "{error}");
            assert_eq!(std::fs::read(bench.path(out)).unwrap(), table);
            assert!(!bench.path(&format!("{out}.journal")).exists());
        };
        refused(&["pmsm.toml", "--loss", "huber"], "another model, or other options");
        refused(&["pmsm.toml", "--constant", "np=4", "--fix", "ls=4e-3"], "another model, or other options");
        refused(&["other.toml"], "another model, or other options");
        let run = bench.path(&format!("{out}.run"));
        let made_by = std::fs::read_to_string(&run).unwrap();
        assert!(made_by.contains(MODEL) && !made_by.contains("None"), "{made_by}");
        std::fs::remove_file(&run).unwrap();
        refused(&["pmsm.toml"], ".run: ");
        std::fs::write(&run, made_by).unwrap();
        let (_, error) = bench.ends(0, &["fleet", "pmsm.toml", "record.csv", "more.csv", "--out", out]);
        assert!(error.contains("1 records are in the table already") && error.contains("1 records: "), "{error}");
    }
}

#[test]
fn records_that_failed_are_tried_again() {
    let bench = Bench::new();
    std::fs::copy(record(), bench.path("b.csv")).unwrap();
    let table = || std::fs::read_to_string(bench.path("t.csv")).unwrap();
    // A mistake that no record survives is no run that holds on to its options.
    let (_, error) =
        bench.ends(3, &["fleet", "pmsm.toml", "record.csv", "b.csv", "--column", "w=speed", "--out", "t.csv"]);
    assert!(error.contains("2 failed"), "{error}");
    std::fs::write(bench.path("b.csv"), "t,ud,uq,w,id,iq\n0,1,2\n").unwrap();
    let (_, error) = bench.ends(3, &["fleet", "pmsm.toml", "record.csv", "b.csv", "--out", "t.csv"]);
    assert!(error.contains("1 usable") && error.contains("1 failed"), "{error}");
    assert_eq!(table().lines().count(), 3, "{}", table());
    // A file that is not named keeps its row.
    bench.ends(3, &["fleet", "pmsm.toml", "record.csv", "--out", "t.csv"]);
    assert!(table().contains("\nb.csv,,") && table().contains(",failed,"), "{}", table());
    std::fs::copy(record(), bench.path("b.csv")).unwrap();
    let (_, error) = bench.ends(0, &["fleet", "pmsm.toml", "record.csv", "b.csv", "--out", "t.csv"]);
    assert!(error.contains("1 records are in the table already") && error.contains("1 records: 1 usable"), "{error}");
    assert!(
        table().lines().count() == 3 && table().contains("\nb.csv,2000,") && !table().contains(",failed,"),
        "{}",
        table()
    );
}

#[test]
fn a_file_that_is_named_twice_is_read_once() {
    let bench = Bench::new();
    motors(&bench, "motors.csv", 2);
    let (out, error) = bench.ends(0, &["fleet", "pmsm.toml", "motors.csv", "./motors.csv", "--by", "motor"]);
    assert!(error.contains("1 files are named again; each is read once"), "{error}");
    assert!(!error.contains("more than one file") && out.lines().count() == 3, "{error}\n{out}");
}

#[cfg(unix)]
#[test]
fn a_table_is_a_file() {
    let bench = Bench::new();
    let (_, error) = bench.ends(1, &["fleet", "pmsm.toml", "record.csv", "--out", "/dev/null"]);
    assert!(error.contains("/dev/null: a table is a file") && error.contains("leave --out out"), "{error}");
    assert!(!std::path::Path::new("/dev/null.journal").exists());
}

/// A pipe that nobody writes to holds up whoever opens it.
#[cfg(unix)]
#[test]
fn files_that_are_in_the_table_are_not_opened() {
    let bench = Bench::new();
    let words = ["fleet", "pmsm.toml", "record.csv", "--out", "t.csv"];
    bench.ends(0, &words);
    std::fs::remove_file(bench.path("record.csv")).unwrap();
    assert!(std::process::Command::new("mkfifo").arg(bench.path("record.csv")).status().unwrap().success());
    let mut run = bench.command(&words).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let begin = Instant::now();
    let ended = loop {
        match run.try_wait().unwrap() {
            None if begin.elapsed() < Duration::from_secs(30) => std::thread::sleep(Duration::from_millis(10)),
            ended => break ended,
        }
    };
    if ended.is_none() {
        run.kill().unwrap();
    }
    assert!(ended.is_some_and(|status| status.success()), "{ended:?}");
}

#[cfg(feature = "arrow")]
#[test]
fn a_table_may_be_parquet() {
    use greybox::Kind;
    use greybox::layout::{Layout, Quantity};
    let bench = Bench::new();
    motors(&bench, "motors.csv", 4);
    let words = |out: &'static str| ["fleet", "pmsm.toml", "motors.csv", "--by", "motor", "--out", out];
    bench.run(&words("t.csv"));
    bench.run(&words("t.parquet"));
    let bytes = std::fs::read(bench.path("t.parquet")).unwrap();
    assert!(bytes.starts_with(b"PAR1") && bytes.ends_with(b"PAR1"));
    // What a finished run has written is read again, and more is added.
    motors(&bench, "more.csv", 1);
    let more = ["fleet", "pmsm.toml", "motors.csv", "more.csv", "--by", "motor", "--out", "t.parquet"];
    let error = String::from_utf8(bench.run(&more).stderr).unwrap();
    assert!(error.contains("4 records are in the table already") && error.contains("1 records: "), "{error}");
    // The library reads the numbers that the other table has.
    let output = |name: &str| Quantity { name: name.to_owned(), unit: String::new() };
    let outputs = ["rs", "ke_upper"].map(output).to_vec();
    let layout = Layout { kind: Kind::Static, states: vec![], inputs: vec![], outputs, parameters: vec![] };
    let record = greybox::DataFile::new(bench.path("t.parquet")).sample_time(1.0).read_record(&layout).unwrap();
    let table = std::fs::read_to_string(bench.path("t.csv")).unwrap();
    let header: Vec<&str> = table.lines().next().unwrap().split(',').collect();
    for (channel, name) in record.outputs().iter().zip(["rs", "ke_upper"]) {
        let at = header.iter().position(|column| *column == name).unwrap();
        let expected: Vec<f64> =
            table.lines().skip(1).map(|row| row.split(',').nth(at).unwrap().parse().unwrap_or(f64::NAN)).collect();
        assert_eq!(format!("{:?}", &channel.values[..4]), format!("{expected:?}"));
    }
    std::fs::write(bench.path("t.parquet"), &bytes[..bytes.len() / 2]).unwrap();
    let (_, error) = bench.ends(1, &words("t.parquet"));
    assert!(error.contains("t.parquet: "), "{error}");
}

#[cfg(not(feature = "arrow"))]
#[test]
fn without_its_feature_parquet_is_refused() {
    let bench = Bench::new();
    let (_, error) = bench.ends(1, &["fleet", "pmsm.toml", "record.csv", "--out", "t.parquet"]);
    assert!(error.contains("--features arrow"), "{error}");
    std::fs::write(bench.path("r.parquet"), "PAR1").unwrap();
    let (_, error) = bench.ends(1, &["fit", "pmsm.toml", "r.parquet"]);
    assert!(error.contains("the file is Parquet") && error.contains("--features arrow"), "{error}");
}
