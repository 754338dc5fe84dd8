//! One pass over the data without slopes: the residuals at the estimate.

pub(crate) mod coupling;
mod experiment;
pub(crate) mod first_errors;
pub(crate) mod largest;
pub(crate) mod modes;
mod output_sums;
pub(crate) mod powers;
pub(crate) mod products;
mod step_error;
pub(crate) mod whiteness;

use crate::error::Error;
use crate::estimate::OutputFit;
use crate::optimize::Infeasible;
use crate::problem::noise::REPRODUCED;
use crate::problem::{At, Objective, gather_together};
use crate::residuals::coupling::Coupled;
use crate::residuals::first_errors::{Errors, FirstErrors};
use crate::residuals::largest::Largest;
use crate::residuals::modes::StateAt;
use crate::residuals::powers::{COMPARED, Powers, Scale, parts_by_chance, scales};
use crate::residuals::step_error::{Compared, step_errors};
use crate::residuals::whiteness::Whiteness;
use experiment::Sums;
use output_sums::OutputSums;
pub(crate) use output_sums::output_fit;

/// Results of a pass over the residuals.
pub(crate) struct Residuals {
    pub outputs: Vec<OutputFit>,
    /// Number of measurements with a weight above zero.
    pub measured: u64,
    /// Logarithm of the determinant of the covariance of all measurements.
    pub log_determinant: f64,
    /// A bound on how far (in standard errors) a finer step could move the unknowns: the norm of the change of all
    /// standardized predictions, extrapolated from the windows that were simulated again.
    pub step_error: f64,
    /// Some points along the records, their begins first.
    pub points: Vec<StateAt>,
    /// The whiteness of each output's errors.
    pub whiteness: Vec<Whiteness>,
    /// Outputs whose errors are correlated at the same sample, if there are such.
    pub coupled: Option<Coupled>,
    /// Mean and standard deviation of each output's measurements.
    pub levels: Vec<(f64, f64)>,
    /// Mean fourth power of each output's errors, relative to the square of their mean square: 3 of normal ones.
    pub kurtosis: Vec<f64>,
    /// The largest error of each output, standardized where variances are predicted.
    pub largest: Vec<Largest>,
    /// The smallest standard deviation that was predicted for a measurement of each output; infinite without
    /// predictions.
    pub least_sigma: Vec<f64>,
    /// The probability that an output's errors follow as much from powers of its prediction by chance; empty where that is not examined.
    pub shape: Vec<f64>,
    /// The least probability that errors of the halves of the records, or of several records, follow from the prediction in ways
    /// that differ as much by chance.
    pub parts: f64,
    /// The first errors of the first experiments.
    pub first_errors: Vec<Errors>,
    /// The same, divided by their predicted deviations; of an experiment without these, empty.
    pub standardized_errors: Vec<Errors>,
}

impl Residuals {
    /// Whether the errors of an output are round-off of its measurements.
    pub fn is_rounding_of(&self, j: usize) -> bool {
        let (level, moves) = self.levels[j];
        self.outputs[j].rmse <= REPRODUCED * level.hypot(moves)
    }

    /// Whether those of all outputs are, so that the model reproduces the data.
    pub fn is_rounding(&self) -> bool {
        (0..self.outputs.len()).all(|j| self.is_rounding_of(j))
    }
}

/// The least of the probabilities that the halves of the records, or some records, differ as much by chance.
fn parts(all: &[Sums<'_>]) -> f64 {
    let outputs = all[0].powers.len();
    let half = |j: usize, half: usize| {
        let mut sum = Powers::default();
        all.iter().for_each(|one| sum.append(&one.powers[j][half]));
        sum
    };
    let record = |one: &Sums<'_>, j: usize| {
        let mut sum = one.powers[j][0];
        sum.append(&one.powers[j][1]);
        sum
    };
    let of = |j: usize| {
        let halves = parts_by_chance(&[half(j, 0), half(j, 1)]);
        let several = (2..=COMPARED).contains(&all.len());
        let records = || all.iter().map(|one| record(one, j)).collect::<Vec<_>>();
        if several { halves.min(parts_by_chance(&records())) } else { halves }
    };
    (0..outputs).map(of).fold(1.0, f64::min)
}

/// The residuals at a point, in the units of the outputs.
pub(crate) fn residual_pass(objective: &Objective<'_>, coordinates: &[f64]) -> Result<Residuals, Error> {
    // Without a pre-filter: the errors as they are.
    let mut plain = objective.in_units();
    let unfiltered;
    if objective.problem.settings.prefilter.is_some() {
        let mut problem = objective.problem.clone();
        problem.settings.prefilter = None;
        unfiltered = problem;
        plain = Objective { problem: &unfiltered, ..plain };
    }
    let scales = scales(objective);
    let make = |experiment: usize| Sums::new(objective, experiment, &scales);
    let all = plain.gather(coordinates, false, make).map_err(|_| failed(objective, coordinates))?;
    let mut all: Vec<Sums<'_>> = all.into_iter().map(Sums::complete).collect();
    let windows: Vec<Compared<'_>> = all.iter().map(|one| one.compared(coordinates)).collect();
    let step_error = step_errors(&windows).into_iter().sum::<f64>();
    Ok(residuals(objective, coordinates, &mut all, step_error))
}

