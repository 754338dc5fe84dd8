//! What a report says, in sentences and tables that every form of it shares.

use super::{Declared, Record, Report, Role};
use crate::estimate::{Direction, Knowledge, Unknown, number};
use crate::optimize::Severity;
use crate::parameter::Transform;

/// A table: names of the columns, and rows of as many cells; the first cell of a row names it.
pub(super) struct Table {
    pub(super) columns: &'static [&'static str],
    pub(super) rows: Vec<Vec<String>>,
}

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
    match report.outcome.converged() {
        true => format!("The search {}.", report.outcome),
        false => format!("The search {}. {}", report.outcome, report.outcome.advice()),
    }
}

/// Everything estimated, then everything fixed.
pub(super) fn parameters(report: &Report) -> Table {
    let estimated = report.unknowns.iter().map(estimated);
    let fixed = report.declared.iter().filter(|declared| !declared.parameter.free);
    let fixed =
        fixed.map(|Declared { name, unit, parameter }| row([name, &number(parameter.start, 7), unit, "", "fixed", ""]));
    let columns = &["parameter", "value", "unit", "std. error", "95 % interval", "error index"];
    Table { columns, rows: estimated.chain(fixed).collect() }
}

fn estimated(unknown: &Unknown) -> Vec<String> {
    let Unknown { name, value, unit, .. } = unknown;
    let said = |text: &str| row([name, &number(*value, 6), unit, "", text, ""]);
    match unknown.knowledge {
        Knowledge::Known { standard_error, lower, upper } => {
            let digits = digits(*value, standard_error);
            let interval = format!("{} … {}", number(lower, digits), number(upper, digits));
            let index = unknown.error_index.map_or(String::new(), |index| format!("{} %", number(index, 3)));
            row([name, &number(*value, digits), unit, &number(standard_error, 2), &interval, &index])
        }
        Knowledge::Held { bound } => said(&format!("held at its bound {}", number(bound, 6))),
        Knowledge::Unidentified => said("not determined by the data"),
        Knowledge::Fixed => said("fixed"),
    }
}

/// The digits of a value that its standard error leaves, and one more.
fn digits(value: f64, standard_error: f64) -> usize {
    let digits = (value / standard_error).abs().log10().ceil() + 2.0;
    if digits.is_finite() { digits.clamp(3.0, 10.0) as usize } else { 6 }
}

/// How well the outputs are reproduced.
pub(super) fn outputs(report: &Report) -> Table {
    let rows = report.outputs.iter().map(|output| {
        let q = &output.quality;
        let fit = q.fit_percent.map_or("constant".to_owned(), |fit| format!("{fit:.2} %"));
        let (rmse, sigma) = (number(q.rmse, 4), number(q.sigma, 4));
        row([&output.name, &fit, &rmse, &sigma, &output.unit, &q.samples.to_string()])
    });
    Table { columns: &["output", "fit", "rms error", "noise", "unit", "samples"], rows: rows.collect() }
}

/// What tests found.
pub(super) fn findings(report: &Report) -> Table {
    let rows = report.findings.iter().map(|finding| {
        let verdict = format!("{} {}", sign(finding.severity), verdict(finding.severity).to_lowercase());
        row([&finding.about, &finding.test, &finding.result, &verdict, &finding.meaning.replace('`', "")])
    });
    Table { columns: &["about", "test", "result", "verdict", "meaning"], rows: rows.collect() }
}

/// The columns of a record.
pub(super) fn signals(record: &Record) -> Table {
    let rows = record.signals.iter().map(|signal| {
        let value = |value: Option<f64>| value.map_or("-".to_owned(), |value| number(value, 4));
        let role = match signal.role {
            Role::Input => "input",
            Role::Output => "output",
        };
        let values = [value(signal.min), value(signal.mean), value(signal.max)];
        row([&signal.name, role, &signal.unit, &values[0], &values[1], &values[2], &signal.missing.to_string()])
    });
    Table { columns: &["signal", "role", "unit", "least", "mean", "greatest", "missing"], rows: rows.collect() }
}

