//! The project file, beside what the command line says.

use crate::bench::{Bench, record, value};
use std::process::Output;

/// A project of the bench's model and record with these entries.
fn project(entries: &str) -> Bench {
    let bench = Bench::new();
    let text = format!("model = 'pmsm.toml'\nrecords = ['record.csv']\n{entries}\n");
    std::fs::write(bench.path("greybox.toml"), text).unwrap();
    bench
}

/// What a command prints that is no error, whatever the verdict.
fn answers(bench: &Bench, words: &[&str]) -> String {
    let Output { status, stdout, stderr } = bench.run(words);
    let [out, error] = [stdout, stderr].map(|bytes| String::from_utf8(bytes).unwrap());
    assert!(status.code().is_some_and(|code| code != 1), "{words:?}\n{out}\n{error}");
    out
}

#[test]
fn the_command_line_goes_before_the_project() {
    let bench = project("fix = { ls = 2e-3 }");
    assert!(answers(&bench, &["fit"]).contains("fixed"));
    for words in [&["fit", "--free", "ls"][..], &["fit", "--set", "ls=5e-3"], &["fit", "--bounds", "ls=1e-3..1e-2"]] {
        let out = answers(&bench, words);
        assert!(!out.contains("fixed") && (value(&out, "ls") - 4e-3).abs() < 1e-4, "{words:?}\n{out}");
    }
    // What is said of another parameter leaves it.
    assert!(answers(&bench, &["fit", "--set", "rs=0.5"]).contains("fixed"));
    let bench = project("bounds = { rs = [0.01, 5] }\nprior = { ls = '4e-3,1e-4' }");
    let out = answers(&bench, &["fit", "--fix", "rs=6", "--fix", "ls=4e-3"]);
    assert_eq!([value(&out, "rs"), value(&out, "ls")], [6.0, 4e-3]);
}

#[test]
fn what_excludes_an_entry_of_the_project_takes_its_place() {
    let bench = project("noise-covariance = true\ninitial = 'steady'\nstaged = true\nsample-time = 1.0");
    let words = ["fit", "--noise", "id=0.05", "--initial", "id=0", "--multiple-shooting", "--time", "t"];
    assert_eq!(answers(&bench, &words).lines().next(), answers(&project(""), &words).lines().next());
    let bench = project("noise = { id = 0.05 }\ninitial = { id = 0 }\ntime = 'Time'\ntime-unit = 'ms'\nzone = 'UTC'");
    answers(&bench, &["fit", "--noise-covariance", "--initial", "first", "--sample-time", "2.5e-4"]);
}

#[test]
fn commands_take_what_is_for_them() {
    let bench = project("report = 'r.html'\nbounds = { rs = [0.01, 5] }\nfix = { rs = 0.63, ls = 4e-3, ke = 0.95 }");
    std::fs::write(bench.path("r.html"), "of a fit").unwrap();
    let (out, _) = bench.ends(0, &["export"]);
    assert!(out.contains("[parameters]"), "{out}");
    answers(&bench, &["residuals", "--free", "rs"]);
    assert_eq!(std::fs::read_to_string(bench.path("r.html")).unwrap(), "of a fit");
    // Bounds are of a search, which a simulation has none of.
    let (out, _) = bench.ends(0, &["simulate"]);
    assert_eq!(out.lines().count(), 2001);
    std::fs::write(bench.path("greybox.toml"), "model = 'pmsm.toml'\nrecords = ['r*.csv']\nfix = { rs = 1.0 }")
        .unwrap();
    bench.ends(0, &["simulate"]);
    std::fs::copy(record(), bench.path("r2.csv")).unwrap();
    let (_, error) = bench.ends(1, &["simulate"]);
    assert!(error.contains("name one file with the inputs, after the model; 2 are named"), "{error}");
    // Records are no model.
    std::fs::write(bench.path("greybox.toml"), "records = ['record.csv']").unwrap();
    let (_, error) = bench.ends(1, &["fit"]);
    assert!(error.contains("no model is named"), "{error}");
}

#[test]
fn a_broken_project_is_in_the_way_of_nothing_else() {
    let bench = project("starts = = 3");
    for words in [&["--version"][..], &["--help"], &["fit", "--help"], &["help", "fit"], &["models"], &["man"]] {
        bench.ends(0, words);
    }
    let (_, error) = bench.ends(1, &["fit"]);
    assert!(error.starts_with("error: greybox.toml: "), "{error}");
}

#[test]
fn entries_say_what_they_take() {
    for (entry, says) in [
        ("log = true", "`log = true`: the option takes names: log = [\"NAME\"]"),
        ("bounds = false", "the option takes values by name: bounds = { NAME = \"A..B\" }"),
        ("starts = true", "`starts = true`: the option takes a value: starts = \"COUNT\""),
        ("staged = 3", "`staged` is true or false; it takes no other value"),
        ("loss = 2020-01-01", "`loss`: a datetime does not belong here"),
        ("starts = 'many'", "invalid value 'many' for '--starts <COUNT>'"),
        ("staged = true\nmultiple-shooting = true", "cannot be used with"),
        ("sample-time = 5e-4\ntime-unit = 'ms'", "'--sample-time <SECONDS>' cannot be used with '--time-unit <UNIT>'"),
    ] {
        let (_, error) = project(entry).ends(1, &["fit", "--loss", "huber"]);
        assert!(error.starts_with("error: greybox.toml: ") && error.contains(says), "{entry}\n{error}");
    }
}

/// A simulation reads no outputs, of which the project may say a column and a unit.
#[test]
fn what_is_said_of_outputs_is_in_no_simulation_s_way() {
    let fixed = "fix = { rs = 0.63, ls = 4e-3, ke = 0.95 }";
    let (plain, _) = project(fixed).ends(0, &["simulate"]);
    let bench = project(&format!("unit = {{ id = 'mA' }}\ncolumn = {{ iq = 'current' }}\n{fixed}"));
    let (out, _) = bench.ends(0, &["simulate"]);
    assert!(out == plain && out.lines().count() == 2001, "{}", out.lines().count());
    let (_, error) = bench.ends(1, &["simulate", "--unit", "v=rpm"]);
    assert!(error.contains("the model has no signal `v`"), "{error}");
}

#[test]
fn a_unit_of_time_takes_the_place_of_the_project_s() {
    let bench = project("unit = ['t=ms']");
    let words = ["fit", "--time-unit", "s"];
    assert_eq!(value(&answers(&bench, &words), "rs"), value(&answers(&project(""), &words), "rs"));
}
