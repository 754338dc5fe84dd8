//! The currents' equation solved exactly from one sample to the next, at constant speed, as discrete models.
//!
//! With complex `i = id + j iq`, `a = rs/ls`: `di/dt = -(a + j we) i + u/ls - j sqrt(2/3) ke w/ls`. What is held over
//! the interval decides the voltage's share: an inverter holds it in the stationary frame, where it stands still and
//! turns backwards seen from the rotor; an ideal simulation may hold it in the rotor frame. To mistake one for the other
//! biases the resistance.

mod salient;

pub use salient::ExactSalient;

use super::units::Constant;
use super::{AngledDrive, Currents, Drive, MotorError, MotorModel, PolePairs, SQRT_2_3, Winding};
use crate::online::{AdaptationLaw, Mras, MrasStart, ObserverError};
use crate::{Kind, Model, Parameter, Scalar};
use serde::{Deserialize, Serialize};

/// In which frame the voltage stands still between two samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum HeldIn {
    /// The stator's, as an inverter holds it; `ud`, `uq` are its rotor-frame values at mid-interval.
    Stationary,
    /// The rotor's.
    Rotor,
}

/// How an exact step is made: pole pairs, sample time, hold.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ExactStep {
    pole_pairs: PolePairs,
    ts: f64,
    held_in: HeldIn,
}

impl ExactStep {
    /// The step of a motor with this many pole pairs over `ts` seconds.
    ///
    /// # Errors
    /// No pole pairs; a sample time that is not positive and finite.
    pub fn new(pole_pairs: u32, ts: f64, held_in: HeldIn) -> Result<Self, MotorError> {
        let ts = MotorError::positive("sample time", ts, "s")?;
        Ok(ExactStep { pole_pairs: PolePairs::new(pole_pairs)?, ts, held_in })
    }

    /// Sample time (s).
    pub const fn sample_time(&self) -> f64 {
        self.ts
    }

    /// The input that reaches the motor: the command less `vdt tanh(i/i0)` (V, A) per phase, at the interval's middle angle.
    /// It is the input for an observer of the motor alone, with measured currents for `i`.
    #[inline(always)]
    pub fn less_dead_time<S: Scalar>(&self, i: &Currents<S>, u: &AngledDrive<S>, vdt: S, i0: f64) -> Drive<S> {
        let lost = i.dead_time(S::from(i0), self.pole_pairs.electrical(u.theta));
        Drive { ud: u.ud - vdt * lost.0, uq: u.uq - vdt * lost.1, w: u.w }
    }

    /// The currents one sample after `i`, under the input `u`.
    #[inline(always)]
    pub fn advance<S: Scalar>(&self, i: &Currents<S>, u: &Drive<S>, p: &Winding<S>) -> Currents<S> {
        let ts = self.ts;
        let we = self.pole_pairs.electrical(u.w);
        let inverse_ls = p.ls.recip();
        let a = p.rs * inverse_ls;
        // h = exp(-j we Ts/2), E = exp(-(a + j we) Ts); (re, im) throughout.
        let (sin, cos) = (we * (ts * 0.5)).sin_cos();
        let x = a * ts;
        let decay = (-x).exp();
        let e = (decay * (cos * cos - sin * sin), -(decay * sin * cos) * 2.0);
        // g = (1 - E)/(a + j we): what a constant in the rotor frame adds.
        let square = a * a + we * we;
        let g = if square > 0.0 {
            let inverse = square.recip();
            let (re, im) = (-e.0 + 1.0, -e.1);
            ((re * a + im * we) * inverse, (im * a - re * we) * inverse)
        } else {
            (S::from(ts), S::from(0.0))
        };
        let v = match self.held_in {
            HeldIn::Rotor => g,
            HeldIn::Stationary => {
                // (1 - exp(-x))/x loses digits near 0, where four terms of its series are exact.
                let phi = if x.abs() < 1e-3 {
                    -x * (-x * (-x * (1.0 / 24.0) + 1.0 / 6.0) + 0.5) + 1.0
                } else {
                    (-decay + 1.0) / x
                };
                (phi * cos * ts, -(phi * sin * ts))
            }
        };
        let (ud, uq) = (u.ud * inverse_ls, u.uq * inverse_ls);
        let emf = p.ke * u.w * inverse_ls * SQRT_2_3;
        Currents {
            id: e.0 * i.id - e.1 * i.iq + v.0 * ud - v.1 * uq + emf * g.1,
            iq: e.0 * i.iq + e.1 * i.id + v.0 * uq + v.1 * ud - emf * g.0,
        }
    }
}

/// [`Surface`](super::Surface) in exact steps: the discrete model for observers.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ExactSurface(
    /// How the step is made.
    pub ExactStep,
);

impl ExactSurface {
    /// The motor's [`Mras`], with this step's sample time.
    ///
    /// # Errors
    /// A resistance, inductance or back-EMF that does not start above zero; else as [`Mras::new`].
    pub fn mras<L: AdaptationLaw<Self>>(self, law: L, start: MrasStart<Self>) -> Result<Mras<Self, L>, ObserverError> {
        let Winding { rs, ls, ke } = start.parameters;
        all_positive([("rs", rs), ("ls", ls), ("ke", ke)])?;
        Mras::new(self, law, self.0.ts, start)
    }
}

