//! Inputs that never move.

use super::*;
use crate::covariance::directions::{taking_part, undetermined};
use crate::judge::checks::data::{constant, inspected};
use crate::judge::evidence::extended::Extended;
use crate::record::{Inspection, Record};
use crate::rows::sensors::{KINDS, Kind};
use std::sync::Arc;

pub(crate) const CONSTANT_INPUTS: Check = Check::new(
    "inputs move",
    "Has an input one value throughout, and would a parameter that acts by way of it be far less known if each \
     output might have an offset?",
    &[WarningCode::ConstantInput],
    |evidence, _| constant_inputs(evidence, &inspected(evidence)).into(),
)
.costs(&[Pass::Slopes(2)])
.levels(&[
    level("the slopes of such a parameter without the input, in those with it", NO_EFFECT, "a tenth"),
    level("its standard error with offsets, in that without", REPLACED, "a tenth of the information"),
]);

/// A parameter whose slopes are below this part of themselves without an input acts by way of that input; one whose standard error is so many
/// times larger where an output may have an offset can hardly be told from it.
const NO_EFFECT: f64 = 0.1;
const REPLACED: f64 = 3.0;

/// Inputs that never move, with the parameters that act by way of them and would be far less known if an output had an offset: where an
/// input multiplies what moves, its effect is no offset.
fn constant_inputs(evidence: &Evidence<'_>, found: &[Arc<Inspection>]) -> Vec<Warning> {
    let inputs = evidence.point.objective.problem.layout().inputs.iter().enumerate();
    let constant = inputs.filter_map(|(i, input)| Some((i, input, constant(found, |one| &one.inputs[i])?)));
    let constant: Vec<(usize, &crate::layout::Quantity, f64)> = constant.collect();
    let acts = constant.iter().any(|(_, _, value)| *value != 0.0);
    let growth = if acts { growth_by_offsets(evidence) } else { None };
    let one = |&(i, input, value): &(usize, &crate::layout::Quantity, f64)| {
        let is = format!("the input `{}` is {}{} throughout", input.name, exact(value), unit_after(&input.unit));
        let (severity, what) = match (value == 0.0, &growth) {
            (true, _) => (Severity::Usable, "what it does is not seen".to_owned()),
            (_, None) => (Severity::UsableWithCare, "what it drives may not be told from an offset".to_owned()),
            (_, Some(growth)) => {
                let (name, growth) = most_by_offsets(evidence, i, growth)?;
                let times = if growth.is_finite() {
                    format!("known {} times less", number(growth, 2))
                } else {
                    "unknown".to_owned()
                };
                (
                    Severity::UsableWithCare,
                    format!("if an output had an offset, `{name}`, which acts by way of it, would be {times}"),
                )
            }
        };
        Some(
            Warning::new(WarningCode::ConstantInput, severity, format!("{is}: {what}; vary it")).about(About::Input(i)),
        )
    };
    constant.iter().filter_map(one).collect()
}

/// Of the parameters that have no effect without an input, the one whose standard error grows most where outputs may have offsets.
fn most_by_offsets<'j>(evidence: &'j Evidence<'_>, input: usize, growth: &[f64]) -> Option<(&'j str, f64)> {
    let problem = evidence.point.objective.problem;
    let without = |record: &Record| {
        let mut inputs = record.inputs.to_vec();
        inputs[input] = inputs[input].with(vec![0.0; record.len()]);
        Record { inputs: inputs.into(), ..record.clone() }
    };
    let zeroed = problem.with_records(problem.records.iter().map(without).collect()).ok();
    let linear = zeroed.as_ref().and_then(|problem| {
        let objective = evidence.point.objective.of(problem, evidence.point.objective.sweep);
        objective.evaluate(&evidence.point.end.coordinates).ok()
    });
    // Without an evaluation at zero, any parameter may be one.
    let norms = linear.map(|linear| linear.column_norms());
    let by_way = |i: usize| norms.as_ref().is_none_or(|norms| norms[i] < NO_EFFECT * evidence.point.norms[i]);
    let rows = problem.unknowns.row.iter().enumerate();
    let parameters =
        rows.filter(|(i, row)| matches!(row.role, Role::Parameter(_)) && growth[*i] > REPLACED && by_way(*i));
    parameters.map(|(i, row)| (row.name.as_str(), growth[i])).max_by(|a, b| a.1.total_cmp(&b.1))
}

/// By how much the standard error of each unknown grows where each output may have an offset; infinite where an offset then replaces it, one
/// where it is held anyway. `None` where that is not examined.
fn growth_by_offsets(evidence: &Evidence<'_>) -> Option<Vec<f64>> {
    let extended = Extended::new(evidence)?;
    let without = extended.held(None);
    let mut with = without.clone();
    for j in 0..evidence.point.objective.outputs() {
        let number = j * KINDS + Kind::ALL.iter().position(|kind| *kind == Kind::Offset)?;
        with[extended.place(number)] = false;
    }
    let found = undetermined(&extended.linear, &with);
    let replaced: Vec<usize> =
        found.directions.iter().flat_map(|direction| taking_part(direction)).map(|(place, _)| place).collect();
    let (before, after) = (extended.linear.covariance(&without)?, extended.linear.covariance(&found.held)?);
    let growth = |i: usize| match extended.place_of(i) {
        place if without[place] => 1.0,
        place if replaced.contains(&place) => f64::INFINITY,
        place => after.standard_error(place) / before.standard_error(place),
    };
    Some((0..evidence.point.values.len()).map(growth).collect())
}
