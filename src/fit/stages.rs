//! A continuation from predictions to a simulation, for far starts: a sequence of fits (stages) of one-step predictions by an extended filter,
//! each from the estimate of the one before, with smaller corrections of the state at each sample, until a simulation follows the measurements.
//!
//! The size of the corrections is given by the filter's memory, the time after which the influence of a measurement on the state has decayed. An
//! error of the parameters accumulates over that time only: with a short memory the predictions are nearly linear in the parameters. With a long
//! one the parameters have smaller variances, and less bias by the noise of the measurements.

use super::refine::Start;
use super::search::search;
use crate::predict::{GivenNoise, Guess};
use crate::problem::{Control, Noise, Problem, Settings, noise};
use crate::record::{Channel, Record};

/// The least noise of an output, as a part of half its range.
const LEAST_NOISE: f64 = 1e-6;
/// The memory of the first stage, as a part of the time in which the outputs change by half their range; at least this part of an interval.
const FIRST_MEMORY: f64 = 0.1;
/// Predictions are near the measurements where their error is at most so many times the noise. If those from the start are not, the first memory is
/// shorter.
const NEAR: f64 = 5.0;
/// How many times longer the memory is from stage to stage, and the most stages: the last memory is 1e9 times the first.
const LONGER: f64 = 4.0;
const MOST: u32 = 16;
/// The most trial steps of a stage. Most take 5 to 20; the first one from a mass that is 500 times too small takes 70.
const TRIALS: u64 = 100;
/// Stages that begin with a longer memory come nearer where the square of the distance is below this part of that before.
const BETTER: f64 = 0.9;
/// A simulation follows an output where its error is at most so many times that of the predictions.
const FOLLOWS: f64 = 1.5;
/// Predictions do not explain an output where their error is above this part of half the range. A longer memory does so still less.
const UNEXPLAINED: f64 = 0.5;
/// With more states the program of a stage takes seconds to compile: its carry has `n + n^2` numbers.
const MOST_STATES: usize = 6;

/// The stages of a problem.
pub(super) struct Stages<'p> {
    problem: &'p Problem<'p>,
    outputs: Vec<Moves>,
    /// The mean interval of the samples (s).
    step: f64,
    /// How fast the outputs change: by half their range in the time `1 / rate` (1/s).
    rate: f64,
}

/// What the stages from a start did.
#[derive(Clone, Copy, Default)]
pub(super) struct Led {
    pub stages: u32,
    pub evaluations: u64,
    /// Whether a simulation from their end follows the measurements as well as the predictions do.
    pub follows: bool,
}

impl Problem<'_> {
    /// The stages of this problem.
    ///
    /// # Errors
    /// Why there are none.
    pub(super) fn stages(&self) -> Result<Stages<'_>, &'static str> {
        let layout = self.layout();
        if self.sweep.predicts_variance() || self.sweep.restarts().is_some() {
            return Err("the predictor corrects the state by itself");
        }
        if layout.states.is_empty() {
            return Err("the model has no state");
        }
        if layout.states.len() > MOST_STATES {
            return Err("the model has more than six states");
        }
        if self.settings.prefilter.is_some() {
            return Err("the errors are filtered");
        }
        let moves = |j: usize| Moves::of(self.records.iter().map(|record| (record, &record.outputs()[j])));
        let outputs: Vec<Moves> = (0..layout.outputs.len()).map(moves).collect();
        let rate = outputs.iter().map(|moves| moves.rate).fold(0.0, f64::max);
        let first = self.records.first().filter(|first| first.len() > 1);
        let step = first.map_or(0.0, |first| (first.time(first.len() - 1) - first.time(0)) / (first.len() - 1) as f64);
        if !(rate > 0.0 && rate.is_finite() && step > 0.0) {
            return Err("no output moves");
        }
        let stages = Stages { problem: self, outputs, step, rate };
        let is_compiled = stages.problem(step).is_some();
        let reason = "the model is not compiled: it cannot be read as a graph, or the integrator chooses its steps";
        is_compiled.then_some(stages).ok_or(reason)
    }

    /// Whether a simulation from the declared start explains the outputs: its rms errors are below a quarter of their ranges. `None` where it cannot be
    /// evaluated.
    pub(super) fn start_explains(&self, control: &Control) -> Option<bool> {
        let explained = |(j, error): (usize, f64)| {
            let moves = Moves::of(self.records.iter().map(|record| (record, &record.outputs()[j])));
            moves.half == 0.0 || error <= UNEXPLAINED * moves.half
        };
        Some(errors(self, &self.start(), control)?.into_iter().enumerate().all(explained))
    }

    /// The size of each state: of those that the outputs give, what moves these by half their range; of the others, what moves the derivatives of
    /// states whose size is known by that size in the time `1 / rate`.
    fn scales(&self, record: &Record, rate: f64) -> Option<Vec<f64>> {
        let p: Vec<f64> = self.unknowns.parameters.iter().map(|parameter| parameter.start).collect();
        let Guess { state, sizes, .. } = self.sweep.guessed_state(record, &p).ok()?;
        let n = state.len();
        let mut scales = sizes;
        let slopes = self.sweep.state_slopes(record, 0, &state, &p).unwrap_or_else(|| vec![0.0; n * n]);
        for _ in 0..n {
            let known = scales.clone();
            for (j, scale) in scales.iter_mut().enumerate().filter(|(_, scale)| scale.is_none()) {
                let moved = |(i, known): (usize, &Option<f64>)| Some(rate * (*known)? / slopes[i * n + j].abs());
                let moved =
                    known.iter().enumerate().filter_map(moved).filter(|moved| *moved > 0.0 && moved.is_finite());
                *scale = moved.min_by(f64::total_cmp);
            }
        }
        let most = scales.iter().flatten().copied().fold(0.0, f64::max);
        let scales =
            scales.into_iter().zip(&state).map(|(scale, x)| scale.unwrap_or(if *x == 0.0 { most } else { x.abs() }));
        Some(scales.collect())
    }
}

