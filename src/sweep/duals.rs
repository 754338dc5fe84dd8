//! [`DualSweep`]: models run in numbers with slopes, one piece at a time.

use super::filtered::Filter;
use super::{ModelCode, Piece, Prepared, Reached, RunError, Seed, Sweep, Visit, unmoved};
use crate::error::{Error, Failure};
use crate::functions::Functions;
use crate::integrate::{Duals, Method, Stuck};
use crate::layout::{Kind, Layout};
use crate::predict::{Between, FreeRun, Guess, Place, Plant, Prediction, SlicePlant};
use crate::record::{Channel, Record};
use core::cell::Cell;
use std::sync::Arc;

/// What is known of equations that run in dual numbers.
#[derive(Clone, Default)]
pub(crate) struct Uncompiled {
    /// Why they were not compiled.
    pub reason: String,
    /// The parameters that decide a choice of theirs; `None` where they are not read as a graph.
    pub choosing: Option<Vec<usize>>,
}

/// A model run in dual numbers.
pub(crate) struct DualSweep<'a> {
    pub layout: Arc<Layout>,
    pub code: Arc<dyn ModelCode + 'a>,
    pub method: Arc<dyn Method>,
    pub predictor: Arc<dyn Prediction>,
    pub uncompiled: Uncompiled,
}

impl DualSweep<'_> {
    fn filter(&self) -> Filter<'_> {
        Filter {
            layout: &self.layout,
            values: self.code.values(),
            duals: self.code.duals(),
            method: &*self.method,
            predictor: &*self.predictor,
        }
    }

    /// The model at a sample.
    fn place<'p>(&'p self, t: f64, u: &'p [f64], p: &'p [f64]) -> Place<'p> {
        Place { layout: &self.layout, functions: self.code.duals(), t, u, p }
    }
}

impl Sweep for DualSweep<'_> {
    fn layout(&self) -> &Layout {
        &self.layout
    }

    fn carry(&self) -> usize {
        self.predictor.carry(&self.layout)
    }

    fn predicts_variance(&self) -> bool {
        self.predictor.predicts_variance()
    }

    fn restarts(&self) -> Option<usize> {
        self.predictor.restarts().map(|horizon| horizon.steps)
    }

    fn choosing(&self) -> Option<&[usize]> {
        self.uncompiled.choosing.as_deref()
    }

    fn prepare(&self, record: &Record, parameters: &[f64]) -> Result<Prepared, Error> {
        let restarts = match self.predictor.restarts() {
            Some(horizon) => horizon.states(&self.layout, self.code.duals(), record, parameters)?,
            None => vec![],
        };
        Ok(Prepared { restarts, ..Prepared::default() })
    }

    fn start(&self, record: &Record, state: &[f64], parameters: &[f64]) -> Reached {
        match self.predictor.is_simulation() {
            true => unmoved(state, parameters),
            false => self.filter().start(record, state, parameters),
        }
    }

    fn run(&self, pieces: &[Piece<'_>], seeds: &[Seed], visit: Visit<'_>) -> Vec<Result<Reached, RunError>> {
        let one = |piece: &Piece<'_>| {
            let restart = self.predictor.restarts().map(|horizon| horizon.steps);
            match restart.is_some() || self.predictor.is_simulation() {
                true => self.code.run(&self.filter(), piece, seeds, restart, visit),
                false => self.filter().run(piece, seeds, None, visit),
            }
        };
        pieces.iter().map(one).collect()
    }

    fn measured_state(&self, record: &Record, sample: usize, p: &[f64]) -> Result<Vec<f64>, String> {
        let u = record.input(sample);
        let place = self.place(record.time(sample), &u, p);
        let x = place.state(&record.output(sample))?;
        match place.depends_on_parameter(&x) {
            Some(name) => Err(format!("the outputs depend on the parameter `{name}`, too")),
            None => Ok(x),
        }
    }

    fn guessed_state(&self, record: &Record, p: &[f64]) -> Result<Guess, String> {
        let first = |channel: &Channel| channel.values.iter().copied().find(|y| y.is_finite()).unwrap_or(f64::NAN);
        let y: Vec<f64> = record.outputs().iter().map(first).collect();
        let half = |range: (f64, f64)| 0.5 * (range.1 - range.0);
        let moves: Vec<f64> =
            record.inspect_some().outputs.iter().map(|output| output.range.map_or(0.0, half)).collect();
        self.place(record.time(0), &record.input(0), p).guess(&y, &moves)
    }

    fn state_slopes(&self, record: &Record, sample: usize, state: &[f64], p: &[f64]) -> Option<Vec<f64>> {
        let (t, u) = (record.time(sample), record.input(sample));
        (self.layout.kind == Kind::Continuous).then(|| self.place(t, &u, p).state_slopes(state))
    }

    fn locate(
        &self,
        record: &Record,
        state: &[f64],
        parameters: &[f64],
        sample: usize,
        sigma: &[f64],
        stops: &dyn Fn() -> bool,
    ) -> Option<Result<Failure, Failure>> {
        let (layout, values, duals) = (&*self.layout, self.code.values(), self.code.duals());
        let search = FailureSearch { layout, values, duals, method: &*self.method, record };
        Some(search.locate(state, parameters, sample, sigma, stops))
    }

    fn is_adaptive(&self) -> bool {
        !self.method.is_fixed()
    }

    fn refined<'s>(&'s self, _samples: usize) -> Option<Arc<dyn Sweep + 's>> {
        let kind = self.layout.kind;
        let (code, method) = (self.code.refined(kind)?, self.method.refined(kind)?);
        let (layout, predictor, uncompiled) = (self.layout.clone(), self.predictor.clone(), self.uncompiled.clone());
        Some(Arc::new(DualSweep { layout, code, method, predictor, uncompiled }))
    }

    fn simulating<'s>(&'s self) -> Option<Arc<dyn Sweep + 's>> {
        self.predictor.restarts()?;
        let (layout, code, method) = (self.layout.clone(), self.code.clone(), self.method.clone());
        Some(Arc::new(DualSweep {
            layout,
            code,
            method,
            predictor: Arc::new(FreeRun),
            uncompiled: self.uncompiled.clone(),
        }))
    }

    fn integrator(&self) -> String {
        self.method.describe(self.layout.kind)
    }

    fn predictor(&self) -> String {
        self.predictor.describe()
    }

    fn engine(&self) -> String {
        format!("dual numbers ({})", self.uncompiled.reason)
    }

    fn identity(&self) -> String {
        self.code.identity()
    }
}

