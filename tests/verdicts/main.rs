//! Verdicts on records of many kinds, good and bad: what is junk is never called usable, and what is good is.

#[path = "../common/dc_motor.rs"]
mod dc_motor;
mod extremes;
mod further;
mod good;
mod good_processes;
mod growing;
mod initial;
mod junk;
mod junk_inputs;
mod junk_models;
mod junk_processes;
mod junk_sensors;
mod levels;
mod plants;
mod processes;
#[path = "../common/random.rs"]
mod random;
mod records;
mod sampling;
mod stiff;

use greybox::optimize::Severity;
use rayon::prelude::*;
use records::Found;
use std::collections::BTreeMap;

/// Records of each kind; in a debug build fewer, for its time (`.ci/run` takes the optimized one, too).
const SEEDS: u64 = if cfg!(debug_assertions) { 1 } else { 10 };

/// The first seed; other seeds (`GREYBOX_SEED`) are for measurements.
fn first() -> u64 {
    std::env::var("GREYBOX_SEED").ok().and_then(|seed| seed.parse().ok()).unwrap_or(0)
}

/// How often each was said, and why.
struct Row {
    name: &'static str,
    counts: [usize; 3],
    codes: BTreeMap<String, usize>,
    worst: String,
    errors: f64,
}

fn row(name: &'static str, judged: fn(u64) -> Found, bad: impl Fn(&Found) -> bool) -> Row {
    let mut row = Row { name, counts: [0; 3], codes: BTreeMap::new(), worst: String::new(), errors: 0.0 };
    for seed in first()..first() + SEEDS {
        let found = judged(seed);
        row.counts[found.severity as usize] += 1;
        for code in &found.codes {
            *row.codes.entry(format!("{code:?}")).or_default() += 1;
        }
        row.errors = row.errors.max(found.errors);
        if bad(&found) {
            row.worst = format!("{name}, seed {seed}:\n{}", found.text);
        }
    }
    row
}

fn print(title: &str, rows: &[Row]) {
    println!("\n{title:<56} usable care not  worst error (standard errors), reasons");
    for Row { name, counts: [usable, care, not], codes, errors, .. } in rows {
        let codes: Vec<String> = codes.iter().map(|(code, count)| format!("{code} {count}")).collect();
        println!("{name:<56} {usable:>6} {care:>4} {not:>3}  {errors:8.1}  {}", codes.join(", "));
    }
}

/// With `GREYBOX_WRITE_CHECKS`, writes how many good records each code was said of, for `docs/checks.md`.
fn write_flagged(rows: &[Row]) {
    if std::env::var_os("GREYBOX_WRITE_CHECKS").is_none() {
        return;
    }
    let mut flagged: BTreeMap<&str, usize> = BTreeMap::new();
    rows.iter().flat_map(|row| &row.codes).for_each(|(code, count)| *flagged.entry(code).or_default() += count);
    let mut text = format!("code,records\nall,{}\n", rows.len() as u64 * SEEDS);
    flagged.iter().for_each(|(code, count)| text += &format!("{code},{count}\n"));
    std::fs::write(concat!(env!("CARGO_MANIFEST_DIR"), "/docs/flagged.csv"), text).unwrap();
}

#[test]
fn junk_is_never_usable() {
    let kinds: Vec<_> = [junk_sensors::all(), junk_inputs::all(), junk_models::all(), junk_processes::all()]
        .into_iter()
        .flatten()
        .collect();
    assert!(kinds.len() >= 30, "{}", kinds.len());
    let wrong = |kind: &junk::Junk, found: &Found| {
        let named = kind.named.is_none_or(|code| found.codes.contains(&code));
        kind.unseen.is_none() && (found.severity == Severity::Usable || !named)
    };
    let judged = |kind: &junk::Junk| row(kind.name, kind.judged, |found| wrong(kind, found));
    let rows: Vec<Row> = kinds.par_iter().map(judged).collect();
    print("junk", &rows);
    for (kind, row) in kinds.iter().zip(&rows).filter(|(kind, _)| kind.unseen.is_some()) {
        println!("{}: cannot be seen: {}", row.name, kind.unseen.unwrap_or_default());
    }
    let wrong: Vec<&str> = rows.iter().filter(|row| !row.worst.is_empty()).map(|row| &*row.worst).collect();
    assert!(wrong.is_empty(), "{} kinds are called usable, or not named:\n{}", wrong.len(), wrong.join("\n\n"));
}

#[test]
fn good_records_are_usable() {
    let kinds: Vec<_> = good::all().into_iter().chain(good_processes::all()).collect();
    assert!(kinds.len() >= 30, "{}", kinds.len());
    let judged = |kind: &good::Good| {
        row(kind.name, kind.judged, |found| {
            found.severity == Severity::NotUsable || found.codes.iter().any(|code| !kind.may.contains(code))
        })
    };
    let rows: Vec<Row> = kinds.par_iter().map(judged).collect();
    print("good", &rows);
    write_flagged(&rows);
    let not: usize = rows.iter().map(|row| row.counts[2]).sum();
    let all = rows.len() * SEEDS as usize;
    let wrong: Vec<&str> = rows.iter().filter(|row| !row.worst.is_empty()).map(|row| &*row.worst).collect();
    assert!(100 * not <= all, "{not} of {all} are not usable:\n{}", wrong.join("\n\n"));
    assert!(wrong.is_empty(), "{} kinds with a reason that is not true:\n{}", wrong.len(), wrong.join("\n\n"));
}
