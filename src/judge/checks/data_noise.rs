//! Bias by noise in what the predictions are made from: in measured states from which they restart, and in inputs.
//!
//! Noise there enters predictions and their slopes together, and their product does not vanish on average: estimates are
//! drawn off (attenuation, for a line). To second order in the noise the bias is proportional to its variance, so noise
//! of the same size, added once more, moves the estimate by as much again (simulation and extrapolation: Cook and
//! Stefanski, J. American Statistical Association 89 (1994) 1314). One Gauss-Newton step measures it, as the mean of noise
//! added and subtracted, in which all but the second order cancels.

use super::*;
use crate::error::Error;
use crate::judge::checks::feedback::Feedback;
use crate::judge::checks::restarts;
use crate::problem::Problem;
use crate::random::Random;
use crate::record::{Channel, Record};
use statrs::distribution::{ContinuousCDF, Normal};

pub(crate) const RESTARTS: Check = Check::new(
    "measured states are without noise",
    "Where predictions restart: how far does noise move an unknown (simulation and extrapolation, Cook and \
     Stefanski 1994) that errors a horizon apart show by a negative correlation beside all unknowns (Breusch \
     1978, Godfrey 1978), or do not exclude?",
    &[WarningCode::RestartNoise],
    |evidence, intervals| restart_noise(evidence, &intervals.unknowns).into(),
)
.costs(&[Pass::Slopes(9)])
.levels(&[
    level("the probability by chance", LEVEL, "one good record in a hundred"),
    level("the bias of care, in standard errors", NO_BIAS, "a tenth"),
    level("standard errors of the correlation that noise may hide in", POSSIBLE, "one-sided 95 %"),
    level(
        "the bias of care by noise that is not excluded",
        NOT_EXCLUDED,
        "0.24 or more in 20 records whose noise is half of what disturbs the plant, 0.11 or less in 20 without \
         noise",
    ),
    level("the bias that is not usable", BIAS, "a quarter: intervals of 95 % cover 94 %"),
]);

pub(crate) const INPUT_NOISE: Check = Check::new(
    "noise of the inputs moves nothing",
    "How far does the noise that was declared for the inputs move an unknown, by the same?",
    &[WarningCode::InputNoise],
    |evidence, intervals| input_noise(evidence, &intervals.unknowns).into(),
)
.costs(&[Pass::Slopes(8)])
.levels(&[level("the bias, in standard errors", BIAS, "a quarter: intervals of 95 % cover 94 %")]);

/// Draws of noise, each added and subtracted.
const DRAWS: u64 = 4;
/// Noise in restarts that biases by more than this many standard errors makes an estimate unusable; noise that was declared of
/// inputs and biases by more is warned of.
const BIAS: f64 = 0.25;
/// Below this many, noise in restarts is not mentioned.
const NO_BIAS: f64 = 0.1;
/// Noise in restarts that is not seen is taken as large as its error by so many standard errors allows (95 %), and is said if it would bias
/// by more than the second.
const POSSIBLE: f64 = 1.645;
const NOT_EXCLUDED: f64 = 0.15;
/// Significance level of the test for noise in restarts.
const LEVEL: f64 = 0.01;

/// An unknown and its bias.
struct Bias<'u> {
    unknown: &'u Unknown,
    /// In standard errors.
    errors: f64,
    /// In the unknown's unit, with its sign.
    change: f64,
}

/// The largest bias, in standard errors, by noise that `with` adds to the problem: a factor (1 or -1) and the number of
/// the draw.
fn largest_bias<'p, 'u>(
    evidence: &'p Evidence<'_>,
    unknowns: &'u [Unknown],
    with: impl Fn(f64, u64) -> Result<Problem<'p>, Error>,
) -> Option<Bias<'u>> {
    let held: Vec<bool> = unknowns.iter().map(|row| row.knowledge.standard_error().is_none()).collect();
    let none = vec![0.0; unknowns.len()];
    let mut mean: Vec<f64> = evidence.point.linear.step(&none, &held)?.iter().map(|step| -step).collect();
    for (draw, sign) in (0..DRAWS).flat_map(|draw| [(draw, 1.0), (draw, -1.0)]) {
        let problem = with(sign, draw).ok()?;
        let objective = evidence.point.objective.of(&problem, evidence.point.objective.sweep);
        let step = objective.evaluate(&evidence.point.end.coordinates).ok()?.step(&none, &held)?;
        mean.iter_mut().zip(&step).for_each(|(mean, step)| *mean += step / (2 * DRAWS) as f64);
    }
    let bias = |(unknown, step): (&'u Unknown, &f64)| {
        let change = step * unknown.transform.slope(unknown.value);
        let error = unknown.knowledge.standard_error()?;
        Some(Bias { unknown, errors: change.abs() / error, change })
    };
    unknowns.iter().zip(&mean).filter_map(bias).max_by(|a, b| a.errors.total_cmp(&b.errors))
}

