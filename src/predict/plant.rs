//! [`Plant`]: the interface of a predictor to the model between two samples.

use super::{Between, Moments};
use crate::dual::Dual;
use crate::functions::Functions;
use crate::integrate::{Duals, Field, Method, Rate, Slopes, Stuck};
use crate::layout::{Kind, Layout};
use crate::scalar::Scalar;
use crate::transition::{Crossing, Transition, squares};
use core::cell::{Cell, OnceCell, RefCell};
use std::rc::Rc;

/// The model at one sample and in the interval to the next, with given parameters and inputs.
pub trait Plant<S> {
    /// The model's quantities.
    fn layout(&self) -> &Layout;

    /// The parameters.
    fn parameters(&self) -> &[S];

    /// The outputs at the sample, from the state there.
    fn output(&self, x: &[S], y: &mut [S]);

    /// Replaces the state at this sample by that at the next; entries of a longer vector after the state are not
    /// changed.
    ///
    /// # Errors
    /// Where the integrator is [`Stuck`].
    fn next(&self, x: &mut [S]) -> Result<(), Stuck>;

    /// Of a continuous model: `dx/dt` at the fraction `position` of the interval; of a discrete one the next state.
    fn derivative(&self, position: f64, x: &[S], to: &mut [S]);

    /// The slopes of the derivative of a continuous model at the fraction `position` of the interval, or of the next state of a discrete one,
    /// with respect to the state, row by row. They have slopes of their own.
    fn state_slopes(&self, position: f64, x: &[S], to: &mut [S]);

    /// The slopes of the outputs at the sample with respect to the state, row by row.
    fn output_slopes(&self, x: &[S], to: &mut [S]);

    /// Moments of the same functions as [`state_slopes`](Plant::state_slopes), of a state that is Gaussian, to the second order: the carry is
    /// its mean, and after it its covariance, upper triangle row by row.
    fn state_moments(&self, position: f64, carry: &[S]) -> Moments<S>;

    /// Those of the outputs at the sample.
    fn output_moments(&self, carry: &[S]) -> Moments<S>;

    /// Whether any state may jump at samples.
    fn jumps(&self) -> bool;

    /// Replaces the state before the sample by that after it ([`Model::jump`](crate::Model::jump)); entries of a longer vector after the state are not
    /// changed. [`next`](Plant::next) does so itself, [`integrate`](Plant::integrate) does not.
    fn jump(&self, x: &mut [S]);

    /// The slopes of the state after the sample with respect to that before it, row by row.
    fn jump_slopes(&self, x: &[S], to: &mut [S]);

    /// Moments of the state after the sample, as [`state_moments`](Plant::state_moments).
    fn jump_moments(&self, carry: &[S]) -> Moments<S>;

    /// Replaces the state after the sample by that at the next one: the part of [`next`](Plant::next) that follows the jump.
    ///
    /// # Errors
    /// Where the integrator is [`Stuck`].
    fn flow(&self, x: &mut [S]) -> Result<(), Stuck>;

    /// How long the interval is (s).
    fn length(&self) -> S;

    /// Integrates any vector to the next sample by the integrator of the fit: `rate(position, z, to)` writes `dz/dt`
    /// (per second) at a fraction of the interval.
    ///
    /// # Errors
    /// Where the integrator is [`Stuck`].
    fn integrate(&self, z: &mut [S], rate: Rate<'_, S>) -> Result<(), Stuck>;

    /// Replaces the covariance of the state at this sample (upper triangle row by row, each entry in the product of its two states' units) by that at
    /// the next, the process noise of the interval included, and returns true, where the fit crosses intervals exactly: by the library's own filters of linear equations
    /// with constant coefficients, where no integrator was chosen. Else it returns false, and the covariance is to be
    /// [integrated](Plant::integrate).
    fn spread(&self, covariance: &mut [S]) -> bool {
        let _ = covariance;
        false
    }

    /// Process noise of each state at the fraction `position` of the interval, as [`Model::diffusion`](crate::Model::diffusion).
    fn diffusion(&self, position: f64, x: &[S], to: &mut [S]);

    /// Measurement noise of each output at the sample, as [`Model::noise`](crate::Model::noise).
    fn noise(&self, x: &[S], to: &mut [S]);

    /// Standard deviation of each state at the first sample, as [`Model::initial_noise`](crate::Model::initial_noise).
    fn initial_noise(&self, to: &mut [S]);
}

/// A plant whose functions and integrator are trait objects.
pub(crate) struct SlicePlant<'a, S> {
    pub layout: &'a Layout,
    pub functions: &'a dyn Functions<S>,
    /// These functions in numbers with slopes, for Jacobians.
    pub duals: &'a dyn Functions<Duals>,
    pub method: &'a dyn Method,
    pub between: Between<S>,
    pub p: &'a [S],
    pub intervals: &'a Intervals<S>,
}

