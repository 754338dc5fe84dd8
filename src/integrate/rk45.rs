//! [`Rk45`]: the explicit Runge-Kutta pair of orders 5 and 4 of Dormand and Prince (J. R. Dormand, P. J. Prince, "A family
//! of embedded Runge-Kutta formulae", Journal of Computational and Applied Mathematics 6, 1980, 19-26, table 2).

use super::tolerance::{MAX_STEPS, combined};
use super::{Integrator, Stuck, System, Tolerance};
use crate::layout::Kind;
use serde::{Deserialize, Serialize};

/// Explicit Runge-Kutta 5(4) whose steps follow the error of the values; they stop at every sample, where the input
/// jumps or bends, and carry on with the same step.
///
/// For models that are fast at times and slow at others. A stiff one needs [`Esdirk`](super::Esdirk).
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
/// let estimate = Fit::new(&Radiating, &record).parameters(start).integrator(greybox::Rk45::default()).run()?;
/// assert!((estimate.parameters.c / 100.0 - 1.0).abs() < 0.02);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rk45 {
    /// Error allowed per step, relative to the value of each state; 1e-14 at least.
    pub relative: f64,
    /// Error allowed per step on top, in the unit of each state: what counts as nothing where a state passes zero.
    pub absolute: f64,
}

impl Default for Rk45 {
    /// 1e-8 and 1e-12.
    fn default() -> Self {
        Rk45 { relative: 1e-8, absolute: 1e-12 }
    }
}

const STAGES: usize = 7;
const C: [f64; STAGES] = [0.0, 1.0 / 5.0, 3.0 / 10.0, 4.0 / 5.0, 8.0 / 9.0, 1.0, 1.0];
/// The last row is the result of order 5, so that its stage is the first of the next step.
const A: [[f64; STAGES]; STAGES] = [
    [0.0; 7],
    [1.0 / 5.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    [3.0 / 40.0, 9.0 / 40.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    [44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0, 0.0, 0.0, 0.0, 0.0],
    [19372.0 / 6561.0, -25360.0 / 2187.0, 64448.0 / 6561.0, -212.0 / 729.0, 0.0, 0.0, 0.0],
    [9017.0 / 3168.0, -355.0 / 33.0, 46732.0 / 5247.0, 49.0 / 176.0, -5103.0 / 18656.0, 0.0, 0.0],
    [35.0 / 384.0, 0.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0, 0.0],
];
/// Order 5 less order 4.
const ERROR: [f64; STAGES] =
    [71.0 / 57600.0, 0.0, -71.0 / 16695.0, 71.0 / 1920.0, -17253.0 / 339200.0, 22.0 / 525.0, -1.0 / 40.0];

impl Integrator for Rk45 {
    const FIXED: bool = false;

    // One call site of the derivative, as in Rk4.
    #[inline(always)]
    fn advance<Y: System>(
        &self,
        system: &Y,
        x: Y::Vector<Y::Scalar>,
        step: &mut f64,
    ) -> Result<Y::Vector<Y::Scalar>, Stuck> {
        let (_, length) = system.interval();
        let tolerance = Tolerance { relative: self.relative, absolute: self.absolute, steps: MAX_STEPS };
        tolerance.cross_in_stages((5.0, &ERROR), system, x, step, |x, tau, h, first, k| {
            let mut stage = x.clone();
            for i in first..STAGES {
                stage = combined(system, x, h, &A[i][..i], k);
                k[i] = system.derivative((tau + C[i] * h) / length, &stage);
            }
            Some(stage)
        })
    }

    fn serves(&self, kind: Kind) -> bool {
        kind == Kind::Continuous
    }

    fn refined(&self, _kind: Kind) -> Option<Self> {
        Some(Rk45 { relative: self.relative * 1e-2, absolute: self.absolute * 1e-2 })
    }

    #[cfg(feature = "std")]
    fn check(&self) -> Result<(), crate::error::Error> {
        Tolerance { relative: self.relative, absolute: self.absolute, steps: MAX_STEPS }.check("Rk45")
    }

    #[cfg(feature = "std")]
    fn describe(&self, _kind: Kind) -> String {
        format!("Runge-Kutta 5(4), adaptive, relative {:e}, absolute {:e}", self.relative, self.absolute)
    }
}
