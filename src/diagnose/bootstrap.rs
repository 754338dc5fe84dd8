//! Bootstrap: refits of what the model could as well have measured. It asks for no normal distribution, and in blocks for
//! no white residuals.

use super::leverages::leverages;
use super::{Pinned, check_complete, minimize};
use crate::covariance::leverage::LEAST;
use crate::error::Error;
use crate::estimate::{Summary, WarningCode};
use crate::layout::Kind;
use crate::numeral::resolved;
use crate::optimize::LeastSquares;
use crate::problem::{Problem, Simulated, each};
use crate::random::Random;
use crate::record::Record;
use crate::section::{Cell, Section, Table};
use crate::severity::Severity;
use serde::{Deserialize, Serialize};
use std::sync::atomic::Ordering;
use std::time::Instant;

/// The quantity that is resampled.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Resampling {
    /// Single residuals (Efron, Annals of Statistics 7 (1979) 1): for white ones.
    Residuals,
    /// Blocks of this many residuals in a row, from anywhere (Kuensch, Annals of Statistics 17 (1989) 1217): for colored
    /// ones. Several times as long as they are correlated; zero takes the cube root of the samples.
    Blocks(usize),
}

/// Results of the refits.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Bootstrap {
    /// Names of the unknowns.
    pub unknowns: Vec<String>,
    /// Refits that ended; the others are left out.
    pub converged: u64,
    /// Refits tried. Where a time limit or a flag ended them, they are the first of those that were asked for.
    pub tried: u64,
    /// Standard deviation of each unknown over the refits.
    #[serde(with = "crate::real")]
    pub standard_errors: Vec<f64>,
    /// Mean over the refits less the estimate.
    #[serde(with = "crate::real")]
    pub bias: Vec<f64>,
    /// The 95 % interval of each: the percentiles of the refits, their deviations from the estimate stretched by
    /// `sqrt(n / (n - p))` for the degrees of freedom that residuals have lost (Davison and Hinkley, *Bootstrap Methods*,
    /// 1997, section 6.2.3); weighted residuals have lost none.
    #[serde(with = "crate::real")]
    pub intervals: Vec<(f64, f64)>,
    /// The seed that makes the same again.
    pub seed: u64,
    /// Whether single residuals were drawn although they are colored: the intervals are too narrow.
    #[serde(default)]
    pub colored: bool,
}

const SINGLE: &str = "the errors are colored, and the bootstrap drew single residuals: its intervals are too narrow; draw blocks of residuals";
/// The fewest refits that have percentiles.
const FEWEST: usize = 20;
/// Refits run side by side; at most so many are left out where a time limit or a flag ends them.
const TOGETHER: usize = 64;

