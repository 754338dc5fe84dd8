//! The tables of a report, which every form of it shares.

use super::words::sign;
use super::{Declared, Record, Report, Role};
use crate::diagnose::{Bootstrap, End, Profile, Test};
use crate::estimate::{Knowledge, Unknown, number};
use crate::optimize::Severity;
use crate::parameter::Transform;

/// A table: names of the columns, and rows of as many cells; the first cell of a row names it.
pub(super) struct Table {
    pub(super) columns: &'static [&'static str],
    pub(super) rows: Vec<Vec<String>>,
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

/// Tests and their results; what each means stands where it failed.
pub(super) fn tests<'a>(tests: impl IntoIterator<Item = &'a Test>) -> Table {
    let rows = tests.into_iter().map(|test| {
        let (severity, verdict) = match test.passed {
            true => (Severity::Usable, "passes"),
            false => (Severity::UsableWithCare, "fails"),
        };
        let meaning = if test.passed { String::new() } else { plain(&test.meaning) };
        row([&plain(&test.name), &test.probability(), &format!("{} {verdict}", sign(severity)), &meaning])
    });
    Table { columns: &["test", "probability", "result", "meaning"], rows: rows.collect() }
}

fn plain(text: &str) -> String {
    text.replace('`', "")
}

/// Where each unknown is excited.
pub(super) fn excitation(report: &Report) -> Table {
    let rows = report.identifiability.excitation.iter().map(|excited| {
        let through = excited.outputs.iter().filter(|(_, share)| *share >= 5e-4);
        let through: Vec<String> =
            through.map(|(output, share)| format!("{output} {} %", number(100.0 * share, 3))).collect();
        row([&excited.name, &number(excited.strength / 100.0, 3), &through.join(", ")])
    });
    Table { columns: &["unknown", "σ of noise per 1 %", "seen through"], rows: rows.collect() }
}

/// Intervals by likelihood profiles.
pub(super) fn profiles(report: &Report) -> Table {
    let rows = report.profiles.iter().map(|profile| {
        let Profile { name, unit, value, probability, .. } = profile;
        let probability = format!("{} %", (1e4 * probability).round() / 100.0);
        row([name, &number(*value, 6), unit, &probability, &ends(profile)])
    });
    Table { columns: &["profile of", "estimate", "unit", "probability", "interval"], rows: rows.collect() }
}

/// The interval of a profile, and how it ends.
pub(super) fn ends(profile: &Profile) -> String {
    let end = |end: End| match end {
        End::At(value) => number(value, 6),
        End::Bound(value) => format!("{} (bound)", number(value, 6)),
        End::Open(value) => format!("open beyond {}", number(value, 4)),
    };
    format!("{} … {}", end(profile.lower), end(profile.upper))
}

/// What refits of resampled records found.
pub(super) fn bootstrap(found: &Bootstrap) -> Table {
    let rows = found.unknowns.iter().zip(&found.standard_errors).zip(found.bias.iter().zip(&found.intervals));
    let rows = rows.map(|((name, error), (bias, (lower, upper)))| {
        let interval = format!("{} … {}", number(*lower, 6), number(*upper, 6));
        row([name, &number(*error, 3), &number(*bias, 2), &interval])
    });
    Table { columns: &["unknown", "std. error", "bias", "95 % interval"], rows: rows.collect() }
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
        ("optimizer", m.optimizer.clone()),
        ("prediction", m.predictor.clone()),
        ("integrator", m.integrator.clone()),
        ("loss", m.loss.clone()),
        ("weighting", m.weighting.clone()),
        ("pre-filter", m.prefilter.clone()),
        ("noise", m.noise.to_string()),
        ("covariance", m.covariance.to_string()),
        ("greybox version", m.version.clone()),
    ];
    Table { columns: &["setting", "value"], rows: rows.map(|(name, value)| row([name, &value])).to_vec() }
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
