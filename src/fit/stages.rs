//! A continuation from predictions to a simulation, for far starts: a sequence of fits (stages) of one-step predictions by an extended filter,
//! each from the estimate of the one before, with smaller corrections of the state at each sample, until a simulation follows the measurements.
//!
//! The size of the corrections is given by the filter's memory, the time after which the influence of a measurement on the state has decayed. An
//! error of the parameters accumulates over that time only: with a short memory the predictions are nearly linear in the parameters. With a long
//! one the parameters have smaller variances, and less bias by the noise of the measurements.

use super::moves::{LEAST_NOISE, Movement, Moves, NEAR, UNEXPLAINED};
use super::refine::Start;
use super::search::search;
use super::shooting::{Shot, shoot};
use super::slower::slower;
use crate::numeral::counted;
use crate::predict::{GivenNoise, Guess};
use crate::problem::{Control, Lead, Noise, Problem, Settings, noise};
use crate::record::Record;
use std::sync::Arc;

/// The memory of the first stage, as a part of the time in which the outputs change by half their range; at least this part of an interval.
const FIRST_MEMORY: f64 = 0.1;
/// How many times longer the memory is from stage to stage, and the most stages: the last memory is 1e9 times the first.
const LONGER: f64 = 4.0;
const MOST: u32 = 16;
/// The most trial steps of a stage. Most take 5 to 20; the first one from a mass that is 500 times too small takes 70.
const TRIALS: u64 = 100;
/// Stages that begin with a longer memory come nearer where the square of the distance is below this part of that before.
const BETTER: f64 = 0.9;
/// A simulation follows an output where its error is at most so many times that of the predictions.
const FOLLOWS: f64 = 1.5;
/// With more states the program of a stage takes seconds to compile: its carry has `n + n^2` numbers.
const MOST_STATES: usize = 6;

/// What the stages are, in words.
const STAGES: &str = "predictions by a filter that corrects the state at each sample, less in each stage";
const SLOWER: &str =
    "parameters changed so that no state decays in less than a sample, as one does at the declared start";
const NO_NEARER: &str = "their end is no nearer to the measurements than the declared start";

/// The stages of a problem.
pub(super) struct Stages<'p> {
    problem: &'p Problem<'p>,
    movement: Movement,
    /// Whether multiple shooting is all there is.
    alone: bool,
}

/// What led a start to the measurements.
#[derive(Clone, Default)]
pub(super) struct Led {
    pub stages: u32,
    /// Multiple shooting after the stages, or alone.
    pub shot: Option<Arc<Shot>>,
    pub evaluations: u64,
    /// Whether a simulation from their end follows the measurements as well as the predictions do.
    pub follows: bool,
    /// Whether they began at a slower start than the declared one.
    pub slower: bool,
}

impl Led {
    /// Whether multiple shooting closed all gaps with errors near the noise.
    pub fn explains(&self) -> bool {
        self.shot.as_ref().is_some_and(|shot| shot.explains())
    }

    /// The path, in words.
    pub fn path(&self) -> String {
        let stages = || format!("{} ({STAGES})", counted(self.stages.into(), "stage"));
        let path = match &self.shot {
            None => stages(),
            Some(shot) if self.stages == 0 => shot.to_string(),
            Some(shot) => format!("{}, then of {shot}", stages()),
        };
        if self.slower { format!("{path}, from {SLOWER}") } else { path }
    }
}

