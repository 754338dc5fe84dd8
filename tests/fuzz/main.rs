//! Random records, models, parameters and settings through fit, diagnoses, report and JSON: no panic, no hang, nothing known
//! that is not finite, every JSON read as it was written.
//!
//! A case follows from its number. `GREYBOX_FUZZ_SECONDS` goes on for so long (a fixed number of cases without it),
//! `GREYBOX_FUZZ_FROM` is the first case (the time of day, if it is `clock`), `GREYBOX_FUZZ_CASE` runs one case alone.

mod case;
mod models;
#[path = "../common/random.rs"]
mod random;
mod values;

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// Cases without a time budget.
const CASES: u64 = 60;
/// Cases that have shown a fault: a line search without a step, scores that overflow, a drawing of excitations that are no
/// numbers, intervals without an end or below the smallest number, fleets that kept a coarse step, words for what is missing,
/// errors with numbers of 300 digits.
const FOUND: [u64; 12] = [462, 620, 397, 1556, 1577, 457, 1234, 1420, 1601, 1889, 100_503, 1_795_353_096_000_008];
/// A case that takes longer hangs: its fit has a limit of a second, its diagnoses of as much each.
const HANG: Duration = Duration::from_secs(120);

fn number(name: &str) -> Option<u64> {
    let text = std::env::var(name).ok()?;
    let clock = || SystemTime::now().duration_since(UNIX_EPOCH).ok().map(|time| time.as_secs() * 1_000_000);
    if text == "clock" { clock() } else { Some(text.parse().unwrap_or_else(|_| panic!("{name} is `{text}`"))) }
}

/// Runs a case on a thread of its own and says what is wrong with it.
fn run(number: u64) -> Result<case::Tally, String> {
    let (send, receive) = channel();
    std::thread::spawn(move || {
        let result = catch_unwind(AssertUnwindSafe(|| case::run(number)));
        let text = |panic: Box<dyn std::any::Any + Send>| {
            let text = panic.downcast_ref::<String>().cloned();
            text.or_else(|| panic.downcast_ref::<&str>().map(|&text| text.to_owned())).unwrap_or_default()
        };
        // The receiver is gone if this took too long, which it has reported.
        let _ = send.send(result.unwrap_or_else(|panic| Err(format!("panics: {}", text(panic)))));
    });
    match receive.recv_timeout(HANG) {
        Ok(result) => result,
        Err(RecvTimeoutError::Timeout) => Err(format!("takes more than {} s", HANG.as_secs())),
        Err(RecvTimeoutError::Disconnected) => Err("its thread ended without a result".to_owned()),
    }
}

#[test]
fn random_fits_end_soundly() {
    let first = number("GREYBOX_FUZZ_FROM").unwrap_or(1);
    if let Some(case) = number("GREYBOX_FUZZ_CASE") {
        return println!("{:?}", run(case).unwrap_or_else(|wrong| panic!("case {case} {wrong}")));
    }
    let begin = Instant::now();
    let budget = number("GREYBOX_FUZZ_SECONDS").map(Duration::from_secs);
    let goes_on = |case: u64| budget.map_or(case < first + CASES, |budget| begin.elapsed() < budget);
    let (mut tally, mut wrong, mut slowest) = (case::Tally::default(), vec![], (0, 0));
    for case in FOUND.into_iter().chain((first..).take_while(|case| goes_on(*case))) {
        let started = Instant::now();
        let result = run(case);
        slowest = slowest.max((started.elapsed().as_millis(), case));
        match result {
            Ok(one) => tally.add(&one),
            Err(text) => {
                println!("case {case} {text}");
                wrong.push(case);
            }
        }
        tally.cases += 1;
    }
    println!("from case {first} on: {tally:?}; the slowest took {} ms: {}", slowest.0, slowest.1);
    assert!(wrong.is_empty(), "wrong cases: {wrong:?}; run one alone with GREYBOX_FUZZ_CASE");
    // Enough cases must come so far that there is something to judge.
    assert!(tally.fits * 5 >= tally.cases, "{tally:?}");
}
