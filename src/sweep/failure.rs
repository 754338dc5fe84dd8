//! [`FailureSearch`]: the cause of a simulation that fails, found in plain numbers.

use crate::error::Failure;
use crate::functions::{Functions, Sloped, delays};
use crate::integrate::{Duals, Method, Stuck};
use crate::layout::Layout;
use crate::moments::Moments;
use crate::predict::{Between, Intervals, Plant, SlicePlant};
use crate::record::{NO_DEAD_TIME, Record, is_dead_time};
use core::sync::atomic::{AtomicBool, Ordering};

/// Runs a record in plain numbers to find the cause of a failure.
pub(crate) struct FailureSearch<'w> {
    pub layout: &'w Layout,
    pub values: &'w dyn Functions<f64>,
    pub duals: &'w dyn Functions<Duals>,
    pub method: &'w dyn Method,
    /// Which inputs have a dead time.
    pub late: Vec<bool>,
    pub record: &'w Record,
}

impl FailureSearch<'_> {
    fn failure(&self, k: usize, signal: String, value: f64, hint: &'static str) -> Failure {
        Failure {
            experiment: self.record.name().to_owned(),
            sample: k,
            time: self.record.moment(k),
            signal,
            value,
            hint,
        }
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
        let overflowing = |x: &[f64]| x.iter().copied().enumerate().find(|(_, x)| x.abs() >= OVERFLOWS);
        let name = |i: usize| &self.layout.states[i].name;
        let delays = delays(self.values, &self.late, p);
        let wrong = |delay: &Option<f64>| delay.is_some_and(|delay| !is_dead_time(delay));
        if let Some(i) = delays.iter().position(wrong) {
            let signal = format!("the dead time of input `{}`", self.layout.inputs[i].name);
            return broken(0, signal, delays[i].unwrap_or(f64::NAN), NO_DEAD_TIME);
        }
        let mut x = state.to_vec();
        let intervals = Intervals::default();
        let watched = Watched::new(self.values);
        let mut y = vec![0.0; self.layout.outputs.len()];
        let mut largest = (sample, 0, 0.0f64);
        for k in 0..self.record.len() {
            let between = Between::new(self.record, k, &delays);
            let FailureSearch { layout, duals, method, .. } = self;
            let plant = SlicePlant {
                layout,
                functions: &watched,
                duals: *duals,
                method: *method,
                between,
                p,
                intervals: &intervals,
            };
            watched.forget();
            plant.output(&x, &mut y);
            for (j, (&y, channel)) in y.iter().zip(self.record.outputs()).enumerate() {
                let found = channel.values[k];
                // An output that was not measured need not be finite, except at the sample where the failure was
                // noticed.
                if !y.is_finite() && (!found.is_nan() || k == sample) {
                    let hint = if overflowing(&x).is_none() { UNDEFINED } else { OVERFLOW };
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
            plant.jump(&mut next);
            if let Some((i, value, _)) = unsound(&next) {
                let hint = if value.is_nan() { UNDEFINED_JUMP } else { OVERFLOW };
                return broken(k, format!("state `{}` after the sample", name(i)), value, hint);
            }
            if plant.flow(&mut next) == Err(Stuck) {
                if let Some((i, value)) = overflowing(&x) {
                    return broken(k, format!("state `{}`", name(i)), value, OVERFLOW);
                }
                plant.jump(&mut x);
                plant.derivative(0.0, &x, &mut next);
                return match unsound(&next) {
                    Some((i, value, hint)) => broken(k, format!("the derivative of state `{}`", name(i)), value, hint),
                    None => broken(k, "the progress of the integrator".to_owned(), 0.0, STUCK),
                };
            }
            if let Some((i, value, hint)) = unsound(&next) {
                let hint = if watched.overflowed() { OVERFLOW } else { hint };
                return broken(k + 1, format!("state `{}`", name(i)), value, hint);
            }
            x = next;
        }
        let (k, j, error) = largest;
        Ok(self.failure(k, format!("the error of output `{}`", self.layout.outputs[j].name), error, HUGE))
    }
}

/// From this magnitude of a state on, at a sample or within a step, a failure counts as overflow: an integrator may be stuck or have
/// computed infinity minus infinity.
const OVERFLOWS: f64 = 1e30;

const STUCK: &str = "; no step is short enough, or 100,000 of them do not reach the next sample: the model is too stiff for \
                     the method, jumps, or leaves its domain (take Esdirk, or smooth the model)";
const UNDEFINED: &str = "; the equations are undefined there (a division by zero, a root or logarithm out of its domain, \
                         or the `derivative` or `next` that Model::KIND asks for was not written): bound the parameters, \
                         or start elsewhere (parameters and initial states)";
const UNDEFINED_JUMP: &str = "; the `jump` of the state is undefined there (a division by zero, a root or logarithm out of its domain): \
                              bound the parameters, or start elsewhere (parameters and initial states)";
pub(crate) const OVERFLOW: &str = "; the simulation overflows (an unstable model, or a step too long for its dynamics): \
                                   bound the parameters, take a shorter step or a stiff method, or predict over a shorter \
                                   horizon";
const HUGE: &str = ", whose square overflows: check the units of the record, the noise levels and the start";

/// Equations that note whether they are asked at a state that has run away.
struct Watched<'w> {
    values: &'w dyn Functions<f64>,
    overflowed: AtomicBool,
}

