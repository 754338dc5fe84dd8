//! [`Tolerance`]: the error that an adaptive method allows itself, and the choice of its steps.

use super::{Stuck, System};
use crate::scalar::Scalar;

/// The error that an adaptive method allows itself per step.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tolerance {
    /// Relative to the value of each state.
    pub relative: f64,
    /// On top of that, in the unit of each state.
    pub absolute: f64,
    /// Steps per interval, tried or taken, after which the method is stuck.
    pub steps: u32,
}

/// The steps per interval of methods that were chosen.
pub(crate) const MAX_STEPS: u32 = 100_000;

/// The end of a step and the error of the values there.
pub(crate) type Trial<Y> = (<Y as System>::Vector<<Y as System>::Scalar>, <Y as System>::Vector<f64>);

impl Tolerance {
    /// Refuses what is no tolerance: a relative one that is not positive, an absolute one that is negative.
    #[cfg(feature = "std")]
    pub fn check(&self, method: &str) -> Result<(), crate::error::Error> {
        let Tolerance { relative, absolute, .. } = *self;
        if !(relative > 0.0 && relative.is_finite()) {
            let what = format!("the relative tolerance of {method}");
            return Err(crate::error::Error::NotPositive { what, value: relative });
        }
        if absolute >= 0.0 && absolute.is_finite() {
            return Ok(());
        }
        Err(crate::error::Error::Option(format!(
            "the absolute tolerance of {method} is {absolute}; it must be finite and not negative"
        )))
    }

    /// Largest ratio of an error to what is allowed; not a number if one of the values is not finite.
    #[inline(always)]
    pub fn ratio<S: Scalar>(&self, error: &[f64], from: &[S], to: &[S]) -> f64 {
        // Below 1e-14 rounding is all there is.
        let (relative, absolute) = (self.relative.max(1e-14), self.absolute.max(0.0));
        let mut largest = 0.0f64;
        for ((error, from), to) in error.iter().zip(from).zip(to) {
            let allowed = relative * from.value().abs().max(to.value().abs()) + absolute;
            let ratio = if *error == 0.0 { 0.0 } else { error.abs() / allowed };
            if ratio.is_nan() || !to.value().is_finite() {
                return f64::NAN;
            }
            largest = largest.max(ratio);
        }
        largest
    }

    /// Crosses the system's interval from `x` with the step kept in `memory` (s; zero: none yet). `step(x, tau, h)` goes
    /// from the time `t0 + tau` to `t0 + tau + h` and returns the state there and its error, which goes with this `power` of
    /// the step; `None`, where it cannot.
    #[inline(always)]
    pub fn cross<Y: System>(
        &self,
        power: f64,
        system: &Y,
        mut x: Y::Vector<Y::Scalar>,
        memory: &mut f64,
        mut step: impl FnMut(&Y::Vector<Y::Scalar>, f64, f64) -> Option<Trial<Y>>,
    ) -> Result<Y::Vector<Y::Scalar>, Stuck> {
        let (t0, length) = system.interval();
        // Between samples of one instant.
        if length == 0.0 {
            return Ok(x);
        }
        let (mut tau, mut growth) = (0.0, 5.0);
        // The first step is a cautious guess; a few steps later it is forgotten.
        let mut proposed = if *memory > 0.0 { *memory } else { 1e-3 * length };
        for _ in 0..self.steps {
            let left = length - tau;
            let resolution = 4.0 * f64::EPSILON * tau.max((t0 + tau).abs());
            // The last two steps share what is left, so that none is tiny.
            let last = proposed >= left;
            let h = if last { left } else { proposed.min(0.5 * left) };
            if h <= resolution && !last {
                return Err(Stuck);
            }
            let ratio = match step(&x, tau, h) {
                Some((to, error)) => {
                    let ratio = self.ratio(error.as_ref(), x.as_ref(), to.as_ref());
                    if ratio <= 1.0 {
                        x = to;
                    }
                    ratio
                }
                None => f64::NAN,
            };
            let factor =
                if ratio.is_nan() { 0.1 } else { (0.9 * Scalar::powf(ratio, -1.0 / power)).clamp(0.2, growth) };
            if ratio <= 1.0 {
                growth = 5.0;
                tau += h;
                // A step cut short by the end of the interval does not shorten the next.
                proposed = if h < proposed { proposed.max(h * factor) } else { h * factor };
                if last {
                    *memory = proposed.min(1e3 * length);
                    return Ok(x);
                }
            } else {
                growth = 1.0;
                proposed = h * factor.min(0.9);
                if proposed <= resolution {
                    return Err(Stuck);
                }
            }
        }
        Err(Stuck)
    }
}

impl Tolerance {
    /// Crosses the system's interval as [`cross`](Self::cross) does, by a Runge-Kutta method whose last stage is the first of
    /// the next step. `stages(x, tau, h, first, k)` computes the slopes `k` of the stages from number `first` on, and the state
    /// at the end of the step; `error` has the weights of the slopes in the step's error.
    #[inline(always)]
    pub fn cross_in_stages<Y: System, const STAGES: usize>(
        &self,
        (power, error): (f64, &[f64; STAGES]),
        system: &Y,
        x: Y::Vector<Y::Scalar>,
        memory: &mut f64,
        mut stages: impl FnMut(
            &Y::Vector<Y::Scalar>,
            f64,
            f64,
            usize,
            &mut Slopes<Y, STAGES>,
        ) -> Option<Y::Vector<Y::Scalar>>,
    ) -> Result<Y::Vector<Y::Scalar>, Stuck> {
        let zero = system.vector(|_| 0.0);
        let mut k: Slopes<Y, STAGES> = core::array::from_fn(|_| system.vector(|_| Y::Scalar::from(0.0)));
        // The times whose slopes are those of the first and of the last stage.
        let (mut start, mut end) = (f64::NAN, f64::NAN);
        self.cross(power, system, x, memory, |x, tau, h| {
            if tau == end {
                k.swap(0, STAGES - 1);
                start = tau;
            }
            let to = stages(x, tau, h, usize::from(tau == start), &mut k)?;
            (start, end) = (tau, tau + h);
            let slopes = core::array::from_fn::<_, STAGES, _>(|i| values(system, &k[i]));
            Some((to, combined(system, &zero, h, error, &slopes)))
        })
    }
}

/// The slopes of the stages of a step.
pub(crate) type Slopes<Y, const STAGES: usize> = [<Y as System>::Vector<<Y as System>::Scalar>; STAGES];

/// `x + h (a[0] k[0] + a[1] k[1] + ...)`, entry by entry.
#[inline(always)]
pub(crate) fn combined<Y: System, S: Scalar>(
    system: &Y,
    x: &Y::Vector<S>,
    h: f64,
    a: &[f64],
    k: &[Y::Vector<S>],
) -> Y::Vector<S> {
    system.vector(|i| {
        let mut sum = S::from(0.0);
        for (a, k) in a.iter().zip(k) {
            sum = sum.plus_times(k.as_ref()[i], *a);
        }
        x.as_ref()[i].plus_times(sum, h)
    })
}

/// Value of each entry.
#[inline(always)]
pub(crate) fn values<Y: System>(system: &Y, x: &Y::Vector<Y::Scalar>) -> Y::Vector<f64> {
    system.vector(|i| x.as_ref()[i].value())
}
