//! Starts that are led to the data in stages: predictions by a filter that corrects the state at each sample, from stage to stage less, until a
//! simulation follows the measurements.
//!
//! How far a filter corrects is told by its memory: the time after which it has forgotten a measurement. Errors of the parameters act no
//! longer than that, so that with a short memory the predictions depend on them almost linearly; the longer it is, the better do the data
//! determine them, and the less does the noise of the measurements bias them.

use super::refine::Start;
use super::search::search;
use crate::predict::{GivenNoise, Guess};
use crate::problem::{Control, Noise, Problem, SearchPlan, Settings};
use crate::record::{Channel, Record};

/// The least noise of an output, as a part of half its range.
const LEAST_NOISE: f64 = 1e-6;
/// The memory of the first stage, as a part of the time in which the outputs change by half their range; at least this part of an interval.
const FIRST_MEMORY: f64 = 0.1;
/// Predictions from a start are near the measurements where their error is at most so many times the noise. Else the first memory is shorter.
const NEAR: f64 = 5.0;
/// How many times longer the memory is from stage to stage, and the most stages: the last memory is 1e9 times the first.
const LONGER: f64 = 4.0;
const MOST: u32 = 16;
/// The most trial steps of a stage. Most take 5 to 20; the first one from a mass that is 500 times too small takes 70.
const TRIALS: u64 = 100;
/// A simulation follows an output where its error is at most so many times that of the predictions.
const FOLLOWS: f64 = 1.5;
/// Predictions do not explain an output where their error is above this part of half the range. A longer memory does so still less.
const UNEXPLAINED: f64 = 0.5;
/// The root of the covariance has the square of so many entries.
const MOST_STATES: usize = 6;

/// The stages of a problem.
pub(super) struct Stages<'p> {
    problem: &'p Problem<'p>,
    /// The noise of each output, in its unit.
    noise: Vec<f64>,
    /// Half the range of each output.
    halves: Vec<f64>,
    /// The mean interval of the samples (s).
    step: f64,
    /// How fast the outputs change: by half their range in the time `1 / rate` (1/s).
    rate: f64,
}

/// Where stages led a start.
pub(super) struct Led {
    pub coordinates: Vec<f64>,
    pub stages: u32,
    /// Iterations and evaluations.
    pub work: (u64, u64),
}

impl Problem<'_> {
    /// The stages of this problem; `None` where the slopes of the equations are not known, where there are too many states, or where no
    /// output moves.
    pub(super) fn stages(&self) -> Option<Stages<'_>> {
        let layout = self.layout();
        let n = layout.states.len();
        if !(1..=MOST_STATES).contains(&n) || self.settings.prefilter.is_some() {
            return None;
        }
        let most = |of: &dyn Fn(&Record) -> f64| self.records.iter().map(of).fold(0.0, f64::max);
        let half = |j: usize| {
            move |record: &Record| {
                let range = record.inspect_some().outputs[j].range;
                range.map_or(0.0, |(least, greatest)| 0.5 * (greatest - least))
            }
        };
        let outputs: Vec<f64> = (0..layout.outputs.len()).map(|j| most(&half(j))).collect();
        let first = self.records.first()?;
        let (length, intervals) = (first.time(first.len() - 1) - first.time(0), first.len().saturating_sub(1));
        let step = length / intervals as f64;
        let rates = first.outputs().iter().zip(&outputs).filter_map(|(channel, half)| rate(channel, *half));
        let rate = rates.fold(0.0, f64::max) / step;
        if !(rate > 0.0 && rate.is_finite()) {
            return None;
        }
        let noise = first.outputs().iter().zip(&outputs).map(|(channel, half)| noise(channel, *half)).collect();
        Some(Stages { problem: self, noise, halves: outputs, step, rate })
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

/// How fast an output changes: by half its range in so many samples, from the shortest of lags that double; the inverse of that number.
fn rate(channel: &Channel, half: f64) -> Option<f64> {
    let values = &*channel.values;
    let mean_square = |lag: usize| {
        let pairs =
            values.iter().zip(&values[lag..]).map(|(a, b)| (b - a) * (b - a)).filter(|square| square.is_finite());
        let (sum, count) = pairs.fold((0.0, 0.0), |(sum, count), square| (sum + square, count + 1.0));
        if count > 0.0 { sum / count } else { 0.0 }
    };
    let lags = std::iter::successors(Some(1), |lag| Some(2 * lag)).take_while(|lag| *lag < values.len());
    let found = lags.map(|lag| (lag, mean_square(lag))).find(|(_, square)| *square >= 0.25 * half * half && half > 0.0);
    found.map(|(lag, _)| 0.5 / lag as f64)
}

