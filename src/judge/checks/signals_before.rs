//! Whether colored errors follow from the inputs and predictions of the samples before.
//!
//! Each error is regressed on the errors before it, and on inputs and predictions before it, as means over ever longer spans. Beyond its own
//! past, noise follows from neither (Granger, Econometrica 37 (1969) 424), in a closed loop either: what a controller computes depends on
//! measurements that were made. A delay, an inertia, a gain or a curve that the model lacks does. Fisher's test compares variances of
//! innovations, which no misfit widens: a larger one is only more certain.

use super::*;
use crate::information::Gathering;
use crate::judge::evidence::color;
use crate::record::Record;
use crate::residuals::first_errors::Errors;
use crate::residuals::powers::by_chance;

pub(crate) const SIGNALS_BEFORE: Check = Check::new(
    "colored errors follow from their own past only",
    "Do inputs and predictions of the samples before explain more of colored errors than the errors before do \
     (Granger 1969)?",
    &[WarningCode::WrongShape],
    |evidence, _| Examined::from(by_signals_before(evidence)).without(left_out(evidence)),
)
.unless(&[Unless::Static, Unless::RoundOff, Unless::Prefilter, Unless::Restarts])
.levels(&[
    level("the probability by chance, over all outputs", color::CERTAIN, "one good record in ten thousand"),
    level(
        "the part of the innovations' variance that they explain",
        LEAST,
        "five times what a closed loop leaves by too short an autoregression",
    ),
    level(
        "the colored part of what an output moves that is not usable",
        color::LEFT,
        "wrong pole pairs, gains and delays move parameters by a quarter or more from there on",
    ),
]);

