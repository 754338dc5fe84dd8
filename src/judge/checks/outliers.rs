//! Whether a few errors far beyond the others decide a fit with a squared loss.

use super::*;
use crate::judge::checks::dropouts;
use crate::judge::checks::suspicions::is_named;
use crate::outliers::{center_and_deviation, hampel};
use crate::problem::Free;
use crate::residuals::first_errors::{self, Errors};
use crate::residuals::largest::chance;

pub(crate) const OUTLIERS: Check = Check::new(
    "no error is far beyond the others",
    "Where the kurtosis is that of heavy tails: do errors far from all and from their neighbors make a part of \
     the sum of squares (Hampel's test), or were values held where none arrived? Else: is the largest error no \
     chance among normal ones (Grubbs 1950)? With a loss, where noise levels are estimated beside it.",
    &[WarningCode::Outliers, WarningCode::Frozen],
    |evidence, _| {
        let without =
            || heavy(evidence).contains(&true).then(|| first_errors::left_out(evidence.point.objective)).flatten();
        match evidence.ruled_out(&[Unless::Weighed]) {
            None => Examined::from(outliers(evidence)).without(without()),
            Some(_) if levels_follow(evidence) => Examined::from(beside_levels(evidence)).without(without()),
            reason => Examined::from(None).without(reason),
        }
    },
)
.unless(&[Unless::RoundOff])
.levels(&[
    level("the kurtosis, in its standard deviations", HEAVY, "one in two million"),
    level("robust standard deviations of an outlier", FAR, "one in two million normal errors"),
    level("the part of the sum of squares of a note", LITTLE, "a tenth"),
    level("the part of care", DECIDE, "a half"),
    level("the probability of the largest error", LEVEL, "one good output in a thousand"),
]);

/// Single errors are examined if the kurtosis exceeds that of a normal distribution by this many of its standard deviations.
const HEAVY: f64 = 5.0;
/// Robust standard deviations from which on an error counts as an outlier: one of two million normal ones is.
const FAR: f64 = 5.0;
/// Samples to either side with which an error is compared, too, so that slow changes of the noise level count as none.
const NEIGHBORS: usize = 10;
/// Outliers that make more than `DECIDE` of the sum of squares are with care, those that make more than `LITTLE` a note.
const DECIDE: f64 = 0.5;
const LITTLE: f64 = 0.1;
/// Level of the test of the largest error.
const LEVEL: f64 = 1e-3;

/// Which outputs have errors with heavy tails.
fn heavy(evidence: &Evidence<'_>) -> Vec<bool> {
    let of = |j: usize| is_heavy(evidence.residuals.kurtosis[j], evidence.residuals.outputs[j].samples);
    (0..evidence.point.objective.outputs()).map(of).collect()
}

/// Outputs whose errors have outliers, or measurements that were held, of a fit by their squares.
fn outliers(evidence: &Evidence<'_>) -> Vec<Warning> {
    let objective = evidence.point.objective;
    let heavy = heavy(evidence);
    let of = |j: usize| {
        let residuals = &evidence.residuals;
        let predicted = evidence.point.objective.sweep.predicts_variance();
        let compared = if predicted { &residuals.standardized_errors } else { &residuals.first_errors };
        let all: Vec<f64> =
            unsuspected(evidence, j, compared).into_iter().flatten().filter(|error| !error.is_nan()).collect();
        dropouts::dropouts_of(evidence, j, &unsuspected(evidence, j, &residuals.first_errors))
            .or_else(|| outliers_of(evidence, j, &all))
    };
    let heavy = |j: usize| if heavy[j] { of(j) } else { None };
    (0..objective.outputs()).filter_map(|j| heavy(j).or_else(|| extreme(evidence, j))).collect()
}

/// Whether a loss reduces the weight of errors by which noise levels are estimated, too.
fn levels_follow(evidence: &Evidence<'_>) -> bool {
    let objective = evidence.point.objective;
    let levels = objective.sweep.levels();
    let is_level = |free: &Free| matches!(free.role, Role::Parameter(place) if levels.contains(&place));
    objective.is_robust() && !objective.is_weighted() && objective.problem.unknowns.row.iter().any(is_level)
}

/// Outliers of a filter with a robust loss. The likelihood takes what is left of them as noise, and the gain of the filter follows from it.
fn beside_levels(evidence: &Evidence<'_>) -> Vec<Warning> {
    let heavy = heavy(evidence);
    let of = |j: usize| {
        let errors = unsuspected(evidence, j, &evidence.residuals.standardized_errors).into_iter().flatten();
        let errors: Vec<f64> = errors.filter(|error| !error.is_nan()).collect();
        let (count, share) = far_errors(&errors).filter(|(_, share)| *share > DECIDE)?;
        let text = format!(
            "{} of the errors of `{}` are beyond {FAR} robust standard deviations, of all and of their neighbors, and make {} of the sum of squares: \
             the loss keeps them from the state, but noise levels and with them all intervals still follow from them; mark these samples as \
             missing, or give the noise levels",
            percent(count as f64 / errors.len() as f64, 2),
            evidence.point.objective.problem.layout().outputs[j].name,
            percent(share, 2)
        );
        Some(with_care(WarningCode::Outliers, text).about(About::Output(j)))
    };
    (0..heavy.len()).filter(|j| heavy[*j]).filter_map(of).collect()
}