/// What is kept of an interval for the next ones.
pub(crate) struct Intervals<S> {
    /// The step of an adaptive integrator.
    pub step: Cell<f64>,
    /// Of linear equations that are crossed exactly, by the length of the interval (s).
    crossings: RefCell<Vec<(f64, Rc<Crossing<S>>)>>,
}

impl<S> Default for Intervals<S> {
    fn default() -> Self {
        Intervals { step: Cell::new(0.0), crossings: RefCell::default() }
    }
}

/// Lengths of intervals whose transitions are kept.
const LENGTHS: usize = 16;

/// Numbers that a [`Method`] can integrate.
pub(crate) trait Stepped: Scalar {
    fn advance(method: &dyn Method, field: &Field<'_, Self>, x: &mut [Self], step: &mut f64) -> Result<(), Stuck>;
}

impl Stepped for f64 {
    fn advance(method: &dyn Method, field: &Field<'_, f64>, x: &mut [f64], step: &mut f64) -> Result<(), Stuck> {
        method.advance_values(field, x, step)
    }
}

impl Stepped for Duals {
    fn advance(method: &dyn Method, field: &Field<'_, Duals>, x: &mut [Duals], step: &mut f64) -> Result<(), Stuck> {
        method.advance_duals(field, x, step)
    }
}

impl<S: Stepped> SlicePlant<'_, S> {
    /// The transition of linear equations, where the method is exact.
    fn crossing(&self) -> Option<Rc<Crossing<S>>> {
        if !self.method.is_exact() {
            return None;
        }
        let (n, length) = (self.layout.states.len(), self.between.crossed);
        let mut known = self.intervals.crossings.borrow_mut();
        if let Some(at) = known.iter().position(|(known, _)| *known == length) {
            // The lengths that were met last stand first.
            known[..=at].rotate_right(1);
            return Some(known[0].1.clone());
        }
        drop(known);
        let none = vec![S::from(0.0); n];
        let (mut a, mut levels) = (vec![S::from(0.0); n * n], none.clone());
        self.state_slopes(0.0, &none, &mut a);
        self.diffusion(0.0, &none, &mut levels);
        let made = Rc::new(Transition::over(n, &a, &squares(&levels), S::from(length)).crossing());
        let mut kept = self.intervals.crossings.borrow_mut();
        kept.truncate(LENGTHS - 1);
        kept.insert(0, (length, made.clone()));
        Some(made)
    }

    fn cross(&self, kind: Kind, z: &mut [S], rate: Rate<'_, S>, slopes: Slopes<'_>) -> Result<(), Stuck> {
        let Between { interval, parts, part, .. } = &self.between;
        if parts.is_empty() || kind == Kind::Discrete {
            let field = Field { kind, interval: *interval, states: z.len(), rate, slopes };
            let mut step = self.intervals.step.get();
            S::advance(self.method, &field, z, &mut step)?;
            self.intervals.step.set(step);
            return Ok(());
        }
        for (i, here) in parts.iter().enumerate() {
            part.set(Some(i));
            // By the fraction of the part, whose length has slopes.
            let (length, states) = (here.length, z.len());
            let rate = |position: f64, z: &[S], to: &mut [S]| {
                rate(position, z, to);
                to.iter_mut().for_each(|to| *to *= length);
            };
            let slopes = |position: f64, z: &[f64], value: &mut [f64], rows: &mut [f64]| {
                slopes(position, z, value, rows);
                value.iter_mut().chain(rows).for_each(|entry| *entry *= length.value());
            };
            let field = Field { kind, interval: (0.0, 1.0), states, rate: &rate, slopes: &slopes };
            let long = length.value() > 0.0;
            let mut step = if long { self.intervals.step.get() / length.value() } else { 0.0 };
            let reached = S::advance(self.method, &field, z, &mut step);
            part.set(None);
            reached?;
            if long {
                self.intervals.step.set(step * length.value());
            }
        }
        Ok(())
    }
}