impl Problem<'_> {
    /// The stages of this problem. Where there is no filter, multiple shooting is all there is.
    ///
    /// # Errors
    /// Why there are none.
    pub(super) fn stages(&self) -> Result<Stages<'_>, &'static str> {
        let (movement, asked) = (self.movement()?, self.settings.lead == Lead::Shooting);
        let step = movement.step;
        let stages = Stages { problem: self, movement, alone: asked };
        let filters = asked || self.layout().states.len() <= MOST_STATES && stages.problem(step).is_some();
        Ok(Stages { alone: asked || !filters, ..stages })
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

    /// The size of each state in a record: of those that the outputs give, what moves these by half their range; of the others, what moves states whose size
    /// is known by that size, by their derivatives in the time `1 / rate` or at a sample.
    pub(super) fn scales(&self, record: &Record, rate: f64) -> Option<Vec<f64>> {
        let p: Vec<f64> = self.unknowns.parameters.iter().map(|parameter| parameter.start).collect();
        let Guess { state, sizes, .. } = self.sweep.guessed_state(record, &p).ok()?;
        let n = state.len();
        let mut scales = sizes;
        let slopes = self.sweep.state_slopes(record, 0, &state, &p).unwrap_or_else(|| vec![0.0; n * n]);
        let jumps = self.sweep.jump_slopes(record, 0, &state, &p).unwrap_or_else(|| vec![0.0; n * n]);
        for _ in 0..n {
            let known = scales.clone();
            for (j, scale) in scales.iter_mut().enumerate().filter(|(_, scale)| scale.is_none()) {
                let moved = |(i, known): (usize, &Option<f64>)| {
                    let at = i * n + j;
                    Some([rate * (*known)? / slopes[at].abs(), (*known)? / jumps[at].abs()])
                };
                let moved = known.iter().enumerate().filter_map(moved).flatten();
                let moved = moved.filter(|moved| *moved > 0.0 && moved.is_finite());
                *scale = moved.min_by(f64::total_cmp);
            }
        }
        let most = scales.iter().flatten().copied().fold(0.0, f64::max);
        let scales =
            scales.into_iter().zip(&state).map(|(scale, x)| scale.unwrap_or(if *x == 0.0 { most } else { x.abs() }));
        Some(scales.collect())
    }
}

