//! Identifiability: which unknowns the records can tell apart, where they are excited, and what would help.

use crate::error::Error;
use crate::estimate::Estimate;
use crate::experiment::ExperimentOf;
use crate::fit::{FitProblem, Objective, Rows};
use crate::information::Information;
use crate::integrate::Integrator;
use crate::model::Model;
use crate::optimize::{LeastSquares, Linearization};
use crate::parameter::Transform;
use crate::predict::{Predictor, WINDOW};
use crate::random::Random;
use crate::signals::Signals;
use serde::{Deserialize, Serialize};

/// What the records can tell of the unknowns.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Identifiability {
    /// Names of the unknowns, in the order of the fit.
    pub unknowns: Vec<String>,
    /// How many directions of the unknowns the records determine at the estimate.
    pub rank: u64,
    /// Largest over smallest singular value of the sensitivities scaled to unit columns; `None` if the smallest is zero.
    pub condition: Option<f64>,
    /// The largest rank at random points about the estimate: if below the number of unknowns, no record with these inputs
    /// determines them all (Pohjanpalo, Math. Biosciences 41 (1978) 21, by numbers).
    pub generic_rank: u64,
    /// Sets of two to four unknowns that stand in for each other, most so first; of each set no part is listed.
    pub collinear: Vec<Collinear>,
    /// Where each unknown is excited.
    pub excitation: Vec<Excitation>,
    /// What it means and what would help, a sentence each; empty if all is well.
    pub advice: Vec<String>,
}

/// Unknowns that stand in for each other.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Collinear {
    /// Collinearity index (Brun, Reichert and Kuensch, Water Resources Research 37 (2001) 1015, eq. 6): a change of one that
    /// the others answer leaves `1 / index` of its effect. Above 10 to 15 they are hardly identifiable together. `None` if
    /// nothing is left at all.
    pub index: Option<f64>,
    /// Names and changes, in their own units and the largest effect first, that answer each other.
    pub moves: Vec<(String, f64)>,
}

/// Where an unknown is excited.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Excitation {
    /// Name of the unknown.
    pub name: String,
    /// Root of the sum of its squared standardized sensitivities, times its value (or one, if zero): how many standard
    /// deviations of noise a relative change of one moves the outputs by.
    pub strength: f64,
    /// Part of its information that comes through each output, by name.
    pub outputs: Vec<(String, f64)>,
    /// Part that comes from each tenth of each experiment, in order.
    pub segments: Vec<Segment>,
}

/// A part of a record.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Segment {
    /// Name of the experiment.
    pub experiment: String,
    /// Time of its first sample (s).
    pub from: f64,
    /// Part of the unknown's information, 0 to 1.
    pub share: f64,
}

/// Indices from here on are listed (Brun et al. 2001, section 3.2).
pub const COLLINEAR: f64 = 10.0;
/// Singular values below this part of the largest are rounding.
const RANK: f64 = 1e-11;
/// Sets of up to four are looked through for at most so many unknowns; the strongest ones beyond.
const MOST: usize = 24;
const SEGMENTS: usize = 10;
const POINTS: u64 = 3;
const SEED: u64 = 1;

/// Examines the problem at its estimate.
///
/// # Errors
/// An estimate of another problem, or one that cannot be simulated any more.
pub fn identifiability<M: Model, I: Integrator<M>, P: Predictor<M>, O>(
    problem: &FitProblem<'_, M, I, P, O>,
    estimate: &Estimate<M, I, P>,
) -> Result<Identifiability, Error> {
    let (objective, best) = problem.at(estimate)?;
    let linear = objective.linearize(&best).map_err(|error| Error::Optimizer(error.to_string()))?;
    let whole = assembled(&linear);
    let norms = whole.column_norms();
    let names: Vec<String> = objective.names();
    let slopes: Vec<f64> = estimate.unknowns.iter().map(|u| u.transform.slope(u.value)).collect();
    let (rank, condition) = spectrum(&whole);
    let generic_rank = generic(&objective, &best, estimate.unknowns.iter().map(|u| u.transform)).max(rank);
    let collinear = collinear(&whole, &norms, &names, &slopes);
    let mut excitation = excitation(&objective, &best)?;
    for ((excited, norm), unknown) in excitation.iter_mut().zip(&norms).zip(&estimate.unknowns) {
        let size = if unknown.value == 0.0 { 1.0 } else { unknown.value.abs() };
        excited.strength = norm * size / unknown.transform.slope(unknown.value).abs();
    }
    let mut result = Identifiability {
        unknowns: names,
        rank: rank as u64,
        condition,
        generic_rank: generic_rank as u64,
        collinear,
        excitation,
        advice: vec![],
    };
    result.advice = advice::<M>(&result, problem.experiments());
    Ok(result)
}

