//! Checks for the tests of those who write losses, models and integrators of their own.

use crate::dual::Dual;
use crate::integrate::{Integrator, ModelSystem};
use crate::interval::{Hold, Interval};
use crate::layout::Kind;
use crate::loss::Loss;
use crate::model::Model;
use crate::numeric::{central_jacobian, joined, taken};
use crate::scalar::Scalar;
use crate::signals;
use crate::signals::{Nothing, Of, Signals};

/// A violated requirement, with the place and the numbers.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Disagreement {
    /// A loss that breaks a requirement of [`Loss`].
    #[error("the loss breaks a requirement at z = {z}: {requirement}: {found} against {expected}")]
    Loss {
        /// The requirement.
        requirement: &'static str,
        /// The standardized error.
        z: f64,
        /// The value found.
        found: f64,
        /// The expected value.
        expected: f64,
    },
    /// A slope of a model that finite differences do not confirm.
    #[error(
        "{function}: the slope of `{quantity}` with respect to `{variable}` is {exact} by duals and {numeric} by central differences; look for a value taken out of its `Scalar`, a wrong `chain`, or a kink or jump at this point"
    )]
    Slope {
        /// `derivative`, `jump`, `next` or `output`.
        function: &'static str,
        /// The state or output.
        quantity: &'static str,
        /// The state, input or parameter.
        variable: &'static str,
        /// The slope by duals.
        exact: f64,
        /// The slope by central differences.
        numeric: f64,
    },
}

/// Whether a loss meets the requirements of [`Loss`]: even, zero at zero, `z^2 / 2` near it, never falling, `psi` its derivative,
/// `weight` and `slope` in agreement with `psi`. Looked at in 400 places up to |z| = 40, to 1e-5.
///
/// # Errors
/// The first [`Disagreement`].
pub fn loss(loss: &dyn Loss) -> Result<(), Disagreement> {
    let agree = |requirement, z, found: f64, expected: f64| {
        if (found - expected).abs() <= 1e-5 * (1.0 + expected.abs()) {
            return Ok(());
        }
        Err(Disagreement::Loss { requirement, z, found, expected })
    };
    agree("rho(0) is 0", 0.0, loss.rho(0.0), 0.0)?;
    agree("the weight at 0 is 1", 0.0, loss.weight(0.0), 1.0)?;
    agree("rho is z^2/2 near 0", 1e-4, loss.rho(1e-4) / 1e-8, 0.5)?;
    agree("psi is z near 0", 1e-4, loss.psi(1e-4) / 1e-4, 1.0)?;
    // An irrational spacing, which does not meet a kink at a round number.
    for k in 1..=400 {
        let z = k as f64 * (0.01 * core::f64::consts::PI.powi(2));
        let h = 1e-6 * z.max(1.0);
        let difference = |f: &dyn Fn(f64) -> f64| (f(z + h) - f(z - h)) / ((z + h) - (z - h));
        agree("rho is even", z, loss.rho(-z), loss.rho(z))?;
        agree("psi is odd", z, loss.psi(-z), -loss.psi(z))?;
        agree("psi is the derivative of rho", z, loss.psi(z), difference(&|z| loss.rho(z)))?;
        agree("slope is the derivative of psi", z, loss.slope(z), difference(&|z| loss.psi(z)))?;
        agree("weight is psi/z", z, loss.weight(z), loss.psi(z) / z)?;
        agree("rho does not fall", z, loss.psi(z).min(0.0), 0.0)?;
    }
    Ok(())
}

/// Whether the slopes of a model's functions are those of its values, at one point (time in s): duals against central
/// differences, to 1e-6 of each slope. The step is 6e-6 of a variable (of one, if zero); where that is too long for the curvature of a function,
/// steps a hundred and ten thousand times shorter, as far as rounding allows. At a kink or a jump they differ by nature.
///
/// # Errors
/// The first [`Disagreement`].
pub fn derivatives<M: Model>(
    model: &M,
    t: f64,
    x: &Of<M::State, f64>,
    u: &Of<M::Input, f64>,
    p: &Of<M::Parameters, f64>,
) -> Result<(), Disagreement> {
    let at = Point::<M> { x: *x, u: *u, p: *p };
    match M::KIND {
        Kind::Continuous => {
            at.compare::<M::State>("derivative", &|x, u, p| model.derivative(t, x, u, p), &|x, u, p| {
                model.derivative(t.into(), x, u, p)
            })?;
            at.compare::<M::State>("jump", &|x, u, p| model.jump(t, x, u, p), &|x, u, p| {
                model.jump(t.into(), x, u, p)
            })?;
        }
        Kind::Discrete => {
            at.compare::<M::State>("next", &|x, u, p| model.next(t, x, u, p), &|x, u, p| {
                model.next(t.into(), x, u, p)
            })?;
        }
        Kind::Static => {}
    }
    at.compare::<M::Output>("output", &|x, u, p| model.output(t, x, u, p), &|x, u, p| model.output(t.into(), x, u, p))
}

