//! Whether the errors of a static model follow from its inputs: in order of an input's size they are white if the shape of
//! the model is right, whatever the order of the samples in time.

use super::color;
use super::conclude::Judgement;
use super::whiteness::{LAGS, Whiteness};
use crate::estimate::{Warning, WarningCode};
use crate::numeral::{p_value, percent};
use crate::sweep::Window;
use crate::whiteness::Portmanteau;

/// Records that are looked at, and samples of each: the first ones.
pub(super) const RECORDS: usize = 8;
const SAMPLES: usize = 16_384;

/// The output and the input that it certainly depends on otherwise than the model says; of several those with the largest part of the
/// errors.
pub(super) fn shape(judgement: &Judgement<'_>) -> Option<Warning> {
    let objective = judgement.objective;
    let (layout, count) = (objective.problem.layout(), objective.outputs());
    if !judgement.is_static() {
        return None;
    }
    let mut sums = vec![(Portmanteau::new(LAGS), 0); count * layout.inputs.len()];
    for e in 0..objective.experiments().min(RECORDS) {
        let errors = first_errors(judgement, e);
        for (i, input) in objective.problem.records[e].inputs().iter().enumerate() {
            let mut order: Vec<usize> = (0..errors[0].len()).collect();
            order.sort_by(|a, b| input.values[*a].total_cmp(&input.values[*b]));
            for (j, errors) in errors.iter().enumerate() {
                let sorted: Vec<f64> = order.iter().filter_map(|&k| errors[k]).collect();
                let mut own = Portmanteau::new(LAGS);
                own.add(&sorted);
                let (sum, errors) = &mut sums[i * count + j];
                sum.append(&own);
                *errors += sorted.len() as u64;
            }
        }
    }
    let white: Vec<Whiteness> = sums.iter().map(|(sum, errors)| Whiteness::of(sum, *errors, 0)).collect();
    let chance = |number: usize| white[number].p_value * sums.len() as f64;
    let more = |a: &usize, b: &usize| white[*a].predicted.total_cmp(&white[*b].predicted);
    let number = (0..white.len()).filter(|number| chance(*number) < color::CERTAIN).max_by(more)?;
    let (i, j, chance) = (number / count, number % count, chance(number));
    let part = judgement.colored(j, &white[number]);
    (part > color::SMALL).then(|| {
        let text = format!(
            "the errors of `{}` follow from the input `{}` ({} in order of its size): the model has the wrong shape, by {} of \
             what the output moves, and no interval allows for that",
            layout.outputs[j].name,
            layout.inputs[i].name,
            p_value(chance),
            percent(part, 2)
        );
        Warning { code: WarningCode::WrongShape, severity: color::severity(part), text }
    })
}

/// The first errors of an experiment, output by output; `None` where nothing was measured.
pub(super) fn first_errors(judgement: &Judgement<'_>, e: usize) -> Vec<Vec<Option<f64>>> {
    let mut errors = vec![vec![]; judgement.objective.outputs()];
    let visit = &mut |window: &mut Window| {
        for k in 0..window.samples[0] {
            for (j, errors) in errors.iter_mut().enumerate() {
                let error = window.error(k, j, 0);
                errors.push((window.is_measured(k, j, 0) && error.is_finite()).then_some(error));
            }
        }
        errors[0].len() < SAMPLES
    };
    // It stops early where there are enough.
    let _ = judgement.objective.run_alone(e, &judgement.end.coordinates, false, visit);
    errors
}