/// Range, noise and rate of change of an output, from its measured samples in all records.
struct Moves {
    /// Half its range, in its unit.
    half: f64,
    /// Standard deviation of its noise, from second differences, in which slow changes nearly cancel; at least a small part of `half`.
    noise: f64,
    /// It changes by `half` in the time `1 / rate` (1/s); 0 where it does not move.
    rate: f64,
}

impl Moves {
    fn of<'r>(channels: impl Iterator<Item = (&'r Record, &'r Channel)>) -> Self {
        let measured = |(record, channel): (&Record, &Channel)| -> (Vec<f64>, f64) {
            let samples: Vec<usize> = (0..record.len()).filter(|&k| channel.values[k].is_finite()).collect();
            let ends = samples.first().zip(samples.last());
            let length = ends.map_or(0.0, |(first, last)| record.time(*last) - record.time(*first));
            (samples.into_iter().map(|k| channel.values[k]).collect(), length)
        };
        let all: Vec<(Vec<f64>, f64)> = channels.map(measured).collect();
        let range = |values: &Vec<f64>| {
            let ends = values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), y| (a.min(*y), b.max(*y)));
            (ends.1 - ends.0).max(0.0)
        };
        let half = 0.5 * all.iter().map(|(values, _)| range(values)).fold(0.0, f64::max);
        let mean_square = |differences: &mut dyn Iterator<Item = f64>| {
            let (sum, count) = differences.fold((0.0, 0.0), |(sum, count), d| (sum + d * d, count + 1.0));
            if count > 0.0 { sum / count } else { 0.0 }
        };
        let mut second = all.iter().flat_map(|(values, _)| values.windows(3).map(|y| y[0] - 2.0 * y[1] + y[2]));
        // A sum of independent errors with weights 1, -2 and 1 has six times their variance.
        let noise = (mean_square(&mut second) / 6.0).sqrt().max(LEAST_NOISE * half);
        // The record in which it moves the most, by lags that double.
        let most = all.iter().max_by(|a, b| range(&a.0).total_cmp(&range(&b.0)));
        let rate =
            most.filter(|(values, length)| half > 0.0 && values.len() > 1 && *length > 0.0).map(|(values, length)| {
                let interval = length / (values.len() - 1) as f64;
                let lags = std::iter::successors(Some(1), |lag| Some(2 * lag)).take_while(|lag| *lag < values.len());
                let far = |lag: &usize| {
                    let mut differences = values.iter().zip(&values[*lag..]).map(|(a, b)| b - a);
                    mean_square(&mut differences) >= 0.25 * half * half
                };
                lags.into_iter().find(far).map_or(length.recip(), |lag| 0.5 / (lag as f64 * interval))
            });
        Moves { half, noise, rate: rate.unwrap_or(0.0) }
    }
}