/// Shorter steps, as parts of a variable: the error of a central difference falls as the square of the step.
const SHORTER: [f64; 2] = [6e-8, 6e-10];

/// Columns of a Jacobian per evaluation.
const COLUMNS: usize = 8;

/// A function of a model, in numbers of type `S`.
type Function<'a, M, R, S> =
    &'a dyn Fn(&Of<<M as Model>::State, S>, &Of<<M as Model>::Input, S>, &Of<<M as Model>::Parameters, S>) -> Of<R, S>;

struct Point<M: Model> {
    x: Of<M::State, f64>,
    u: Of<M::Input, f64>,
    p: Of<M::Parameters, f64>,
}

impl<M: Model> Point<M> {
    fn compare<R: Signals>(
        &self,
        function: &'static str,
        f: Function<'_, M, R, f64>,
        duals: Function<'_, M, R, Dual<COLUMNS>>,
    ) -> Result<(), Disagreement> {
        let at = joined::<M::State, M::Input, M::Parameters, f64>(&self.x, &self.u, &self.p);
        let names = [M::State::NAMES, M::Input::NAMES, M::Parameters::NAMES].concat();
        let of_vector = |v: &[f64]| {
            let (x, v) = taken::<M::State>(v);
            let (u, v) = taken::<M::Input>(v);
            R::into_array(f(&x, &u, &taken::<M::Parameters>(v).0)).as_ref().to_vec()
        };
        let values = of_vector(&at);
        let numeric = central_jacobian(&of_vector, &at, &vec![0.0; at.len()]);
        for from in (0..at.len()).step_by(COLUMNS) {
            let seed = |i: usize, v: f64| Dual::variable(v, i.checked_sub(from).unwrap_or(COLUMNS));
            let (x, u, p) = (
                seeded::<M::State, COLUMNS>(&self.x, 0, &seed),
                seeded::<M::Input, COLUMNS>(&self.u, M::State::LEN, &seed),
                seeded::<M::Parameters, COLUMNS>(&self.p, M::State::LEN + M::Input::LEN, &seed),
            );
            let exact = R::into_array(duals(&x, &u, &p));
            for (i, dual) in exact.as_ref().iter().enumerate() {
                let row = numeric.get(i).map(Vec::as_slice).unwrap_or_default();
                // In steps of each variable's own size, so that slopes of different units compare.
                let size = |j: usize| if at[j] == 0.0 { 1.0 } else { at[j].abs() };
                let largest = row.iter().enumerate().fold(values[i].abs(), |m, (j, s)| m.max((s * size(j)).abs()));
                for (j, numeric) in row.iter().enumerate().skip(from).take(COLUMNS) {
                    let exact = dual.slopes[j - from];
                    let tolerance = 1e-6 * (exact * size(j)).abs() + 1e-8 * largest;
                    let close = |numeric: f64| (exact - numeric).abs() * size(j) <= tolerance;
                    // A step that is lost in rounding would confirm a slope of zero.
                    let confirms = |step: &f64| {
                        let [(from, low), (to, high)] = [-step, *step].map(|step| {
                            let mut v = at.clone();
                            v[j] += step * size(j);
                            (v[j], of_vector(&v)[i])
                        });
                        let told = low != high && f64::EPSILON * values[i].abs() <= step * tolerance;
                        told && close((high - low) / (to - from))
                    };
                    if !close(*numeric) && !SHORTER.iter().any(confirms) {
                        let (quantity, variable) = (R::NAMES[i], names[j]);
                        return Err(Disagreement::Slope { function, quantity, variable, exact, numeric: *numeric });
                    }
                }
            }
        }
        Ok(())
    }
}

