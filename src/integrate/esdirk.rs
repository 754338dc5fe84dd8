//! [`Esdirk`]: an implicit Runge-Kutta method for stiff models, ARK4(3)6L\[2\]SA-ESDIRK (C. A. Kennedy, M. H. Carpenter,
//! "Additive Runge-Kutta schemes for convection-diffusion-reaction equations", Applied Numerical Mathematics 44, 2003,
//! 139-181, appendix C; NASA/TM-2001-211038).
//!
//! Why implicit and not linearly implicit (Rosenbrock): the formula of a Rosenbrock step holds the Jacobian, so its exact
//! slopes would need second derivatives of the model. A stage of this method is defined by an equation, and once that is
//! solved, one more Newton step in arithmetic with slopes gives the slopes by the implicit function theorem, exactly.
//! Newton's Jacobian comes from duals, eight columns at a time, and is taken anew at each iterate, because the slopes
//! need it at the solution anyway.
//!
//! Measured at a tolerance of 1e-8, against the explicit [`Rk45`](super::Rk45): Robertson's kinetics to 40 s take 0.57 ms
//! (three slopes included: 0.58 ms) against 4.0 ms; van der Pol's oscillator with mu = 1000 takes 1.7 ms over 2000 s, where the
//! explicit method gives up after 100,000 steps; a circuit with a stray time constant of 10 ns, sampled every 1 ms, takes
//! 33 us per sample against 6.1 ms.

use super::{Integrator, Stuck, Tolerance, axpy, combined};
use crate::dual::Dual;
use crate::interval::Interval;
use crate::model::{Kind, Model};
use crate::scalar::Scalar;
use crate::signals::{Of, Signals};
use serde::{Deserialize, Serialize};

/// Singly diagonally implicit Runge-Kutta 4(3) with an explicit first stage, stiffly accurate and L-stable: for models
/// with time constants far below the sample time. Steps follow the error of the values, and stop at every sample.
///
/// A step costs 3 to 20 times one of [`Rk45`](super::Rk45), the more the more states there are, and is as long as the
/// solution is smooth.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Esdirk {
    /// Error allowed per step, relative to the value of each state; 1e-14 at least.
    pub relative: f64,
    /// Error allowed per step on top, in the unit of each state: what counts as nothing where a state passes zero.
    pub absolute: f64,
}

impl Default for Esdirk {
    /// 1e-8 and 1e-12.
    fn default() -> Self {
        Esdirk { relative: 1e-8, absolute: 1e-12 }
    }
}

const STAGES: usize = 6;
const GAMMA: f64 = 0.25;
const C: [f64; STAGES] = [0.0, 0.5, 0.332, 0.62, 0.85, 1.0];
/// Below the diagonal; the last row, with `GAMMA`, is the result.
const A: [[f64; STAGES - 1]; STAGES] = [
    [0.0; 5],
    [0.25, 0.0, 0.0, 0.0, 0.0],
    [8611.0 / 62500.0, -1743.0 / 31250.0, 0.0, 0.0, 0.0],
    [5012029.0 / 34652500.0, -654441.0 / 2922500.0, 174375.0 / 388108.0, 0.0, 0.0],
    [15267082809.0 / 155376265600.0, -71443401.0 / 120774400.0, 730878875.0 / 902184768.0, 2285395.0 / 8070912.0, 0.0],
    [82889.0 / 524892.0, 0.0, 15625.0 / 83664.0, 69875.0 / 102672.0, -2260.0 / 8211.0],
];
/// Order 4 less order 3.
const ERROR: [f64; STAGES] = [
    31666707.0 / 9881966720.0,
    0.0,
    -256875.0 / 105007616.0,
    -2768025.0 / 128864768.0,
    169839.0 / 3864644.0,
    -5247.0 / 225920.0,
];

/// Newton steps per stage before the step is given up.
const ITERATIONS: usize = 10;
/// Columns of the Jacobian per evaluation.
const COLUMNS: usize = 8;

/// The equation `k = f(base + h gamma k)` of a stage, made linear at a guess.
struct Linearization<X: Signals> {
    /// The guess.
    k: Of<X, f64>,
    /// `f(base + h gamma k)`.
    f: Of<X, f64>,
    /// `I - h gamma df/dx` in triangles.
    rows: X::Array<X::Array<f64>>,
    /// Where these rows stood.
    order: X::Array<usize>,
}

