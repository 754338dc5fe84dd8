use super::frames::{Dq0, Park, rotate_into, rotate_out_of};
use super::{Currents, Error, PolePairs, SQRT_2_3};
use crate::{Model, Scalar};
use serde::{Deserialize, Serialize};

crate::signals! {
    /// What an inverter is told, in the rotor frame, with the angle at which it happens.
    pub struct AngledDrive {
        /// Commanded voltage along the magnet flux.
        ud: "V",
        /// Commanded voltage 90 electrical degrees ahead of it.
        uq: "V",
        /// Mechanical speed.
        w: "rad/s",
        /// Mechanical angle; where it is held over a sample interval, that of the middle of the interval.
        theta: "rad",
    }
    /// Parameters of everything between the commanded voltage and the current: inverter, cable, motor, resolver.
    pub struct Line {
        /// Phase resistance of the motor.
        rs: "ohm",
        /// Resistance per phase of the cable; only the sum with `rs` is seen by the data.
        r_cable: "ohm",
        /// Inductance along the magnet flux.
        ld: "H",
        /// Inductance 90 electrical degrees ahead of it.
        lq: "H",
        /// Line-to-line rms back-EMF per mechanical speed.
        ke: "V s/rad",
        /// Voltage that the inverter's dead time takes from each phase.
        vdt: "V",
        /// Current at which that error turns over, positive.
        i0: "A",
        /// By how much later the voltage acts than the record says.
        tau: "s",
        /// By how much the recorded electrical angle is ahead of the magnet.
        delta: "rad",
    }
}

/// Currents of a motor behind a real inverter and a cable.
///
/// Each phase loses `vdt tanh(i/i0)` to dead time. A voltage that acts `tau` late has turned back by `we tau` seen from
/// the rotor, while a resolver that is `delta` ahead turns voltages, currents and EMF alike: at one speed the two look
/// similar, over several they are told apart. The equations are those of [`Salient`](super::Salient) in the magnet's true
/// frame, with `rs + r_cable` for the resistance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Fed {
    pole_pairs: PolePairs,
}

impl Fed {
    /// A motor with this many pole pairs; zero is an error.
    pub const fn new(pole_pairs: u32) -> Result<Self, Error> {
        match PolePairs::new(pole_pairs) {
            Ok(pole_pairs) => Ok(Fed { pole_pairs }),
            Err(error) => Err(error),
        }
    }
}

/// The dead time's voltage (V), `1 V * tanh(i/i0)` in each phase, seen from the rotor at electrical angle `theta_e`.
#[inline]
pub fn dead_time<S: Scalar>(x: &Currents<S>, i0: S, theta_e: S) -> (S, S) {
    let park = Park::amplitude_invariant();
    let mut phases = park.inverse(Dq0 { d: x.id, q: x.iq, zero: S::from(0.0) }, theta_e);
    for i in [&mut phases.a, &mut phases.b, &mut phases.c] {
        *i = (*i / i0).tanh();
    }
    let lost = park.forward(phases, theta_e);
    (lost.d, lost.q)
}

impl Model for Fed {
    type State = Currents;
    type Input = AngledDrive;
    type Output = Currents;
    type Parameters = Line;

    #[inline]
    fn derivative<S: Scalar>(&self, _t: S, x: &Currents<S>, u: &AngledDrive<S>, p: &Line<S>) -> Currents<S> {
        let we = self.pole_pairs.electrical(u.w);
        let lost = dead_time(x, p.i0, self.pole_pairs.electrical(u.theta));
        // Into the magnet's frame: the inverter's voltage by its delay and by the resolver's offset, all else by the latter.
        let (cd, cq) = rotate_into((u.ud, u.uq), we * p.tau);
        let (ud, uq) = rotate_out_of((cd - p.vdt * lost.0, cq - p.vdt * lost.1), p.delta);
        let (id, iq) = rotate_out_of((x.id, x.iq), p.delta);
        let r = p.rs + p.r_cable;
        let did = (ud - r * id + we * p.lq * iq) / p.ld;
        let diq = (uq - r * iq - we * p.ld * id - p.ke * u.w * SQRT_2_3) / p.lq;
        let (id, iq) = rotate_into((did, diq), p.delta);
        Currents { id, iq }
    }

    #[inline]
    fn output<S: Scalar>(&self, _t: S, x: &Currents<S>, _u: &AngledDrive<S>, _p: &Line<S>) -> Currents<S> {
        *x
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Drive, Salient, SalientWinding};
    use super::*;
    use proptest::prelude::*;

    const P: Line =
        Line { rs: 0.4, r_cable: 0.23, ld: 3.84e-3, lq: 4.16e-3, ke: 0.95, vdt: 0.0, i0: 0.15, tau: 0.0, delta: 0.0 };
    const Q: SalientWinding = SalientWinding { rs: 0.63, ld: 3.84e-3, lq: 4.16e-3, ke: 0.95 };

    proptest! {
        #[test]
        fn with_an_ideal_inverter_it_is_the_salient_motor(id in -60.0..60.0, iq in -60.0..60.0, ud in -300.0..300.0,
                                                          w in -400.0..400.0, theta in -9.0..9.0) {
            let x = Currents { id, iq };
            let a = Fed::new(4).unwrap().derivative(0.0, &x, &AngledDrive { ud, uq: 50.0, w, theta }, &P);
            let b = Salient::new(4).unwrap().derivative(0.0, &x, &Drive { ud, uq: 50.0, w }, &Q);
            approx::assert_relative_eq!(a, b, epsilon = 1e-7, max_relative = 1e-11);
        }

        // A record taken with a resolver that is ahead by delta is the true one, turned back by delta.
        #[test]
        fn an_offset_resolver_turns_everything(id in -60.0..60.0, iq in -60.0..60.0, delta in -0.3..0.3, w in -400.0..400.0) {
            let (ud, uq) = rotate_into((20.0, 50.0), delta);
            let (md, mq) = rotate_into((id, iq), delta);
            let recorded = Fed::new(4).unwrap().derivative(
                0.0, &Currents { id: md, iq: mq }, &AngledDrive { ud, uq, w, theta: 0.0 }, &Line { delta, ..P });
            let b = Salient::new(4).unwrap().derivative(0.0, &Currents { id, iq }, &Drive { ud: 20.0, uq: 50.0, w }, &Q);
            let (bd, bq) = rotate_into((b.id, b.iq), delta);
            approx::assert_relative_eq!(recorded, Currents { id: bd, iq: bq }, epsilon = 1e-6, max_relative = 1e-10);
        }

        // Dead time takes power from the motor whatever the angle.
        #[test]
        fn dead_time_is_a_loss(id in -60.0..60.0, iq in -60.0..60.0, theta_e in -9.0..9.0) {
            let (d, q) = dead_time(&Currents { id, iq }, 0.15, theta_e);
            prop_assert!(d * id + q * iq >= 0.0);
        }
    }

    // Far from zero crossings a phase set of signs (+, -, -) is a vector of length 4/3 along phase a.
    #[test]
    fn dead_time_of_a_large_current() {
        let (d, q) = dead_time(&Currents { id: 30.0, iq: 0.0 }, 0.15, 0.0);
        approx::assert_relative_eq!(d, 4.0 / 3.0, max_relative = 1e-12);
        assert!(q.abs() < 1e-12);
    }
}
