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
//! explicit method fails after 100,000 steps; a circuit with a stray time constant of 10 ns, sampled every 1 ms, takes
//! 33 us per sample against 6.1 ms.

use super::tolerance::{MAX_STEPS, combined, values};
use super::{Integrator, Square, Stuck, System, Tolerance};
use crate::layout::Kind;
use crate::scalar::Scalar;
use serde::{Deserialize, Serialize};

/// Singly diagonally implicit Runge-Kutta 4(3) with an explicit first stage, stiffly accurate and L-stable: for models
/// with time constants far below the sample time. Steps follow the error of the values, and stop at every sample.
///
/// A step costs 3 to 20 times one of [`Rk45`](super::Rk45), the more the more states there are, and is as long as the
/// solution is smooth.
///
/// ```
/// # use greybox::{Fit, Model, Scalar, Time, free, signals, simulate};
/// # signals! { pub struct Heat { t: "K" } pub struct Power { p: "W" } pub struct Body { c: "J/K", g: "W/K^4" } }
/// # #[derive(Clone)]
/// # struct Radiating;
/// # impl Model for Radiating {
/// #     type State = Heat; type Input = Power; type Output = Heat; type Parameters = Body;
/// #     fn derivative<S: Scalar>(&self, _t: S, x: &Heat<S>, u: &Power<S>, p: &Body<S>) -> Heat<S> {
/// #         Heat { t: (u.p - p.g * x.t.powi(4)) / p.c }
/// #     }
/// #     fn output<S: Scalar>(&self, _t: S, x: &Heat<S>, _u: &Power<S>, _p: &Body<S>) -> Heat<S> { *x }
/// # }
/// # fn main() -> Result<(), greybox::Error> {
/// # let powers: Vec<Power> = (0..200).map(|k| Power { p: if k < 100 { 500.0 } else { 50.0 } }).collect();
/// # let time = Time::Uniform { start: 0.0, step: 2.0 };
/// # let run = simulate(&Radiating, &Body { c: 100.0, g: 1e-9 }, &Heat { t: 300.0 }, time, &powers)?;
/// # let record = run.with_noise(Heat { t: 1.0 }, 1).experiment(&Radiating)?;
/// # let start = Body { c: free(200.0).log(), g: free(3e-9).log() };
/// let estimate = Fit::new(&Radiating, &record).parameters(start).integrator(greybox::Esdirk::default()).run()?;
/// assert!((estimate.parameters.c / 100.0 - 1.0).abs() < 0.02);
/// # Ok(())
/// # }
/// ```
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

/// Newton steps per stage, after which the step is rejected.
const ITERATIONS: usize = 10;

/// The equation `k = f(base + h gamma k)` of a stage, made linear at a guess.
struct Linearization<Y: System> {
    /// The guess.
    k: Y::Vector<f64>,
    /// `f(base + h gamma k)`.
    f: Y::Vector<f64>,
    /// `I - h gamma df/dx` in triangles.
    rows: Y::Matrix,
    /// Where these rows stood.
    order: Y::Vector<usize>,
}

impl Integrator for Esdirk {
    const FIXED: bool = false;

    #[inline(always)]
    fn advance<Y: System>(
        &self,
        system: &Y,
        x: Y::Vector<Y::Scalar>,
        step: &mut f64,
    ) -> Result<Y::Vector<Y::Scalar>, Stuck> {
        self.advance_within(MAX_STEPS, system, x, step)
    }

    fn serves(&self, kind: Kind) -> bool {
        kind == Kind::Continuous
    }

    fn refined(&self, _kind: Kind) -> Option<Self> {
        Some(Esdirk { relative: self.relative * 1e-2, absolute: self.absolute * 1e-2 })
    }

    #[cfg(feature = "std")]
    fn check(&self) -> Result<(), crate::error::Error> {
        self.tolerance(MAX_STEPS).check("Esdirk")
    }

    #[cfg(feature = "std")]
    fn describe(&self, _kind: Kind) -> String {
        format!("implicit Runge-Kutta 4(3), adaptive, relative {:e}, absolute {:e}", self.relative, self.absolute)
    }
}

/// `x + a * k`, entry by entry.
#[inline(always)]
fn axpy<Y: System, S: Scalar>(system: &Y, x: &Y::Vector<S>, a: f64, k: &Y::Vector<S>) -> Y::Vector<S> {
    system.vector(|i| x.as_ref()[i].plus_times(k.as_ref()[i], a))
}

impl Esdirk {
    fn tolerance(&self, steps: u32) -> Tolerance {
        Tolerance { relative: self.relative, absolute: self.absolute, steps }
    }