impl<M: Model> Integrator<M> for Esdirk {
    type Memory = f64;

    #[inline(always)]
    fn advance<S: Scalar>(
        &self,
        model: &M,
        interval: &Interval<M::Input>,
        x: Of<M::State, S>,
        p: &Of<M::Parameters, S>,
        memory: &mut f64,
    ) -> Result<Of<M::State, S>, Stuck> {
        let length = interval.t1 - interval.t0;
        let zero = M::State::splat(0.0);
        let values = |x: &Of<M::State, S>| M::State::map(*x, |v: S| v.value());
        let p_value = M::Parameters::map(*p, |v: S| v.value());
        let mut k = [M::State::splat(S::from(0.0)); STAGES];
        let (mut start, mut end) = (f64::NAN, f64::NAN);
        let tolerance = Tolerance { relative: self.relative, absolute: self.absolute };
        tolerance.cross::<M::State, M::Input, S>(4.0, interval, x, memory, |x, tau, h| {
            if tau == end {
                (k[0], start) = (k[STAGES - 1], tau);
            }
            let mut stage = *x;
            for i in usize::from(tau == start)..STAGES {
                let base = combined::<M::State, S>(x, h, &A[i][..i], &k);
                let at = tau + C[i] * h;
                let (t, s) = (interval.t0 + at, at / length);
                // The slope k of the stage solves k = f(base + h gamma k); the first guess keeps the last stage.
                let (gamma_h, u) = (GAMMA * h, interval.input::<f64>(s));
                let equation = if i == 0 {
                    None
                } else {
                    Some(self.solve(model, t, &u, &p_value, &values(&base), &values(&stage), gamma_h)?)
                };
                let guess = M::State::map(equation.as_ref().map_or(zero, |e| e.k), S::from);
                let at_guess = axpy::<M::State, S>(base, gamma_h, guess);
                let f = model.derivative(t, &at_guess, &interval.input::<S>(s), p);
                k[i] = match &equation {
                    None => f,
                    Some(equation) => equation.improved::<S>(guess, f),
                };
                if i == 0 {
                    continue;
                }
                stage = axpy::<M::State, S>(base, gamma_h, k[i]);
            }
            (start, end) = (tau, tau + h);
            let k = k.map(|k| values(&k));
            Some((stage, combined::<M::State, f64>(&zero, h, &ERROR, &k)))
        })
    }

    fn serves(&self, kind: Kind) -> bool {
        kind == Kind::Continuous
    }

    fn refined(&self) -> Option<Self> {
        Some(Esdirk { relative: self.relative * 1e-2, absolute: self.absolute * 1e-2 })
    }

    #[cfg(feature = "std")]
    fn check(&self) -> Result<(), crate::error::Error> {
        Tolerance { relative: self.relative, absolute: self.absolute }.check("Esdirk")
    }

    #[cfg(feature = "std")]
    fn describe(&self) -> String {
        format!("implicit Runge-Kutta 4(3), adaptive, relative {:e}, absolute {:e}", self.relative, self.absolute)
    }
}

impl Esdirk {
    /// The equation of a stage by Newton's method, but for the last step, which is left to arithmetic with slopes. `None`
    /// where it does not converge.
    #[expect(clippy::too_many_arguments, reason = "an equation with its coefficients")]
    fn solve<M: Model>(
        &self,
        model: &M,
        t: f64,
        u: &Of<M::Input, f64>,
        p: &Of<M::Parameters, f64>,
        base: &Of<M::State, f64>,
        guess: &Of<M::State, f64>,
        gamma_h: f64,
    ) -> Option<Linearization<M::State>> {
        // What is left is squared by the last step, so that 1e-10 is as good as it gets.
        let allowed = Tolerance { relative: self.relative.max(1e-10), absolute: self.absolute };
        let from_base = axpy::<M::State, f64>(*guess, -1.0, *base);
        let mut k = M::State::map(from_base, |v: f64| v / gamma_h);
        let mut before = f64::INFINITY;
        for _ in 0..ITERATIONS {
            let x = axpy::<M::State, f64>(*base, gamma_h, k);
            let equation = Linearization::new(model, t, &x, u, p, k, gamma_h)?;
            let next = equation.improved::<f64>(k, equation.f);
            let moved = axpy::<M::State, f64>(next, -1.0, k);
            let ratio = allowed.ratio::<M::State, f64>(&M::State::map(moved, |v: f64| v * gamma_h), &x, &x);
            // Small against the tolerance and, for the slopes' sake, against the states, or no longer getting smaller.
            if ratio <= 1e-3 && (ratio * allowed.relative <= 1e-10 || ratio > 0.1 * before) {
                return Some(equation);
            }
            if ratio.is_nan() || ratio >= 2.0 * before {
                return None;
            }
            (before, k) = (ratio, next);
        }
        None
    }
}