impl<S: Stepped> Plant<S> for SlicePlant<'_, S> {
    fn layout(&self) -> &Layout {
        self.layout
    }

    fn parameters(&self) -> &[S] {
        self.p
    }

    fn output(&self, x: &[S], y: &mut [S]) {
        self.functions.output(self.between.time(0.0), x, &self.between.input(0.0), self.p, y);
    }

    fn next(&self, x: &mut [S]) -> Result<(), Stuck> {
        self.jump(x);
        self.flow(x)
    }

    fn flow(&self, x: &mut [S]) -> Result<(), Stuck> {
        let (state, _) = x.split_at_mut(self.layout.states.len());
        if let Some(crossing) = self.crossing() {
            crossing.state(state, self.between.u1.is_some(), |position, x, to| self.derivative(position, x, to));
            return Ok(());
        }
        // An explicit method does not ask for them.
        let constants = OnceCell::new();
        let slopes = |position: f64, x: &[f64], value: &mut [f64], rows: &mut [f64]| {
            let p: &Vec<Duals> = constants.get_or_init(|| self.p.iter().map(|p| Dual::constant(p.value())).collect());
            let t = Dual::constant(self.between.time(position).value());
            let input = self.between.input(position);
            let mut u = vec![Dual::constant(0.0); input.len()];
            u.iter_mut().zip(&*input).for_each(|(to, u)| to.value = u.value());
            write_slopes(x, &|x, to| self.duals.state(t, x, &u, p, to), value, rows);
        };
        self.cross(self.layout.kind, state, &|position, x, to| self.derivative(position, x, to), &slopes)
    }

    fn derivative(&self, position: f64, x: &[S], to: &mut [S]) {
        let (t, u) = (self.between.time(position), self.between.input(position));
        self.functions.state(t, x, &u, self.p, to);
    }

    fn state_slopes(&self, position: f64, x: &[S], to: &mut [S]) {
        let (t, u) = (self.between.time(position), self.between.input(position));
        self.functions.state_slopes(t, x, &u, self.p, to);
    }

    fn output_slopes(&self, x: &[S], to: &mut [S]) {
        self.functions.output_slopes(self.between.time(0.0), x, &self.between.input(0.0), self.p, to);
    }

    fn state_moments(&self, position: f64, carry: &[S]) -> Moments<S> {
        let (t, u) = (self.between.time(position), self.between.input(position));
        self.functions.state_moments(t, carry, &u, self.p, self.layout)
    }

    fn output_moments(&self, carry: &[S]) -> Moments<S> {
        let (t, u) = (self.between.time(0.0), self.between.input(0.0));
        self.functions.output_moments(t, carry, &u, self.p, self.layout)
    }

    fn jumps(&self) -> bool {
        self.functions.jumps()
    }

    fn jump(&self, x: &mut [S]) {
        if self.jumps() && self.between.passes() {
            let (state, _) = x.split_at_mut(self.layout.states.len());
            let before = state.to_vec();
            self.functions.jump(self.between.time(0.0), &before, &self.between.input(0.0), self.p, state);
        }
    }

    fn jump_slopes(&self, x: &[S], to: &mut [S]) {
        if !self.between.passes() {
            return to.copy_from_slice(&identity(x.len()));
        }
        self.functions.jump_slopes(self.between.time(0.0), x, &self.between.input(0.0), self.p, to);
    }

    fn jump_moments(&self, carry: &[S]) -> Moments<S> {
        let n = self.layout.states.len();
        if !self.between.passes() {
            return Moments { mean: carry[..n].to_vec(), slopes: identity(n), spread: vec![] };
        }
        self.functions.jump_moments(self.between.time(0.0), carry, &self.between.input(0.0), self.p, self.layout)
    }

    fn length(&self) -> S {
        S::from(self.between.length())
    }

    fn integrate(&self, z: &mut [S], rate: Rate<'_, S>) -> Result<(), Stuck> {
        // The rate is known in these numbers alone: the Jacobian that an implicit method asks for is by differences.
        let values = |position: f64, z: &[f64]| {
            let lifted: Vec<S> = z.iter().map(|z| S::from(*z)).collect();
            let mut to = lifted.clone();
            rate(position, &lifted, &mut to);
            to.iter().map(Scalar::value).collect::<Vec<f64>>()
        };
        let slopes = |position: f64, z: &[f64], value: &mut [f64], rows: &mut [f64]| {
            value.copy_from_slice(&values(position, z));
            for j in 0..z.len() {
                let h = 6e-6 * z[j].abs().max(1e-3);
                let (mut above, mut below) = (z.to_vec(), z.to_vec());
                (above[j], below[j]) = (z[j] + h, z[j] - h);
                let (a, b) = (values(position, &above), values(position, &below));
                let column = rows.iter_mut().skip(j).step_by(z.len());
                column.zip(a.iter().zip(&b)).for_each(|(to, (a, b))| *to = (a - b) / (above[j] - below[j]));
            }
        };
        self.cross(Kind::Continuous, z, rate, &slopes)
    }

    fn spread(&self, covariance: &mut [S]) -> bool {
        self.crossing().map(|crossing| crossing.spread(covariance)).is_some()
    }

    fn diffusion(&self, position: f64, x: &[S], to: &mut [S]) {
        let (t, u) = (self.between.time(position), self.between.input(position));
        self.functions.diffusion(t, x, &u, self.p, to);
    }

    fn noise(&self, x: &[S], to: &mut [S]) {
        self.functions.noise(self.between.time(0.0), x, &self.between.input(0.0), self.p, to);
    }

    fn initial_noise(&self, to: &mut [S]) {
        self.functions.initial_noise(self.p, to);
    }
}

