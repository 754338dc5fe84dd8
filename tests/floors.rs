//! The floors of the house: a file imports only from floors below its own, siblings never from each other.
//!
//! A file's room is its name, or the name of the contract file that its folder stands beside: `fit/run.rs` belongs to
//! `fit`. Within a room, parts use their contract and each other. What is said in comments, doc comments and unit tests is
//! free, and the crate's public list (`crate::Model`) is for the wing and the roof, which stand on everything.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// The rooms, floor by floor. Each may import from all the rows above its own, and from nothing else.
const FLOORS: &[(&str, &[&str])] = &[
    ("ground: hardware", &["lanes", "wide"]),
    ("ground: beside numbers", &["scalar", "units", "dispatch", "random", "numeral", "whiteness", "real", "format"]),
    ("ground: numbers", &["dual", "fused", "signals"]),
    ("ground: vectors of numbers", &["information", "error", "by_name", "layout", "graph"]),
    ("say: words", &["model", "parameter", "scaling", "interval"]),
    ("say: records and functions by position", &["record", "functions"]),
    ("say: equations as graphs", &["equations"]),
    ("say: records by type", &["experiment"]),
    // Filtering a record is editing it, and a horizon may start from filtered states.
    ("expect: one step", &["integrate", "prefilter"]),
    ("expect: a step as a graph", &["recurrence"]),
    ("expect: a step as a program", &["engine"]),
    ("expect: a record", &["predict", "simulate"]),
    ("expect: pieces of records", &["sweep"]),
    ("learn: parts", &["loss", "weighting", "outliers", "optimize", "regress", "numeric", "online"]),
    ("learn: the problem", &["problem"]),
    ("learn: words and figures for a reader", &["section"]),
    ("learn: the answer", &["estimate"]),
    ("learn: the judgement", &["judge"]),
    ("learn: the fit", &["fit"]),
    ("roof: answers", &["diagnose", "check"]),
    // A report reads diagnoses.
    ("roof: a reader", &["report"]),
    ("wing", &["models", "pmsm"]),
    ("documentation", &["guide"]),
];

/// Rooms that may use the crate's public list, names in capitals.
const ABOVE_ALL: &[&str] = &["diagnose", "report", "check", "models", "pmsm"];

fn files(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        match path.extension() {
            _ if path.is_dir() => files(&path, found),
            Some(extension) if extension == "rs" => found.push(path),
            _ => {}
        }
    }
}

/// The code of a file: no comments, nothing from its unit tests on.
fn code(text: &str) -> String {
    let text = text.split("#[cfg(test)]").next().unwrap_or_default();
    text.lines().map(|line| line.split("//").next().unwrap_or_default()).collect::<Vec<_>>().join("\n")
}

/// The first names of the paths that follow `prefix`: `a` of `crate::a::b`, `a` and `b` of `crate::{a::c, b}`.
fn heads(code: &str, prefix: &str) -> Vec<String> {
    let mut found = vec![];
    for (at, _) in code.match_indices(prefix) {
        let before = code[..at].chars().next_back();
        if before.is_some_and(|c| c.is_alphanumeric() || c == '_' || c == ':' || c == '$') {
            continue;
        }
        let rest = code[at + prefix.len()..].trim_start();
        let word =
            |text: &str| text.trim().chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect::<String>();
        let Some(list) = rest.strip_prefix('{') else {
            found.push(word(rest));
            continue;
        };
        let (mut depth, mut item) = (1, String::new());
        for c in list.chars() {
            depth += i32::from(c == '{') - i32::from(c == '}');
            if depth == 0 || depth == 1 && c == ',' {
                found.push(word(&item));
                item.clear();
            } else {
                item.push(c);
            }
            if depth == 0 {
                break;
            }
        }
    }
    found.retain(|name| !name.is_empty());
    found
}

/// The place of a file among the modules: `["fit", "run"]`.
fn place(root: &Path, file: &Path) -> Vec<String> {
    let inside = file.strip_prefix(root).unwrap().with_extension("");
    inside.iter().map(|part| part.to_str().unwrap().to_owned()).collect()
}

fn floors() -> BTreeMap<&'static str, usize> {
    FLOORS.iter().enumerate().flat_map(|(floor, (_, rooms))| rooms.iter().map(move |&room| (room, floor))).collect()
}

/// What of one file's code breaks the law.
fn wrong(place: &[String], code: &str) -> Vec<String> {
    let (floors, room) = (floors(), place[0].as_str());
    let Some(&floor) = floors.get(room) else {
        return vec![format!("`{room}` stands on no floor; give it one in tests/floors.rs")];
    };
    let mut rooms = heads(code, "crate::");
    // As many `super` as the file is deep lead to the other rooms.
    rooms.extend(heads(code, &"super::".repeat(place.len())));
    let mut problems = vec![];
    for other in rooms {
        let listed = other.starts_with(char::is_uppercase) && ABOVE_ALL.contains(&room);
        match floors.get(other.as_str()) {
            _ if other == room || listed || other == "super" => {}
            Some(&below) if below < floor => {}
            Some(&above) => problems.push(format!(
                "`{}` ({}) imports from `{other}` ({})",
                place.join("/"),
                FLOORS[floor].0,
                FLOORS[above].0
            )),
            None => problems.push(format!("`{}` imports `crate::{other}`, which is no room below it", place.join("/"))),
        }
    }
    problems
}

#[test]
fn files_import_from_floors_below_only() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut found = vec![];
    files(&root, &mut found);
    let found: Vec<_> = found.into_iter().filter(|path| *path != root.join("lib.rs")).collect();
    assert!(found.len() > 50, "{} files in {}", found.len(), root.display());
    let problems: Vec<String> = found
        .iter()
        .flat_map(|file| wrong(&place(&root, file), &code(&std::fs::read_to_string(file).unwrap())))
        .collect();
    assert!(problems.is_empty(), "{}", problems.join("\n"));
}

#[test]
fn an_import_from_above_is_seen() {
    let seen = |place: &[&str], text: &str| {
        let place: Vec<String> = place.iter().map(|part| (*part).to_owned()).collect();
        wrong(&place, &code(text)).len()
    };
    assert_eq!(seen(&["loss"], "use crate::error::Error;\n/// [`check`](crate::check)\nuse core::fmt;"), 0);
    assert_eq!(seen(&["loss"], "use crate::fit::Fit;"), 1);
    assert_eq!(seen(&["loss"], "use crate::weighting::BySignal;"), 1, "a sibling");
    assert_eq!(seen(&["loss"], "use crate::{error::{Error, Failure}, fit, weighting::BySignal};"), 2);
    assert_eq!(seen(&["loss"], "fn f() { crate::estimate::number(1.0) }"), 1);
    assert_eq!(seen(&["loss"], "use super::fit::Fit;"), 1);
    assert_eq!(seen(&["fit", "run"], "use super::objective::Halt; use super::super::report::text;"), 1);
    assert_eq!(seen(&["loss"], "use crate::Model;"), 1, "the public list");
    assert_eq!(seen(&["pmsm", "surface"], "use crate::{Model, Kind}; use super::Drive;"), 0);
    assert_eq!(seen(&["cellar"], ""), 1);
    assert_eq!(seen(&["loss"], "#[cfg(test)]\nmod tests { use crate::fit::Fit; }"), 0);
}
