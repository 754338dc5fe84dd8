//! Identifiability: which unknowns the records can tell apart, where they are excited, and what would help.

mod advice;
mod collinear;
mod excitation;
mod together;

pub(crate) use together::reworded;

use crate::error::Error;
use crate::estimate::{Direction, Summary};
use crate::information::Information;
use crate::optimize::{LeastSquares, Linearization};
use crate::parameter::Transform;
use crate::problem::{Objective, Problem};
use crate::random::Random;
use serde::{Deserialize, Serialize};

/// Identifiability of the unknowns from the records.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Identifiability {
    /// Names of the unknowns, in the order of the fit.
    pub unknowns: Vec<String>,
    /// How many directions of the unknowns the records determine at the estimate.
    pub rank: u64,
    /// Largest over smallest singular value of the sensitivities scaled to unit columns; `None` if the smallest is zero.
    #[serde(with = "crate::real")]
    pub condition: Option<f64>,
    /// The largest rank at random points about the estimate: if below the number of unknowns, no record with these inputs
    /// determines them all (Pohjanpalo, Math. Biosciences 41 (1978) 21, by numbers).
    pub generic_rank: u64,
    /// Sets of two to four unknowns that stand in for each other, most so first; of each set no part is listed.
    pub collinear: Vec<Collinear>,
    /// Where each unknown is excited.
    pub excitation: Vec<Excitation>,
    /// Meaning and remedies, a sentence each; empty if nothing is wrong.
    pub advice: Vec<String>,
}

/// Unknowns that stand in for each other.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Collinear {
    /// Collinearity index (Brun, Reichert and Kuensch, Water Resources Research 37 (2001) 1015, eq. 6): a change of one that
    /// the others answer leaves `1 / index` of its effect. Above 10 to 15 they are hardly identifiable together. `None` if
    /// nothing is left at all.
    #[serde(with = "crate::real")]
    pub index: Option<f64>,
    /// Names and changes, in their own units and the largest effect first, that answer each other.
    #[serde(with = "crate::real")]
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
    #[serde(with = "crate::real")]
    pub strength: f64,
    /// Part of its information that comes through each output, by name.
    #[serde(with = "crate::real")]
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
    #[serde(with = "crate::real")]
    pub from: f64,
    /// Part of the unknown's information, 0 to 1.
    #[serde(with = "crate::real")]
    pub share: f64,
}

/// Indices from here on are listed (Brun et al. 2001, section 3.2).
const COLLINEAR: f64 = 10.0;
/// Singular values below this part of the largest are rounding.
const RANK: f64 = 1e-11;
const POINTS: u64 = 3;
const SEED: u64 = 1;

/// Examines the problem at its estimate.
///
/// # Errors
/// An estimate of another problem, or one that cannot be simulated any more.
///
/// ```
/// # use greybox::{Experiment, Fit, free, pmsm::{Surface, Winding}};
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// # let model = Surface::new(4)?;
/// # let record = Experiment::from_file(&model, "examples/data/pmsm.csv")?;
/// # let start = Winding { rs: free(1.0), ls: free(2e-3), ke: free(0.7) };
/// # let problem = Fit::new(&model, &record).parameters(start).problem()?;
/// # let estimate = problem.run()?;
/// let found = greybox::diagnose::identifiability(&problem, &estimate)?;
/// assert_eq!(found.rank, 5); // three parameters and two initial currents
/// assert!(found.condition.unwrap() < 2.0 && found.collinear.is_empty() && found.advice.is_empty());
/// # Ok(())
/// # }
/// ```
pub fn identifiability(problem: &Problem<'_>, estimate: &Summary) -> Result<Identifiability, Error> {
    examine(problem, estimate, &[])
}

/// [`identifiability`] without advice on sets of unknowns that the estimate's directions name, of which its warnings speak.
pub(crate) fn identifiability_beside_warnings(
    problem: &Problem<'_>,
    estimate: &Summary,
) -> Result<Identifiability, Error> {
    examine(problem, estimate, &estimate.directions)
}

/// Examines the problem; no advice is given on the sets of unknowns of these directions.
fn examine(problem: &Problem<'_>, estimate: &Summary, warned: &[Direction]) -> Result<Identifiability, Error> {
    let (objective, best) = problem.at(estimate)?;
    let linear = objective.linearize(&best).map_err(|error| Error::Optimizer(error.to_string()))?;
    let whole = assembled(&linear);
    let norms = whole.column_norms();
    let names: Vec<String> = objective.names();
    let slopes: Vec<f64> = estimate.unknowns.iter().map(|u| u.transform.slope(u.value)).collect();
    let (rank, condition) = spectrum(&whole);
    // Full rank at one point is full rank.
    let generic_rank = if rank == best.len() {
        rank
    } else {
        generic(&objective, &best, estimate.unknowns.iter().map(|u| u.transform)).max(rank)
    };
    let collinear = collinear::collinear(&whole, &norms, &names, &slopes);
    let mut excitation = excitation::excitation(&objective, &best)?;
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
    let levels = if problem.sweep.predicts_variance() { &[] } else { problem.sweep.levels() };
    result.advice = advice::advice(&result, (warned, levels), &estimate.unknowns, problem.records[0].time_unit());
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
                    Transform::Identity if c == 0.0 => factor,
                    Transform::Identity => c * factor,
                };
                place.clamp(lower, upper)
            })
            .collect();
        objective.linearize(&place).map_or(0, |linear| spectrum(&assembled(&linear)).0)
    };
    (0..POINTS).map(rank).max().unwrap_or(0)
}
