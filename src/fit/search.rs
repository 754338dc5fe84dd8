//! The search: rounds of an optimizer, with the noise estimated between them.

use crate::error::Error;
use crate::judge::{SearchEnd, noise};
use crate::optimize::{Infeasible, Outcome};
use crate::problem::{CheckpointFile, Noise, Objective, Optimizer, Problem, RoundError};
use std::hash::{DefaultHasher, Hash, Hasher};
use std::sync::Arc;

/// The noise is known well enough when a round changes it by less than this part: no unknown then moves by more than that
/// part of its standard error.
const NOISE_TOLERANCE: f64 = 1e-6;
const NOISE_ROUNDS: u32 = 100;

/// Searches from the start, or from where a checkpoint says. `plain` leaves errors in the units of the outputs.
pub(super) fn search(plain: &Objective<'_>, optimizer: &Arc<dyn Optimizer>) -> Result<SearchEnd, Error> {
    let problem = plain.problem;
    let mut coordinates = problem.unknowns.start();
    let mut next = optimizer.clone();
    let mut file = None;
    if let Some((path, every)) = &problem.settings.checkpoint {
        let mut checkpoint = CheckpointFile::new(path.clone(), *every, fingerprint(problem), optimizer.settings()?);
        match optimizer.resume(&checkpoint)? {
            Some((place, iterations, saved)) if place.len() == coordinates.len() => {
                (coordinates, checkpoint.before) = (place, iterations);
                next = saved.unwrap_or(next);
            }
            // Written at once: a place that cannot be written to is better known now.
            _ => optimizer.begin(&checkpoint, &coordinates)?,
        }
        file = Some(checkpoint);
    }
    let mut whitening =
        noise::first_whitening(plain, &coordinates).map_err(|error| start_error(plain, &coordinates, error))?;
    let known = !noise::is_estimated(plain);
    let before = file.as_ref().map_or(0, |file| file.before);
    let (mut iterations, mut evaluations) = (before, 0);
    // Noise as the errors at the start show it is not worth an exact minimum.
    if !known && file.is_none() {
        next = optimizer.rough();
    }
    let mut memory = plain.memory.clone();
    for round in 1.. {
        let objective = Objective { memory, ..plain.with(whitening.clone()) };
        let result = next.round(&objective, coordinates.clone(), file.as_ref()).map_err(|error| match error {
            RoundError::Start(error) => start_error(plain, &coordinates, error),
            RoundError::Optimizer(text) => Error::Optimizer(text),
        })?;
        iterations += result.iterations;
        evaluations += result.evaluations;
        coordinates = result.coordinates;
        let (mut outcome, mut linear) = (result.outcome, result.linear);
        let lost = matches!(outcome, Outcome::Stalled { .. } | Outcome::LimitOfPrecision { .. });
        if lost && noise::reproduces(&objective, &coordinates) {
            outcome = Outcome::Exact;
        }
        let mut settled = known || !outcome.converged();
        if !settled {
            let found = noise::estimate(&objective, &coordinates).unwrap_or_else(|_| whitening.clone());
            let changes = found.sigma().into_iter().zip(whitening.sigma()).map(|(a, b)| (a / b).ln().abs());
            settled = round > 1 && changes.fold(0.0, f64::max) < NOISE_TOLERANCE;
            if !settled {
                (whitening, linear) = (found, None);
            }
            // Rounding is another at every point.
            settled |= outcome == Outcome::Exact;
            if !settled && round == NOISE_ROUNDS {
                outcome = Outcome::IterationLimit { iterations };
                settled = true;
            }
        }
        if settled {
            let trouble = file.and_then(|file| file.trouble());
            let name = result.name;
            let memory = objective.memory;
            return Ok(SearchEnd {
                coordinates,
                whitening,
                linear,
                outcome,
                iterations,
                evaluations,
                name,
                trouble,
                memory,
            });
        }
        next = optimizer.clone();
        memory = objective.memory;
    }
    Err(Error::Optimizer("the search never began".to_owned()))
}

/// Why the start could not be evaluated.
pub(super) fn start_error(objective: &Objective<'_>, coordinates: &[f64], error: Infeasible) -> Error {
    if error == Infeasible::Cancelled {
        return stopped(objective);
    }
    let locate = |e: usize, sample: usize| {
        let failure = objective.locate(e, coordinates, sample);
        if objective.control.stops() { stopped(objective) } else { Error::Start(failure) }
    };
    for e in 0..objective.experiments() {
        let mut last = 0;
        let failed = objective.run_alone(e, coordinates, true, &mut |window| {
            last = window.begin[0];
            let errors = (0..window.samples[0]).flat_map(|k| (0..window.outputs()).map(move |j| (k, j)));
            let mut bad = errors.clone().filter(|&(k, j)| !window.error(k, j, 0).is_finite());
            match bad.next() {
                Some((k, _)) => {
                    last += k;
                    false
                }
                None => true,
            }
        });
        if failed.is_err() {
            return locate(e, last);
        }
    }
    let failing = (0..objective.experiments()).find(|&e| {
        let alone = objective.cost_of(e, coordinates);
        !alone.is_ok_and(f64::is_finite)
    });
    locate(failing.unwrap_or(0), 0)
}

fn stopped(objective: &Objective<'_>) -> Error {
    Error::Option(match objective.problem.settings.time_limit {
        Some(limit) if objective.control.expired() => format!(
            "the time limit of {} s was over before the start had been evaluated; allow more time",
            limit.as_secs_f64()
        ),
        _ => "the fit was cancelled before its start had been evaluated; lower the flag to run it".to_owned(),
    })
}

/// What a checkpoint belongs to: the data, and everything that shapes the cost.
fn fingerprint(problem: &Problem<'_>) -> String {
    let mut hash = DefaultHasher::new();
    env!("CARGO_PKG_VERSION").hash(&mut hash);
    let (sweep, settings) = (&problem.sweep, &problem.settings);
    (sweep.identity(), sweep.layout(), sweep.integrator(), sweep.predictor()).hash(&mut hash);
    for record in &problem.records {
        (record.name(), record.len(), format!("{:?}{:?}", record.input_hold(), record.initial_state())).hash(&mut hash);
        (0..record.len()).for_each(|k| record.time(k).to_bits().hash(&mut hash));
        for channel in record.inputs().iter().chain(record.outputs()) {
            channel.values.iter().for_each(|value| value.to_bits().hash(&mut hash));
        }
    }
    format!("{:?}{:?}", problem.unknowns.parameters, problem.unknowns.row).hash(&mut hash);
    settings.weights.as_ref().map(|weights| weights.describe()).hash(&mut hash);
    settings.loss.as_ref().map(|loss| loss.describe()).hash(&mut hash);
    let noise: &Noise = &settings.noise;
    format!("{:?}{noise:?}", settings.prefilter).hash(&mut hash);
    format!("{:016x}", hash.finish())
}