/// Whether noise in the states from which predictions restart biases the estimate. Such noise is in the error at
/// the restart, and with the opposite sign in the error a horizon later.
fn restart_noise(evidence: &Evidence<'_>, unknowns: &[Unknown]) -> Option<Warning> {
    let steps = evidence.point.objective.sweep.restarts()?;
    let outputs = &evidence.residuals.outputs;
    let found = if evidence.rounding { None } else { restarts::correlations(evidence, steps) }?;
    let tail = |z: f64| outputs.len() as f64 * Normal::standard().cdf(z);
    let least = found.iter().map(|(_, z)| tail(*z)).fold(1.0, f64::min);
    let seen = least < LEVEL;
    // Found, or as large as it may be.
    let most = |rho: f64, z: f64| if seen || z == 0.0 { rho } else { rho - POSSIBLE * (rho / z).abs() };
    let deviation =
        |((rho, z), fit): (&(f64, f64), &crate::estimate::OutputFit)| fit.rmse * (-most(*rho, *z)).max(0.0).sqrt();
    let sigma: Vec<f64> = found.iter().zip(outputs).map(deviation).collect();
    let problem = evidence.point.objective.problem;
    let feedback = Feedback::of(evidence);
    let bias = largest_bias(evidence, unknowns, |sign, draw| {
        let records = problem.records.iter().enumerate();
        let noisy = |(e, record): (usize, &Record)| {
            let outputs = noisy(&record.outputs, &sigma, sign, draw, e);
            let inputs = feedback.inputs(record, &outputs);
            Record { inputs: inputs.into(), outputs: outputs.into(), ..record.clone() }
        };
        let noisy: Vec<Record> = records.map(noisy).collect();
        // Predictions are compared with the measurements without the added noise, plus the plant's response to the added inputs.
        let compared = feedback.outputs(evidence, &noisy);
        Ok(Problem { records: compared, ..problem.with_records(noisy)? })
    })?;
    let Bias { unknown, errors, .. } = bias;
    if errors < if seen { NO_BIAS } else { NOT_EXCLUDED } {
        return None;
    }
    if !seen {
        let j =
            (0..sigma.len()).max_by(|&a, &b| (sigma[a] / outputs[a].rmse).total_cmp(&(sigma[b] / outputs[b].rmse)))?;
        let output = &problem.layout().outputs[j];
        let text = format!(
            "predictions restart from measured states as if these were exact: the errors do not exclude noise of up to {}{} in `{}`, which \
             would bias `{}` by {} standard errors; use Kalman with Model::noise, filter the restarts (Horizon::filtered), or take a longer \
             horizon",
            number(sigma[j], 2),
            unit_after(&output.unit),
            output.name,
            unknown.name,
            number(errors, 2)
        );
        return Some(with_care(WarningCode::RestartNoise, text));
    }
    let severity = if errors > BIAS { Severity::NotUsable } else { Severity::UsableWithCare };
    let also = match feedback.names(problem.layout()) {
        names if names.is_empty() => String::new(),
        names => format!(", {} being fed back from the same measurements", names.join(" and ")),
    };
    let text = format!(
        "the states from which predictions restart are noisy, or what disturbs the plant alternates: errors {steps} sample(s) apart \
         are negatively correlated ({}). Either biases the estimate; noise, `{}` by about {} standard errors{also}: use Kalman with \
         Model::noise, filter the restarts (Horizon::filtered), or take a longer horizon",
        p_value(least),
        unknown.name,
        number(errors, 2)
    );
    Some(Warning { code: WarningCode::RestartNoise, severity, text })
}

/// The bias by the noise of inputs that was declared.
fn input_noise(evidence: &Evidence<'_>, unknowns: &[Unknown]) -> Option<Warning> {
    let problem = evidence.point.objective.problem;
    let sigma = problem.settings.input_noise.as_ref()?;
    let bias = largest_bias(evidence, unknowns, |sign, draw| {
        let records = problem.records.iter().enumerate();
        let noisy = records.map(|(e, record)| {
            let inputs = noisy(&record.inputs, sigma, sign, draw, e);
            Record { inputs: inputs.into(), ..record.clone() }
        });
        problem.with_records(noisy.collect())
    })?;
    let Bias { unknown, errors, change } = bias;
    if errors < BIAS {
        return None;
    }
    let text = format!(
        "the noise declared for the inputs biases `{}` by about {}{} ({} of it, {} standard errors), which no interval \
         allows for; measure the inputs better, filter record and outputs alike, or average over periods",
        unknown.name,
        number(change, 2),
        unit_after(&unknown.unit),
        percent((change / unknown.value).abs(), 2),
        number(errors, 2)
    );
    Some(with_care(WarningCode::InputNoise, text))
}

/// The channels with Gaussian noise of these standard deviations, times a sign.
fn noisy(channels: &[Channel], sigma: &[f64], sign: f64, draw: u64, experiment: usize) -> Vec<Channel> {
    let one = |(j, (channel, sigma)): (usize, (&Channel, &f64))| {
        let mut random = Random::stream(draw, (experiment * channels.len() + j) as u64);
        let values = channel.values.iter().map(|value| value + sign * sigma * random.normal());
        channel.with(values.collect::<Vec<f64>>())
    };
    channels.iter().zip(sigma).enumerate().map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each channel of each experiment has noise of its own, which adding and subtracting cancels.
    #[test]
    fn noise_differs_by_channel_and_experiment() {
        let channels = ["a", "b"].map(|name| Channel::new(name, "V", vec![10.0; 3]));
        let values = |sign: f64, experiment: usize| -> Vec<Vec<f64>> {
            noisy(&channels, &[0.5, 2.0], sign, 7, experiment).iter().map(|channel| channel.values.to_vec()).collect()
        };
        for experiment in [0, 1, 3] {
            let (above, below) = (values(1.0, experiment), values(-1.0, experiment));
            for (j, sigma) in [0.5, 2.0].into_iter().enumerate() {
                let mut random = Random::stream(7, (2 * experiment + j) as u64);
                for k in 0..3 {
                    assert_eq!(above[j][k], 10.0 + sigma * random.normal());
                    assert!((above[j][k] + below[j][k] - 20.0).abs() < 1e-14);
                }
            }
        }
    }
}
