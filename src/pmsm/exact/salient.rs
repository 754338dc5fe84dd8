use super::{ExactStep, HeldIn, all_positive};
use crate::online::{AdaptationLaw, Mras, MrasStart, ObserverError};
use crate::pmsm::{Currents, Drive, MotorModel, PolePairs, SQRT_2_3, Salient, SalientWinding};
use crate::{Kind, Model, Scalar};
use serde::{Deserialize, Serialize};

/// Terms of the exponential series. What is left out is `x^13/13!` of the whole, `x` being the larger of `|we| Ts` and
/// `rs/l Ts`: rounding up to 0.4 (700 rad/s mechanical on the reference robot), 2e-10 at 1.
const TERMS: u32 = 12;

impl ExactStep {
    /// The currents one sample after `i`, for a motor whose inductance differs between the axes.
    ///
    /// Currents, voltage and EMF together obey a linear equation with constant coefficients, `v' = M v`: the voltage stands
    /// still, or turns backwards at `we` where it is held in the stationary frame. Its solution `exp(M Ts) v` is summed as
    /// `v + M Ts (v + M Ts/2 (v + M Ts/3 (...)))`, which has no special case at any speed or resistance.
    #[inline(always)]
    pub fn advance_salient<S: Scalar>(&self, i: &Currents<S>, u: &Drive<S>, p: &SalientWinding<S>) -> Currents<S> {
        let ts = self.ts;
        let angle = self.pole_pairs.electrical(u.w) * ts;
        let (by_ld, by_lq) = (p.ld.recip() * ts, p.lq.recip() * ts);
        // The coefficients times Ts.
        let (damping_d, damping_q) = (p.rs * by_ld, p.rs * by_lq);
        let (from_q, from_d) = (angle * p.lq / p.ld, angle * p.ld / p.lq);
        let emf = p.ke * u.w * by_lq * SQRT_2_3;
        let (start, turn) = match self.held_in {
            HeldIn::Rotor => ((u.ud, u.uq), S::from(0.0)),
            HeldIn::Stationary => {
                // At the begin it is half of the interval's angle ahead of its value at the middle.
                let (sin, cos) = (angle * 0.5).sin_cos();
                ((u.ud * cos - u.uq * sin, u.uq * cos + u.ud * sin), angle)
            }
        };
        let (mut x, mut v) = (*i, start);
        for k in (1..=TERMS).rev() {
            let by = 1.0 / f64::from(k);
            let slope = Currents {
                id: from_q * x.iq - damping_d * x.id + by_ld * v.0,
                iq: by_lq * v.1 - damping_q * x.iq - from_d * x.id - emf,
            };
            v = (start.0 + turn * v.1 * by, start.1 - turn * v.0 * by);
            x = Currents { id: i.id + slope.id * by, iq: i.iq + slope.iq * by };
        }
        x
    }
}

/// [`Salient`] in exact steps: the discrete model for observers and fits.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ExactSalient(
    /// How the step is made.
    pub ExactStep,
);

impl ExactSalient {
    /// The motor's [`Mras`], with this step's sample time.
    ///
    /// # Errors
    /// A resistance, inductance or back-EMF that does not start above zero; else as [`Mras::new`].
    pub fn mras<L: AdaptationLaw<Self>>(self, law: L, start: MrasStart<Self>) -> Result<Mras<Self, L>, ObserverError> {
        let SalientWinding { rs, ld, lq, ke } = start.parameters;
        all_positive([("rs", rs), ("ld", ld), ("lq", lq), ("ke", ke)])?;
        Mras::new(self, law, self.0.ts, start)
    }
}

impl MotorModel for ExactSalient {
    fn pole_pairs(&self) -> PolePairs {
        self.0.pole_pairs
    }

    /// As [`Salient`]'s.
    #[inline]
    fn torque<S: Scalar>(&self, x: &Currents<S>, theta: S, p: &SalientWinding<S>) -> S {
        Salient::with(self.0.pole_pairs).torque(x, theta, p)
    }
}

impl Model for ExactSalient {
    type State = Currents;
    type Input = Drive;
    type Output = Currents;
    type Parameters = SalientWinding;
    const KIND: Kind = Kind::Discrete;

    #[inline]
    fn next<S: Scalar>(&self, _t: S, x: &Currents<S>, u: &Drive<S>, p: &SalientWinding<S>) -> Currents<S> {
        self.0.advance_salient(x, u, p)
    }

    #[inline]
    fn output<S: Scalar>(&self, _t: S, x: &Currents<S>, _u: &Drive<S>, _p: &SalientWinding<S>) -> Currents<S> {
        *x
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{TS, fine};
    use super::*;
    use crate::pmsm::Winding;
    use approx::assert_relative_eq;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]
        // Against 2000 Runge-Kutta steps; without resistance too, and at any ratio of the inductances.
        #[test]
        fn solves_the_continuous_equation(id in -60.0..60.0, iq in -60.0..60.0, ud in -300.0..300.0, uq in -300.0..300.0,
                                          w in -700.0..700.0, rs in 0.0..2.0, ld in 1e-3..8e-3, lq in 1e-3..8e-3) {
            let (i, u, p) = (Currents { id, iq }, Drive { ud, uq, w }, SalientWinding { rs, ld, lq, ke: 0.95 });
            for held_in in [HeldIn::Stationary, HeldIn::Rotor] {
                let exact = ExactStep::new(4, TS, held_in).unwrap().advance_salient(&i, &u, &p);
                assert_relative_eq!(exact, fine(i, u, &p, held_in), epsilon = 1e-9);
            }
        }

        // With equal inductances it is the closed form of the surface motor, at any sample time; the closed form loses
        // digits as 1/(rs/ls Ts).
        #[test]
        fn of_equal_inductances_it_is_the_surface_motors(id in -60.0..60.0, iq in -60.0..60.0, uq in -300.0..300.0,
                                                         w in -700.0..700.0, ts in 1e-5..2e-4) {
            let (i, u) = (Currents { id, iq }, Drive { ud: 20.0, uq, w });
            for held_in in [HeldIn::Stationary, HeldIn::Rotor] {
                let step = ExactStep::new(4, ts, held_in).unwrap();
                let round = step.advance(&i, &u, &Winding { rs: 0.4, ls: 4e-3, ke: 0.95 });
                let salient = step.advance_salient(&i, &u, &SalientWinding { rs: 0.4, ld: 4e-3, lq: 4e-3, ke: 0.95 });
                assert_relative_eq!(salient, round, epsilon = 1e-10);
            }
        }
    }
}