impl<'w> Watched<'w> {
    fn new(values: &'w dyn Functions<f64>) -> Self {
        Watched { values, overflowed: AtomicBool::new(false) }
    }

    /// Begins the next step.
    fn forget(&self) {
        self.overflowed.store(false, Ordering::Relaxed);
    }

    fn overflowed(&self) -> bool {
        self.overflowed.load(Ordering::Relaxed)
    }
}

impl Functions<f64> for Watched<'_> {
    fn state(&self, t: f64, x: &[f64], u: &[f64], p: &[f64], to: &mut [f64]) {
        if x.iter().any(|x| x.abs() >= OVERFLOWS) {
            self.overflowed.store(true, Ordering::Relaxed);
        }
        self.values.state(t, x, u, p, to);
    }

    fn output(&self, t: f64, x: &[f64], u: &[f64], p: &[f64], to: &mut [f64]) {
        self.values.output(t, x, u, p, to);
    }

    fn diffusion(&self, t: f64, x: &[f64], u: &[f64], p: &[f64], to: &mut [f64]) {
        self.values.diffusion(t, x, u, p, to);
    }

    fn noise(&self, t: f64, x: &[f64], u: &[f64], p: &[f64], to: &mut [f64]) {
        self.values.noise(t, x, u, p, to);
    }

    fn initial_noise(&self, p: &[f64], to: &mut [f64]) {
        self.values.initial_noise(p, to);
    }

    fn initial(&self, u: &[f64], p: &[f64], to: &mut [f64]) {
        self.values.initial(u, p, to);
    }

    fn delay(&self, p: &[f64], to: &mut [f64]) {
        self.values.delay(p, to);
    }

    fn jumps(&self) -> bool {
        self.values.jumps()
    }

    fn jump(&self, t: f64, x: &[f64], u: &[f64], p: &[f64], to: &mut [f64]) {
        self.values.jump(t, x, u, p, to);
    }

    fn known(&self) -> Option<&dyn Sloped<f64>> {
        Some(self)
    }
}

/// Of the equations themselves: secants ask at states so large that they count as run away.
impl Sloped<f64> for Watched<'_> {
    fn state_slopes(&self, t: f64, x: &[f64], u: &[f64], p: &[f64], to: &mut [f64]) {
        self.values.state_slopes(t, x, u, p, to);
    }

    fn output_slopes(&self, t: f64, x: &[f64], u: &[f64], p: &[f64], to: &mut [f64]) {
        self.values.output_slopes(t, x, u, p, to);
    }

    fn jump_slopes(&self, t: f64, x: &[f64], u: &[f64], p: &[f64], to: &mut [f64]) {
        self.values.jump_slopes(t, x, u, p, to);
    }

    fn state_moments(&self, t: f64, carry: &[f64], u: &[f64], p: &[f64], layout: &Layout) -> Moments<f64> {
        self.values.state_moments(t, carry, u, p, layout)
    }

    fn output_moments(&self, t: f64, carry: &[f64], u: &[f64], p: &[f64], layout: &Layout) -> Moments<f64> {
        self.values.output_moments(t, carry, u, p, layout)
    }

    fn jump_moments(&self, t: f64, carry: &[f64], u: &[f64], p: &[f64], layout: &Layout) -> Moments<f64> {
        self.values.jump_moments(t, carry, u, p, layout)
    }
}