impl MotorModel for ExactSurface {
    fn pole_pairs(&self) -> PolePairs {
        self.0.pole_pairs
    }

    /// `kt iq` (N m).
    #[inline]
    fn torque<S: Scalar>(&self, x: &Currents<S>, _theta: S, p: &Winding<S>) -> S {
        Constant::TorquePerPeak.from_ke(p.ke) * x.iq
    }
}

impl Model for ExactSurface {
    type State = Currents;
    type Input = Drive;
    type Output = Currents;
    type Parameters = Winding;
    const KIND: Kind = Kind::Discrete;

    #[inline]
    fn next<S: Scalar>(&self, _t: S, x: &Currents<S>, u: &Drive<S>, p: &Winding<S>) -> Currents<S> {
        self.0.advance(x, u, p)
    }

    #[inline]
    fn output<S: Scalar>(&self, _t: S, x: &Currents<S>, _u: &Drive<S>, _p: &Winding<S>) -> Currents<S> {
        *x
    }
}

/// Refuses a start that is not positive.
pub(super) fn all_positive<const N: usize>(starts: [(&'static str, Parameter); N]) -> Result<(), ObserverError> {
    starts.iter().try_for_each(|&(signal, Parameter { start: value, .. })| {
        let positive = value > 0.0 && value.is_finite();
        if positive { Ok(()) } else { Err(ObserverError::NotPositive { what: "the start", signal, value }) }
    })
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::{Salient, SalientWinding, frames::rotate_into};
    use super::*;
    use approx::assert_relative_eq;
    use proptest::prelude::*;

    pub const TS: f64 = 0.126e-3;
    const P: Winding = Winding { rs: 0.4, ls: 4e-3, ke: 0.95 };

    /// The continuous equation in 2000 Runge-Kutta steps of one sample; global error below 1e-12 A.
    pub fn fine(i: Currents, u: Drive, p: &SalientWinding, held_in: HeldIn) -> Currents {
        let (motor, n) = (Salient::new(4).unwrap(), 2000);
        let h = TS / n as f64;
        let f = |t: f64, i: Currents| {
            let turned = match held_in {
                HeldIn::Rotor => (u.ud, u.uq),
                HeldIn::Stationary => rotate_into((u.ud, u.uq), 4.0 * u.w * (t - TS / 2.0)),
            };
            motor.derivative(t, &i, &Drive { ud: turned.0, uq: turned.1, w: u.w }, p)
        };
        let add = |i: Currents, a: f64, k: Currents| Currents { id: i.id + a * k.id, iq: i.iq + a * k.iq };
        (0..n).fold(i, |i, step| {
            let t = step as f64 * h;
            let k1 = f(t, i);
            let k2 = f(t + h / 2.0, add(i, h / 2.0, k1));
            let k3 = f(t + h / 2.0, add(i, h / 2.0, k2));
            let k4 = f(t + h, add(i, h, k3));
            add(add(add(add(i, h / 6.0, k1), h / 3.0, k2), h / 3.0, k3), h / 6.0, k4)
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]
        #[test]
        fn solves_the_continuous_equation(id in -60.0..60.0, iq in -60.0..60.0, ud in -300.0..300.0, uq in -300.0..300.0,
                                          w in -700.0..700.0, rs in 0.0..2.0) {
            let (i, u, p) = (Currents { id, iq }, Drive { ud, uq, w }, Winding { rs, ..P });
            for held_in in [HeldIn::Stationary, HeldIn::Rotor] {
                let exact = ExactStep::new(4, TS, held_in).unwrap().advance(&i, &u, &p);
                let salient = SalientWinding { rs, ld: P.ls, lq: P.ls, ke: P.ke };
                assert_relative_eq!(exact, fine(i, u, &salient, held_in), epsilon = 1e-9);
            }
        }
    }

    #[test]
    fn without_resistance_at_standstill_current_grows_by_the_volt_seconds() {
        let (i, u) = (Currents::default(), Drive { ud: 1.0, uq: 2.0, w: 0.0 });
        for held_in in [HeldIn::Stationary, HeldIn::Rotor] {
            let next = ExactStep::new(4, TS, held_in).unwrap().advance(&i, &u, &Winding { rs: 0.0, ..P });
            assert_relative_eq!(next, Currents { id: TS / 4e-3, iq: 2.0 * TS / 4e-3 }, max_relative = 1e-14);
        }
    }

    #[test]
    fn what_makes_no_sense_is_refused() {
        assert_eq!(ExactStep::new(0, TS, HeldIn::Rotor).unwrap_err(), MotorError::NoPolePairs);
        let error = ExactStep::new(4, -1.0, HeldIn::Rotor).unwrap_err();
        assert_eq!(error.to_string(), "sample time is -1 s; it must be positive and finite");
    }
}
