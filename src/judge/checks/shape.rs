//! Whether errors follow from the inputs or from the prediction, which those of a model of the right shape do not.
//!
//! The errors of a static model are white in order of an input's size, whatever the order of the samples in time. Those of any model
//! are uncorrelated with powers of its prediction, and with every input that has acted. A delay or a lag that the model lacks shows at the
//! samples after each change of an input, a curve that it lacks in the powers of the input. Errors that do follow are tested again with the slopes of the unknowns.

mod beside_unknowns;

use super::*;
use crate::judge::evidence::color;
use crate::problem::Accumulate;
use crate::record::Record;
use crate::residuals::first_errors;
use crate::residuals::powers::{SHAPE, Scale, scales};
use crate::residuals::products::{Change, Products};
use crate::residuals::whiteness::{LAGS, Whiteness};
use crate::sweep::Window;
use crate::whiteness::Portmanteau;

pub(crate) const FOLLOWING: Check = Check::new(
    "errors follow from nothing that is known",
    "Do the errors follow from the size of an input (static models), from the inputs of four samples before, or \
     from powers of the prediction (Ramsey 1969; White 1980)?",
    &[WarningCode::WrongShape],
    |evidence, _| Examined::unless(skipped(evidence), || shape(evidence)).without(left_out(evidence)),
)
.costs(&[Pass::Values(1), Pass::Slopes(1)])
.levels(&[
    level(
        "the probability by chance, over all outputs and inputs",
        color::CERTAIN,
        "one good record in ten thousand; for inputs before 1e-3",
    ),
    level("the part of what an output moves that is a note", color::SMALL, "no parameter moves by more"),
]);

/// Number of samples before an error whose inputs are regressors.
const BEFORE: usize = 4;