/// Runs a record in plain numbers to find the cause of a failure.
pub(crate) struct FailureSearch<'w> {
    pub layout: &'w Layout,
    pub values: &'w dyn Functions<f64>,
    pub duals: &'w dyn Functions<Duals>,
    pub method: &'w dyn Method,
    pub record: &'w Record,
}

impl FailureSearch<'_> {
    fn failure(&self, k: usize, signal: String, value: f64, hint: &'static str) -> Failure {
        Failure { experiment: self.record.name().to_owned(), sample: k, time: self.record.time(k), signal, value, hint }
    }

    /// The cause of a failure in a simulation from this state, as an error; where nothing fails, the error of an output that is
    /// largest relative to the noise.
    pub fn locate(
        &self,
        state: &[f64],
        p: &[f64],
        sample: usize,
        sigma: &[f64],
        stops: &dyn Fn() -> bool,
    ) -> Result<Failure, Failure> {
        let broken = |k, signal, value, hint| Err(self.failure(k, signal, value, hint));
        let unsound = |values: &[f64]| {
            let i = values.iter().position(|v| !v.is_finite())?;
            Some((i, values[i], if values[i].is_nan() { UNDEFINED } else { OVERFLOW }))
        };
        let runaway = |x: &[f64]| x.iter().copied().enumerate().find(|(_, x)| x.abs() >= RUNAWAY);
        let name = |i: usize| &self.layout.states[i].name;
        let mut x = state.to_vec();
        let step = Cell::new(0.0);
        let mut y = vec![0.0; self.layout.outputs.len()];
        let mut largest = (sample, 0, 0.0f64);
        for k in 0..self.record.len() {
            let between = Between::new(self.record, k);
            let FailureSearch { layout, values, duals, method, .. } = *self;
            let plant = SlicePlant { layout, functions: values, duals, method, between, p, step: &step };
            plant.output(&x, &mut y);
            for (j, (&y, channel)) in y.iter().zip(self.record.outputs()).enumerate() {
                let found = channel.values[k];
                // An output that was not measured need not be finite, except at the sample where the failure was
                // noticed.
                if !y.is_finite() && (!found.is_nan() || k == sample) {
                    let hint = if y.is_nan() || runaway(&x).is_none() { UNDEFINED } else { OVERFLOW };
                    return broken(k, format!("output `{}`", self.layout.outputs[j].name), y, hint);
                }
                if ((found - y) / sigma[j]).abs() > (largest.2 / sigma[largest.1]).abs() {
                    largest = (k, j, found - y);
                }
            }
            if k + 1 == self.record.len() || stops() {
                break;
            }
            let mut next = x.clone();
            if plant.next(&mut next) == Err(Stuck) {
                if let Some((i, value)) = runaway(&x) {
                    return broken(k, format!("state `{}`", name(i)), value, OVERFLOW);
                }
                plant.derivative(0.0, &x, &mut next);
                return match unsound(&next) {
                    Some((i, value, hint)) => broken(k, format!("the derivative of state `{}`", name(i)), value, hint),
                    None => broken(k, "the progress of the integrator".to_owned(), 0.0, STUCK),
                };
            }
            if let Some((i, value, hint)) = unsound(&next) {
                let hint = if runaway(&x).is_some() { OVERFLOW } else { hint };
                return broken(k + 1, format!("state `{}`", name(i)), value, hint);
            }
            x = next;
        }
        let (k, j, error) = largest;
        Ok(self.failure(k, format!("the error of output `{}`", self.layout.outputs[j].name), error, HUGE))
    }
}

/// From this magnitude on, a failure counts as overflow: an integrator may be stuck or have computed infinity minus
/// infinity.
const RUNAWAY: f64 = 1e100;

const STUCK: &str = "; no step is short enough, or 100,000 of them do not reach the next sample: the model is too stiff for \
                     the method, jumps, or leaves its domain (take Esdirk, or smooth the model)";
const UNDEFINED: &str = "; the equations are undefined there (a division by zero, a root or logarithm out of its domain, \
                         or the `derivative` or `next` that Model::KIND asks for was not written): bound the parameters, \
                         or start elsewhere (parameters and initial states)";
pub(crate) const OVERFLOW: &str = "; the simulation overflows (an unstable model, or a step too long for its dynamics): \
                                   bound the parameters, take a shorter step or a stiff method, or predict over a shorter \
                                   horizon";
const HUGE: &str = ", whose square overflows: check the units of the record, the noise levels and the start";
