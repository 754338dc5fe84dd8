//! A piece run by a [`Predictor`](crate::Predictor) of any kind, on vectors of run-time length: filters of all models, and models that
//! have no types.

use super::rest::Rest;
use super::{NoStart, Piece, Prepared, Reached, RunError, Seed, Visit, Window};
use crate::dual::Dual;
use crate::functions::{Functions, delays};
use crate::integrate::{Duals, Method, Stuck};
use crate::layout::Layout;
use crate::predict::{Between, Intervals, Plant, Prediction, SlicePlant, Stepped, Steps};
use crate::record::{Initial, Record};
use crate::scalar::Scalar;

/// Samples per window.
const WINDOW: usize = 128;
/// Samples per window where a single one may take many steps: after each window a fit looks at its time limit.
const ADAPTIVE_WINDOW: usize = 8;
/// Slopes of a pass.
pub(super) const SLOPES: usize = 8;
/// Slopes below this are set to zero: their squares are denormal.
const NEGLIGIBLE: f64 = 1e-150;

/// Model, integrator and predictor of a run.
pub(crate) struct Filter<'f> {
    pub layout: &'f Layout,
    pub values: &'f dyn Functions<f64>,
    pub duals: &'f dyn Functions<Duals>,
    pub method: &'f dyn Method,
    /// Which inputs have a dead time.
    pub late: Vec<bool>,
    pub predictor: &'f dyn Prediction,
}

/// A piece and how it is to be run.
struct Task<'t, S> {
    functions: &'t dyn Functions<S>,
    steps: &'t dyn Steps<S>,
    piece: &'t Piece<'t>,
    restart: Option<usize>,
}

/// The state of one pass with up to eight slopes.
struct Pass<S> {
    carry: Vec<S>,
    /// The carry at the begin of the piece.
    start: Vec<S>,
    p: Vec<S>,
    /// Dead times of the inputs, where there are any.
    delays: Vec<Option<S>>,
    /// The outputs at a sample, of a simulation.
    outputs: Vec<S>,
    intervals: Intervals<S>,
    first: usize,
    used: usize,
}

/// A number with access to its slopes.
trait Number: Stepped {
    fn with(value: f64, slope: &dyn Fn(usize) -> f64) -> Self;
    fn slope(&self, i: usize) -> f64;
    fn flushed(self) -> Self;
}

impl Number for f64 {
    fn with(value: f64, _slope: &dyn Fn(usize) -> f64) -> Self {
        value
    }
    fn slope(&self, _i: usize) -> f64 {
        0.0
    }
    fn flushed(self) -> Self {
        self
    }
}

impl Number for Duals {
    fn with(value: f64, slope: &dyn Fn(usize) -> f64) -> Self {
        let mut dual = Dual::constant(value);
        dual.slopes.iter_mut().enumerate().for_each(|(i, s)| *s = slope(i));
        dual
    }
    fn slope(&self, i: usize) -> f64 {
        self.slopes[i]
    }
    fn flushed(mut self) -> Self {
        for slope in &mut self.slopes {
            if slope.abs() < NEGLIGIBLE {
                *slope = 0.0;
            }
        }
        self
    }
}

