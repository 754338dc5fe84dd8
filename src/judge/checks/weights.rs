//! Weights that follow the measurements, whose noise is then correlated with them.
//!
//! The estimate makes the score `sum w e s` zero, of weights `w`, errors `e` and slopes `s`. Its mean at the true parameters should be zero. Where `w`
//! depends on the measurement `y`, it is `sum w'(y) s` times the variance of Gaussian noise (Stein, Annals of Statistics 9 (1981) 1135). One
//! Gauss-Newton step gives the bias of the unknowns.

use super::*;
use crate::problem::Accumulate;
use crate::record::Record;
use crate::sweep::Window;

pub(crate) const WEIGHTS: Check = Check::new(
    "weights do not follow the measurements",
    "How far does noise of the measurements move an unknown by way of weights that are computed from them (Stein 1981)?",
    &[WarningCode::InputNoise],
    |evidence, intervals| weights(evidence, &intervals.unknowns).into(),
)
.unless(&[Unless::RoundOff, Unless::Prefilter, Unless::Variances])
.costs(&[Pass::Slopes(1)])
.levels(&[level("the bias, in standard errors", BIAS, "a quarter: intervals of 95 % cover 94 %")]);

const BIAS: f64 = 0.25;

fn weights(evidence: &Evidence<'_>, unknowns: &[Unknown]) -> Option<Warning> {
    let (objective, point) = (evidence.point.objective, &evidence.point);
    let weights = objective.problem.settings.weights.as_ref()?;
    let errors: Vec<f64> = evidence.residuals.outputs.iter().map(|output| output.rmse).collect();
    let along = |record: &Record, j: usize| -> Vec<f64> {
        let [above, below] = [1.0, -1.0].map(|sign| moved(record, j, sign * errors[j]));
        let by = |k: usize| (weights.weight(&above, k) - weights.weight(&below, k)) / (2.0 * errors[j]);
        (0..record.len()).map(by).collect()
    };
    let of = |record: &Record| -> Vec<Vec<f64>> { (0..errors.len()).map(|j| along(record, j)).collect() };
    let along: Vec<Vec<Vec<f64>>> = objective.problem.records.iter().map(of).collect();
    let follows = |j: usize| along.iter().any(|record| record[j].iter().any(|by| by.abs() > 0.0));
    let j = (0..errors.len()).find(|j| follows(*j))?;
    // The variance of the noise, in units of the standardized errors and slopes.
    let sizes: Vec<f64> =
        errors.iter().zip(objective.whitening.sigma()).map(|(error, sigma)| error * error / sigma).collect();
    let columns = |e: usize| objective.problem.unknowns.columns(e);
    let make = |e: usize| Score { along: &along[e], sizes: &sizes, sum: vec![0.0; columns(e).count()] };
    let all = objective.gather(&point.end.coordinates, true, make).ok()?;
    let mut score = vec![0.0; unknowns.len()];
    for (e, one) in all.iter().enumerate() {
        columns(e).zip(&one.sum).for_each(|(i, own)| score[i] += own);
    }
    let unit = evidence.unit()?;
    let bias = |(i, unknown): (usize, &Unknown)| {
        let step: f64 = score.iter().enumerate().map(|(k, score)| unit.get(i, k) * score).sum();
        let change = (step * point.slopes[i]).abs();
        Some((i, change, change / unknown.knowledge.standard_error()?))
    };
    let biases = unknowns.iter().enumerate().filter_map(bias);
    let (i, change, errors) = biases.max_by(|a, b| a.2.total_cmp(&b.2)).filter(|(.., errors)| *errors > BIAS)?;
    let part = (change / unknowns[i].value).abs();
    let part = if part.is_finite() { format!("{} of it, ", percent(part, 2)) } else { String::new() };
    let text = format!(
        "the weights follow the measured `{}`, whose noise biases `{}` by about {}{} ({part}{} standard errors), which no interval allows for: weigh by \
         time, by inputs, or by what a model predicts",
        objective.problem.layout().outputs[j].name,
        unknowns[i].name,
        number(change, 2),
        unit_after(&unknowns[i].unit),
        number(errors, 2)
    );
    Some(with_care(WarningCode::InputNoise, text).about(About::Unknown(i)))
}

/// A record with an output moved.
fn moved(record: &Record, j: usize, by: f64) -> Record {
    let mut outputs = record.outputs.to_vec();
    outputs[j] = outputs[j].with(outputs[j].values.iter().map(|value| value + by).collect::<Vec<f64>>());
    Record { outputs: outputs.into(), ..record.clone() }
}

/// The mean of the score that the noise in the weights makes.
struct Score<'s> {
    /// Slopes of the weights, output by output and sample by sample.
    along: &'s [Vec<f64>],
    sizes: &'s [f64],
    sum: Vec<f64>,
}

impl Accumulate for Score<'_> {
    fn add(&mut self, window: &Window, lane: usize) {
        for (k, j) in (0..window.samples[lane]).flat_map(|k| (0..window.outputs()).map(move |j| (k, j))) {
            let by = self.along[j][window.begin[lane] + k] * self.sizes[j];
            if window.is_measured(k, j, lane) && by.is_finite() {
                self.sum.iter_mut().enumerate().for_each(|(c, sum)| *sum += by * window.at(k, j, c, lane));
            }
        }
    }

    fn append(&mut self, later: Self) {
        self.sum.iter_mut().zip(later.sum).for_each(|(sum, later)| *sum += later);
    }
}
