//! Warnings about the order of a filter of a model that is not affine in its state.

use super::step::{Shift, shift};
use super::*;

pub(crate) const FILTER_ORDER: Check = Check::new(
    "a filter of second order changes nothing",
    "By how many standard errors would an unknown move, if the filter took the model's curvature within the standard deviation of the state \
     into account? A choice that depends on the state (dry friction, a limit, a table) has none, and asks for care.",
    &[WarningCode::FilterOrder],
    filter_order,
)
.costs(&[Pass::Slopes(1)])
.levels(&[
    level("the states of a model that is examined", MOST as f64, "third derivatives grow by the fourth power"),
    level("standard errors from which on care is needed", CARE, "half of one: intervals of 95 % then cover 92 %"),
    level("standard errors from which on intervals mean nothing", FAR, "two: they cover half"),
]);

const MOST: usize = 8;
const CARE: f64 = 0.5;
const FAR: f64 = 2.0;

/// Whether an unknown of a fit by the extended filter would move by that of second order.
fn filter_order(evidence: &Evidence<'_>, intervals: &Intervals) -> Examined {
    let objective = evidence.point.objective;
    let chooses = objective.sweep.linearizes_choices().then(|| {
        let text = "the model chooses by its state (an `if`, a limit, an absolute value, a place in a table), and the filter takes the choice \
                    at the mean of the state for all of its standard deviation: estimates and intervals may be far off; write the choice in a \
                    smooth form (a `tanh`), so that this can be tested, or compare with a simulation";
        with_care(WarningCode::FilterOrder, text.to_owned())
    });
    let many = objective.problem.layout().states.len() > MOST;
    let closer = (!many).then(|| objective.sweep.second_order()).flatten();
    let part = (many && objective.sweep.predicts_variance()).then_some("models of more than 8 states");
    let Some(closer) = closer else { return Examined::from(chooses).without(part) };
    let advice = "fit with SecondOrder, or measure more often";
    let warning = match shift(evidence, &objective.of(objective.problem, &*closer), &intervals.unknowns) {
        Some(Shift { errors, .. }) if errors < CARE => None,
        Some(Shift { of, errors, .. }) if errors.is_finite() => {
            let warning = if errors >= FAR { not_usable } else { with_care };
            let text = format!(
                "the model is curved within the standard deviation of its state, which the extended filter does not take into account: a \
                 filter of second order would change {of} by {} standard errors; {advice}",
                number(errors, 2)
            );
            Some(warning(WarningCode::FilterOrder, text))
        }
        _ => {
            let text = format!("a filter of second order fails at the estimate of the extended filter; {advice}");
            Some(with_care(WarningCode::FilterOrder, text))
        }
    };
    chooses.into_iter().chain(warning).collect::<Vec<_>>().into()
}