/// Refits `count` records made of the simulation and resampled residuals, from the estimate on. Weighted residuals, which may be of several sizes, stay
/// where they are, divided by one less their leverage, and change their signs by chance, all of a block alike (the wild bootstrap: C. F. J. Wu,
/// Annals of Statistics 14 (1986) 1261; E. Flachaire, Computational Statistics and Data Analysis 49 (2005) 361).
///
/// # Errors
/// A predictor that takes in measurements (a filter, [`Horizon`](crate::Horizon)): records made of its predictions are not those of a
/// disturbed plant. An estimate of another problem or one that cannot be simulated, blocks longer than half of an experiment, fewer than twenty
/// refits that end. A time limit or a flag ends it with the refits so far, or is an error where they are fewer.
///
/// ```
/// # use greybox::{Experiment, Fit, free, pmsm::{Surface, Winding}};
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// # let model = Surface::new(4)?;
/// # let record = Experiment::from_file(&model, "examples/data/pmsm.csv")?;
/// # let start = Winding { rs: free(1.0), ls: free(2e-3), ke: free(0.7) };
/// # let problem = Fit::new(&model, &record).parameters(start).problem()?;
/// # let estimate = problem.run()?;
/// use greybox::diagnose::{Resampling, bootstrap};
/// let drawn = bootstrap(&problem, &estimate, Resampling::Residuals, 100, 1)?; // 100 refits, seed 1
/// let by_slopes = estimate.unknowns[0].knowledge.standard_error().unwrap();
/// assert!((drawn.standard_errors[0] / by_slopes - 1.0).abs() < 0.3); // 100 refits know it to 7 %
/// # Ok(())
/// # }
/// ```
pub fn bootstrap(
    problem: &Problem<'_>,
    estimate: &Summary,
    resampling: Resampling,
    count: usize,
    seed: u64,
) -> Result<Bootstrap, Error> {
    let control = problem.control(Instant::now());
    let (objective, best) = problem.at_within(estimate, &control)?;
    if problem.sweep.predicts_variance() || problem.sweep.restarts().is_some() {
        return Err(Error::Option(format!(
            "the bootstrap makes records of a simulation and its errors; {} takes in the measurements, so that its errors are also those of a \
             disturbed plant, which no such record has; take diagnose::profile",
            problem.sweep.predictor()
        )));
    }
    let predictions = (0..objective.experiments()).map(|e| objective.predict(e, &best));
    let predictions = predictions.collect::<Result<Vec<_>, _>>()?;
    check_complete(problem, &control, "the bootstrap")?;
    let residuals: Vec<Vec<Vec<f64>>> = predictions.iter().map(centered).collect();
    if let Some(e) = residuals.iter().position(Vec::is_empty) {
        let experiment = problem.records()[e].name().to_owned();
        return Err(Error::TooFewSamples {
            experiment,
            samples: 0,
            needed: 1,
            purpose: "with all outputs, to resample",
        });
    }
    check_blocks(problem, &residuals, resampling)?;
    let held = estimate.unknowns.iter().map(|unknown| unknown.knowledge.standard_error().is_none()).collect::<Vec<_>>();
    let leverages = objective.is_weighted().then(|| leverages(&objective, &best, &held)).flatten();
    let weighted: Option<Vec<Vec<Vec<f64>>>> = objective.is_weighted().then(|| {
        let of = |e: usize| leverages.as_ref().and_then(|all| all.get(e));
        predictions.iter().enumerate().map(|(e, prediction)| deleted(prediction, of(e))).collect()
    });
    let refit = |number: usize| -> Option<Vec<f64>> {
        let mut random = Random::stream(seed, number as u64);
        let records = problem.records().iter().enumerate().map(|(e, record)| {
            let errors = match &weighted {
                Some(residuals) => signed(&residuals[e], resampling, &mut random),
                None => draw(&residuals[e], record.len(), resampling, &mut random),
            };
            resampled(record, &predictions[e], errors)
        });
        let again = objective.problem.with_records(records.collect()).ok()?;
        let again = objective.of(&again, objective.sweep);
        let (place, _) = minimize(Pinned { problem: &again, bounds: again.bounds() }, best.clone())?;
        Some(estimate.unknowns.iter().zip(&place).map(|(u, &c)| u.transform.to_value(c)).collect())
    };
    // `None` of a refit that a time limit or a flag kept from its beginning or its end.
    let counted = |number: usize| -> Option<Option<Vec<f64>>> {
        let found = if control.stops() { return None } else { refit(number) };
        if let Some(counter) = &problem.settings.counter {
            counter.fetch_add(1, Ordering::Relaxed);
        }
        (found.is_some() || !control.stops()).then_some(found)
    };
    // Those before the first that is missing, so that as many refits with this seed are the same.
    let mut tried: Vec<Option<Vec<f64>>> = vec![];
    for first in (0..count).step_by(TOGETHER) {
        let block = each(TOGETHER.min(count - first), |i| counted(first + i));
        let wanted = tried.len() + block.len();
        tried.extend(block.into_iter().map_while(|refit| refit));
        if tried.len() < wanted {
            break;
        }
    }
    let begun = tried.len();
    let found: Vec<Vec<f64>> = tried.into_iter().flatten().collect();
    if found.len() < FEWEST {
        check_complete(problem, &control, "the bootstrap")?;
        return Err(Error::Option(format!(
            "only {} of {count} refits ended; twenty are the least, some thousand are wanted for percentiles",
            found.len()
        )));
    }
    // Residuals divided by one less their leverage need no factor for degrees of freedom.
    let lost = if leverages.is_some() { 0.0 } else { estimate.measurements as f64 - estimate.degrees_of_freedom() };
    let colored = estimate.warnings.iter().any(|warning| warning.code == WarningCode::ColoredErrors);
    let single = matches!(resampling, Resampling::Residuals) && problem.layout().kind != Kind::Static;
    Ok(Bootstrap { colored: colored && single, ..spread(estimate, &found, (begun, lost), seed) })
}

