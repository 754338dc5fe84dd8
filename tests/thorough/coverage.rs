//! How often intervals cover the truth: a table of cases, each with records of its own.
//!
//! `COVERAGE_RECORDS=2000 COVERAGE_SEED=7 cargo test --release --test thorough coverage -- --nocapture` prints the table
//! of `docs/intervals.md` with as many records and from another seed; the test takes fewer.

mod cases;
mod few;
mod models;

use crate::random::Random;
use greybox::{Knowledge, Severity, Summary, WarningCode};
use rayon::prelude::*;

/// What one fit said, and the truth of each unknown that is examined.
struct Trial {
    summary: Summary,
    truth: Vec<f64>,
}

/// A kind of records, and how one of them is made and fitted.
struct Case {
    name: &'static str,
    /// Least and most coverage (%), of the fits that are not "not usable".
    wanted: (f64, f64),
    /// A warning that at least 80 % of the fits must have.
    warned: Option<WarningCode>,
    trial: fn(&mut Random) -> Trial,
}

/// What the fits of a case said.
struct Findings {
    name: &'static str,
    wanted: (f64, f64),
    warned: Option<WarningCode>,
    records: usize,
    /// Of the fits that are not "not usable": part (%) whose interval covers, for each unknown.
    covered: Vec<f64>,
    /// Parts (%) that miss below and above the interval.
    missed: Vec<[f64; 2]>,
    /// Parts (%) that are usable, usable with care, not usable.
    severity: [f64; 3],
    /// Parts (%) with each warning.
    codes: Vec<(WarningCode, f64)>,
    /// Part (%) with a HAC covariance.
    hac: f64,
    /// Mean error of each unknown in standard errors.
    bias: Vec<f64>,
    /// Mean width of the intervals, over that of 1.96 times the errors' root mean square to either side.
    width: Vec<f64>,
}

fn number_from(variable: &str, otherwise: u64) -> u64 {
    std::env::var(variable).ok().and_then(|text| text.parse().ok()).unwrap_or(otherwise)
}

/// The ends of an interval; of unknowns at their lower bound, too.
fn interval(knowledge: &Knowledge) -> (f64, f64) {
    match *knowledge {
        Knowledge::Known { lower, upper, .. } => (lower, upper),
        Knowledge::Held { bound, end: Some(end) } => (bound, end),
        _ => (f64::NAN, f64::NAN),
    }
}

fn examine(case: &Case, records: u64, seed: u64) -> Findings {
    let trial = |record: u64| {
        // Neighboring seeds would give the same numbers, shifted by one.
        let mut random = Random((seed << 32) + record);
        (case.trial)(&mut Random((random.uniform() * 2f64.powi(53)) as u64))
    };
    let trials: Vec<Trial> = (0..records).into_par_iter().map(trial).collect();
    let percent = |part: usize, of: usize| 100.0 * part as f64 / of.max(1) as f64;
    let with = |severity: Severity| trials.iter().filter(|trial| trial.summary.severity() == severity).count();
    let judged: Vec<&Trial> = trials.iter().filter(|t| t.summary.severity() != Severity::NotUsable).collect();
    let unknowns = 0..trials[0].truth.len();
    let share = |test: &dyn Fn(&Trial, usize) -> bool, i: usize| {
        percent(judged.iter().filter(|trial| test(trial, i)).count(), judged.len())
    };
    let ends = |trial: &Trial, i: usize| interval(&trial.summary.unknowns[i].knowledge);
    let covers = |trial: &Trial, i: usize| {
        let (lower, upper) = ends(trial, i);
        lower <= trial.truth[i] && trial.truth[i] <= upper
    };
    let mut codes: Vec<(WarningCode, f64)> = vec![];
    for warning in trials.iter().flat_map(|trial| &trial.summary.warnings) {
        match codes.iter_mut().find(|(code, _)| *code == warning.code) {
            Some((_, part)) => *part += percent(1, trials.len()),
            None => codes.push((warning.code, percent(1, trials.len()))),
        }
    }
    let error = |trial: &Trial, i: usize| {
        let unknown = &trial.summary.unknowns[i];
        unknown.knowledge.standard_error().map_or(0.0, |error| (unknown.value - trial.truth[i]) / error)
    };
    let bias = |i: usize| trials.iter().map(|trial| error(trial, i)).sum::<f64>() / trials.len() as f64;
    let width = |i: usize| {
        let errors = judged.iter().map(|t| (t.summary.unknowns[i].value - t.truth[i]).powi(2)).sum::<f64>();
        let said = judged.iter().map(|t| (ends(t, i).1 - ends(t, i).0) / (2.0 * 1.96)).sum::<f64>();
        said / (errors * judged.len() as f64).sqrt()
    };
    let is_hac =
        |trial: &&Trial| matches!(trial.summary.method.covariance, greybox::estimate::CovarianceMethod::Hac { .. });
    Findings {
        name: case.name,
        wanted: case.wanted,
        warned: case.warned,
        records: trials.len(),
        covered: unknowns.clone().map(|i| share(&covers, i)).collect(),
        missed: unknowns
            .map(|i| [share(&|t, i| t.truth[i] < ends(t, i).0, i), share(&|t, i| t.truth[i] > ends(t, i).1, i)])
            .collect(),
        severity: [Severity::Usable, Severity::UsableWithCare, Severity::NotUsable]
            .map(|severity| percent(with(severity), trials.len())),
        codes,
        hac: percent(trials.iter().filter(is_hac).count(), trials.len()),
        bias: (0..trials[0].truth.len()).map(bias).collect(),
        width: (0..trials[0].truth.len()).map(width).collect(),
    }
}

impl Findings {
    fn print(&self) {
        let Findings { name, covered, missed, severity: [usable, care, not], codes, hac, bias, width, .. } = self;
        let missed: Vec<String> = missed.iter().map(|[low, high]| format!("{low:.1}/{high:.1}")).collect();
        println!(
            "{name:50} covered {covered:5.1?} missed {} usable {usable:.0} care {care:.0} not {not:.0} HAC {hac:.0} bias {bias:.1?} width {width:.2?} {codes:.0?}",
            missed.join(" ")
        );
    }

    /// Whether the coverage is as wanted, with three binomial standard deviations for chance, and, where a warning is
    /// wanted, whether it is there.
    fn holds(&self) -> bool {
        let said = |code: &WarningCode| self.codes.iter().any(|(found, part)| found == code && *part >= 80.0);
        if !self.warned.iter().all(said) {
            return false;
        }
        let judged = self.records as f64 * (1.0 - self.severity[2] / 100.0);
        let chance = 3.0 * (5.0 * 95.0 / judged.max(1.0)).sqrt();
        self.covered.iter().all(|c| (self.wanted.0 - chance..=self.wanted.1 + chance).contains(c))
    }
}

#[test]
fn coverage() {
    let (records, seed) = (number_from("COVERAGE_RECORDS", 300), number_from("COVERAGE_SEED", 1));
    let only = std::env::var("COVERAGE_CASE").unwrap_or_default();
    let mut wrong = vec![];
    for case in cases::all().iter().filter(|case| case.name.contains(&only)) {
        let findings = examine(case, records, seed);
        findings.print();
        if !findings.holds() {
            wrong.push(format!("{}: {:.1?}", findings.name, findings.covered));
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}