/// What is not examined of colored errors.
fn left_out(evidence: &Evidence<'_>) -> Option<&'static str> {
    let problem = evidence.point.objective.problem;
    let long = problem.samples() > MOST || problem.records.len() > RECORDS;
    (long && evidence.is_colored()).then_some("errors beyond the first 16,384 of eight records")
}

/// Errors before that are regressors: one per so many errors, ten at most. Sums of colored and white noise, which are no autoregressions, leave
/// less than the least part below (20,000 samples of closed loops of gain 1 to 10).
const ERRORS: usize = 10;
const PER_ERROR: usize = 40;
/// The longest lag of an input or prediction (samples), and which part of the shortest record it is at most.
const LONGEST: usize = 128;
const OF_RECORD: usize = 8;
/// How many errors there are for each regressor at least.
const PER_REGRESSOR: usize = 4;
/// Errors that are regressed, of all records together.
const MOST: usize = 16_384;
const RECORDS: usize = 8;
/// The least part of the innovations' variance that inputs and predictions explain.
const LEAST: f64 = 0.05;

/// The output whose colored errors certainly follow from inputs and predictions before; of several that with the largest colored part.
fn by_signals_before(evidence: &Evidence<'_>) -> Option<Warning> {
    if !evidence.is_colored() {
        return None;
    }
    let (objective, all) = (evidence.point.objective, &evidence.residuals.first_errors);
    // Of further records none are kept.
    let kept = || all.iter().enumerate().filter(|(_, errors)| errors.iter().any(|of| !of.is_empty()));
    let most = MOST / kept().count().max(1);
    let series: Vec<Series> = kept().map(|(e, errors)| Series::new(evidence, e, errors, most)).collect();
    let tested = evidence.tested();
    let regression = Regression::new(&series)?;
    let found = tested.iter().filter_map(|(j, white)| {
        let (chance, part) = regression.test(&series, *j)?;
        let chance = chance * tested.len() as f64;
        (chance < color::CERTAIN && part > LEAST).then(|| (*j, evidence.colored(*j, white), chance))
    });
    let (j, part, chance) = found.max_by(|a, b| a.1.total_cmp(&b.1))?;
    let layout = objective.problem.layout();
    let from = if layout.inputs.is_empty() { "predictions" } else { "inputs and predictions" };
    let text = format!(
        "the errors of `{}` follow from {from} of the samples before, as no noise does ({}): the model lacks a delay, an inertia, a \
         coupling or a curve, or signals are not those that it takes them for; the colored part is {} of what the output moves, and no \
         interval allows for that",
        layout.outputs[j].name,
        p_value(chance),
        percent(part, 2)
    );
    Some(Warning::new(WarningCode::WrongShape, color::severity_of_misfit(part), text).about(About::Output(j)))
}

/// Signals of one record, each with the sums of its values up to each sample, and its errors.
struct Series {
    sums: Vec<Vec<f64>>,
    errors: Errors,
    samples: usize,
}

impl Series {
    fn new(evidence: &Evidence<'_>, e: usize, errors: &Errors, most: usize) -> Self {
        let objective = evidence.point.objective;
        let (record, sigma, mut errors) = (&objective.problem.records[e], objective.whitening.sigma(), errors.clone());
        let samples = errors[0].len().min(most);
        let predicted = errors.iter().enumerate().map(|(j, errors)| predictions(record, j, &errors[..samples]));
        let inputs = record.inputs().iter().map(|input| input.values[..samples].to_vec());
        let sums = inputs.chain(predicted).map(|values| sums(&values)).collect();
        // What the minimum makes orthogonal to the slopes: errors times their weights.
        for (j, errors) in errors.iter_mut().enumerate() {
            for (k, error) in errors.iter_mut().enumerate() {
                let by_loss = |error: f64| objective.loss().map_or(1.0, |loss| loss.weight(error / sigma[j]));
                *error *= objective.weight(e, k) * by_loss(*error);
            }
        }
        Series { sums, errors, samples }
    }
}

/// What was predicted for an output; where nothing was measured, for the measurement before.
fn predictions(record: &Record, j: usize, errors: &[f64]) -> Vec<f64> {
    let measured = &record.outputs()[j].values;
    let mut last = 0.0;
    let all = errors.iter().zip(measured.iter()).map(|(error, y)| {
        last = if error.is_nan() { last } else { y - error };
        last
    });
    all.collect()
}

/// Sums of the values before each sample, less the first value.
fn sums(values: &[f64]) -> Vec<f64> {
    let first = values.first().copied().unwrap_or(0.0);
    let mut sum = 0.0;
    let rest = values.iter().map(|value| {
        sum += value - first;
        sum
    });
    std::iter::once(0.0).chain(rest).collect()
}

/// Which regressors an error has.
struct Regression {
    /// Numbers of the signals that move.
    signals: Vec<usize>,
    /// First and last lag of each mean.
    spans: Vec<(usize, usize)>,
    errors: usize,
}

impl Regression {
    /// As many as the records allow; `None` if these are too short.
    fn new(series: &[Series]) -> Option<Self> {
        let moves = |sums: &Vec<f64>| sums.iter().any(|sum| *sum != 0.0);
        let signals: Vec<usize> =
            (0..series.first()?.sums.len()).filter(|i| series.iter().any(|one| moves(&one.sums[*i]))).collect();
        let samples: usize = series.iter().map(|one| one.samples).sum();
        let shortest = series.iter().map(|one| one.samples).min()?;
        let errors = (samples / PER_ERROR).clamp(1, ERRORS);
        let mut spans = spans(LONGEST.min(shortest / OF_RECORD));
        while PER_REGRESSOR * (1 + errors + signals.len() * spans.len()) > samples && !spans.is_empty() {
            spans.pop();
        }
        (!spans.is_empty() && !signals.is_empty()).then_some(Regression { signals, spans, errors })
    }

    /// The probability that as much of an output's innovations follows from the signals by chance, and which part of their variance does.
    fn test(&self, series: &[Series], j: usize) -> Option<(f64, f64)> {
        let (longest, own) = (self.spans.last()?.1, 1 + self.errors);
        let regressors = self.signals.len() * self.spans.len();
        let mut rows = Gathering::new(own + regressors);
        let mut row = vec![1.0; own + regressors];
        for one in series {
            let mut before: Vec<f64> = vec![];
            for k in 0..one.samples {
                let error = one.errors[j][k];
                if error.is_nan() {
                    continue;
                }
                if k >= longest && before.len() >= self.errors {
                    let last = before.iter().rev();
                    row[1..own].iter_mut().zip(last).for_each(|(to, error)| *to = *error);
                    let spans = self.signals.iter().flat_map(|i| self.spans.iter().map(move |span| (*i, *span)));
                    for (to, (i, (from, until))) in row[own..].iter_mut().zip(spans) {
                        let sums = &one.sums[i];
                        *to = (sums[k + 1 - from] - sums[k - until]) / (until + 1 - from) as f64;
                    }
                    rows.take(&row, error);
                }
                before.push(error);
            }
        }
        let information = rows.triangle();
        let (free, degrees) = (information.rows() as f64 - row.len() as f64, regressors as f64);
        let beyond = information.eliminate(own);
        let (without, with) = (beyond.residual_at_zero(), beyond.residual());
        let part = 1.0 - with / free / (without / (free + degrees));
        Some((by_chance(without - with, degrees, with, free), part))
    }
}

/// First and last lags up to the longest: four of one sample, two of two, two of four, and so on.
fn spans(longest: usize) -> Vec<(usize, usize)> {
    let widths = [1, 1].into_iter().chain((0..).flat_map(|power| [1 << power; 2]));
    let mut next = 1;
    let all = widths.map(|width: usize| {
        let from = next;
        next += width;
        (from, next - 1)
    });
    all.take_while(|(_, until)| *until <= longest).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    #[test]
    fn spans_grow() {
        assert_eq!(spans(14), [(1, 1), (2, 2), (3, 3), (4, 4), (5, 6), (7, 8), (9, 12)]);
        assert_eq!((spans(0).len(), spans(128).last()), (0, Some(&(97, 128))));
    }

    /// Less the first value.
    #[test]
    fn sums_before_each_sample() {
        assert_eq!(sums(&[3.0, 4.0, 2.0]), [0.0, 0.0, 1.0, 0.0]);
    }

    /// Errors of an autoregression, in a loop whose input follows them with this gain and a reference that is new each ninth sample, beside a
    /// part of the input of seven samples before.
    fn series(seed: u64, misfit: f64, gain: f64) -> Series {
        let mut random = Random::stream(seed, 0);
        let (mut noise, mut reference, mut u, mut errors) = (0.0, 0.0, vec![], vec![]);
        for k in 0..600usize {
            noise = 0.9 * noise + 0.3 * random.normal();
            let late = if k >= 7 { u[k - 7] } else { 0.0 };
            let error = noise + misfit * late;
            errors.push(error);
            reference = if k % 9 == 0 { random.normal() } else { reference };
            u.push(reference - gain * error);
        }
        Series { sums: vec![sums(&u)], errors: vec![errors], samples: 600 }
    }

    /// Of 400 records of noise that is fed back, one in a hundred is below 0.01: 4, with a deviation of 2. Where a half of the input is
    /// late, 66 steps of 0.7 (root mean square) stand beside 600 innovations of 0.3: at most 38 % of their variance, half of it by a mean
    /// over two lags. That is named in each record.
    #[test]
    fn noise_follows_from_its_own_past_only() {
        let tested = |seed: u64, misfit: f64, gain: f64| {
            let all = [series(seed, misfit, gain)];
            Regression::new(&all).unwrap().test(&all, 0).unwrap()
        };
        let below = (0..400).filter(|seed| tested(*seed, 0.0, 0.5).0 < 0.01).count();
        assert!((1..=12).contains(&below), "{below}");
        for seed in 0..20 {
            let mut least = color::CERTAIN;
            // The larger the misfit, the more certain it is.
            for misfit in [0.5, 1.0, 2.0] {
                let (chance, part) = tested(seed, misfit, 0.1);
                assert!(chance < least && part > LEAST, "{seed} {misfit}: {chance} {part}");
                least = chance;
            }
        }
    }
}