/// Scatter and percentiles of the refits that ended, of `tried` in all, of residuals that have lost so many degrees of freedom.
fn spread(estimate: &Summary, found: &[Vec<f64>], (tried, lost): (usize, f64), seed: u64) -> Bootstrap {
    let measurements = estimate.measurements as f64;
    let stretch = (measurements / (measurements - lost).max(1.0)).sqrt();
    let mut result = Bootstrap {
        unknowns: estimate.unknowns.iter().map(|unknown| unknown.name.clone()).collect(),
        converged: found.len() as u64,
        tried: tried as u64,
        standard_errors: vec![],
        bias: vec![],
        intervals: vec![],
        seed,
        colored: false,
    };
    let n = found.len() as f64;
    for (i, unknown) in estimate.unknowns.iter().enumerate() {
        let transform = unknown.transform;
        let center = transform.to_coordinate(unknown.value);
        let mut column: Vec<f64> = found.iter().map(|values| values[i]).collect();
        column.sort_unstable_by(f64::total_cmp);
        let mean = column.iter().sum::<f64>() / n;
        let variance = column.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0);
        let at = |part: f64| {
            let value = quantile(&column, part);
            transform.to_value(center + stretch * (transform.to_coordinate(value) - center))
        };
        result.standard_errors.push(stretch * variance.sqrt());
        result.bias.push(mean - unknown.value);
        result.intervals.push((at(0.025), at(0.975)));
    }
    result
}

/// The quantile of numbers in order: number `part (n + 1)` of them, on the line between neighbors (Hyndman and Fan, The American
/// Statistician 50 (1996) 361, definition 6).
fn quantile(ordered: &[f64], part: f64) -> f64 {
    let n = ordered.len() as f64;
    let place = part * (n + 1.0) - 1.0;
    let below = place.floor().clamp(0.0, n - 1.0);
    let above = (below + 1.0).min(n - 1.0);
    let (low, high) = (ordered[below as usize], ordered[above as usize]);
    low + (high - low) * (place - below).clamp(0.0, 1.0)
}

/// Refuses blocks longer than half of an experiment's residuals: its resamples would hardly differ, and with them the refits.
fn check_blocks(problem: &Problem<'_>, residuals: &[Vec<Vec<f64>>], resampling: Resampling) -> Result<(), Error> {
    let Resampling::Blocks(length) = resampling else { return Ok(()) };
    match residuals.iter().position(|own| length > own.len() / 2) {
        Some(e) => Err(Error::Option(format!(
            "blocks of {length} residuals are longer than half of experiment `{}`, which has {}: its resamples would hardly \
             differ; take shorter blocks, or zero for the cube root of the samples",
            problem.records()[e].name(),
            residuals[e].len()
        ))),
        None => Ok(()),
    }
}

/// The residuals of the samples of which all outputs have one, sample by sample. Centered: a mean that the model left would
/// be counted as noise.
fn centered(prediction: &Simulated) -> Vec<Vec<f64>> {
    let means: Vec<f64> = prediction.residuals.iter().map(|column| mean(column)).collect();
    let samples = prediction.residuals.first().map_or(0, Vec::len);
    let row = |k: usize| -> Vec<f64> {
        prediction.residuals.iter().zip(&means).map(|(column, mean)| column[k] - mean).collect()
    };
    (0..samples).map(row).filter(|row| row.iter().all(|e| e.is_finite())).collect()
}

fn mean(values: &[f64]) -> f64 {
    let values = values.iter().filter(|value| value.is_finite());
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), value| (sum + value, count + 1.0));
    if count > 0.0 { sum / count } else { 0.0 }
}

/// The record that the prediction and these errors make; what was not measured stays so.
fn resampled(record: &Record, prediction: &Simulated, errors: Vec<Vec<f64>>) -> Record {
    let outputs = record.outputs.iter().enumerate().map(|(j, channel)| {
        let rows = channel.values.iter().zip(&prediction.outputs[j]).zip(&errors);
        let drawn = |((old, new), e): ((&f64, &f64), &Vec<f64>)| if old.is_nan() { f64::NAN } else { new + e[j] };
        channel.with(rows.map(drawn).collect::<Vec<f64>>())
    });
    Record { outputs: outputs.collect(), ..record.clone() }
}

/// As many rows as asked for, all outputs of a sample together.
fn draw<Y: Clone>(residuals: &[Y], count: usize, resampling: Resampling, random: &mut Random) -> Vec<Y> {
    let length = block(resampling, residuals.len());
    let mut drawn = Vec::with_capacity(count + length);
    while drawn.len() < count {
        let begin = random.below(residuals.len() - length + 1);
        drawn.extend_from_slice(&residuals[begin..begin + length]);
    }
    drawn.truncate(count);
    drawn
}

/// How many of so many residuals in a row stay together.
fn block(resampling: Resampling, residuals: usize) -> usize {
    match resampling {
        Resampling::Residuals => 1,
        Resampling::Blocks(0) => (residuals as f64).cbrt().round() as usize,
        Resampling::Blocks(length) => length,
    }
    .clamp(1, residuals.max(1))
}