/// One triangle over all unknowns.
fn assembled(linear: &Linearization) -> Information {
    let n = linear.unknowns();
    let mut whole = Information::new(n);
    for (block, columns) in linear.columns() {
        for i in 0..=block.columns() {
            let mut row = vec![0.0; n];
            columns.iter().enumerate().for_each(|(c, &unknown)| row[unknown] = block.at(i, c));
            whole.absorb_row(&row, block.at(i, block.columns()));
        }
    }
    whole
}

fn spectrum(whole: &Information) -> (usize, Option<f64>) {
    let scales: Vec<f64> = whole.column_norms().iter().map(|n| if *n > 0.0 { n.recip() } else { 1.0 }).collect();
    match whole.decomposition(&scales) {
        Ok(spectrum) => {
            let condition = spectrum.condition();
            (spectrum.rank(RANK), (condition.is_finite() && condition < RANK.recip()).then_some(condition))
        }
        Err(_) => (0, None),
    }
}

/// The largest rank at a few random points within a factor of 1.5 of the estimate.
fn generic(objective: &Objective<'_>, best: &[f64], transforms: impl Iterator<Item = Transform> + Clone) -> usize {
    let bounds = objective.bounds();
    let rank = |point: u64| {
        let mut random = Random::stream(SEED, point);
        let place: Vec<f64> = best
            .iter()
            .zip(transforms.clone())
            .zip(&bounds)
            .map(|((&c, transform), &(lower, upper))| {
                let factor = 1.5f64.powf(2.0 * random.uniform() - 1.0);
                let place = match transform {
                    Transform::Log => c + factor.ln(),
                    Transform::Identity if c == 0.0 => 2.0 * random.uniform() - 1.0,
                    Transform::Identity => c * factor,
                };
                place.clamp(lower, upper)
            })
            .collect();
        objective.linearize(&place).map_or(0, |linear| spectrum(&assembled(&linear)).0)
    };
    (0..POINTS).map(rank).max().unwrap_or(0)
}

/// All sets of two to four unknowns above the limit, without those that hold a smaller such set.
fn collinear(whole: &Information, norms: &[f64], names: &[String], slopes: &[f64]) -> Vec<Collinear> {
    let mut seen: Vec<usize> = (0..norms.len()).filter(|&i| norms[i] > 0.0).collect();
    seen.truncate(MOST);
    let mut found: Vec<(f64, Vec<usize>, Vec<f64>)> = vec![];
    for size in 2..=seen.len().min(4) {
        for set in subsets(&seen, size) {
            if found.iter().any(|(_, smaller, _)| smaller.iter().all(|i| set.contains(i))) {
                continue;
            }
            let scales: Vec<f64> = set.iter().map(|&i| norms[i].recip()).collect();
            let Ok(spectrum) = whole.select(&set).decomposition(&scales) else { continue };
            let (Some(smallest), Some(direction)) = (spectrum.values.last(), spectrum.directions.last()) else {
                continue;
            };
            if smallest * COLLINEAR <= 1.0 {
                found.push((*smallest, set, direction.clone()));
            }
        }
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    let listed = |(smallest, set, direction): (f64, Vec<usize>, Vec<f64>)| {
        let mut moves: Vec<(f64, String, f64)> =
            set.iter().zip(&direction).map(|(&i, d)| (d.abs(), names[i].clone(), d / norms[i] * slopes[i])).collect();
        moves.sort_by(|a, b| b.0.total_cmp(&a.0));
        let unit = moves.first().map_or(1.0, |(_, _, by)| *by);
        let moves = moves.into_iter().map(|(_, name, by)| (name, by / unit)).collect();
        Collinear { index: (smallest > RANK).then(|| smallest.recip()), moves }
    };
    found.into_iter().map(listed).collect()
}

fn subsets(of: &[usize], size: usize) -> Vec<Vec<usize>> {
    match (size, of) {
        (0, _) => vec![vec![]],
        (_, []) => vec![],
        (_, [first, rest @ ..]) => {
            let with = subsets(rest, size - 1).into_iter().map(|set| [&[*first], set.as_slice()].concat());
            with.chain(subsets(rest, size)).collect()
        }
    }
}

fn excitation(objective: &Objective<'_>, best: &[f64]) -> Result<Vec<Excitation>, Error> {
    let (n, outputs) = (best.len(), objective.outputs());
    let mut by_output = vec![vec![0.0; outputs]; n];
    let mut by_segment = vec![vec![]; n];
    let mut begins = vec![];
    for e in 0..objective.experiments() {
        let samples = objective.source.samples(e);
        let columns: Vec<usize> = objective.unknowns.columns(e).collect();
        let (rows, length) = (outputs * WINDOW, samples.div_ceil(SEGMENTS).max(1));
        let mut sums = vec![vec![0.0; samples.div_ceil(length)]; n];
        let visit = &mut |Rows { begin, samples, window }: Rows<'_>| {
            let slopes = window.data_mut();
            for (c, &unknown) in columns.iter().enumerate() {
                for j in 0..outputs {
                    let column = &slopes[c * rows + j * WINDOW..][..samples];
                    for (k, slope) in column.iter().enumerate() {
                        by_output[unknown][j] += slope * slope;
                        sums[unknown][(begin + k) / length] += slope * slope;
                    }
                }
            }
        };
        if objective.walk(e, best, true, visit).is_err() {
            return Err(Error::Simulation(objective.locate(e, best, 0)));
        }
        let segments = sums.first().map_or(0, Vec::len);
        let label = &objective.unknowns.labels[e];
        begins.extend((0..segments).map(|s| (label.clone(), objective.source.time(e, s * length))));
        by_segment.iter_mut().zip(sums).for_each(|(all, sums): (&mut Vec<f64>, _)| all.extend(sums));
    }
    let names = objective.names();
    let excited = |i: usize| {
        let total = by_output[i].iter().sum::<f64>().max(f64::MIN_POSITIVE);
        let output = |j: usize| (objective.source.outputs()[j].to_owned(), by_output[i][j] / total);
        let segment = |(sum, (experiment, from)): (&f64, &(String, f64))| Segment {
            experiment: experiment.clone(),
            from: *from,
            share: sum / total,
        };
        Excitation {
            name: names[i].clone(),
            strength: 0.0,
            outputs: (0..outputs).map(output).collect(),
            segments: by_segment[i].iter().zip(&begins).map(segment).collect(),
        }
    };
    Ok((0..n).map(excited).collect())
}

