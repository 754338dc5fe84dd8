use super::{Currents, Drive, Error, Mechanics, PolePairs, Salient, SalientWinding, Shaft, Turning};
use crate::integrate::{axpy, combined};
use crate::{Model, Scalar};
use serde::{Deserialize, Serialize};

crate::signals! {
    /// Everything that moves in a motor.
    pub struct Motion {
        /// Current along the magnet flux, phase peak.
        id: "A",
        /// Current 90 electrical degrees ahead of it.
        iq: "A",
        /// Mechanical speed.
        w: "rad/s",
        /// Mechanical angle, not wrapped.
        theta: "rad",
    }
    /// What acts on a motor from outside.
    pub struct Acting {
        /// Voltage along the magnet flux, phase peak.
        ud: "V",
        /// Voltage 90 electrical degrees ahead of it.
        uq: "V",
        /// Load torque besides friction and gravity.
        tau_l: "N m",
    }
    /// Parameters of a motor with its mechanics.
    pub struct Rotor {
        /// Phase resistance.
        rs: "ohm",
        /// Inductance along the magnet flux.
        ld: "H",
        /// Inductance 90 electrical degrees ahead of it.
        lq: "H",
        /// Line-to-line rms back-EMF per mechanical speed.
        ke: "V s/rad",
        /// Inertia.
        j: "kg m^2",
        /// Viscous friction.
        bv: "N m s",
        /// Coulomb friction.
        tc: "N m",
        /// Gravity's torque where the arm is level.
        tg: "N m",
    }
}

/// A motor that turns: the currents of [`Salient`] and the motion of [`Shaft`], coupled by EMF and torque.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Machine {
    /// The electrical half.
    pub winding: Salient,
    /// The mechanical half.
    pub shaft: Shaft,
}

impl Machine {
    /// A motor with this many pole pairs behind a gear; zero pole pairs or a gear that is not positive are errors.
    pub fn new(pole_pairs: u32, gear: f64) -> Result<Self, Error> {
        Ok(Machine { winding: Salient::new(pole_pairs)?, shaft: Shaft::new(gear)? })
    }

    /// Its pole pairs.
    pub const fn pole_pairs(&self) -> PolePairs {
        self.winding.pole_pairs()
    }
}

impl Model for Machine {
    type State = Motion;
    type Input = Acting;
    type Output = Motion;
    type Parameters = Rotor;

    #[inline]
    fn derivative<S: Scalar>(&self, t: S, x: &Motion<S>, u: &Acting<S>, p: &Rotor<S>) -> Motion<S> {
        let currents = Currents { id: x.id, iq: x.iq };
        let winding = SalientWinding { rs: p.rs, ld: p.ld, lq: p.lq, ke: p.ke };
        let di = self.winding.derivative(t, &currents, &Drive { ud: u.ud, uq: u.uq, w: x.w }, &winding);
        let turning = Turning { w: x.w, theta: x.theta };
        let mechanics = Mechanics { j: p.j, bv: p.bv, tc: p.tc, tg: p.tg, ke: p.ke };
        let torque = self.winding.torque(&currents, &winding) - self.shaft.load(&turning, &mechanics) - u.tau_l;
        Motion { id: di.id, iq: di.iq, w: torque / p.j, theta: x.w }
    }

    #[inline]
    fn output<S: Scalar>(&self, _t: S, x: &Motion<S>, _u: &Acting<S>, _p: &Rotor<S>) -> Motion<S> {
        *x
    }
}

/// One step of the classical Runge-Kutta method (Kutta 1901) over `h` (s), for a slope that does not depend on time.
#[inline]
pub(super) fn runge_kutta(x: Motion, h: f64, f: impl Fn(&Motion) -> Motion) -> Motion {
    let ahead = |h: f64, k: Motion| axpy::<Motion, f64>(x, h, k);
    let k1 = f(&x);
    let k2 = f(&ahead(0.5 * h, k1));
    let k3 = f(&ahead(0.5 * h, k2));
    let k4 = f(&ahead(h, k3));
    combined::<Motion, f64>(&x, h / 6.0, &[1.0, 2.0, 2.0, 1.0], &[k1, k2, k3, k4])
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
            let p = Rotor { rs: 0.4, ld: 3.84e-3, lq: 4.16e-3, ke: 0.95, j: 0.012, bv: 4e-3, tc: 1.2, tg: 6.0 };
            let (x, u) = (Motion { id, iq, w, theta: 1.0 }, Acting { ud, uq, tau_l });
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
