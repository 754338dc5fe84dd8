//! What a report says, in sentences that every form of it shares. Names stand between backticks.

use super::{Record, Report};
use crate::diagnose::{Bootstrap, LEVEL, Test};
use crate::estimate::{Knowledge, number};
use crate::optimize::Severity;

/// The verdict in a word or three.
pub(super) fn verdict(severity: Severity) -> &'static str {
    match severity {
        Severity::Usable => "Usable",
        Severity::UsableWithCare => "Usable with care",
        Severity::NotUsable => "Not usable",
    }
}

/// A sign that goes with the verdict, for those who do not see its color.
pub(super) fn sign(severity: Severity) -> &'static str {
    match severity {
        Severity::Usable => "✓",
        Severity::UsableWithCare => "!",
        Severity::NotUsable => "✗",
    }
}

/// How the search ended, and what to do about it if it ended badly.
pub(super) fn search(report: &Report) -> String {
    let mut text = format!("Search: {}.", report.outcome);
    if !report.outcome.converged() {
        text = format!("{text} {}", report.outcome.advice());
    }
    let unknown = report.unknowns.iter().filter(|unknown| unknown.knowledge == Knowledge::Unidentified).count();
    match unknown {
        0 => text,
        _ => format!("The data do not determine {unknown} of the {} unknowns. {text}", report.unknowns.len()),
    }
}

/// A record in one line.
pub(super) fn extent(record: &Record) -> String {
    let Record { samples, begin, end, sample_time, gaps, .. } = record;
    let (begin, end, step) = (number(*begin, 7), number(*end, 7), number(*sample_time, 4));
    let gaps = match gaps {
        0 => "no gap".to_owned(),
        1 => "1 gap in time".to_owned(),
        gaps => format!("{gaps} gaps in time"),
    };
    format!("{samples} samples from {begin} s to {end} s, every {step} s; {gaps}")
}

/// What the drawings of a record do not show, said for each output.
pub(super) fn unpredicted(record: &Record) -> Vec<String> {
    let fits = record.fits.iter().filter(|fit| fit.unpredicted > 0);
    fits.map(|fit| format!("`{}` has no prediction in {} samples; they are gaps", fit.name, fit.unpredicted)).collect()
}

/// Pairs of estimates that are hard to tell apart, most so first.
pub(super) fn correlated(report: &Report) -> Vec<String> {
    const STRONG: f64 = 0.95;
    const MENTIONED: usize = 10;
    let n = report.unknowns.len().min(report.correlation.size());
    let pairs = (0..n).flat_map(|i| (0..i).map(move |j| (j, i, report.correlation[(i, j)])));
    let mut strong: Vec<_> = pairs.filter(|(_, _, r)| r.abs() > STRONG).collect();
    strong.sort_by(|a, b| b.2.abs().total_cmp(&a.2.abs()));
    let name = |i: usize| &report.unknowns[i].name;
    strong.into_iter().take(MENTIONED).map(|(i, j, r)| format!("`{}` and `{}`: {:+.4}", name(i), name(j), r)).collect()
}

/// Rank and condition in a sentence.
pub(super) fn rank(report: &Report) -> String {
    let found = &report.identifiability;
    let n = found.unknowns.len();
    let condition = found.condition.map_or("beyond rounding".to_owned(), |condition| number(condition, 3));
    match found.rank as usize == n {
        true => format!(
            "The records tell all {n} unknowns apart (condition number of the scaled sensitivities {condition})."
        ),
        false => {
            format!("The records do not tell all unknowns apart: the sensitivities have rank {} of {n}.", found.rank)
        }
    }
}