/// The noise of an output, from its second differences, which what moves slowly hardly changes.
fn noise(channel: &Channel, half: f64) -> f64 {
    let second = channel.values.windows(3).map(|three| three[0] - 2.0 * three[1] + three[2]);
    let (sum, count) = second.filter(|d| d.is_finite()).fold((0.0, 0.0), |(sum, count), d| (sum + d * d, count + 1.0));
    // A sum of independent errors with weights 1, -2 and 1 has six times their variance.
    let noise = if count > 0.0 { (sum / count / 6.0_f64).sqrt() } else { 0.0 };
    noise.max(LEAST_NOISE * half)
}

impl Stages<'_> {
    /// The problem of a stage: predictions by a filter that forgets measurements after this time (s). A walk with increments of `part` times its
    /// noise, each interval, is forgotten after `1 / part` intervals.
    fn problem(&self, memory: f64) -> Option<Problem<'_>> {
        let problem = self.problem;
        let scales = problem.scales(problem.records.first()?, self.rate.max(memory.recip()))?;
        let part = self.noise.iter().zip(&self.halves).map(|(noise, half)| noise / half);
        let part = part.filter(|part| part.is_finite()).fold(LEAST_NOISE, f64::max) * self.step / memory;
        let positive = |level: f64| if level > 0.0 { level } else { 1.0 };
        let noise = GivenNoise {
            states: scales.iter().map(|scale| part * positive(*scale)).collect(),
            outputs: self.noise.iter().map(|noise| positive(*noise)).collect(),
        };
        let sweep = problem.sweep.filtering(&noise)?;
        let optimizer = problem.settings.optimizer.limited(TRIALS);
        let settings = Settings {
            noise: Noise::Predicted,
            checkpoint: None,
            searches: SearchPlan::Single,
            optimizer,
            ..problem.settings.clone()
        };
        let parameters = &problem.unknowns.parameters;
        Problem::new(sweep, problem.records.clone(), parameters, settings).ok()
    }

    /// The root of the mean square error of each output, by the predictor of a problem; `None` where it cannot be evaluated.
    fn errors(&self, problem: &Problem<'_>, coordinates: &[f64], control: &Control) -> Option<Vec<f64>> {
        let objective = problem.in_units(control);
        let mut sums = vec![(0.0, 0.0); self.noise.len()];
        for e in 0..problem.records.len() {
            let simulated = objective.predict(e, coordinates).ok()?;
            for (sum, errors) in sums.iter_mut().zip(&simulated.residuals) {
                let errors = errors.iter().filter(|error| error.is_finite());
                *sum = errors.fold(*sum, |(sum, count), error| (sum + error * error, count + 1.0));
            }
        }
        Some(sums.into_iter().map(|(sum, count)| (sum / count).sqrt()).collect())
    }

    /// The memory of the first stage (s): so short that the outputs change little, and that predictions from a start are near the measurements.
    fn first_memory(&self, start: &[f64], control: &Control) -> f64 {
        let least = FIRST_MEMORY * self.step;
        let mut memory = (FIRST_MEMORY / self.rate).max(least);
        let follows = |memory: f64| {
            let problem = self.problem(memory)?;
            let errors = self.errors(&problem, start, control)?;
            Some(errors.iter().zip(&self.noise).all(|(error, noise)| *error <= NEAR * noise || *noise == 0.0))
        };
        while memory > least && follows(memory) != Some(true) && !control.stops() {
            memory = (memory / LONGER).max(least);
        }
        memory
    }

    /// Leads a start to where a simulation follows the measurements as well as the predictions do, or through all stages that explain them; `None`
    /// where a stage fails.
    pub fn lead(&self, start: Vec<f64>, control: &Control) -> Option<Led> {
        let mut led = Led { coordinates: start, stages: 0, work: (0, 0) };
        let mut memory = self.first_memory(&led.coordinates, control);
        for stage in 0..MOST {
            if control.stops() {
                return None;
            }
            let problem = self.problem(memory)?;
            memory *= LONGER;
            let plain = problem.in_units(control);
            let end = search(&plain, &problem.settings.optimizer, led.coordinates.clone()).ok()?;
            led.work = (led.work.0 + end.iterations, led.work.1 + end.evaluations);
            led.coordinates = end.coordinates;
            led.stages = stage + 1;
            let predicted = self.errors(&problem, &led.coordinates, control)?;
            if predicted.iter().zip(&self.halves).any(|(error, half)| *error > UNEXPLAINED * half) {
                break;
            }
            let simulated = self.errors(self.problem, &led.coordinates, control);
            let follows = |(simulated, predicted): (&f64, &f64)| *simulated <= FOLLOWS * predicted;
            if simulated.is_some_and(|simulated| simulated.iter().zip(&predicted).all(follows)) {
                break;
            }
        }
        Some(led)
    }

    /// The start to which stages led the declared one, and how many there were.
    pub fn declared(&self, control: &Control) -> Option<(Start, u32)> {
        let declared = Start::declared(self.problem);
        let Led { coordinates, stages, work } = self.lead(declared.coordinates.clone(), control)?;
        Some((Start { coordinates, before: work, ..declared }, stages))
    }
}