/// Why none of the tests below is made.
fn skipped(evidence: &Evidence<'_>) -> Option<&'static str> {
    if evidence.point.is_static() {
        return None;
    }
    let colored = || evidence.autocorrelated_at(color::CERTAIN).map(|_| "errors that are correlated over time");
    evidence.ruled_out(&[Unless::RoundOff, Unless::Prefilter, Unless::Restarts]).or_else(colored)
}

/// Which of them are not made.
fn left_out(evidence: &Evidence<'_>) -> Option<&'static str> {
    let powers =
        evidence.residuals.shape.is_empty().then_some("powers of the prediction (a loss, weights or a pre-filter)");
    powers.or_else(|| first_errors::left_out(evidence.point.objective))
}

/// Whether the model certainly has the wrong shape.
fn shape(evidence: &Evidence<'_>) -> Option<Warning> {
    by_inputs(evidence).or_else(|| by_inputs_before(evidence)).or_else(|| by_predictions(evidence))
}

/// The output and the input that it certainly depends on otherwise than the model says; of several those with the largest part of the
/// errors.
fn by_inputs(evidence: &Evidence<'_>) -> Option<Warning> {
    let objective = evidence.point.objective;
    let (layout, count) = (objective.problem.layout(), objective.outputs());
    if !evidence.point.is_static() {
        return None;
    }
    let mut sums = vec![(Portmanteau::new(LAGS), 0); count * layout.inputs.len()];
    for (e, errors) in evidence.residuals.first_errors.iter().enumerate() {
        for (i, input) in objective.problem.records[e].inputs().iter().enumerate() {
            let mut order: Vec<usize> = (0..errors[0].len()).collect();
            order.sort_by(|a, b| input.values[*a].total_cmp(&input.values[*b]));
            for (j, errors) in errors.iter().enumerate() {
                let sorted: Vec<f64> = order.iter().map(|&k| errors[k]).filter(|error| !error.is_nan()).collect();
                let mut own = Portmanteau::new(LAGS);
                own.add(&sorted);
                let (sum, errors) = &mut sums[i * count + j];
                sum.append(&own);
                *errors += sorted.len() as u64;
            }
        }
    }
    let white: Vec<Whiteness> = sums.iter().map(|(sum, errors)| Whiteness::of(sum, *errors)).collect();
    let chance = |number: usize| white[number].p_value * sums.len() as f64;
    let more = |a: &usize, b: &usize| white[*a].predicted.total_cmp(&white[*b].predicted);
    let number = (0..white.len()).filter(|number| chance(*number) < color::CERTAIN).max_by(more)?;
    let (i, j, chance) = (number / count, number % count, chance(number));
    let part = evidence.colored(j, &white[number]);
    (part > color::SMALL).then(|| {
        let text = format!(
            "the errors of `{}` follow from the input `{}` ({} in order of its size): the model has the wrong shape, by {} of \
             what the output moves, and no interval allows for that",
            layout.outputs[j].name,
            layout.inputs[i].name,
            p_value(chance),
            percent(part, 2)
        );
        Warning::new(WarningCode::WrongShape, color::severity(part), text).about(About::Output(j))
    })
}

/// The output whose errors certainly follow from an input: from powers of its value at the sample before, or from one of its changes. The
/// input of the same sample is left out, since a controller may have computed it from the measurement. White errors only: correlated
/// ones follow from an input that a controller has computed from earlier ones.
fn by_inputs_before(evidence: &Evidence<'_>) -> Option<Warning> {
    let objective = evidence.point.objective;
    let (layout, outputs) = (objective.problem.layout(), objective.outputs());
    if evidence.point.is_static() {
        return None;
    }
    let sigma = objective.whitening.sigma();
    // What the minimum makes orthogonal to the slopes: errors times their weights.
    let weighted = |e: usize, j: usize, k: usize, error: f64| {
        let by_loss = objective.loss().map_or(1.0, |loss| loss.weight(error / sigma[j]));
        error * objective.weight(e, k) * by_loss
    };
    let scales: Vec<Scale> = (0..layout.inputs.len()).map(|i| scale(evidence, i)).collect();
    let mut sums = vec![Before::default(); outputs * layout.inputs.len()];
    for (e, errors) in evidence.residuals.first_errors.iter().enumerate() {
        let samples = errors.first().map_or(0, Vec::len);
        let inputs = objective.problem.records[e].inputs().iter().zip(&scales);
        let inputs: Vec<Vec<f64>> =
            inputs.map(|(input, scale)| input.values[..samples].iter().map(|u| scale.one(*u)).collect()).collect();
        for (j, errors) in errors.iter().enumerate() {
            let numbers = errors.iter().enumerate().skip(BEFORE);
            let one = |(k, error): (usize, &f64)| match error.is_nan() {
                true => (0.0, 0.0),
                false => (weighted(e, j, k, *error), 1.0),
            };
            let (own, present): (Vec<f64>, Vec<f64>) = numbers.map(one).unzip();
            for (input, sums) in inputs.iter().zip(sums.iter_mut().skip(j).step_by(outputs)) {
                sums.take(input, &own, &present);
            }
        }
    }
    let of = |number: usize| {
        let (i, j) = (number / outputs, number % outputs);
        let (change, part, chance) = sums[number].follows();
        let part = part * evidence.residuals.outputs[j].rmse / evidence.residuals.levels[j].1;
        ((i, j, change), part, chance * sums.len() as f64)
    };
    let mut suspicious: Vec<_> = (0..sums.len()).map(of).filter(|(.., chance)| *chance < color::LIKELY).collect();
    suspicious.sort_by(|a, b| b.1.total_cmp(&a.1));
    let many = (sums.len() * BEFORE) as f64;
    let of_errors = &evidence.residuals.first_errors;
    let beside = |(i, j, change): (usize, usize, Option<usize>)| {
        let value = |at: &beside_unknowns::Measured, before: usize| {
            let examined = at.output == j && at.sample >= BEFORE;
            let kept = of_errors.get(at.experiment).and_then(|errors| errors.first()).map_or(0, Vec::len);
            let value = || objective.problem.records[at.experiment].inputs()[i].values[at.sample - before];
            (examined && at.sample < kept).then(value)
        };
        match change {
            None => beside_unknowns::by_chance(evidence, |at| {
                let one = scales[i].one(value(&at, 1)?);
                Some(std::array::from_fn::<f64, SHAPE, _>(|power| one.powi(power as i32)))
            }),
            Some(lag) => beside_unknowns::by_chance(evidence, |at| Some([value(&at, lag + 1)? - value(&at, lag + 2)?])),
        }
    };
    let mut told = suspicious.into_iter().map(|(of, part, chance)| (of, part, chance.max(beside(of) * many)));
    let ((i, j, _), part, chance) = told.find(|(.., chance)| *chance < color::LIKELY)?;
    let text = format!(
        "the errors of `{}` follow from what the input `{}` was at the samples before ({}): the model lacks a delay, an inertia or a \
         curve, the signals are not of the same moments, or correlated noise is fed back, by {} of what the output moves, and no \
         interval allows for that",
        layout.outputs[j].name,
        layout.inputs[i].name,
        p_value(chance),
        percent(part, 2)
    );
    Some(Warning::new(WarningCode::WrongShape, color::severity(part), text).about(About::Output(j)))
}

/// Center and width of an input over all records.
fn scale(evidence: &Evidence<'_>, i: usize) -> Scale {
    Scale::over(evidence.point.objective.problem.records.iter().map(|record| record.inspect_some().inputs[i].range))
}

/// Sums over errors and an input at the samples before: with powers of the last one, and with each of its changes. These may be few and
/// far between, so that each is tested alone.
#[derive(Clone, Copy, Default)]
struct Before {
    powers: Products<SHAPE>,
    changes: [Change; BEFORE - 1],
}

impl Before {
    /// Takes the values of the input, and the errors and whether there is one from sample [`BEFORE`] on.
    fn take(&mut self, input: &[f64], errors: &[f64], present: &[f64]) {
        let before = |samples: usize| &input[(BEFORE - samples).min(input.len())..];
        self.powers.take_powers(before(1), errors, present);
        for (lag, change) in self.changes.iter_mut().enumerate() {
            change.take_differences(before(lag + 1), before(lag + 2), errors, present);
        }
    }

    /// What the errors follow from most certainly, the powers or one of the changes; the root of the part of the squared errors that does, and the probability by
    /// chance.
    fn follows(&self) -> (Option<usize>, f64, f64) {
        let squares = self.powers.sum_of_squares();
        let changes = self.changes.iter().enumerate();
        let changes = changes.map(|(lag, one)| (Some(lag), one.explained_part(squares), one.by_chance()));
        let powers = (None, self.powers.explained_part(), self.powers.by_chance());
        let all = std::iter::once(powers).chain(changes);
        let (change, part, chance) = all.min_by(|a, b| a.2.total_cmp(&b.2)).unwrap_or(powers);
        (change, part, chance * BEFORE as f64)
    }
}

/// The output whose errors certainly follow from its prediction; of several that with the largest part of what it moves. White errors
/// only: correlated ones follow from a prediction that is as slow as they are.
fn by_predictions(evidence: &Evidence<'_>) -> Option<Warning> {
    let (objective, chances) = (evidence.point.objective, &evidence.residuals.shape);
    let count = chances.len() as f64;
    let suspicious = chances.iter().any(|chance| chance * count < color::CERTAIN);
    if !suspicious || evidence.rounding || evidence.autocorrelated_at(color::CERTAIN).is_some() {
        return None;
    }
    let scales = scales(objective);
    let make = |experiment: usize| Following {
        record: &objective.problem.records[experiment],
        scales: &scales,
        sums: vec![Products::default(); scales.len()],
    };
    let all = objective.in_units().gather(&evidence.point.end.coordinates, false, make).ok()?;
    let mut sums = vec![Products::default(); scales.len()];
    for one in all {
        sums.iter_mut().zip(&one.sums).for_each(|(sum, own)| sum.append(own));
    }
    let of = |j: usize| {
        let (part, chance) =
            (sums[j].explained_part() * evidence.residuals.outputs[j].rmse, sums[j].by_chance() * count);
        (j, part / evidence.residuals.levels[j].1, chance)
    };
    let mut suspicious: Vec<_> = (0..sums.len()).map(of).filter(|(.., chance)| *chance < color::CERTAIN).collect();
    suspicious.sort_by(|a, b| b.1.total_cmp(&a.1));
    let beside = |j: usize| {
        beside_unknowns::by_chance(evidence, |at| {
            let values = &objective.problem.records[at.experiment].outputs()[j].values;
            let one = || scales[j].one(values[at.sample] - at.error);
            (at.output == j).then(|| std::array::from_fn::<f64, SHAPE, _>(|power| one().powi(power as i32)))
        })
    };
    let mut told = suspicious.into_iter().map(|(j, part, chance)| (j, part, chance.max(beside(j) * count)));
    let (j, part, chance) = told.find(|(.., chance)| *chance < color::CERTAIN)?;
    let text = format!(
        "the errors of `{}` follow from what the model predicts for it ({}): the model has the wrong shape, by {} of what the output \
         moves, and no interval allows for that",
        objective.problem.layout().outputs[j].name,
        p_value(chance),
        percent(part, 2)
    );
    Some(Warning::new(WarningCode::WrongShape, color::severity(part), text).about(About::Output(j)))
}

/// Products of an output's errors and of the powers of its prediction, for one experiment.
struct Following<'f> {
    record: &'f Record,
    scales: &'f [Scale],
    sums: Vec<Products<SHAPE>>,
}

impl Accumulate for Following<'_> {
    fn add(&mut self, window: &Window, lane: usize) {
        for (j, (sums, scale)) in self.sums.iter_mut().zip(self.scales).enumerate() {
            let values = &self.record.outputs()[j].values[window.begin[lane]..];
            for k in (0..window.samples[lane]).filter(|k| window.is_measured(*k, j, lane)) {
                let error = window.error(k, j, lane) * window.variance_root(k, j, lane);
                let one = scale.one(values[k] - error);
                sums.take(std::array::from_fn(|i| one.powi(i as i32)), error);
            }
        }
    }

    fn append(&mut self, later: Self) {
        self.sums.iter_mut().zip(&later.sums).for_each(|(sum, later)| sum.append(later));
    }
}