/// Why the estimate is not simply usable, the worst first: warnings, failed tests, better minima.
pub(super) fn reasons(report: &Report) -> Vec<(Severity, String)> {
    let mut reasons: Vec<_> = report.warnings.iter().map(|warning| (warning.severity, warning.text.clone())).collect();
    reasons.extend(failed(report));
    for finding in report.findings.iter().filter(|finding| !finding.test.passed) {
        let text = format!("{}, {}: {}", quoted(&finding.about), finding.test.name, finding.test.meaning);
        reasons.push((Severity::UsableWithCare, text));
    }
    let remarks = report.profiles.iter().map(|profile| (profile.severity, profile.remark.clone()));
    let restarts = report.restarts.iter().map(|restarts| (restarts.severity, restarts.meaning.clone()));
    reasons.extend(remarks.chain(restarts).filter(|(_, text)| !text.is_empty()));
    reasons.sort_by_key(|(severity, _)| core::cmp::Reverse(*severity));
    reasons
}

/// The tests of the residuals, each with whose they are.
fn tests(report: &Report) -> impl Iterator<Item = (String, &Test)> {
    let one = report.records.len() == 1;
    let fits = report.records.iter().flat_map(|record| record.fits.iter().map(move |fit| (record, fit)));
    fits.flat_map(move |(record, fit)| {
        let of = if one { format!("`{}`", fit.name) } else { format!("`{}` of {}", fit.name, quoted(&record.name)) };
        fit.residuals.tests.iter().map(move |test| (of.clone(), test))
    })
}

/// What someone called something, as a name.
fn quoted(name: &str) -> String {
    format!("`{}`", name.replace('`', "'"))
}

/// How many tests of the residuals fail, what the clearest of them means, and what that makes of the estimate: of many
/// tests some fail by chance, so each must fail at its part of the [`LEVEL`] (Bonferroni) to count.
pub(super) fn failed(report: &Report) -> Option<(Severity, String)> {
    let failed: Vec<_> = tests(report).filter(|(_, test)| !test.passed).collect();
    let (of, clearest) = failed.iter().min_by(|a, b| a.1.p_value.total_cmp(&b.1.p_value))?;
    let (count, all) = (failed.len(), tests(report).count());
    if clearest.p_value * all as f64 >= LEVEL {
        let text =
            format!("{count} of {all} tests of the residuals failed, none clearly: among so many that may be chance");
        return Some((Severity::Usable, text));
    }
    let Test { name, meaning, .. } = clearest;
    let text = format!("{count} of {all} tests of the residuals failed, clearest {name} on {of}: {meaning}");
    Some((Severity::UsableWithCare, text))
}

/// What the failed tests of the residuals mean, each meaning once, with what failed it.
pub(super) fn failures(report: &Report) -> Vec<String> {
    const NAMED: usize = 4;
    let mut groups: Vec<(&str, Vec<String>)> = vec![];
    for (of, test) in tests(report).filter(|(_, test)| !test.passed) {
        let what = format!("{of} {} ({})", test.name, test.probability());
        match groups.iter_mut().find(|(meaning, _)| *meaning == test.meaning) {
            Some((_, whats)) => whats.push(what),
            None => groups.push((&test.meaning, vec![what])),
        }
    }
    let said = |(meaning, whats): (&str, Vec<String>)| {
        let more = match whats.len().saturating_sub(NAMED) {
            0 => String::new(),
            more => format!("; {more} more"),
        };
        format!("{}{more}: {meaning}", whats[..whats.len().min(NAMED)].join("; "))
    };
    groups.into_iter().map(said).collect()
}

/// How many refits a bootstrap rests on.
pub(super) fn refits(found: &Bootstrap) -> String {
    let Bootstrap { converged, tried, seed, .. } = found;
    format!("Bootstrap: {converged} of {tried} refits ended, seed {seed}")
}

/// The further tests, by what they are about.
pub(super) fn by_subject(report: &Report) -> Vec<(&str, Vec<&Test>)> {
    let mut subjects: Vec<(&str, Vec<&Test>)> = vec![];
    for finding in &report.findings {
        match subjects.iter_mut().find(|(about, _)| *about == finding.about) {
            Some((_, of_it)) => of_it.push(&finding.test),
            None => subjects.push((&finding.about, vec![&finding.test])),
        }
    }
    subjects
}

/// Pieces of a sentence: plain text and, between backticks, names.
pub(super) fn pieces(text: &str) -> impl Iterator<Item = (bool, &str)> {
    text.split('`').enumerate().map(|(i, piece)| (i % 2 == 1, piece))
}
