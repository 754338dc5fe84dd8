//! The layers of `ARCHITECTURE.md`: a module imports only from rows below its own, and modules of one row not from each
//! other.
//!
//! The module of a file is its top one: `fit/run.rs` belongs to `fit`. Files of one module may import from each other.
//! Comments, doc comments and unit tests are not examined. Names of the crate's public list (`crate::Model`) may be imported
//! by results and shipped models only, which use most layers.

mod circles;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Row by row, the lowest first, the layer and its modules. Each may import from all earlier rows, and from nothing else.
const LAYERS: &[(&str, &[&str])] = &[
    ("vector registers", &["aligned", "lanes", "wide"]),
    ("numbers", &["scalar", "units", "random", "numeral", "whiteness", "real", "format", "hash"]),
    ("numbers: with slopes, in vectors; units", &["dual", "fused", "signals", "unit"]),
    ("numbers: graphs, triangles", &["information", "error", "by_name", "layout", "graph", "moments"]),
    ("numbers: linear equations over an interval", &["transition"]),
    ("declarations", &["model", "parameter", "scaling", "interval"]),
    ("data: records and functions by position", &["record", "functions"]),
    ("data: equations as graphs", &["equations"]),
    ("data: records by type", &["experiment"]),
    // Filtering a record is editing it, and a horizon may start from filtered states.
    ("one step", &["integrate", "prefilter"]),
    ("one step: as a graph", &["recurrence"]),
    ("one step: as a program", &["engine"]),
    ("one record", &["predict", "simulate"]),
    ("one record: in pieces", &["sweep"]),
    ("estimation: parts", &["loss", "weighting", "outliers", "optimize", "regress", "numeric", "online", "severity"]),
    ("estimation: the problem", &["problem"]),
    ("estimation: sections of a report", &["section"]),
    ("estimation: the result", &["estimate"]),
    ("estimation: sums over the data", &["residuals", "covariance"]),
    ("estimation: sums over rows with slopes", &["rows"]),
    ("estimation: judgement", &["judge"]),
    ("estimation: the fit", &["fit"]),
    ("results", &["diagnose", "check"]),
    // A report reads diagnoses.
    ("results: reports", &["report"]),
    ("models", &["models", "pmsm", "text"]),
    ("documentation", &["guide"]),
];

/// Modules that may use the crate's public list, names in capitals.
const ABOVE_ALL: &[&str] = &["diagnose", "report", "check", "models", "pmsm"];

fn files(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        match path.extension() {
            _ if path.is_dir() => files(&path, found),
            // Unit tests in a file of their own.
            Some(_) if path.ends_with("tests.rs") => {}
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

/// The path of a file among the modules: `["fit", "run"]`.
fn place(root: &Path, file: &Path) -> Vec<String> {
    let inside = file.strip_prefix(root).unwrap().with_extension("");
    inside.iter().map(|part| part.to_str().unwrap().to_owned()).collect()
}

fn layers() -> BTreeMap<&'static str, usize> {
    LAYERS
        .iter()
        .enumerate()
        .flat_map(|(layer, (_, modules))| modules.iter().map(move |&module| (module, layer)))
        .collect()
}

/// The imports of one file that the layers forbid.
fn wrong(place: &[String], code: &str) -> Vec<String> {
    let (layers, module) = (layers(), place[0].as_str());
    let Some(&layer) = layers.get(module) else {
        return vec![format!("`{module}` is in no layer; add it to a row of tests/layers/main.rs")];
    };
    let mut modules = heads(code, "crate::");
    // As many `super` as the file is deep lead to the other modules.
    modules.extend(heads(code, &"super::".repeat(place.len())));
    let mut problems = vec![];
    for other in modules {
        let listed = other.starts_with(char::is_uppercase) && ABOVE_ALL.contains(&module);
        match layers.get(other.as_str()) {
            _ if other == module || listed || other == "super" => {}
            Some(&below) if below < layer => {}
            Some(&above) => problems.push(format!(
                "`{}` ({}) imports from `{other}` ({})",
                place.join("/"),
                LAYERS[layer].0,
                LAYERS[above].0
            )),
            None => problems
                .push(format!("`{}` imports `crate::{other}`, which is no module of a lower row", place.join("/"))),
        }
    }
    problems
}

#[test]
fn files_import_from_lower_layers_only() {
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
    assert_eq!(seen(&["unlisted"], ""), 1);
    assert_eq!(seen(&["loss"], "#[cfg(test)]\nmod tests { use crate::fit::Fit; }"), 0);
}
