use super::{AngledDrive, Currents, Load, MotorError, MotorModel, PolePairs, Salient, Shaft, ShaftMotion};
#[cfg(feature = "std")]
use crate::integrate::{axpy, combined};
use crate::{Kind, Model, Of, Scalar, Signals};
use core::marker::PhantomData;
use serde::{Deserialize, Serialize};

crate::signals! {
    /// Everything that moves in a motor.
    pub struct MachineState {
        /// Current along the magnet flux, phase peak.
        id: "A",
        /// Current 90 electrical degrees ahead of it.
        iq: "A",
        /// Mechanical speed.
        w: "rad/s",
        /// Mechanical angle, not wrapped.
        theta: "rad",
    }
    /// Inputs of a motor with its rotor.
    pub struct VoltageAndLoad {
        /// Voltage along the magnet flux, phase peak.
        ud: "V",
        /// Voltage 90 electrical degrees ahead of it.
        uq: "V",
        /// Load torque besides friction and gravity.
        tau_l: "N m",
    }
    /// Parameters of a salient motor with its mechanics.
    pub struct MachineParameters {
        /// Phase resistance; must be positive.
        rs: "ohm",
        /// Inductance along the magnet flux; must be positive.
        ld: "H",
        /// Inductance 90 electrical degrees ahead of it; must be positive.
        lq: "H",
        /// Line-to-line rms back-EMF per mechanical speed.
        ke: "V s/rad",
        /// Inertia; must be positive.
        j: "kg m^2",
        /// Viscous friction.
        bv: "N m s",
        /// Coulomb friction.
        tc: "N m",
        /// Gravity's torque where the arm is level.
        tg: "N m",
    }
}

/// A motor that turns: the currents of a motor `M` and the motion of [`Shaft`], coupled by EMF and torque.
///
/// The parameters `P` hold those of `M` and of [`Load`], by name; unless said otherwise it is the [`Salient`] motor with
/// [`MachineParameters`]. Any continuous motor model can be used, an [`InverterFed`](super::InverterFed) one included.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Machine<M = Salient, P = MachineParameters> {
    motor: M,
    shaft: Shaft,
    #[serde(skip)]
    parameters: PhantomData<fn() -> P>,
}

impl Machine {
    /// A salient motor with this many pole pairs behind a gear.
    ///
    /// # Errors
    /// Zero pole pairs, a gear that is not positive.
    pub fn new(pole_pairs: u32, gear: f64) -> Result<Self, MotorError> {
        Ok(Machine::of(Salient::new(pole_pairs)?, Shaft::new(gear)?))
    }
}

impl<M: MotorModel, P: Signals> Machine<M, P> {
    /// This motor on this shaft.
    pub const fn of(motor: M, shaft: Shaft) -> Self {
        const { assert!(matches!(M::KIND, Kind::Continuous), "a motor in exact steps has its speed as an input") };
        Machine { motor, shaft, parameters: PhantomData }
    }

    /// Its pole pairs.
    pub fn pole_pairs(&self) -> PolePairs {
        self.motor.pole_pairs()
    }

    /// Electromagnetic torque (N m).
    #[inline]
    pub fn torque<S: Scalar>(&self, x: &MachineState<S>, p: &Of<P, S>) -> S {
        let currents = MachineState::part::<Currents, S>(*x);
        self.motor.torque(&currents, x.theta, &P::part::<M::Parameters, S>(*p))
    }
}

impl<M: MotorModel, P: Signals> Model for Machine<M, P> {
    type State = MachineState;
    type Input = VoltageAndLoad;
    type Output = MachineState;
    type Parameters = P;

    #[inline]
    fn derivative<S: Scalar>(&self, t: S, x: &MachineState<S>, u: &VoltageAndLoad<S>, p: &Of<P, S>) -> MachineState<S> {
        let currents = MachineState::part::<Currents, S>(*x);
        let drive = AngledDrive { ud: u.ud, uq: u.uq, w: x.w, theta: x.theta };
        let (drive, winding) = (AngledDrive::part::<M::Input, S>(drive), P::part::<M::Parameters, S>(*p));
        let di = self.motor.derivative(t, &currents, &drive, &winding);
        let (motion, load) = (MachineState::part::<ShaftMotion, S>(*x), P::part::<Load, S>(*p));
        let turned = self.shaft.accelerated(self.torque(x, p) - u.tau_l, &motion, &load);
        MachineState { id: di.id, iq: di.iq, w: turned.w, theta: turned.theta }
    }

    #[inline]
    fn output<S: Scalar>(&self, _t: S, x: &MachineState<S>, _u: &VoltageAndLoad<S>, _p: &Of<P, S>) -> MachineState<S> {
        *x
    }
}

/// One step of the classical Runge-Kutta method (Kutta 1901) over `h` (s), for a slope that does not depend on time.
#[cfg(feature = "std")]
#[inline]
pub(super) fn runge_kutta(x: MachineState, h: f64, f: impl Fn(&MachineState) -> MachineState) -> MachineState {
    let ahead = |h: f64, k: MachineState| axpy::<MachineState, f64>(x, h, k);
    let k1 = f(&x);
    let k2 = f(&ahead(0.5 * h, k1));
    let k3 = f(&ahead(0.5 * h, k2));
    let k4 = f(&ahead(h, k3));
    combined::<MachineState, f64>(&x, h / 6.0, &[1.0, 2.0, 2.0, 1.0], &[k1, k2, k3, k4])
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        // (4.1): input power = torque * speed + copper loss + change of the field's energy; friction and load take the
        // rest from the rotor's energy.
        #[test]
        fn power_balances(id in -60.0..60.0, iq in -60.0..60.0, ud in -300.0..300.0, uq in -300.0..300.0,
                          w in -400.0..400.0, tau_l in -50.0..50.0) {
            let machine = Machine::new(4, 120.0).unwrap();
            let p = MachineParameters { rs: 0.4, ld: 3.84e-3, lq: 4.16e-3, ke: 0.95, j: 0.012, bv: 4e-3, tc: 1.2, tg: 6.0 };
            let (x, u) = (MachineState { id, iq, w, theta: 1.0 }, VoltageAndLoad { ud, uq, tau_l });
            let dx = machine.derivative(0.0, &x, &u, &p);
            let field = 1.5 * (p.ld * id * dx.id + p.lq * iq * dx.iq);
            let copper = 1.5 * p.rs * (id * id + iq * iq);
            let load = (p.tc * (w / 0.5).tanh() + p.bv * w + p.tg * (1.0 / 120f64).cos() + tau_l) * w;
            let kinetic = p.j * w * dx.w;
            let electrical = 1.5 * (ud * id + uq * iq);
            let scale = 1.0 + electrical.abs() + kinetic.abs() + field.abs();
            prop_assert!((electrical - copper - field - load - kinetic).abs() < 1e-12 * scale);
        }
    }
}