impl Stages<'_> {
    /// The problem of a stage with this memory (s). The steady gain of a random walk whose increments are `part` times the noise of its measurements
    /// is about `part`, so that the influence of a measurement decays in `1 / part` intervals.
    fn problem(&self, memory: f64) -> Option<Problem<'_>> {
        let problem = self.problem;
        let scales = problem.scales(problem.records.first()?, self.rate.max(memory.recip()))?;
        let part = self.outputs.iter().filter(|moves| moves.half > 0.0).map(|moves| moves.noise / moves.half);
        let part = part.fold(LEAST_NOISE, f64::max) * self.step / memory;
        let positive = |level: f64| if level > 0.0 { level } else { 1.0 };
        let noise = GivenNoise {
            states: scales.iter().map(|scale| part * positive(*scale)).collect(),
            outputs: self.outputs.iter().map(|moves| positive(moves.noise)).collect(),
        };
        let sweep = problem.sweep.filtering(&noise)?;
        let optimizer = problem.settings.optimizer.limited(TRIALS);
        let settings = Settings { optimizer, ..problem.settings.beside(Noise::Predicted) };
        let parameters = &problem.unknowns.parameters;
        Problem::new(sweep, problem.records.clone(), parameters, settings).ok()
    }

    /// The memory of the first stage (s): the longest one, in steps of four, in which the outputs change by a small part of their range, and with which
    /// predictions from the start are near the measurements; else a part of an interval.
    fn first_memory(&self, start: &[f64], control: &Control) -> f64 {
        let least = FIRST_MEMORY * self.step;
        let mut memory = (FIRST_MEMORY / self.rate).max(least);
        let follows = |memory: f64| {
            let problem = self.problem(memory)?;
            let errors = errors(&problem, start, control)?;
            Some(errors.iter().zip(&self.outputs).all(|(e, moves)| *e <= NEAR * moves.noise || moves.half == 0.0))
        };
        while memory > least && follows(memory) != Some(true) && !control.stops() {
            memory = (memory / LONGER).max(least);
        }
        memory
    }

    /// The end of the stages from a start. With a short memory the predictions depend little on the parameters, beside the noise of the measurements:
    /// where the last predictions are not near these, the stages are repeated from the start with a longer first memory, as long as their end comes
    /// nearer. `None` where no simulation from an end is nearer to the measurements than one from the start.
    pub fn lead(&self, start: &[f64], control: &Control) -> Option<(Vec<f64>, Led)> {
        let (mut memory, longest) = (self.first_memory(start, control), self.rate.recip());
        let (mut found, mut nearest): (_, f64) = (None, self.distance(start).unwrap_or(f64::INFINITY));
        let mut evaluations = 0;
        loop {
            let (coordinates, led, near) = self.lead_from(start, memory, control);
            evaluations += led.evaluations;
            let distance = self.distance(&coordinates).unwrap_or(f64::INFINITY);
            let no_better = found.is_some() && distance > BETTER * nearest;
            if distance < nearest {
                (found, nearest) = (Some((coordinates, led)), distance);
            }
            memory *= LONGER * LONGER;
            if near || no_better || memory > longest || control.stops() {
                break;
            }
        }
        found.map(|(coordinates, led)| (coordinates, Led { evaluations, ..led }))
    }

    /// The end of the stages from a start, of which the first one has this memory (s), and whether its predictions are near the measurements. The
    /// last stage is the first one after which a simulation follows the measurements as well as the predictions do, one that does not explain them,
    /// or the one before a stage that fails.
    fn lead_from(&self, start: &[f64], mut memory: f64, control: &Control) -> (Vec<f64>, Led, bool) {
        let (mut coordinates, mut led, mut near) = (start.to_vec(), Led::default(), false);
        for stage in 1..=MOST {
            if control.stops() {
                break;
            }
            let Some(problem) = self.problem(memory) else { break };
            memory *= LONGER;
            let plain = problem.in_units(control);
            let Ok(end) = search(&plain, &problem.settings.optimizer, coordinates.clone()) else { break };
            coordinates = end.coordinates;
            led.stages = stage;
            led.evaluations += end.evaluations;
            let Some(predicted) = errors(&problem, &coordinates, control) else { break };
            let parts = || predicted.iter().zip(&self.outputs).filter(|(_, moves)| moves.half > 0.0);
            near = parts().all(|(error, moves)| *error <= NEAR * moves.noise);
            if parts().any(|(error, moves)| *error > UNEXPLAINED * moves.half) {
                break;
            }
            let simulated = errors(self.problem, &coordinates, control);
            let as_well = |(simulated, predicted): (&f64, &f64)| *simulated <= FOLLOWS * predicted;
            led.follows = simulated.is_some_and(|simulated| simulated.iter().zip(&predicted).all(as_well));
            if led.follows {
                break;
            }
        }
        (coordinates, led, near)
    }

    /// The sum over the outputs of the mean square error of a simulation, in units of half the range; `None` where it cannot be evaluated.
    fn distance(&self, at: &[f64]) -> Option<f64> {
        let errors = errors(self.problem, at, &Control::NEVER)?;
        let parts = errors.iter().zip(&self.outputs).filter(|(_, moves)| moves.half > 0.0);
        Some(parts.map(|(error, moves)| (error / moves.half).powi(2)).sum::<f64>())
    }

    /// The end of stages from the declared start.
    pub fn declared(&self, control: &Control) -> Option<(Start, Led)> {
        let declared = Start::declared(self.problem);
        let (coordinates, led) = self.lead(&declared.coordinates, control)?;
        Some((Start { coordinates, stages: Some(led), ..declared }, led))
    }
}

/// The root of the mean square error of each output, by the predictor of a problem; `None` where it cannot be evaluated.
fn errors(problem: &Problem<'_>, coordinates: &[f64], control: &Control) -> Option<Vec<f64>> {
    noise::errors(&problem.in_units(control), coordinates).ok()
}