/// The deleted residuals of all samples: each divided by one less its leverage, as if the fit had been made without it. Zero where nothing
/// was measured.
fn deleted(prediction: &Simulated, leverages: Option<&Vec<f64>>) -> Vec<Vec<f64>> {
    let (samples, outputs) = (prediction.residuals.first().map_or(0, Vec::len), prediction.residuals.len());
    let at = |k: usize, j: usize| {
        let leverage = leverages.map_or(0.0, |own| own[k * outputs + j]);
        let (residual, leverage) = (prediction.residuals[j][k], if leverage.is_finite() { leverage } else { 0.0 });
        if residual.is_finite() { residual / (1.0 - leverage).max(LEAST) } else { 0.0 }
    };
    (0..samples).map(|k| (0..outputs).map(|j| at(k, j)).collect()).collect()
}

/// These residuals, those of a block with one sign.
fn signed(residuals: &[Vec<f64>], resampling: Resampling, random: &mut Random) -> Vec<Vec<f64>> {
    let length = block(resampling, residuals.len());
    let mut sign = || if random.below(2) == 0 { 1.0 } else { -1.0 };
    let signed = |block: &[Vec<f64>]| -> Vec<Vec<f64>> {
        let sign = sign();
        block.iter().map(|row| row.iter().map(|e| sign * e).collect()).collect()
    };
    residuals.chunks(length).flat_map(signed).collect()
}

/// Standard errors, bias and intervals as a table.
impl From<&Bootstrap> for Section {
    fn from(found: &Bootstrap) -> Section {
        let Bootstrap { unknowns, converged, tried, standard_errors, bias, intervals, seed, colored } = found;
        let row = |i: usize| {
            let (error, (lower, upper)) = (standard_errors[i], intervals[i]);
            let interval = format!("{} … {}", resolved(lower, error), resolved(upper, error));
            [unknowns[i].as_str().into(), Cell::error(error), Cell::number(bias[i], 2), interval.into()]
        };
        let rows = unknowns.len().min(standard_errors.len()).min(bias.len()).min(intervals.len());
        let columns = ["unknown", "std. error", "bias", "95 % interval"];
        let table = Table::new("Refits of resampled records", columns).rows((0..rows).map(row));
        let text = format!("{converged} of {tried} refits ended; the seed {seed} makes the same again.");
        let section = Section::new("bootstrap", "Bootstrap").says(text).table(table.at_most(40));
        if *colored { section.because(Severity::UsableWithCare, SINGLE) } else { section }
    }
}

impl From<Bootstrap> for Section {
    fn from(found: Bootstrap) -> Section {
        Section::from(&found)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_are_of_what_is_finite() {
        assert_eq!([mean(&[1.0, 3.0, f64::NAN, 8.0]), mean(&[f64::INFINITY, 2.0]), mean(&[f64::NAN])], [4.0, 2.0, 0.0]);
    }

    /// Of 1, 4, 9, ..., 361 (19 squares) the quantile `part` is at number `20 part`.
    #[test]
    fn quantiles_are_between_neighbors() {
        let squares: Vec<f64> = (1..20).map(|k| f64::from(k * k)).collect();
        for (part, expected) in
            [(0.5, 100.0), (0.05, 1.0), (0.95, 361.0), (0.13, 4.0 + 0.6 * 5.0), (0.01, 1.0), (0.99, 361.0)]
        {
            assert!((quantile(&squares, part) - expected).abs() < 1e-9, "{part}: {}", quantile(&squares, part));
        }
    }

    /// Blocks stand together, each place of a block in the record is drawn, the first and the last as often as others, and
    /// samples keep all their outputs.
    #[test]
    fn blocks_are_drawn_evenly() {
        let rows: Vec<Vec<f64>> = (0..10).map(|k| vec![f64::from(k), -f64::from(k)]).collect();
        let drawn = draw(&rows, 24_000, Resampling::Blocks(3), &mut Random::stream(1, 1));
        assert_eq!(drawn.len(), 24_000);
        let mut begins = [0u32; 8];
        for block in drawn.chunks(3) {
            let first = block[0][0];
            begins[first as usize] += 1;
            assert!((0..3).all(|k| block[k][0] == first + k as f64 && block[k][1] == -block[k][0]), "{block:?}");
        }
        // 1000 each, four deviations of 30.
        assert!(begins.iter().all(|count| count.abs_diff(1000) < 120), "{begins:?}");
        assert_eq!(draw(&rows, 7, Resampling::Residuals, &mut Random::stream(1, 2)).len(), 7);
    }
}
