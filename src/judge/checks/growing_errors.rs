//! Warnings about standard errors that grow with the unknown itself, as those of noise levels do.

use crate::estimate::{Unknown, Warning, WarningCode};
use crate::judge::check::{Check, Examined, Level};
use crate::judge::covariances::Covariances;
use crate::numeral::percent;
use crate::optimize::Severity;
use crate::parameter::Transform;

pub(crate) const GROWING: Check = Check {
    name: "standard errors do not grow with their unknown",
    asks: "Where variances are predicted: does the standard error of an unknown, such as a noise level, grow along its interval?",
    codes: &[WarningCode::CurvedInterval],
    costs: &[],
    levels: &[Level {
        of: "the change of the logarithm of its variance over a standard error",
        value: UNEVEN,
        source: "a relative standard error of 15 %",
    }],
    examine: |evidence, intervals| {
        let many = intervals.covariances.own.is_empty() && evidence.point.objective.sweep.predicts_variance();
        Examined::unless(many.then_some("more than 12 unknowns beside predicted variances"), || {
            uneven(&intervals.unknowns, &intervals.covariances)
        })
    },
};

/// Change of the logarithm of an unknown's variance over one standard error of the unknown, from which on a symmetric interval is
/// named. For a noise level the change is twice its relative standard error, so that 0.3 is 15 % (see docs/intervals.md).
const UNEVEN: f64 = 0.3;

/// An unknown, such as a noise level, whose interval should reach further above than below.
fn uneven(unknowns: &[Unknown], covariances: &Covariances) -> Option<Warning> {
    let eligible =
        |i: usize| unknowns[i].transform == Transform::Identity && unknowns[i].knowledge.standard_error().is_some();
    let own = covariances.own.iter().enumerate().filter(|(i, own)| own.is_finite() && eligible(*i));
    let (i, own) = own.max_by(|a, b| a.1.total_cmp(b.1))?;
    if *own <= UNEVEN {
        return None;
    }
    let unknown = &unknowns[i];
    let text = format!(
        "the standard error of `{}` grows with its value, by {} per standard error: its interval is too short above; \
         estimate its logarithm (.log())",
        unknown.name,
        percent(0.5 * own, 2)
    );
    Some(Warning { code: WarningCode::CurvedInterval, severity: Severity::Usable, text })
}