/// A record in one line.
pub(super) fn extent(record: &Record) -> String {
    let Record { samples, begin, end, sample_time, gaps, .. } = record;
    let (begin, end, step) = (number(*begin, 7), number(*end, 7), number(*sample_time, 5));
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

/// What was declared of the parameters.
pub(super) fn declared(report: &Report) -> Table {
    let rows = report.declared.iter().map(|Declared { name, unit, parameter: p }| {
        let bounds = match (p.lower.is_finite(), p.upper.is_finite()) {
            (false, false) => "none".to_owned(),
            _ => format!("{} … {}", number(p.lower, 6), number(p.upper, 6)),
        };
        let prior = p.prior.map_or("none".to_owned(), |prior| format!("{} ± {}", prior.mean, prior.std));
        let mut kind = if p.free { "free".to_owned() } else { "fixed".to_owned() };
        if p.transform == Transform::Log {
            kind += ", as its logarithm";
        }
        if p.per_experiment {
            kind += ", one per experiment";
        }
        row([name, &kind, &format!("{:?}", p.start), unit, &bounds, &prior])
    });
    Table { columns: &["parameter", "declared", "start", "unit", "bounds", "prior"], rows: rows.collect() }
}

/// How the estimate was made.
pub(super) fn settings(report: &Report) -> Table {
    let m = &report.method;
    let rows = [
        ("optimizer", &m.optimizer),
        ("prediction", &m.predictor),
        ("integrator", &m.integrator),
        ("loss", &m.loss),
        ("weighting", &m.weighting),
        ("pre-filter", &m.prefilter),
        ("noise", &m.noise),
        ("covariance", &m.covariance),
        ("greybox version", &m.version),
    ];
    Table { columns: &["setting", "value"], rows: rows.map(|(name, value)| row([name, value])).to_vec() }
}

/// Sums and criteria.
pub(super) fn figures(report: &Report) -> Table {
    let f = &report.figures;
    let mut rows = vec![
        row(["cost", &number(f.cost, 8)]),
        row(["measurements", &f.measurements.to_string()]),
        row(["unknowns", &report.unknowns.len().to_string()]),
    ];
    for (name, value) in
        [("deviance", f.deviance), ("AIC", f.aic), ("AICc", f.aicc), ("BIC", f.bic), ("final prediction error", f.fpe)]
    {
        rows.extend(value.map(|value| row([name, &number(value, 8)])));
    }
    rows.push(row(["iterations", &f.iterations.to_string()]));
    rows.push(row(["passes with slopes", &f.evaluations.to_string()]));
    rows.push(row(["time", &format!("{} s", number(f.seconds, 3))]));
    Table { columns: &["figure", "value"], rows }
}

fn row<const N: usize>(cells: [&str; N]) -> Vec<String> {
    cells.map(str::to_owned).to_vec()
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

/// Moves are the same if they differ by less than this part.
const SAME: f64 = 0.02;

/// What cannot be told apart, in the words that fit the case: a common shift, a common factor, a product.
pub(super) fn together(direction: &Direction, unknowns: &[Unknown]) -> String {
    let of = |name: &str| unknowns.iter().find(|unknown| unknown.name == name);
    let absolute: Option<Vec<(f64, &Unknown)>> = direction
        .moves
        .iter()
        .map(|(name, by)| {
            of(name).map(|unknown| (if unknown.value == 0.0 { *by } else { by * unknown.value.abs() }, unknown))
        })
        .collect();
    let Some(absolute) = absolute.filter(|moves| moves.len() > 1) else { return direction.to_string() };
    let names: Vec<String> = direction.moves.iter().map(|(name, _)| format!("`{name}`")).collect();
    let names = listed(&names);
    let same = |sizes: &mut dyn Iterator<Item = f64>| {
        let (low, high) = sizes.fold((f64::INFINITY, 0.0f64), |(low, high), size| (low.min(size), high.max(size)));
        low > (1.0 - SAME) * high
    };
    let unit = &absolute[0].1.unit;
    if same(&mut absolute.iter().map(|(by, _)| by.abs())) && absolute.iter().all(|(_, unknown)| unknown.unit == *unit) {
        let moves = absolute.iter().map(|(by, unknown)| format!("`{}` {}1 {unit}", unknown.name, plus(*by)));
        let moves: Vec<String> = moves.map(|text| text.trim_end().to_owned()).collect();
        return format!(
            "{names} are known only up to a common shift: {} together change no prediction",
            listed(&moves)
        );
    }
    if same(&mut direction.moves.iter().map(|(_, by)| by.abs())) && absolute.iter().all(|(_, u)| u.value != 0.0) {
        let up = direction.moves.iter().filter(|(_, by)| *by > 0.0).count();
        if up == 0 || up == direction.moves.len() {
            return format!("{names} are known only up to a common factor");
        }
        if direction.moves.len() == 2 {
            return format!("{names} are known only as their product");
        }
    }
    direction.to_string()
}

fn plus(by: f64) -> &'static str {
    if by < 0.0 { "−" } else { "+" }
}

/// `a, b and c`.
fn listed(names: &[String]) -> String {
    match names {
        [] => String::new(),
        [one] => one.clone(),
        [most @ .., last] => format!("{} and {last}", most.join(", ")),
    }
}

/// Pieces of a sentence: plain text and, between backticks, names.
pub(super) fn pieces(text: &str) -> impl Iterator<Item = (bool, &str)> {
    text.split('`').enumerate().map(|(i, piece)| (i % 2 == 1, piece))
}
