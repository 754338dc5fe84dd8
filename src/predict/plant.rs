//! [`Plant`]: the interface of a predictor to the model between two samples.

use super::Moments;
use crate::dual::Dual;
use crate::functions::Functions;
use crate::integrate::{Duals, Field, Method, Rate, Slopes, Stuck};
use crate::interval::Hold;
use crate::layout::{Kind, Layout};
use crate::record::{Part, Record};
use crate::scalar::Scalar;
use crate::transition::{Crossing, Transition, squares};
use core::cell::{Cell, RefCell};
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

/// From one sample of a record to the next.
pub(crate) struct Between<S> {
    /// Begin and length (s).
    interval: (f64, f64),
    /// The length that its transition is computed for (s).
    crossed: f64,
    u0: Vec<S>,
    /// The input at the end; `None` where it is held.
    u1: Option<Vec<S>>,
    /// Where an input is late: between its jumps.
    parts: Vec<Part<S>>,
    /// The part that is being crossed.
    part: Cell<Option<usize>>,
}

impl<S: Scalar> Between<S> {
    /// From sample `k` on, with the dead times of inputs, if any has one; after the last sample the input is held and no time passes.
    pub fn new(record: &Record, k: usize, delays: &[Option<S>]) -> Self {
        let t0 = record.time(k);
        let last = k + 1 >= record.len();
        let length = if last { 0.0 } else { record.time(k + 1) - t0 };
        let (interval, crossed, part) = ((t0, length), length, Cell::new(None));
        if !delays.is_empty() {
            let (u0, parts) = (record.late_inputs(k, delays), record.parts(k, delays));
            return Between { interval, crossed, u0, u1: None, parts, part };
        }
        let u0 = record.input(k);
        let at_end = |(i, u0): (usize, &f64)| match record.input_hold(i) {
            Hold::Zero => S::from(*u0),
            Hold::First => S::from(record.inputs()[i].values[k + 1]),
        };
        let moves = !record.holds.all_zero() && !last;
        let u1 = moves.then(|| u0.iter().enumerate().map(at_end).collect());
        Between { interval, crossed, u0: u0.into_iter().map(S::from).collect(), u1, parts: vec![], part }
    }

    /// Crossed by the transition over this length (s), which all have that differ by rounding.
    pub fn crossed_as(self, length: f64) -> Self {
        Between { crossed: length, ..self }
    }

    /// How long it is (s).
    pub fn length(&self) -> f64 {
        self.interval.1
    }

    fn part(&self) -> Option<&Part<S>> {
        self.part.get().and_then(|i| self.parts.get(i))
    }

    /// Time at a fraction of the interval, or of the part that is being crossed (s).
    pub fn time(&self, position: f64) -> S {
        match self.part() {
            Some(part) => part.length * position + part.t0,
            None => S::from(self.interval.0 + position * self.interval.1),
        }
    }

    /// The input there.
    pub fn input(&self, position: f64) -> Vec<S> {
        let (u0, u1) = match self.part() {
            Some(part) => (&part.u0, Some(&part.u1)),
            None => (&self.u0, self.u1.as_ref()),
        };
        let Some(u1) = u1 else { return u0.clone() };
        u0.iter().zip(u1).map(|(u0, u1)| (*u1 - *u0) * position + *u0).collect()
    }
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
    fn advance(method: &dyn Method, field: &Field<'_, Self>, x: Vec<Self>, step: &mut f64) -> Result<Vec<Self>, Stuck>;
}

impl Stepped for f64 {
    fn advance(method: &dyn Method, field: &Field<'_, f64>, x: Vec<f64>, step: &mut f64) -> Result<Vec<f64>, Stuck> {
        method.advance_values(field, x, step)
    }
}

impl Stepped for Duals {
    fn advance(
        method: &dyn Method,
        field: &Field<'_, Duals>,
        x: Vec<Duals>,
        step: &mut f64,
    ) -> Result<Vec<Duals>, Stuck> {
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
        if let Some((_, known)) = self.intervals.crossings.borrow().iter().find(|(known, _)| *known == length) {
            return Some(known.clone());
        }
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
            z.copy_from_slice(&S::advance(self.method, &field, z.to_vec(), &mut step)?);
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
            let slopes = |position: f64, z: &[f64]| {
                let (mut value, mut rows) = slopes(position, z);
                value.iter_mut().chain(rows.iter_mut().flatten()).for_each(|entry| *entry *= length.value());
                (value, rows)
            };
            let field = Field { kind, interval: (0.0, 1.0), states, rate: &rate, slopes: &slopes };
            let long = length.value() > 0.0;
            let mut step = if long { self.intervals.step.get() / length.value() } else { 0.0 };
            let end = S::advance(self.method, &field, z.to_vec(), &mut step);
            part.set(None);
            z.copy_from_slice(&end?);
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
        let (state, _) = x.split_at_mut(self.layout.states.len());
        if let Some(crossing) = self.crossing() {
            crossing.state(state, self.between.u1.is_some(), |position, x, to| self.derivative(position, x, to));
            return Ok(());
        }
        let p: Vec<Duals> = self.p.iter().map(|p| Dual::constant(p.value())).collect();
        let slopes = |position: f64, x: &[f64]| {
            let t = Dual::constant(self.between.time(position).value());
            let u: Vec<Duals> = self.between.input(position).iter().map(|u| Dual::constant(u.value())).collect();
            jacobian(x, &|x, to| self.duals.state(t, x, &u, &p, to))
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
        let slopes = |position: f64, z: &[f64]| {
            let columns = (0..z.len()).map(|j| {
                let h = 6e-6 * z[j].abs().max(1e-3);
                let (mut above, mut below) = (z.to_vec(), z.to_vec());
                (above[j], below[j]) = (z[j] + h, z[j] - h);
                let (a, b) = (values(position, &above), values(position, &below));
                a.iter().zip(&b).map(|(a, b)| (a - b) / (above[j] - below[j])).collect::<Vec<f64>>()
            });
            let columns: Vec<Vec<f64>> = columns.collect();
            let rows = (0..z.len()).map(|i| columns.iter().map(|column| column[i]).collect()).collect();
            (values(position, z), rows)
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

/// Value of `f` and its Jacobian by rows, eight columns at a time.
pub(crate) fn jacobian(x: &[f64], f: &dyn Fn(&[Duals], &mut [Duals])) -> (Vec<f64>, Vec<Vec<f64>>) {
    const COLUMNS: usize = 8;
    let n = x.len();
    let (mut value, mut rows) = (vec![0.0; n], vec![vec![0.0; n]; n]);
    for first in (0..n).step_by(COLUMNS) {
        let lane = |i: usize| i.checked_sub(first).unwrap_or(COLUMNS);
        let seeded: Vec<Duals> = x.iter().enumerate().map(|(i, x)| Dual::variable(*x, lane(i))).collect();
        let mut to = seeded.clone();
        f(&seeded, &mut to);
        for (i, dual) in to.iter().enumerate() {
            value[i] = dual.value;
            for (entry, slope) in rows[i].iter_mut().skip(first).zip(dual.slopes) {
                *entry = slope;
            }
        }
    }
    (value, rows)
}
