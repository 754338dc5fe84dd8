//! The currents' equation solved exactly from one sample to the next, at constant speed, as discrete models.
//!
//! With complex `i = id + j iq`, `a = rs/ls`: `di/dt = -(a + j we) i + u/ls - j sqrt(2/3) ke w/ls`. What is held over
//! the interval decides the voltage's share: an inverter holds it in the stationary frame, where it stands still and
//! turns backwards seen from the rotor; an ideal simulation may hold it in the rotor frame. To mistake one for the other
//! biases the resistance.

use super::{AngledDrive, Currents, Drive, Error, PolePairs, SQRT_2_3, Winding, dead_time};
use crate::online::{Ekf, EkfStart, Law, Mras, MrasStart, ObserverError};
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
    pub fn new(pole_pairs: u32, ts: f64, held_in: HeldIn) -> Result<Self, Error> {
        let ts = Error::positive("sample time", ts, "s")?;
        Ok(ExactStep { pole_pairs: PolePairs::new(pole_pairs)?, ts, held_in })
    }

    /// The input that reaches the motor: the command less `vdt tanh(i/i0)` (V, A) per phase, at the interval's middle angle.
    /// An observer of the motor alone is fed with this, and with measured currents for `i`.
    #[inline(always)]
    pub fn less_dead_time<S: Scalar>(&self, i: &Currents<S>, u: &AngledDrive<S>, vdt: S, i0: f64) -> Drive<S> {
        let lost = dead_time(i, S::from(i0), self.pole_pairs.electrical(u.theta));
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
    pub fn mras<L: Law<Self>>(self, law: L, start: MrasStart<Self>) -> Result<Mras<Self, L>, ObserverError> {
        let Winding { rs, ls, ke } = start.parameters;
        all_positive([("rs", rs), ("ls", ls), ("ke", ke)])?;
        Mras::new(self, law, self.0.ts, start)
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

crate::signals! {
    /// Parameters of a motor with surface magnets behind an inverter with dead time.
    pub struct FedWinding {
        /// Phase resistance, cable included.
        rs: "ohm",
        /// Synchronous inductance.
        ls: "H",
        /// Line-to-line rms back-EMF per mechanical speed.
        ke: "V s/rad",
        /// Voltage that the inverter's dead time takes from each phase.
        vdt: "V",
    }
}

/// The motor with surface magnets behind an inverter that loses `vdt tanh(i/i0)` per phase, in exact steps: the model of
/// the joint filter over (id, iq, rs, ke, vdt).
///
/// The lost voltage is that of the currents at the begin of the interval, at its middle angle, and is held as the
/// command is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ExactFed {
    step: ExactStep,
    i0: f64,
}

impl ExactFed {
    /// A motor stepped so, with the turnover current `i0` (A) of its inverter's dead time.
    ///
    /// # Errors
    /// A turnover current that is not positive and finite.
    pub fn new(step: ExactStep, i0: f64) -> Result<Self, Error> {
        Ok(ExactFed { step, i0: Error::positive("turnover current i0", i0, "A")? })
    }

    /// The motor's joint [`Ekf`], with this step's sample time; five states where rs, ke and vdt are free.
    ///
    /// # Errors
    /// A resistance, inductance or back-EMF that does not start above zero; else as [`Ekf::new`].
    pub fn ekf<const N: usize>(self, start: EkfStart<Self>) -> Result<Ekf<Self, N>, ObserverError> {
        let FedWinding { rs, ls, ke, .. } = start.parameters;
        all_positive([("rs", rs), ("ls", ls), ("ke", ke)])?;
        Ekf::new(self, self.step.ts, start)
    }
}

impl Model for ExactFed {
    type State = Currents;
    type Input = AngledDrive;
    type Output = Currents;
    type Parameters = FedWinding;
    const KIND: Kind = Kind::Discrete;

    #[inline]
    fn next<S: Scalar>(&self, _t: S, x: &Currents<S>, u: &AngledDrive<S>, p: &FedWinding<S>) -> Currents<S> {
        let u = self.step.less_dead_time(x, u, p.vdt, self.i0);
        self.step.advance(x, &u, &Winding { rs: p.rs, ls: p.ls, ke: p.ke })
    }

    #[inline]
    fn output<S: Scalar>(&self, _t: S, x: &Currents<S>, _u: &AngledDrive<S>, _p: &FedWinding<S>) -> Currents<S> {
        *x
    }
}

fn all_positive(starts: [(&'static str, Parameter); 3]) -> Result<(), ObserverError> {
    starts.iter().try_for_each(|&(signal, Parameter { start: value, .. })| {
        let positive = value > 0.0 && value.is_finite();
        if positive { Ok(()) } else { Err(ObserverError::NotPositive { what: "the start", signal, value }) }
    })
}

#[cfg(test)]
mod tests {
    use super::super::{Surface, frames::rotate_into};
    use super::*;
    use approx::assert_relative_eq;
    use proptest::prelude::*;

    const TS: f64 = 0.126e-3;
    const P: Winding = Winding { rs: 0.4, ls: 4e-3, ke: 0.95 };

    /// The continuous equation in 2000 Runge-Kutta steps of one sample; global error below 1e-12 A.
    fn fine(i: Currents, u: Drive, p: &Winding, held_in: HeldIn) -> Currents {
        let (motor, n) = (Surface::new(4).unwrap(), 2000);
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
                assert_relative_eq!(exact, fine(i, u, &p, held_in), epsilon = 1e-9);
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
    fn dead_time_is_a_voltage_lost() {
        let step = ExactStep::new(4, TS, HeldIn::Stationary).unwrap();
        let (i, theta) = (Currents { id: 3.0, iq: -8.0 }, 0.3);
        let lost = dead_time(&i, 0.15, 4.0 * theta);
        let p = FedWinding { rs: 0.4, ls: 4e-3, ke: 0.95, vdt: 2.0 };
        let a =
            ExactFed::new(step, 0.15).unwrap().next(0.0, &i, &AngledDrive { ud: 9.0, uq: 40.0, w: 60.0, theta }, &p);
        let u = Drive { ud: 9.0 - 2.0 * lost.0, uq: 40.0 - 2.0 * lost.1, w: 60.0 };
        assert_relative_eq!(a, step.advance(&i, &u, &P), max_relative = 1e-14);
    }

    #[test]
    fn what_makes_no_sense_is_refused() {
        assert_eq!(ExactStep::new(0, TS, HeldIn::Rotor).unwrap_err(), Error::NoPolePairs);
        let error = ExactStep::new(4, -1.0, HeldIn::Rotor).unwrap_err();
        assert_eq!(error.to_string(), "sample time is -1 s; it must be positive and finite");
        let step = ExactStep::new(4, TS, HeldIn::Rotor).unwrap();
        assert!(ExactFed::new(step, 0.0).is_err());
    }
}
