//! All that is needed to make the estimate again.

use crate::estimate::ParameterEstimate;
use crate::numeral::{exact, number};
use crate::parameter::{Parameter, Transform};
use crate::report::facts::Facts;
use crate::section::{Cell, Section, Table};

pub(super) fn section(facts: &Facts) -> Section {
    let parameters = Section::new("declared", "What was declared of the parameters").table(declared(facts)).folded();
    let section = Section::new("reproduce", "To reproduce").table(settings(facts)).table(figures(facts));
    section.part(Some(parameters).filter(|part| !part.is_empty()))
}

fn declared(facts: &Facts) -> Table {
    let rows = facts.estimate.parameters.iter().map(|ParameterEstimate { name, unit, declared: p, .. }| {
        let bounds = match (p.lower.is_finite(), p.upper.is_finite()) {
            (false, false) => String::new(),
            (true, false) => format!("{} or more", exact(p.lower)),
            (false, true) => format!("{} or less", exact(p.upper)),
            (true, true) => format!("{} … {}", exact(p.lower), exact(p.upper)),
        };
        let prior = p.prior.map_or(String::new(), |prior| format!("{} ± {}", exact(prior.mean), exact(prior.std)));
        let start = Cell::number(p.start, 15);
        [name.as_str().into(), kind(p).into(), start, unit.as_str().into(), bounds.into(), prior.into()]
    });
    let columns = ["parameter", "declared", "start", "unit", "bounds", "prior"];
    Table::new("What was declared of the parameters", columns).rows(rows)
}

fn kind(parameter: &Parameter) -> String {
    let mut kind = if parameter.free { "free".to_owned() } else { "fixed".to_owned() };
    if parameter.transform == Transform::Log {
        kind += ", as its logarithm";
    }
    if parameter.positive {
        kind += ", positive";
    }
    if parameter.per_experiment {
        kind += ", one per experiment";
    }
    kind
}

/// How the estimate was made.
fn settings(facts: &Facts) -> Table {
    let m = &facts.estimate.method;
    let mut holds: Vec<&str> = facts.records.iter().map(|record| record.hold.as_str()).collect();
    holds.dedup();
    let hold = match holds.as_slice() {
        [one] => (*one).to_owned(),
        several => several
            .iter()
            .enumerate()
            .map(|(i, hold)| format!("{} {hold}", i + 1))
            .take(5)
            .collect::<Vec<_>>()
            .join("; "),
    };
    let (noise, covariance) = (m.noise.to_string(), m.covariance.to_string());
    let rows = [
        ("model", facts.model.as_str()),
        ("hold", &hold),
        ("optimizer", &m.optimizer),
        ("prediction", &m.predictor),
        ("integrator", &m.integrator),
        ("equations", &m.engine),
        ("loss", &m.loss),
        ("weighting", &m.weighting),
        ("pre-filter", &m.prefilter),
        ("noise", &noise),
        ("covariance", &covariance),
        ("greybox version", &m.version),
    ];
    Table::new("Settings", ["setting", "value"]).rows(rows.map(|(name, value)| [name.into(), value.into()]))
}

/// Sums and criteria.
fn figures(facts: &Facts) -> Table {
    let s = &facts.estimate;
    let counts = [("measurements", s.measurements), ("unknowns", s.unknowns.len() as u64)];
    let criteria = [
        ("log-likelihood", s.log_likelihood),
        ("deviance", s.deviance),
        ("AIC", s.aic()),
        ("AICc", s.aicc()),
        ("BIC", s.bic()),
        ("final prediction error", s.fpe()),
    ];
    let criteria = criteria.into_iter().filter_map(|(name, value)| Some((name, Cell::number(value?, 7))));
    let work = [("iterations", s.iterations), ("passes with slopes", s.evaluations)];
    let seconds = Cell::Number { value: s.seconds, text: format!("{} s", number(s.seconds, 2)) };
    let rows = [("cost", Cell::number(s.cost, 7))].into_iter().chain(counts.map(|(name, count)| (name, count.into())));
    let rows = rows.chain(criteria).chain(work.map(|(name, count)| (name, count.into()))).chain([("time", seconds)]);
    Table::new("Figures", ["figure", "value"]).rows(rows.map(|(name, value)| [name.into(), value]))
}