impl<X: Signals> Linearization<X> {
    /// At the slope `k`, where the state is `x`; `None` if the equation is singular there or not finite.
    fn new<M: Model<State = X>>(
        model: &M,
        t: f64,
        x: &Of<X, f64>,
        u: &Of<M::Input, f64>,
        p: &Of<M::Parameters, f64>,
        k: Of<X, f64>,
        gamma_h: f64,
    ) -> Option<Self> {
        let x = X::into_array(*x);
        let u = M::Input::map(*u, Dual::<COLUMNS>::constant);
        let p = M::Parameters::map(*p, Dual::<COLUMNS>::constant);
        let mut f = k;
        let mut rows = X::array_from_fn(|_| X::array_from_fn(|_| 0.0));
        for from in (0..X::LEN).step_by(COLUMNS) {
            let lane = |i: usize| i.checked_sub(from).unwrap_or(COLUMNS);
            let seeded = X::from_fn(|i| Dual::<COLUMNS>::variable(x.as_ref()[i], lane(i)));
            let duals = model.derivative(t, &seeded, &u, &p);
            f = X::map(duals, |v: Dual<COLUMNS>| v.value);
            let duals = X::into_array(duals);
            for (i, (row, dual)) in rows.as_mut().iter_mut().zip(duals.as_ref()).enumerate() {
                for (j, (entry, slope)) in row.as_mut().iter_mut().skip(from).zip(dual.slopes).enumerate() {
                    *entry = f64::from(u8::from(i == from + j)) - gamma_h * slope;
                }
            }
        }
        Linearization { k, f, rows, order: X::array_from_fn(|i| i) }.eliminated()
    }

    /// Gaussian elimination; the pivot is the largest entry against its row, which does not depend on the states' units.
    fn eliminated(mut self) -> Option<Self> {
        let largest = |row: &X::Array<f64>| row.as_ref().iter().fold(0.0f64, |m, v| m.max(v.abs()));
        let (rows, order) = (self.rows.as_mut(), self.order.as_mut());
        let mut size = X::array_from_fn(|i| largest(&rows[i]));
        let size = size.as_mut();
        for j in 0..X::LEN {
            let against_row = |i: &usize| rows[*i].as_ref()[j].abs() / size[*i];
            let pivot = (j..X::LEN).max_by(|a, b| against_row(a).total_cmp(&against_row(b)))?;
            rows.swap(j, pivot);
            order.swap(j, pivot);
            size.swap(j, pivot);
            let top = rows[j];
            let divisor = top.as_ref()[j];
            if divisor == 0.0 || !divisor.is_finite() {
                return None;
            }
            for row in rows[j + 1..].iter_mut() {
                let row = row.as_mut();
                row[j] /= divisor;
                let factor = row[j];
                for (entry, above) in row[j + 1..].iter_mut().zip(&top.as_ref()[j + 1..]) {
                    *entry -= factor * above;
                }
            }
        }
        Some(self)
    }

    /// Newton's step from the guess `k` (here without slopes of its own) and `f = f(base + h gamma k)`: the solution, with
    /// the slopes that those of `f` give it.
    #[inline(always)]
    fn improved<S: Scalar>(&self, k: Of<X, S>, f: Of<X, S>) -> Of<X, S> {
        let residual = X::into_array(axpy::<X, S>(f, -1.0, k));
        let rows = self.rows.as_ref();
        let mut step = X::array_from_fn(|i| residual.as_ref()[self.order.as_ref()[i]]);
        let v = step.as_mut();
        for i in 0..X::LEN {
            for j in 0..i {
                v[i] -= v[j] * rows[i].as_ref()[j];
            }
        }
        for i in (0..X::LEN).rev() {
            for j in i + 1..X::LEN {
                v[i] -= v[j] * rows[i].as_ref()[j];
            }
            v[i] /= rows[i].as_ref()[i];
        }
        axpy::<X, S>(X::from_array(step), 1.0, k)
    }
}