    /// Crosses an interval with at most this many steps, tried or taken.
    ///
    /// # Errors
    /// `Stuck`, where that is not enough.
    #[inline(always)]
    pub(super) fn advance_within<Y: System>(
        &self,
        steps: u32,
        system: &Y,
        x: Y::Vector<Y::Scalar>,
        step: &mut f64,
    ) -> Result<Y::Vector<Y::Scalar>, Stuck> {
        let (_, length) = system.interval();
        self.tolerance(steps).cross_in_stages((4.0, &ERROR), system, x, step, |x, tau, h, first, k| {
            let mut stage = x.clone();
            for i in first..STAGES {
                let base = combined(system, x, h, &A[i][..i], k);
                let position = (tau + C[i] * h) / length;
                // The slope k of the stage solves k = f(base + h gamma k); the first guess keeps the last stage.
                let gamma_h = GAMMA * h;
                let equation = if i == 0 {
                    None
                } else {
                    Some(self.solve(system, position, &values(system, &base), &values(system, &stage), gamma_h)?)
                };
                let guess = match &equation {
                    None => system.vector(|_| Y::Scalar::from(0.0)),
                    Some(equation) => system.vector(|i| Y::Scalar::from(equation.k.as_ref()[i])),
                };
                let at_guess = axpy::<Y, _>(system, &base, gamma_h, &guess);
                let f = system.derivative(position, &at_guess);
                k[i] = match &equation {
                    None => f,
                    Some(equation) => equation.improved(system, &guess, &f),
                };
                if i == 0 {
                    continue;
                }
                stage = axpy::<Y, _>(system, &base, gamma_h, &k[i]);
            }
            Some(stage)
        })
    }

    /// The equation of a stage by Newton's method, but for the last step, which is left to arithmetic with slopes. `None`
    /// where it does not converge.
    fn solve<Y: System>(
        &self,
        system: &Y,
        position: f64,
        base: &Y::Vector<f64>,
        guess: &Y::Vector<f64>,
        gamma_h: f64,
    ) -> Option<Linearization<Y>> {
        // The last step squares the remaining error: 1e-10 is at the limit of precision.
        let allowed = Tolerance { relative: self.relative.max(1e-10), ..self.tolerance(MAX_STEPS) };
        let mut k = system.vector(|i| (guess.as_ref()[i] - base.as_ref()[i]) / gamma_h);
        let mut before = f64::INFINITY;
        for _ in 0..ITERATIONS {
            let x = axpy::<Y, f64>(system, base, gamma_h, &k);
            let equation = Linearization::new(system, position, &x, k, gamma_h)?;
            let next = equation.improved(system, &equation.k, &equation.f);
            let moved = system.vector(|i| (next.as_ref()[i] - equation.k.as_ref()[i]) * gamma_h);
            let ratio = allowed.ratio(moved.as_ref(), x.as_ref(), x.as_ref());
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

impl<Y: System> Linearization<Y> {
    /// At the slope `k`, where the state is `x`; `None` if the equation is singular there or not finite.
    fn new(system: &Y, position: f64, x: &Y::Vector<f64>, k: Y::Vector<f64>, gamma_h: f64) -> Option<Self> {
        let (f, mut rows) = system.jacobian(position, x);
        for i in 0..k.as_ref().len() {
            for (j, entry) in rows.row_mut(i).iter_mut().enumerate() {
                *entry = f64::from(u8::from(i == j)) - gamma_h * *entry;
            }
        }
        Linearization { k, f, rows, order: system.vector(|i| i) }.eliminated(system)
    }

    /// Gaussian elimination; the pivot is the largest entry against its row, which does not depend on the states' units.
    fn eliminated(mut self, system: &Y) -> Option<Self> {
        let largest = |row: &[f64]| row.iter().fold(0.0f64, |m, v| m.max(v.abs()));
        let rows = &mut self.rows;
        let mut size = system.vector(|i| largest(rows.row(i)));
        let (order, size) = (self.order.as_mut(), size.as_mut());
        let n = size.len();
        for j in 0..n {
            let against_row = |i: &usize| rows.row(*i)[j].abs() / size[*i];
            let pivot = (j..n).max_by(|a, b| against_row(a).total_cmp(&against_row(b)))?;
            if pivot != j {
                for column in 0..n {
                    let (a, b) = (rows.row(j)[column], rows.row(pivot)[column]);
                    (rows.row_mut(j)[column], rows.row_mut(pivot)[column]) = (b, a);
                }
                order.swap(j, pivot);
                size.swap(j, pivot);
            }
            let divisor = rows.row(j)[j];
            if divisor == 0.0 || !divisor.is_finite() {
                return None;
            }
            for i in j + 1..n {
                let factor = rows.row(i)[j] / divisor;
                rows.row_mut(i)[j] = factor;
                for column in j + 1..n {
                    let above = rows.row(j)[column];
                    rows.row_mut(i)[column] -= factor * above;
                }
            }
        }
        Some(self)
    }

    /// Newton's step from the guess `k` (here without slopes of its own) and `f = f(base + h gamma k)`: the solution, with
    /// the slopes that those of `f` give it.
    #[inline(always)]
    fn improved<S: Scalar>(&self, system: &Y, k: &Y::Vector<S>, f: &Y::Vector<S>) -> Y::Vector<S> {
        let residual = |i: usize| f.as_ref()[i].plus_times(k.as_ref()[i], -1.0);
        let mut step = system.vector(|i| residual(self.order.as_ref()[i]));
        let v = step.as_mut();
        for i in 0..v.len() {
            let row = self.rows.row(i);
            for j in 0..i {
                v[i] -= v[j] * row[j];
            }
        }
        for i in (0..v.len()).rev() {
            let row = self.rows.row(i);
            for j in i + 1..v.len() {
                v[i] -= v[j] * row[j];
            }
            v[i] /= row[i];
        }
        axpy::<Y, S>(system, &step, 1.0, k)
    }
}
