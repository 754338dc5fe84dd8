//! The table of checks against `docs/checks.md` and the schema of an estimate's JSON.

use super::*;
use crate::estimate::WarningCode;
use crate::judge::check::{Level, Pass};
use crate::numeral::exact;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

fn code(code: impl serde::Serialize) -> String {
    serde_json::to_value(code).unwrap().as_str().unwrap().to_owned()
}

fn pass(pass: &Pass) -> String {
    let passes = |count: &usize| format!("{count} pass{}", if *count == 1 { "" } else { "es" });
    match pass {
        Pass::Rows => "the pass with slopes that checks share".to_owned(),
        Pass::Values(count) => format!("up to {} in values, where there is a reason", passes(count)),
        Pass::Slopes(count) => format!("up to {} with slopes, where there is a reason", passes(count)),
        Pass::Curvature => "the pass with slopes for the curvature of a loss".to_owned(),
        Pass::Left => "one with slopes that parts and sensors share, where there is a reason".to_owned(),
        Pass::EachUnknown(count) => format!("{} or more for each unknown with a reason", passes(count)),
        Pass::Finer => "a pass by a finer method, where there is a reason".to_owned(),
    }
}

/// Of how many good records each code was said as more than a note, as measured by the table of verdicts.
fn flagged() -> BTreeMap<String, usize> {
    let text = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/flagged.csv")).unwrap();
    let row = |line: &str| line.split_once(',').map(|(code, count)| (code.to_owned(), count.parse().unwrap())).unwrap();
    text.lines().skip(1).map(row).collect()
}

/// The page about all checks.
fn page() -> String {
    let mut page = "# Checks of an estimate\n\nWritten from the table `CHECKS` in `src/judge/checks.rs` by \
                    `GREYBOX_WRITE_CHECKS=1 cargo test --lib checks`; a test compares it. The checks stand in the order in \
                    which their warnings are shown. Passes over the data are counted beside the one in values that every \
                    estimate takes. The covariance takes the pass with slopes that checks share, too; one more with slopes for \
                    colored errors, or for a sandwich; and one more for weights, a loss or a pre-filter.\n\n"
        .to_owned();
    let flagged = flagged();
    page += &match flagged["all"] {
        0 => "How many good records of the table of verdicts each code was said of is not measured yet".to_owned(),
        all => format!(
            "The number after a code says for how many of {all} good records of the table of verdicts it was a reason for care or for not \
             usable; notes do not count, and a code of several checks has one number"
        ),
    };
    page += " (`GREYBOX_WRITE_CHECKS=1 cargo test --release --test verdicts good` measures that).\n";
    for (number, Check { name, asks, codes, unless, of_usable, costs, levels, .. }) in CHECKS.iter().enumerate() {
        let named = |one: &WarningCode| match flagged["all"] {
            0 => format!("`{}`", code(one)),
            _ => format!("`{}` ({})", code(one), flagged.get(&format!("{one:?}")).unwrap_or(&0)),
        };
        let codes: Vec<String> = codes.iter().map(named).collect();
        let costs: Vec<String> = costs.iter().map(pass).collect();
        let costs = if costs.is_empty() { "none".to_owned() } else { costs.join("; ") };
        page += &format!("\n## {}. {name}\n\n{asks}\n\nCodes: {}. Passes: {costs}.", number + 1, codes.join(", "));
        let unless: Vec<&str> = unless.iter().map(|one| one.reason()).chain(of_usable.then_some(USELESS)).collect();
        page += &if unless.is_empty() { "\n".to_owned() } else { format!(" Skipped for: {}.\n", unless.join("; ")) };
        if !levels.is_empty() {
            page += "\n| level | value | where it comes from |\n|---|---|---|\n";
        }
        for Level { of, value, source } in *levels {
            page += &format!("| {of} | {} | {source} |\n", exact(*value));
        }
    }
    page
}

/// `GREYBOX_WRITE_CHECKS=1` writes the page.
#[test]
fn the_page_is_that_of_the_table() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/checks.md");
    if std::env::var_os("GREYBOX_WRITE_CHECKS").is_some() {
        std::fs::write(&path, page()).unwrap();
    }
    assert_eq!(std::fs::read_to_string(path).unwrap(), page(), "run it with GREYBOX_WRITE_CHECKS=1");
}

/// No name stands twice, and the schema lists the codes of all checks.
#[test]
fn names_and_codes_are_complete() {
    let names: BTreeSet<&str> = CHECKS.iter().map(|check| check.name).collect();
    assert_eq!(names.len(), CHECKS.len());
    let codes: BTreeSet<String> = CHECKS.iter().flat_map(|check| check.codes).map(code).collect();
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("schema/estimate.schema.json");
    let schema: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    let listed = schema["$defs"]["warning"]["properties"]["code"]["enum"].as_array().unwrap().iter().map(code);
    assert_eq!(listed.collect::<BTreeSet<String>>(), codes);
}
