//! Warnings about unknowns whose intervals rest on one or two measurements.

use super::*;
use crate::covariance::shares::{DECIDES, Share, part};
use crate::estimate::CovarianceMethod;
use crate::rows::{Asked, rows};

pub(crate) const DECIDED: Check = Check::new(
    "no measurement decides an interval",
    "Does one measurement, or do two together, make most of the variance of an unknown?",
    &[WarningCode::DecidedByFew],
    |evidence, intervals| {
        let long = intervals.covariances.shares.is_none() && evidence.residuals.measured > MOST;
        Examined::unless(long.then_some("more than 200 measurements"), || {
            decided_by_few(evidence, &intervals.unknowns, &intervals.covariances)
        })
    },
)
.unless(&[Unless::Prefilter, Unless::RoundOff, Unless::Variances])
.costs(&[Pass::Rows])
.levels(&[level("the part of the variance", DECIDES, "nine tenths")]);

/// Fits of more measurements are not examined if that takes a pass of its own.
const MOST: u64 = 200;

/// The unknown whose interval rests most on one or two measurements: a parameter, or with a sandwich any.
fn decided_by_few(evidence: &Evidence<'_>, unknowns: &[Unknown], covariances: &Covariances) -> Option<Warning> {
    let examined;
    let largest = match (&covariances.shares, evidence.unit()) {
        (Some(largest), _) => largest,
        (None, Some(unit)) => {
            let asked = Asked { shares: Some(unit), ..Asked::default() };
            (examined, _) = rows(evidence.point.objective, &evidence.point.end.coordinates, asked).shares?;
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
    Some(note(WarningCode::DecidedByFew, text).about(About::Unknown(i)))
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