fn seeded<X: Signals, const N: usize>(
    x: &Of<X, f64>,
    first: usize,
    seed: &dyn Fn(usize, f64) -> Dual<N>,
) -> Of<X, Dual<N>> {
    let x = X::into_array(*x);
    X::from_fn(|i| seed(first + i, x.as_ref()[i]))
}

signals! {
    /// A point of the plane.
    struct Plane { x: "1", y: "1" }
}
signals! {
    /// How fast [`Spiral`] grows and turns.
    struct Rates { growth: "1/s", turn: "rad/s" }
}

/// A problem with a known solution: a point that spirals to the unit circle, at rates that vary with time. In polar
/// coordinates `dr/dt = growth cos(t) r (1 - r^2)` and `d angle/dt = turn (1 + sin t)`.
#[derive(Clone, Copy, Debug)]
struct Spiral;

impl Model for Spiral {
    type State = Plane;
    type Input = Nothing;
    type Output = Plane;
    type Parameters = Rates;

    #[inline]
    fn derivative<S: Scalar>(&self, t: S, x: &Plane<S>, _u: &Nothing, p: &Rates<S>) -> Plane<S> {
        let growth = p.growth * t.cos() * ((x.x * x.x + x.y * x.y) * -1.0 + 1.0);
        let turn = p.turn * (t.sin() + 1.0);
        Plane { x: growth * x.x - turn * x.y, y: growth * x.y + turn * x.x }
    }

    #[inline]
    fn output<S: Scalar>(&self, _t: S, x: &Plane<S>, _u: &Nothing, _p: &Rates<S>) -> Plane<S> {
        *x
    }
}

impl Spiral {
    /// Where the point is at time `t` (s) if it starts at `x` at time zero.
    fn solution<S: Scalar>(&self, t: f64, x: &Plane<S>, p: &Rates<S>) -> Plane<S> {
        let start = (x.x * x.x + x.y * x.y).recip() - 1.0;
        let radius = (start * (p.growth * (-2.0 * t.sin())).exp() + 1.0).sqrt().recip();
        let (sin, cos) = (x.y.atan2(x.x) + p.turn * (t + 1.0 - t.cos())).sin_cos();
        Plane { x: radius * cos, y: radius * sin }
    }
}

/// The order of an integrator with fixed steps: as which power of the step the errors fall, those of the states and those of their
/// slopes with respect to parameters and initial states. The model is a point that spirals to the unit circle at rates that vary with time, over one second in 32 and in 64 intervals.
///
/// The answer lies within some 0.2 of the order. It is not meaningful for an adaptive method (its tolerance does not follow
/// the interval), unless its tolerance is so large that each interval is one step. `None` where the method is stuck.
pub fn order<I: Integrator>(integrator: &I) -> Option<[f64; 2]> {
    let ([values, slopes], [finer_values, finer_slopes]) = (errors(integrator, 32)?, errors(integrator, 64)?);
    Some([(values / finer_values).log2(), (slopes / finer_slopes).log2()])
}

/// Largest errors of values and slopes after one second.
fn errors<I: Integrator>(integrator: &I, intervals: u32) -> Option<[f64; 2]> {
    let start = Plane { x: Dual::<4>::variable(0.4, 0), y: Dual::variable(-0.3, 1) };
    let p = Rates { growth: Dual::variable(1.2, 2), turn: Dual::variable(1.5, 3) };
    let (mut x, mut memory) = (start, 0.0);
    let time = |k: u32| f64::from(k) / f64::from(intervals);
    for k in 0..intervals {
        let interval = Interval { t0: time(k), t1: time(k + 1), u0: Nothing, u1: Nothing, hold: Hold::Zero };
        x = ModelSystem { model: &Spiral, interval: &interval, p: &p }.step(integrator, x, &mut memory).ok()?;
    }
    let exact = Spiral.solution(1.0, &start, &p);
    let difference = [x.x - exact.x, x.y - exact.y];
    let largest = |m: f64, v: &f64| m.max(v.abs());
    Some([
        difference.iter().map(|d| d.value).fold(0.0, |m, v| largest(m, &v)),
        difference.iter().flat_map(|d| d.slopes).fold(0.0, |m, v| largest(m, &v)),
    ])
}