fn advice<M: Model>(found: &Identifiability, records: &[ExperimentOf<M>]) -> Vec<String> {
    let mut advice = vec![];
    let n = found.unknowns.len() as u64;
    if found.generic_rank < n {
        advice.push(format!(
            "the records determine {} combinations of the {n} unknowns wherever the parameters lie: with these inputs and \
             outputs the model cannot be told apart; fix {} of them, or measure or excite something else",
            found.generic_rank,
            n - found.generic_rank
        ));
    }
    for Collinear { index, moves } in &found.collinear {
        let names: Vec<String> = moves.iter().map(|(name, _)| format!("`{name}`")).collect();
        let together: Vec<String> = moves.iter().map(|(name, by)| format!("{name} by {by:+.4}")).collect();
        let left = index.map_or("nothing".to_owned(), |index| format!("{:.2} % of the effect", 100.0 / index));
        advice.push(format!(
            "{} stand in for each other: moving {} leaves {left}; fix one, or excite them apart",
            names.join(", "),
            together.join(", ")
        ));
    }
    for excited in &found.excitation {
        if excited.outputs.iter().all(|(_, share)| *share == 0.0) {
            advice.push(format!("`{}` moves no output at all: fix it", excited.name));
            continue;
        }
        if excited.outputs.len() > 1
            && let Some((output, share)) = excited.outputs.iter().find(|(_, share)| *share > 0.99)
            && !excited.name.contains("(0)")
        {
            let others: Vec<String> = excited
                .outputs
                .iter()
                .filter(|(name, _)| name != output)
                .map(|(name, _)| format!("`{name}`"))
                .collect();
            advice.push(format!(
                "`{}` is seen only through `{output}` ({:.2} %): {} hardly answers to it; excite it there for a second witness",
                excited.name,
                100.0 * share,
                others.join(", ")
            ));
        }
        if let Some(segment) = excited.segments.iter().find(|segment| segment.share > 0.9)
            && excited.segments.len() > 1
            && !excited.name.contains("(0)")
        {
            advice.push(format!(
                "`{}` is known from one tenth of `{}` alone, from t = {} s on ({:.1} %)",
                excited.name,
                segment.experiment,
                segment.from,
                100.0 * segment.share
            ));
        }
    }
    for i in 0..M::Input::LEN {
        let value = |k: usize, e: usize| M::Input::into_array(records[e].inputs()[k]).as_ref()[i];
        let first = value(0, 0);
        let all = records.iter().enumerate();
        if all.flat_map(|(e, r)| (0..r.len()).map(move |k| (k, e))).all(|(k, e)| value(k, e) == first) {
            advice.push(format!(
                "the input `{}` is {first} throughout: what it drives cannot be told from an offset; vary it",
                M::Input::NAMES[i]
            ));
        }
    }
    advice
}