/// The slopes of what does not change, row by row.
pub(super) fn identity<S: Scalar>(n: usize) -> Vec<S> {
    (0..n * n).map(|at| S::from(f64::from(u8::from(at % (n + 1) == 0)))).collect()
}

/// The value of `f` and its Jacobian, row by row.
pub(crate) fn value_and_slopes(x: &[f64], f: &dyn Fn(&[Duals], &mut [Duals])) -> (Vec<f64>, Vec<f64>) {
    let (mut value, mut rows) = (vec![0.0; x.len()], vec![0.0; x.len() * x.len()]);
    write_slopes(x, f, &mut value, &mut rows);
    (value, rows)
}

/// Writes the value of `f` and its Jacobian, row by row; eight columns at a time.
fn write_slopes(x: &[f64], f: &dyn Fn(&[Duals], &mut [Duals]), value: &mut [f64], rows: &mut [f64]) {
    const COLUMNS: usize = 8;
    let n = x.len();
    for first in (0..n).step_by(COLUMNS) {
        let lane = |i: usize| i.checked_sub(first).unwrap_or(COLUMNS);
        let none = Duals::constant(0.0);
        let (mut seeded, mut to) = (vec![none; n], vec![none; n]);
        seeded.iter_mut().zip(x).enumerate().for_each(|(i, (to, x))| *to = Dual::variable(*x, lane(i)));
        f(&seeded, &mut to);
        for (i, dual) in to.iter().enumerate() {
            value[i] = dual.value;
            for (entry, slope) in rows[i * n..][..n].iter_mut().skip(first).zip(dual.slopes) {
                *entry = slope;
            }
        }
    }
}
