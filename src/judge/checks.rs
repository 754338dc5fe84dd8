//! The questions that the verdict asks of an estimate: [`CHECKS`] is their only list.

mod aliases;
mod conditions;
mod constant_inputs;
mod copies;
mod curved;
mod data;
mod data_noise;
mod declared;
mod dropouts;
mod errors;
mod exchanged;
mod explained;
mod feedback;
mod few;
mod filter_order;
mod input_timing;
mod known;
mod likelihood;
mod missing_terms;
mod outliers;
mod parts;
mod restarts;
mod rise;
mod search;
mod sensors;
mod shape;
mod signals_before;
mod simulates;
mod step;
mod suspicions;
#[cfg(test)]
mod tests;
mod twice;
mod weights;
mod within_loss;

pub(crate) use aliases::Aliases;
pub(crate) use search::INDISTINGUISHABLE;

// What the files of the checks name, which they take from here.
use crate::estimate::{About, Examination, Extent, Knowledge, Unknown, Warning, WarningCode};
use crate::judge::check::{Check, Examined, Pass, level, not_usable, note, with_care};
use crate::judge::covariances::Covariances;
use crate::judge::evidence::Evidence;
use crate::judge::evidence::ruled_out::Unless;
use crate::judge::intervals::Intervals;
use crate::numeral::{counted, exact, number, p_value, percent, unit_after};
use crate::problem::{Objective, Role};
use crate::severity::Severity;

/// All checks, in the order in which their warnings are shown.
pub(crate) const CHECKS: &[Check] = &[
    search::ENOUGH,
    data::CONSTANT_OUTPUTS,
    constant_inputs::CONSTANT_INPUTS,
    suspicions::SUSPICIONS,
    data::COARSE,
    suspicions::INPUT_SENTINELS,
    data::MISSING_PART,
    twice::TWICE,
    copies::COPIES,
    explained::UNEXPLAINED,
    explained::GIVEN_NOISE,
    shape::FOLLOWING,
    signals_before::SIGNALS_BEFORE,
    outliers::OUTLIERS,
    parts::PARTS,
    sensors::SENSORS,
    known::NO_ERROR,
    known::ZERO,
    known::PRIORS,
    known::SIGNS,
    known::SIZES,
    likelihood::LIKELIHOOD,
    declared::GAPS,
    declared::GUESSED,
    declared::HELD,
    declared::POSITIVE,
    declared::IDENTIFIED,
    step::STEP,
    filter_order::FILTER_ORDER,
    input_timing::INPUT_TIMING,
    missing_terms::MISSING_TERMS,
    simulates::SIMULATES,
    aliases::ALIASES,
    search::MINIMUM,
    search::STARTS,
    exchanged::EXCHANGED,
    search::CHECKPOINT,
    curved::CURVED,
    conditions::CONDITIONS,
    errors::GROWING,
    few::DECIDED,
    errors::UNEVEN_ERRORS,
    within_loss::LOSS,
    data_noise::RESTARTS,
    data_noise::INPUT_NOISE,
    weights::WEIGHTS,
    errors::COLOR,
    errors::COUPLED,
    search::TIME,
];

/// Why a check of usable estimates is not made of another.
const USELESS: &str = "an estimate that is not usable";

/// The warnings of all checks, and how far each was made.
pub(crate) fn examine(evidence: &Evidence<'_>, intervals: &Intervals) -> (Vec<Warning>, Vec<Examination>) {
    let (control, mut warnings, mut examined) = (evidence.point.objective.control, vec![], vec![]);
    for check in CHECKS {
        let is_useless = || warnings.iter().any(|warning: &Warning| warning.severity == Severity::NotUsable);
        let mut found = match check.of_usable && is_useless() {
            true => Examined::skipped(USELESS),
            false => check.examine(evidence, intervals),
        };
        debug_assert!(found.warnings.iter().all(|warning| check.codes.contains(&warning.code)), "{}", check.name);
        // Passes that are ended find nothing.
        if !check.costs.is_empty() && control.stops() {
            found.extent = Extent::Nothing { because: control.reason().into() };
        }
        warnings.append(&mut found.warnings);
        examined.push(Examination { check: check.name.into(), extent: found.extent });
    }
    (warnings, examined)
}
