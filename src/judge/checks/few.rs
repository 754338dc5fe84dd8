//! Warnings about unknowns whose intervals rest on one or two measurements.

use crate::estimate::{CovarianceMethod, Unknown, Warning, WarningCode};
use crate::judge::check::{Check, Examined, Level, Pass};
use crate::judge::covariances::Covariances;
use crate::judge::evidence::rows::{Asked, rows};
use crate::judge::evidence::shares::{DECIDES, Share, part};
use crate::judge::evidence::{Evidence, PREFILTER, ROUND_OFF};
use crate::judge::intervals::Intervals;
use crate::numeral::percent;
use crate::optimize::Severity;
use crate::problem::Role;

pub(crate) const DECIDED: Check = Check {
    name: "no measurement decides an interval",
    asks: "Does one measurement, or do two together, make most of the variance of an unknown?",
    codes: &[WarningCode::DecidedByFew],
    costs: &[Pass::Rows],
    levels: &[Level { of: "the part of the variance", value: DECIDES, source: "nine tenths" }],
    examine: |evidence, intervals| {
        Examined::unless(skipped(evidence, intervals), || {
            decided_by_few(evidence, &intervals.unknowns, &intervals.covariances)
        })
    },
};

/// Fits of more measurements are not examined if that takes a pass of its own.
const MOST: u64 = 200;

/// Why that is not examined.
fn skipped(evidence: &Evidence<'_>, intervals: &Intervals) -> Option<&'static str> {
    let objective = evidence.point.objective;
    let long = intervals.covariances.shares.is_none() && evidence.residuals.measured > MOST;
    match () {
        _ if objective.problem.settings.prefilter.is_some() => Some(PREFILTER),
        _ if evidence.rounding || evidence.point.is_exact() => Some(ROUND_OFF),
        _ if objective.sweep.predicts_variance() => Some("variances are predicted"),
        _ => long.then_some("more than 200 measurements"),
    }
}

/// The unknown whose interval rests most on one or two measurements: a parameter, or with a sandwich any.
fn decided_by_few(evidence: &Evidence<'_>, unknowns: &[Unknown], covariances: &Covariances) -> Option<Warning> {
    let examined;
    let largest = match (&covariances.shares, evidence.unit()) {
        (Some(largest), _) => largest,
        (None, Some(unit)) if evidence.residuals.measured <= MOST => {
            examined = rows(
                evidence.point.objective,
                &evidence.point.end.coordinates,
                Asked { shares: Some(unit), ..Asked::default() },
            )
            .shares?
            .0;
            &examined
        }
        _ => return None,
    };
    let assumed = covariances.method != CovarianceMethod::Sandwich;
    let known = |i: &usize| unknowns[*i].knowledge.standard_error().is_some();
    let counts = |i: &usize| known(i) && (!assumed || matches!(unknowns[*i].role, Role::Parameter(_)));
    let decided = (0..unknowns.len()).filter(counts).filter_map(|i| Some((i, largest[i].decisive()?)));
    let (i, shares) = decided.max_by(|a, b| part(a.1).total_cmp(&part(b.1)))?;
    let noise = match assumed {
        true => "whose noise is taken to be that of all",
        false => "whose noise is taken to be up to some three times that of all",
    };
    let text = format!(
        "the interval of `{}` rests by {} on {}, {noise}: errors there do not tell, since the fit passes through them; \
         measure more of the kind",
        unknowns[i].name,
        percent(part(shares), 2),
        places(evidence, shares)
    );
    Some(Warning { code: WarningCode::DecidedByFew, severity: Severity::Usable, text })
}

/// Outputs, times and experiments of measurements.
fn places(evidence: &Evidence<'_>, shares: &[Share]) -> String {
    let problem = evidence.point.objective.problem;
    let place = |share: &Share| {
        format!(
            "`{}` at t = {} of `{}`",
            problem.layout().outputs[share.output].name,
            problem.records[share.experiment].moment(share.sample),
            problem.unknowns.labels[share.experiment]
        )
    };
    shares.iter().map(place).collect::<Vec<_>>().join(" and ")
}
