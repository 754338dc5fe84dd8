use super::frames::{rotate_into, rotate_out_of};
use super::motor_model::{MotorModel, passes_on, wraps_motor};
use super::{AngledDrive, Currents, PolePairs};
use crate::{Of, Scalar, Signals};

crate::signals! {
    /// Delay and angle offset between a record and the motor.
    struct Misalignment {
        /// By how much later the voltage acts than recorded.
        tau: "s",
        /// By how much the recorded electrical angle is ahead of the magnet.
        delta: "rad",
    }
}

wraps_motor! {
    /// A motor whose record has its voltage `tau` early and its angle `delta` ahead. The parameters `P` hold, by name,
    /// those of the motor `M`, `tau` (s), and `delta` (rad, electrical).
    ///
    /// A voltage that acts `tau` late has turned back by `we tau` seen from the rotor, while a resolver that is `delta`
    /// ahead turns voltages, currents and EMF alike: at one speed the two are hardly distinguishable, over several they are.
    /// The motor inside is computed in the magnet's true frame.
    Misaligned, AngledDrive, |wrapper, x, u, p, motor| {
        let (Misalignment { tau, delta }, np) = (P::part::<Misalignment, S>(*p), wrapper.motor.pole_pairs());
        let (ud, uq) = rotate_into((u.ud, u.uq), np.electrical(u.w) * tau - delta);
        let u = AngledDrive { ud, uq, w: u.w, theta: u.theta - np.mechanical(delta) };
        let (id, iq) = rotate_out_of((x.id, x.iq), delta);
        let i = motor(&Currents { id, iq }, &AngledDrive::part::<M::Input, S>(u), &P::part::<M::Parameters, S>(*p));
        let (id, iq) = rotate_into((i.id, i.iq), delta);
        Currents { id, iq }
    }
}

impl<M: MotorModel, P: Signals> MotorModel for Misaligned<M, P> {
    passes_on!(pole_pairs);

    #[inline(always)]
    fn torque<S: Scalar>(&self, x: &Currents<S>, theta: S, p: &Of<P, S>) -> S {
        let delta = P::part::<Misalignment, S>(*p).delta;
        let (id, iq) = rotate_out_of((x.id, x.iq), delta);
        let theta = theta - self.motor.pole_pairs().mechanical(delta);
        self.motor.torque(&Currents { id, iq }, theta, &P::part::<M::Parameters, S>(*p))
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Drive, InverterFed, Salient, SalientWinding};
    use super::*;
    use crate::Model;
    use proptest::prelude::*;

    crate::signals! {
        /// A salient motor, its inverter and its alignment.
        struct Line { rs: "ohm", ld: "H", lq: "H", ke: "V s/rad", vdt: "V", i0: "A", tau: "s", delta: "rad" }
    }

    const P: Line = Line { rs: 0.63, ld: 3.84e-3, lq: 4.16e-3, ke: 0.95, vdt: 0.0, i0: 0.15, tau: 0.0, delta: 0.0 };
    const Q: SalientWinding = SalientWinding { rs: 0.63, ld: 3.84e-3, lq: 4.16e-3, ke: 0.95 };

    fn model() -> Misaligned<InverterFed<Salient, Line>, Line> {
        Misaligned::new(InverterFed::new(Salient::new(4).unwrap()))
    }

    proptest! {
        // A record taken with a resolver that is ahead by delta is the true one, turned back by delta; dead time is that of
        // the phases, whatever the angle is taken to be.
        #[test]
        fn an_offset_resolver_turns_everything(id in -60.0..60.0, iq in -60.0..60.0, delta in -0.3..0.3,
                                               w in -400.0..400.0, theta in -2.0..2.0) {
            let (ud, uq) = rotate_into((20.0, 50.0), delta);
            let (md, mq) = rotate_into((id, iq), delta);
            let u = AngledDrive { ud, uq, w, theta: theta + delta / 4.0 };
            let recorded = model().derivative(0.0, &Currents { id: md, iq: mq }, &u, &Line { delta, vdt: 2.0, ..P });
            let lost = Currents { id, iq }.dead_time(0.15, 4.0 * theta);
            let left = Drive { ud: 20.0 - 2.0 * lost.0, uq: 50.0 - 2.0 * lost.1, w };
            let b = Salient::new(4).unwrap().derivative(0.0, &Currents { id, iq }, &left, &Q);
            let (bd, bq) = rotate_into((b.id, b.iq), delta);
            approx::assert_relative_eq!(recorded, Currents { id: bd, iq: bq }, epsilon = 1e-6, max_relative = 1e-10);
        }

        // A late voltage has turned back by the rotor's angle in the meantime.
        #[test]
        fn a_late_voltage_has_turned_back(w in -400.0..400.0, tau in 0.0..1e-4f64) {
            let (x, u) = (Currents { id: 1.0, iq: 2.0 }, AngledDrive { ud: 20.0, uq: 50.0, w, theta: 0.0 });
            let (ud, uq) = rotate_into((20.0, 50.0), 4.0 * w * tau);
            let late = model().derivative(0.0, &x, &u, &Line { tau, ..P });
            let b = Salient::new(4).unwrap().derivative(0.0, &x, &Drive { ud, uq, w }, &Q);
            approx::assert_relative_eq!(late, b, epsilon = 1e-7, max_relative = 1e-11);
        }
    }
}