impl Filter<'_> {
    /// The carry at the first sample, with slopes with respect to states, then parameters; of the states, some follow from the parameters.
    ///
    /// # Errors
    /// A plant that is unstable where the predictor cannot start from one that is, or that does not rest where it should.
    pub fn start(
        &self,
        record: &Record,
        state: &[f64],
        follows: &[bool],
        parameters: &[f64],
    ) -> Result<Reached, NoStart> {
        // Of several samples at the first instant the last, from which time passes.
        let sample = (1..record.len()).take_while(|k| record.time(*k) == record.time(0)).last().unwrap_or(0);
        let (n, width) = (state.len(), state.len() + parameters.len());
        let size = self.predictor.carry(self.layout);
        let mut reached = Reached { carry: vec![0.0; size], slopes: vec![0.0; size * width] };
        let rests = follows.contains(&true) && *record.initial_state() == Initial::Steady;
        let rest = if rests { Some(Rest::near(self, record, state, parameters)?) } else { None };
        for first in (0..width.max(1)).step_by(SLOPES) {
            let lane = |i: usize| i.wrapping_sub(first);
            let mut carry = vec![Duals::constant(0.0); size];
            for (i, x) in state.iter().enumerate() {
                carry[i] = Dual::variable(*x, lane(i));
            }
            let p: Vec<Duals> = parameters.iter().enumerate().map(|(j, p)| Dual::variable(*p, lane(n + j))).collect();
            let intervals = Intervals::default();
            let delays = delays(self.duals, &self.late, &p);
            match &rest {
                Some(rest) => carry[..n].copy_from_slice(&rest.state(self, record, &delays, &p)),
                None if follows.contains(&true) => {
                    let mut said = carry[..n].to_vec();
                    self.duals.initial(&Between::new(record, 0, &delays).input(0.0), &p, &mut said);
                    let all = carry.iter_mut().zip(said).zip(follows).filter(|(_, follows)| **follows);
                    all.for_each(|((x, said), _)| *x = said);
                }
                None => {}
            }
            let plant = self.plant(self.duals, Between::new(record, sample, &delays), &p, &intervals);
            self.predictor.duals().start(&plant, &mut carry)?;
            for (entry, x) in carry.iter().enumerate() {
                reached.carry[entry] = x.value;
                for i in 0..SLOPES.min(width - first.min(width)) {
                    reached.slopes[entry * width + first + i] = x.slopes[i];
                }
            }
        }
        Ok(reached)
    }

    /// Runs a piece. With `restart`, samples are predicted from the measured states that many samples before.
    pub fn run(
        &self,
        piece: &Piece<'_>,
        seeds: &[Seed],
        restart: Option<usize>,
        visit: Visit<'_>,
    ) -> Result<Reached, RunError> {
        let (values, duals) = (self.predictor.values(), self.predictor.duals());
        match seeds.is_empty() {
            true => self.run_windows(&Task { functions: self.values, steps: values, piece, restart }, seeds, visit),
            false => self.run_windows(&Task { functions: self.duals, steps: duals, piece, restart }, seeds, visit),
        }
    }

    pub(super) fn plant<'p, S: Stepped>(
        &'p self,
        functions: &'p dyn Functions<S>,
        between: Between<S>,
        p: &'p [S],
        intervals: &'p Intervals<S>,
    ) -> SlicePlant<'p, S> {
        SlicePlant { layout: self.layout, functions, duals: self.duals, method: self.method, between, p, intervals }
    }

    /// From a sample to the next.
    pub(super) fn between<S: Scalar>(
        &self,
        (record, prepared): (&Record, &Prepared),
        sample: usize,
        delays: &[Option<S>],
    ) -> Between<S> {
        let between = Between::new(record, sample, delays);
        match self.method.is_exact() {
            true => between.crossed_as(prepared.lengths(record).after(sample)),
            false => between,
        }
    }

    fn run_windows<S: Number>(
        &self,
        task: &Task<'_, S>,
        seeds: &[Seed],
        visit: Visit<'_>,
    ) -> Result<Reached, RunError> {
        let piece = task.piece;
        let capacity = if self.method.is_fixed() { WINDOW } else { ADAPTIVE_WINDOW };
        let count = seeds.len().div_ceil(SLOPES).max(1);
        let mut passes: Vec<Pass<S>> = (0..count).map(|pass| self.pass(task, seeds, pass * SLOPES)).collect();
        let outputs = self.layout.outputs.len();
        let variances = self.predictor.predicts_variance();
        let mut window = Window::new(1, outputs, seeds.len(), capacity, variances);
        let mut begin = piece.samples.start;
        while begin < piece.samples.end {
            let samples = capacity.min(piece.samples.end - begin);
            (window.begin[0], window.samples[0]) = (begin, samples);
            window.carry = match task.restart {
                None => passes[0].carry.iter().map(Scalar::value).collect(),
                // Nothing is carried from window to window: all of them begin with the state at the record's first sample.
                Some(_) => piece.carry.to_vec(),
            };
            for pass in &mut passes {
                for k in 0..samples {
                    self.sample(task, pass, begin + k, k, &mut window)?;
                }
                pass.carry.iter_mut().for_each(|x| *x = x.flushed());
            }
            if !visit(&mut window) {
                return Err(RunError::Stopped);
            }
            begin += samples;
        }
        let size = passes[0].carry.len();
        let carry = passes[0].carry.iter().map(Scalar::value).collect();
        let mut slopes = vec![0.0; size * seeds.len()];
        for pass in &passes {
            for (entry, x) in pass.carry.iter().enumerate() {
                for i in 0..pass.used {
                    slopes[entry * seeds.len() + pass.first + i] = x.slope(i);
                }
            }
        }
        Ok(Reached { carry, slopes })
    }

    fn pass<S: Number>(&self, task: &Task<'_, S>, seeds: &[Seed], first: usize) -> Pass<S> {
        let pass = Pass::new(task.piece, seeds, first);
        let outputs = vec![S::from(0.0); self.layout.outputs.len()];
        Pass { delays: delays(task.functions, &self.late, &pass.p), outputs, ..pass }
    }

    /// Predicts the outputs of a sample, corrects the carry with the measured ones, and advances to the next sample.
    fn sample<S: Number>(
        &self,
        task: &Task<'_, S>,
        pass: &mut Pass<S>,
        sample: usize,
        k: usize,
        window: &mut Window,
    ) -> Result<(), RunError> {
        let Task { functions, steps, piece, restart } = *task;
        let is_known = match restart {
            None => true,
            Some(restart) => self.restart(task, pass, sample, restart).map_err(|Stuck| RunError::Failed { sample })?,
        };
        let between = self.between((piece.record, piece.prepared), sample, &pass.delays);
        let plant = self.plant(functions, between, &pass.p, &pass.intervals);
        let columns = window.columns();
        let is_simulated = self.predictor.is_simulation();
        if is_simulated && piece.record.outputs().iter().any(|channel| !channel.values[sample].is_nan()) {
            plant.output(&pass.carry, &mut pass.outputs);
        }
        for (j, channel) in piece.record.outputs().iter().enumerate() {
            let y = if is_known { channel.values[sample] } else { f64::NAN };
            window.set_measured(k, j, u32::from(!y.is_nan()));
            if y.is_nan() {
                window.clear_unmeasured_row(k, j);
                continue;
            }
            let (mean, variance) = match is_simulated {
                true => (pass.outputs[j], S::from(1.0)),
                false => steps.predict(&plant, &pass.carry, j),
            };
            let error = S::from(y) - mean;
            let write = |row: &mut [f64], value: &S, sign: f64| {
                row[columns - 1] = value.value();
                for i in 0..pass.used {
                    row[pass.first + i] = sign * value.slope(i);
                }
            };
            // The slopes of the prediction are the negative slopes of the error.
            write(window.row_mut(k, j), &error, -1.0);
            if window.has_variances() {
                write(window.variance_row_mut(k, j), &variance, 1.0);
            }
            if !is_simulated {
                steps.correct(&plant, &mut pass.carry, j, error);
            }
        }
        if restart.is_some() || sample + 1 >= piece.record.len() {
            return Ok(());
        }
        steps.advance(&plant, &mut pass.carry).map_err(|Stuck| RunError::Failed { sample: sample + 1 })
    }

    /// Moves the carry to the state from which a sample is predicted; false where it was not measured.
    fn restart<S: Number>(
        &self,
        task: &Task<'_, S>,
        pass: &mut Pass<S>,
        sample: usize,
        restart: usize,
    ) -> Result<bool, Stuck> {
        let (piece, n) = (task.piece, self.layout.states.len());
        let first = sample.saturating_sub(restart);
        if sample < restart {
            pass.carry.copy_from_slice(&pass.start);
        } else {
            let measured = &piece.prepared.restarts[first * n..][..n];
            if measured.iter().any(|x| x.is_nan()) {
                return Ok(false);
            }
            pass.carry.iter_mut().zip(measured).for_each(|(x, measured)| *x = S::from(*measured));
        }
        pass.intervals.step.set(0.0);
        for from in first..sample {
            let between = self.between((piece.record, piece.prepared), from, &pass.delays);
            let plant = self.plant(task.functions, between, &pass.p, &pass.intervals);
            task.steps.advance(&plant, &mut pass.carry)?;
        }
        Ok(true)
    }
}

impl<S: Number> Pass<S> {
    fn new(piece: &Piece<'_>, seeds: &[Seed], first: usize) -> Self {
        let used = seeds.len().saturating_sub(first).min(SLOPES);
        let slope = |entry: usize, i: usize| {
            if i < used { piece.slopes[entry * seeds.len() + first + i] } else { 0.0 }
        };
        let moves = |j: usize, i: usize| i < used && seeds[first + i] == Seed::Parameter(j);
        let carry: Vec<S> =
            piece.carry.iter().enumerate().map(|(entry, x)| S::with(*x, &|i| slope(entry, i))).collect();
        let parameters = piece.parameters.iter().enumerate();
        let p = parameters.map(|(j, p)| S::with(*p, &|i| f64::from(u8::from(moves(j, i))))).collect();
        Pass {
            start: carry.clone(),
            carry,
            p,
            delays: vec![],
            outputs: vec![],
            intervals: Intervals::default(),
            first,
            used,
        }
    }
}
