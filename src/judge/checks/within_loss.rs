//! Whether enough errors are where a robust loss is curved.
//!
//! The curvature of the cost is the mean of `psi'` over all errors times that of the squares. With a constant far below the noise few
//! errors are within it, or positive and negative slopes cancel: then the mean depends on few errors, and so do the standard errors.

use super::*;

pub(crate) const LOSS: Check = Check::new(
    "the loss is wide enough",
    "How well do the errors within a robust loss determine its mean curvature?",
    &[WarningCode::NarrowLoss],
    |evidence, _| few_within_the_loss(evidence).into(),
)
.costs(&[Pass::Curvature])
.levels(&[
    level("the relative standard deviation of care", CARE, "standard errors are off by as much"),
    level("that is not usable", NONE, "a half"),
]);

/// Relative standard deviation of the curvature above which standard errors are not usable without care, and not at all.
const CARE: f64 = 0.15;
const NONE: f64 = 0.5;

/// A loss with a larger mean curvature is not narrow: in a few measurements that mean is uncertain with any loss.
const NARROW: f64 = 0.5;

/// A warning of a loss whose mean curvature at these errors is too uncertain for standard errors.
fn few_within_the_loss(evidence: &Evidence<'_>) -> Option<Warning> {
    let objective = evidence.point.objective;
    // That of a loss which is not robust is one.
    let [sum, squares, count] = evidence.bread().filter(|_| objective.is_robust())?.slopes_of_influence();
    if sum / count >= NARROW {
        return None;
    }
    let deviation = relative_deviation(sum, squares, count, objective.problem.unknowns.row.len() as f64);
    let severity = match deviation {
        part if part > NONE => Severity::NotUsable,
        part if part > CARE => Severity::UsableWithCare,
        _ => return None,
    };
    let text = format!(
        "the loss is too narrow for these errors: its mean curvature, {} of that of squares, is known {}, and the standard \
         errors with it; take a larger constant, or a larger noise",
        percent(sum / count, 2),
        if deviation.is_finite() { format!("to {} only", percent(deviation, 2)) } else { "not at all".to_owned() }
    );
    Some(Warning { code: WarningCode::NarrowLoss, severity, text })
}

/// The relative standard deviation of a mean of so many numbers of one at most, from their sum and that of their squares, less the
/// `unknowns`: a fit by absolute errors passes through as many measurements. Infinite where nothing is left.
fn relative_deviation(sum: f64, squares: f64, count: f64, unknowns: f64) -> f64 {
    let left = sum - unknowns;
    if left > 0.0 { (squares - sum * sum / count).max(0.0).sqrt() / left } else { f64::INFINITY }
}

#[cfg(test)]
mod tests {
    use super::relative_deviation;

    /// Of 100 errors four within the loss, one of which is that of an unknown: a deviation of `sqrt(4 0.96)` of three; all within: none;
    /// no more than unknowns: infinite.
    #[test]
    fn deviations_by_hand() {
        assert!((relative_deviation(4.0, 4.0, 100.0, 1.0) - (4.0 * 0.96f64).sqrt() / 3.0).abs() < 1e-15);
        assert_eq!(relative_deviation(100.0, 100.0, 100.0, 2.0), 0.0);
        assert_eq!(
            [relative_deviation(2.0, 2.0, 9.0, 2.0), relative_deviation(-1.0, 3.0, 9.0, 0.0)],
            [f64::INFINITY; 2]
        );
    }
}