impl Stages<'_> {
    /// The problem of a stage with this memory (s). The steady gain of a random walk whose increments are `part` times the noise of its measurements
    /// is about `part`, so that the influence of a measurement decays in `1 / part` intervals.
    fn problem(&self, memory: f64) -> Option<Problem<'_>> {
        let problem = self.problem;
        let scales =
            problem.scales(problem.records.get(self.movement.most)?, self.movement.rate.max(memory.recip()))?;
        let part = self.movement.outputs.iter().filter(|moves| moves.half > 0.0).map(|moves| moves.noise / moves.half);
        let part = part.fold(LEAST_NOISE, f64::max) * self.movement.step / memory;
        let positive = |level: f64| if level > 0.0 { level } else { 1.0 };
        let noise = GivenNoise {
            states: scales.iter().map(|scale| part * positive(*scale)).collect(),
            outputs: self.movement.outputs.iter().map(|moves| positive(moves.noise)).collect(),
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
        let least = FIRST_MEMORY * self.movement.step;
        let mut memory = (FIRST_MEMORY / self.movement.rate).max(least);
        let follows = |memory: f64| {
            let problem = self.problem(memory)?;
            Some(self.are_within(&errors(&problem, start, control)?, |moves| NEAR * moves.noise))
        };
        while memory > least && follows(memory) != Some(true) && !control.stops() {
            memory = (memory / LONGER).max(least);
        }
        memory
    }

    /// Where a start is led, by stages and multiple shooting or by the latter alone.
    ///
    /// # Errors
    /// Why it is not led anywhere that is nearer to the measurements.
    pub fn lead(&self, start: &[f64], control: &Control) -> Result<(Vec<f64>, Led), &'static str> {
        let none = (None, start.to_vec(), Led::default());
        let (nearer, last, led) = match self.alone {
            true => none,
            false => self.filtered(start, control),
        };
        if nearer.is_some() && led.follows || control.stops() {
            return nearer.map(|end| (end, led)).ok_or(NO_NEARER);
        }
        let nearest = self.distance(nearer.as_deref().unwrap_or(start));
        match self.better_shot(&last, start, control) {
            Ok(shot) => {
                let led = Led { evaluations: led.evaluations + shot.evaluations, ..led };
                match shot.explains() || self.distance(&shot.coordinates) < nearest {
                    true => Ok((shot.coordinates.clone(), Led { shot: Some(Arc::new(shot)), ..led })),
                    false => nearer.map(|end| (end, led)).ok_or(NO_NEARER),
                }
            }
            Err(_) if nearer.is_some() => nearer.map(|end| (end, led)).ok_or(NO_NEARER),
            Err(reason) => Err(if self.alone { reason } else { NO_NEARER }),
        }
    }

    /// Multiple shooting from the end of stages; where its gaps stay open or its errors large, from their start as well, since stages may lead away from
    /// the minimum. Of two, the second one if it has neither, or if its simulation is nearer to the measurements.
    ///
    /// # Errors
    /// Why there are no pieces that can be run.
    fn better_shot(&self, last: &[f64], start: &[f64], control: &Control) -> Result<Shot, &'static str> {
        let shot = self.shot(last, control);
        if last == start || control.stops() || shot.as_ref().is_ok_and(|shot| !shot.is_lost()) {
            return shot;
        }
        let Ok(again) = self.shot(start, control) else { return shot };
        let Ok(shot) = shot else { return Ok(again) };
        let evaluations = shot.evaluations + again.evaluations;
        let better = !again.is_lost() || self.distance(&again.coordinates) < self.distance(&shot.coordinates);
        Ok(Shot { evaluations, ..if better { again } else { shot } })
    }

    /// Multiple shooting from a point.
    ///
    /// # Errors
    /// Why there are no pieces that can be run.
    pub fn shot(&self, from: &[f64], control: &Control) -> Result<Shot, &'static str> {
        let few = self.problem.layout().states.len() <= MOST_STATES;
        let filter = few.then(|| self.problem(self.first_memory(from, control))).flatten();
        // It leads a start only, and its errors are compared with the noise, which no robust loss is.
        let settings = Settings { loss: None, ..self.problem.settings.clone() };
        let squared = Problem { settings, ..self.problem.clone() };
        shoot((&squared, &self.movement, filter.as_ref()), from, control)
    }

    /// The end of the stages from a start that is nearer to the measurements, if there is one, the last end, and what led there. With a short memory the
    /// predictions depend little on the parameters, beside the noise of the measurements: where the last predictions are not near these, the stages are
    /// repeated from the start with a longer first memory, as long as their end comes nearer. Nearer is an end from which a simulation is.
    fn filtered(&self, start: &[f64], control: &Control) -> (Option<Vec<f64>>, Vec<f64>, Led) {
        let (mut memory, longest) = (self.first_memory(start, control), self.movement.rate.recip());
        let (mut found, mut nearest) = (None, self.distance(start));
        let mut evaluations = 0;
        loop {
            let (coordinates, led, near) = self.lead_from(start, memory, control);
            evaluations += led.evaluations;
            let distance = self.distance(&coordinates);
            let no_better = found.is_some() && distance > BETTER * nearest;
            if distance < nearest {
                (found, nearest) = (Some((coordinates.clone(), led.clone())), distance);
            }
            memory *= LONGER * LONGER;
            if near || no_better || memory > longest || control.stops() {
                let (nearer, led) = found.map_or((None, led), |(nearer, led)| (Some(nearer), led));
                return (nearer.clone(), nearer.unwrap_or(coordinates), Led { evaluations, ..led });
            }
        }
    }

    /// The end of the stages from a start, of which the first one has this memory (s), and whether its predictions are near the measurements. The
    /// last stage is the first one after which a simulation follows the measurements as well as the predictions do, one that does not explain them,
    /// or the one before a stage that fails, or whose search does not converge and is away from measurements that it was near.
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
            led.evaluations += end.evaluations;
            let predicted = errors(&problem, &end.coordinates, control);
            let are_near = |errors: &Vec<f64>| self.are_within(errors, |moves| NEAR * moves.noise);
            let is_near = predicted.as_ref().is_some_and(are_near);
            // With this memory the cost of a chaotic plant is too rough: the stage before was nearer to the minimum.
            if near && !is_near && !end.outcome.converged() {
                break;
            }
            (coordinates, led.stages, near) = (end.coordinates, stage, is_near);
            let Some(predicted) = predicted else { break };
            // A longer memory explains still less.
            if !self.are_within(&predicted, |moves| UNEXPLAINED * moves.half) {
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

    /// The sum over the outputs of the mean square error of a simulation, in units of half the range; infinite where it cannot be evaluated.
    fn distance(&self, at: &[f64]) -> f64 {
        let Some(errors) = errors(self.problem, at, &Control::NEVER) else { return f64::INFINITY };
        let parts = errors.iter().zip(&self.movement.outputs).filter(|(_, moves)| moves.half > 0.0);
        parts.map(|(error, moves)| (error / moves.half).powi(2)).sum()
    }

    /// Whether the errors of all outputs that move are at most so large.
    fn are_within(&self, errors: &[f64], most: impl Fn(&Moves) -> f64) -> bool {
        errors.iter().zip(&self.movement.outputs).all(|(error, moves)| moves.half == 0.0 || *error <= most(moves))
    }

    /// The end of stages from the declared start.
    pub fn declared(&self, control: &Control) -> Result<(Start, Led), &'static str> {
        let declared = Start::declared(self.problem);
        let (coordinates, led) = self.lead_or_slower(&declared.coordinates, control)?;
        Ok((Start { coordinates, stages: Some(led.clone()), ..declared }, led))
    }

    /// Where a start is led; where a simulation from it explains nothing and stages do not lead it to the measurements, where a slower one is led, if
    /// pieces from there are explained, or if a simulation is nearer to the measurements.
    ///
    /// # Errors
    /// As [`lead`](Self::lead).
    fn lead_or_slower(&self, start: &[f64], control: &Control) -> Result<(Vec<f64>, Led), &'static str> {
        let found = self.lead(start, control);
        let is_led = found.as_ref().is_ok_and(|(_, led)| led.follows || led.explains());
        if self.alone || is_led || self.problem.start_explains(control) == Some(true) || control.stops() {
            return found;
        }
        let Some(slower) = slower(self.problem, &self.movement, start, control) else { return found };
        let Ok((end, led)) = self.lead(&slower, control) else { return found };
        let nearest = self.distance(found.as_ref().map_or(start, |(end, _)| end));
        let evaluations = led.evaluations + found.as_ref().map_or(0, |(_, led)| led.evaluations);
        match led.explains() || self.distance(&end) < nearest {
            true => Ok((end, Led { evaluations, slower: true, ..led })),
            false => found.map(|(end, led)| (end, Led { evaluations, ..led })),
        }
    }
}

