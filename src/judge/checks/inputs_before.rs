//! Whether errors follow from the inputs of the samples before.
//!
//! What a model of the right shape leaves is uncorrelated with every input that has acted. A delay or a lag that it lacks shows at the
//! samples after each change of an input, a curve that it lacks in the powers of the input.

use crate::estimate::{Warning, WarningCode};
use crate::judge::evidence::Evidence;
use crate::judge::evidence::color;
use crate::judge::evidence::powers::{SHAPE, Scale};
use crate::judge::evidence::products::{Change, Products};
use crate::numeral::{p_value, percent};

/// Number of samples before an error whose inputs are regressors.
const BEFORE: usize = 4;

/// The output whose errors certainly follow from an input: from powers of its value at the sample before, or from one of its changes. The
/// input of the same sample is left out, since a controller may have computed it from the measurement. White errors only: correlated
/// ones follow from an input that a controller has computed from earlier ones.
pub(crate) fn by_inputs_before(evidence: &Evidence<'_>) -> Option<Warning> {
    let objective = evidence.point.objective;
    let (layout, outputs) = (objective.problem.layout(), objective.outputs());
    let plain = objective.problem.settings.prefilter.is_none() && objective.sweep.restarts().is_none();
    let examined = !evidence.point.is_static() && plain && !layout.inputs.is_empty();
    let exact = evidence.rounding || evidence.point.is_exact();
    if !examined || exact || evidence.autocorrelated_at(color::CERTAIN).is_some() {
        return None;
    }
    let sigma = objective.whitening.sigma();
    // What the minimum makes orthogonal to the slopes: errors times their weights.
    let weight = |e: usize, j: usize, k: usize, error: f64| {
        let by_loss = objective.loss().map_or(1.0, |loss| loss.weight(error / sigma[j]));
        objective.weight(e, k) * by_loss
    };
    let scales: Vec<Scale> = (0..layout.inputs.len()).map(|i| scale(evidence, i)).collect();
    let mut sums = vec![Before::default(); outputs * layout.inputs.len()];
    for (e, errors) in evidence.residuals.first_errors.iter().enumerate() {
        let inputs = objective.problem.records[e].inputs().iter().zip(&scales);
        for ((input, scale), sums) in inputs.zip(sums.chunks_mut(outputs)) {
            let u = &input.values;
            for k in BEFORE..errors[0].len() {
                let before = std::array::from_fn(|lag| scale.one(u[k - 1 - lag]));
                for (j, (sums, errors)) in sums.iter_mut().zip(errors).enumerate() {
                    if let Some(error) = errors[k] {
                        sums.take(before, error * weight(e, j, k, error));
                    }
                }
            }
        }
    }
    let of = |number: usize| {
        let (i, j) = (number / outputs, number % outputs);
        let (part, chance) = sums[number].follows();
        let part = part * evidence.residuals.outputs[j].rmse / evidence.residuals.levels[j].1;
        (i, j, part, chance * sums.len() as f64)
    };
    let certain = (0..sums.len()).map(of).filter(|(.., chance)| *chance < color::LIKELY);
    let (i, j, part, chance) = certain.max_by(|a, b| a.2.total_cmp(&b.2))?;
    let text = format!(
        "the errors of `{}` follow from what the input `{}` was at the samples before ({}): the model lacks a delay, an inertia or a \
         curve, the signals are not of the same moments, or correlated noise is fed back, by {} of what the output moves, and no \
         interval allows for that",
        layout.outputs[j].name,
        layout.inputs[i].name,
        p_value(chance),
        percent(part, 2)
    );
    Some(Warning { code: WarningCode::WrongShape, severity: color::severity(part), text })
}

/// Center and width of an input over all records.
fn scale(evidence: &Evidence<'_>, i: usize) -> Scale {
    let range =
        |(low, high): (f64, f64), own: Option<(f64, f64)>| own.map_or((low, high), |(a, b)| (low.min(a), high.max(b)));
    let records = evidence.point.objective.problem.records.iter();
    Scale::new(
        records.map(|record| record.inspect_some().inputs[i].range).fold((f64::INFINITY, f64::NEG_INFINITY), range),
    )
}

/// Sums over errors and an input at the samples before: with powers of the last one, and with each of its changes. These may be few and
/// far between, so that each is tested alone.
#[derive(Clone, Copy, Default)]
struct Before {
    powers: Products<SHAPE>,
    changes: [Change; BEFORE - 1],
}

impl Before {
    fn take(&mut self, before: [f64; BEFORE], error: f64) {
        self.powers.take(std::array::from_fn(|i| before[0].powi(i as i32)), error);
        self.changes.iter_mut().zip(before.windows(2)).for_each(|(sums, pair)| sums.take(pair[0] - pair[1], error));
    }

    /// The root of the part of the squared errors that follows most certainly, and the probability by chance.
    fn follows(&self) -> (f64, f64) {
        let squares = self.powers.sum_of_squares();
        let changes = self.changes.iter().map(|one| (one.explained_part(squares), one.by_chance()));
        let all = std::iter::once((self.powers.explained_part(), self.powers.by_chance())).chain(changes);
        let (part, chance) = all.min_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((0.0, 1.0));
        (part, chance * BEFORE as f64)
    }
}