/// The first errors of an output, record by record, without those of samples that the look at its column names.
fn unsuspected(evidence: &Evidence<'_>, j: usize, first: &[Errors]) -> Vec<Vec<f64>> {
    let of = |(e, one): (usize, &Errors)| {
        let errors = one[j].iter().enumerate();
        errors.map(|(k, error)| if is_named(evidence, e, j, k) { f64::NAN } else { *error }).collect()
    };
    first.iter().enumerate().map(of).collect()
}

fn outliers_of(evidence: &Evidence<'_>, j: usize, errors: &[f64]) -> Option<Warning> {
    let (count, share) = far_errors(errors)?;
    let output = &evidence.point.objective.problem.layout().outputs[j].name;
    let text = format!(
        "{} of the errors of `{output}` are beyond {FAR} robust standard deviations, of all and of their neighbors, and make {} of the sum of squares: outliers, \
         or moments that the model misses; take a robust loss (Huber, Tukey), or mark these samples as missing",
        percent(count as f64 / errors.len() as f64, 2),
        percent(share, 2)
    );
    let severity = if share > DECIDE { Severity::UsableWithCare } else { Severity::Usable };
    Some(Warning::new(WarningCode::Outliers, severity, text).about(About::Output(j)))
}

/// The largest error of an output, if normal ones are hardly so large.
fn extreme(evidence: &Evidence<'_>, j: usize) -> Option<Warning> {
    let (fit, largest) = (&evidence.residuals.outputs[j], evidence.residuals.largest[j]);
    let count = fit.samples as f64;
    let named = is_named(evidence, largest.experiment, j, largest.sample);
    if fit.rmse <= 0.0 || named {
        return None;
    }
    // Errors that are divided by their predicted deviations.
    let rmse = if evidence.point.objective.sweep.predicts_variance() { 1.0 } else { fit.rmse };
    let (ratio, chance) = chance(largest.error, rmse, count);
    if !ratio.is_finite() || chance >= LEVEL {
        return None;
    }
    let problem = evidence.point.objective.problem;
    let text = format!(
        "the error of `{}` at t = {} of `{}` is {} times the deviation of all others ({} for the largest of {count} normal \
         errors): look at this measurement, and mark it as missing if it is wrong",
        problem.layout().outputs[j].name,
        problem.records[largest.experiment].moment(largest.sample),
        problem.unknowns.labels[largest.experiment],
        number(ratio, 3),
        p_value(chance)
    );
    Some(note(WarningCode::Outliers, text).about(About::Output(j)))
}

/// How many errors are far from the others and from their neighbors, and their part of the sum of squares, if it is no little.
fn far_errors(errors: &[f64]) -> Option<(usize, f64)> {
    let (_, deviation) = center_and_deviation(&mut errors.to_vec())?;
    let far = hampel(&mut errors.to_vec(), NEIGHBORS, FAR, FAR * deviation);
    let squares = |errors: &mut dyn Iterator<Item = f64>| errors.map(|error| error * error).sum::<f64>();
    let share = squares(&mut far.iter().map(|k| errors[*k])) / squares(&mut errors.iter().copied());
    (deviation > 0.0 && share > LITTLE).then_some((far.len(), share))
}

/// Whether a kurtosis is beyond that of so many normal errors, whose variance is `24 / n`.
fn is_heavy(kurtosis: f64, samples: u64) -> bool {
    kurtosis > 3.0 + HEAVY * (24.0 / samples.max(1) as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::{far_errors, is_heavy};

    /// Of 600 errors the deviation is 0.2.
    #[test]
    fn tails_are_heavy_beyond_five_deviations() {
        assert!(is_heavy(4.01, 600) && !is_heavy(3.99, 600) && !is_heavy(3.0, 0));
    }

    /// In whatever unit: errors of -1, 0 and 1 in turn, whose robust deviation is 1.4826, after calm ones of a tenth. Of the calm ones
    /// one of 6 is far from its neighbors only, and 7.3 is not yet five deviations; 7.5 and -8 are.
    #[test]
    fn errors_far_from_all_and_from_their_neighbors() {
        for unit in [1e-6, 1.0, 1e6] {
            let error = |k: usize| unit * (k % 3) as f64 - unit;
            let mut errors: Vec<f64> = (0..201).map(|k| if k < 40 { 0.1 * error(k) } else { error(k) }).collect();
            let calm = errors[20];
            (errors[20], errors[90]) = (6.0 * unit, 7.3 * unit);
            assert_eq!(far_errors(&errors), None);
            (errors[20], errors[60], errors[90]) = (calm, 7.5 * unit, -8.0 * unit);
            let (count, share) = far_errors(&errors).unwrap();
            // Squares of the others that are not zero: 105 of one, and 27 of a tenth.
            let (far, others) = (7.5 * 7.5 + 8.0 * 8.0, 105.0 + 0.27);
            assert!(count == 2 && (share - far / (far + others)).abs() < 1e-12, "{count} {share}");
        }
        assert_eq!(far_errors(&[]), None);
        assert_eq!(far_errors(&[0.0, 0.0, 0.0, 1.0]), None);
    }
}
