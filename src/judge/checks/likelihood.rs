//! Warnings about a likelihood without a maximum.

use super::*;

pub(crate) const LIKELIHOOD: Check = Check::new(
    "the likelihood is bounded",
    "Is a predicted standard deviation nothing beside the errors?",
    &[WarningCode::UnboundedLikelihood],
    |evidence, _| unbounded(evidence).into(),
)
.levels(&[level("the standard deviation, in errors", ZERO_DEVIATION, "a millionth")]);

/// A predicted standard deviation below this fraction of the errors counts as zero.
const ZERO_DEVIATION: f64 = 1e-6;

/// Whether a predicted variance goes to zero: there the likelihood has no maximum.
fn unbounded(evidence: &Evidence<'_>) -> Option<Warning> {
    let of = |j: usize| (evidence.residuals.least_sigma[j], evidence.residuals.outputs[j].rmse);
    let j = (0..evidence.residuals.least_sigma.len()).find(|&j| is_nothing(of(j)))?;
    let (output, (least_sigma, rmse)) = (&evidence.point.objective.problem.layout().outputs[j], of(j));
    let free =
        evidence.point.objective.problem.unknowns.row.iter().any(|one| matches!(one.role, Role::InitialState(_)));
    let (cause, remedy) = match free {
        true => ("a free initial state fits the first measurement exactly", "fix the initial state"),
        false => ("such as a first one that equals the initial state", "leave out what is predicted exactly (NaN)"),
    };
    let text = format!(
        "a measurement of `{}` is predicted with a standard deviation of {}{unit}, beside errors of {}{unit}: the \
         likelihood grows without bound ({cause}); give the noise a lower bound, or {remedy}",
        output.name,
        number(least_sigma, 2),
        number(rmse, 2),
        unit = unit_after(&output.unit)
    );
    Some(not_usable(WarningCode::UnboundedLikelihood, text))
}

/// Whether a predicted standard deviation is nothing beside the root mean square of the errors.
fn is_nothing((sigma, rmse): (f64, f64)) -> bool {
    sigma < ZERO_DEVIATION * rmse
}

#[cfg(test)]
mod tests {
    use super::is_nothing;

    /// A millionth, of large errors and of small ones.
    #[test]
    fn deviations_of_nothing() {
        for rmse in [1e-3, 1e3] {
            assert!(is_nothing((0.99e-6 * rmse, rmse)) && !is_nothing((1.01e-6 * rmse, rmse)));
        }
        assert!(!is_nothing((0.0, 0.0)) && !is_nothing((f64::INFINITY, 1.0)));
    }
}