/// The residuals of several objectives of one record each, at points of their own, whatever their stop conditions; `None` for one that fails.
pub(crate) fn residuals_together(points: &[At<'_>]) -> Vec<Option<Residuals>> {
    let plain: Vec<Objective<'_>> = points.iter().map(|(objective, _)| objective.in_units().unlimited()).collect();
    let in_units: Vec<At<'_>> = plain.iter().zip(points).map(|(plain, (_, x))| (plain, *x)).collect();
    let scales: Vec<Vec<Scale>> = points.iter().map(|(objective, _)| scales(objective)).collect();
    let all = gather_together(&in_units, |i| Sums::new(points[i].0, 0, &scales[i]));
    let mut all: Vec<Option<Sums<'_>>> = all.into_iter().map(|sums| sums.map(Sums::complete)).collect();
    let present = all.iter().zip(points).filter_map(|(sums, (_, x))| Some(sums.as_ref()?.compared(x)));
    let windows: Vec<Compared<'_>> = present.collect();
    let mut step_errors = step_errors(&windows).into_iter();
    let finish = |(sums, (objective, x)): (&mut Option<Sums<'_>>, &At<'_>)| {
        let sums = std::slice::from_mut(sums.as_mut()?);
        Some(residuals(objective, x, sums, step_errors.next()?))
    };
    all.iter_mut().zip(points).map(finish).collect()
}

/// Results from the sums of all experiments, and the sum of the squared changes with a finer step.
fn residuals(objective: &Objective<'_>, coordinates: &[f64], all: &mut [Sums<'_>], step_error: f64) -> Residuals {
    let first_errors: Vec<FirstErrors> = all
        .iter_mut()
        .map(|one| std::mem::replace(&mut one.first_errors, FirstErrors::new(0, 0, 0)))
        .filter(|first| first.errors.first().is_some_and(|errors| !errors.is_empty()))
        .collect();
    let (first_errors, standardized_errors) =
        first_errors.into_iter().map(|first| (first.errors, first.standardized)).unzip();
    let (all, outputs) = (&*all, objective.outputs());
    let mut sums = vec![OutputSums::default(); outputs];
    let (mut measured, mut log_determinant) = (0, 0.0);
    for one in all {
        measured += one.measured;
        log_determinant += one.log_determinants.1;
        sums.iter_mut().zip(&one.outputs).for_each(|(sum, one)| sum.append(one));
    }
    let mut coupling = all[0].coupling.clone();
    all[1..].iter().for_each(|one| coupling.append(&one.coupling));
    let whiteness = |j: usize| {
        let mut total = all[0].portmanteaus[j].clone();
        all[1..].iter().for_each(|one| total.append(&one.portmanteaus[j]));
        // Errors of a short record are correlated by its own unknowns, at each lag by no more than their number in errors.
        let unknowns = &objective.problem.unknowns;
        let own = if all.len() > 1 { unknowns.row.len() - unknowns.shared() } else { 0 };
        let count = sums[j].count;
        Whiteness::of(&total.without(own as f64 / count.max(1) as f64), count)
    };
    let whiteness: Vec<Whiteness> = (0..outputs).map(whiteness).collect();
    let shape = |j: usize| {
        let mut sum = Powers::default();
        all.iter().flat_map(|one| one.powers[j]).for_each(|half| sum.append(&half));
        sum.shape_by_chance()
    };
    Residuals {
        shape: (0..all[0].powers.len()).map(shape).collect(),
        parts: parts(all),
        first_errors,
        standardized_errors,
        outputs: sums.iter().map(OutputSums::fit).collect(),
        levels: sums.iter().map(OutputSums::level).collect(),
        kurtosis: sums.iter().map(OutputSums::kurtosis).collect(),
        measured,
        log_determinant,
        step_error: step_error.sqrt(),
        points: points(objective, coordinates, all),
        coupled: coupling.strongest(&whiteness),
        whiteness,
        largest: (0..outputs)
            .map(|j| all.iter().map(|one| one.largest[j]).fold(Largest::default(), Largest::or))
            .collect(),
        least_sigma: (0..outputs)
            .map(|j| all.iter().map(|one| one.least_sigma[j]).fold(f64::INFINITY, f64::min))
            .collect(),
    }
}

/// The begins of the records, then some points along them.
fn points(objective: &Objective<'_>, coordinates: &[f64], all: &[Sums<'_>]) -> Vec<StateAt> {
    let begin = |experiment: usize| {
        let state = objective.values_of(experiment, coordinates).x;
        StateAt { experiment, sample: 0, state }
    };
    let states = objective.problem.layout().states.len();
    let later = |(experiment, one): (usize, &Sums<'_>)| -> Vec<StateAt> {
        let at = |(sample, carry): &(usize, Vec<f64>)| StateAt {
            experiment,
            sample: *sample,
            state: carry[..states].to_vec(),
        };
        one.points.iter().map(at).collect()
    };
    (0..all.len()).map(begin).chain(all.iter().enumerate().flat_map(later)).collect()
}

fn failed(objective: &Objective<'_>, coordinates: &[f64]) -> Error {
    for e in 0..objective.experiments() {
        let probe = objective.run_alone(e, coordinates, false, &mut |window| {
            (0..window.samples[0]).all(|k| (0..window.outputs()).all(|j| window.error(k, j, 0).is_finite()))
        });
        if let Err(error) = probe {
            let sample = if let crate::sweep::RunError::Failed { sample } = error { sample } else { 0 };
            return Error::Simulation(objective.locate(e, coordinates, sample));
        }
    }
    Error::Simulation(objective.locate(0, coordinates, 0))
}

/// The error of an infeasible point.
pub(crate) fn reason(error: Infeasible) -> Error {
    Error::Optimizer(error.to_string())
}

#[cfg(test)]
mod tests;