/// The root of the mean square error of each output, by the predictor of a problem; `None` where it cannot be evaluated.
fn errors(problem: &Problem<'_>, coordinates: &[f64], control: &Control) -> Option<Vec<f64>> {
    noise::errors(&problem.in_units(control), coordinates).ok()
}

#[cfg(test)]
mod tests {
    use crate::tests::{Current, Gain, Voltage};
    use crate::{Experiment, Fit, Model, Scalar, Time, free, signals};

    signals! { struct Memory { i: "A", held: "V", before: "mA" } }

    /// A coil whose controller holds what follows from the sample before, in another unit.
    #[derive(Clone)]
    struct Held;

    impl Model for Held {
        type State = Memory;
        type Input = Voltage;
        type Output = Current;
        type Parameters = Gain;

        fn derivative<S: Scalar>(&self, _t: S, x: &Memory<S>, u: &Voltage<S>, p: &Gain<S>) -> Memory<S> {
            Memory { i: u.u + x.held * 2.0 - p.a * x.i, held: S::from(0.0), before: S::from(0.0) }
        }
        fn jump<S: Scalar>(&self, _t: S, x: &Memory<S>, _u: &Voltage<S>, _p: &Gain<S>) -> Memory<S> {
            Memory { i: x.i, held: x.before * -0.001, before: x.i * 1000.0 }
        }
        fn output<S: Scalar>(&self, _t: S, x: &Memory<S>, _u: &Voltage<S>, _p: &Gain<S>) -> Current<S> {
            Current { i: x.i }
        }
    }

    /// The output moves by 3 A to each side; in a third of a second so does the state by 4.5 V of `held`, which is 4,500 mA of `before` at a sample.
    #[test]
    fn sizes_of_states_that_act_at_samples() {
        let outputs: Vec<Current> = (0..50).map(|k| Current { i: if k % 2 == 0 { 3.0 } else { -3.0 } }).collect();
        let record =
            Experiment::new(&Held, Time::Uniform { start: 0.0, step: 0.1 }, vec![Voltage { u: 0.0 }; 50], outputs);
        let record = record.unwrap();
        let problem = Fit::new(&Held, &record).parameters(Gain { a: free(1.0) }).problem().unwrap();
        let found = problem.scales(record.record(), 3.0).unwrap();
        for (found, expected) in found.iter().zip([3.0, 4.5, 4500.0]) {
            assert!((found / expected - 1.0).abs() < 1e-12, "{found} {expected}");
        }
    }
}
