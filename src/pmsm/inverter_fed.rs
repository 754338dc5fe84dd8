use super::frames::Park;
use super::motor_model::{MotorModel, passes_on, wraps_motor};
use super::{Currents, ExactSurface, PolePairs};
use crate::online::{Ekf, EkfStart, ObserverError};
use crate::{Of, Scalar, Signals};

crate::signals! {
    /// Voltage command of an inverter in the rotor frame, with speed and angle.
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
    /// Voltage loss of an inverter by dead time.
    struct DeadTimeLoss {
        /// Voltage lost in each phase.
        vdt: "V",
        /// Current at which that error turns over; must be positive.
        i0: "A",
    }
    /// Parameters of a surface-magnet motor behind an inverter.
    pub struct InverterFedWinding {
        /// Phase resistance, cable included; must be positive.
        rs: "ohm",
        /// Synchronous inductance; must be positive.
        ls: "H",
        /// Line-to-line rms back-EMF per mechanical speed.
        ke: "V s/rad",
        /// Voltage that the inverter's dead time takes from each phase.
        vdt: "V",
        /// Current at which that error turns over; must be positive.
        i0: "A",
    }
}

wraps_motor! {
    /// A motor behind an inverter that loses `vdt tanh(i/i0)` per phase to dead time.
    ///
    /// The parameters `P` hold, by name, those of the motor `M`, `vdt` (V), and `i0` (A), which must be positive. The voltage lost is that of the
    /// model's own current at the input's angle; for motors in exact steps, that of the current at the begin of the
    /// interval, held as the command is. For offline fits [`Compensated`](super::Compensated) is more exact.
    ///
    /// ```
    /// use greybox::pmsm::{InverterFed, Saturated};
    /// greybox::signals! {
    ///     /// A saturated motor and the dead time of its inverter.
    ///     pub struct Mine {
    ///         rs: "ohm", ld: "H", lq: "H", lq_saturated: "H", lq_cross: "H/A", i_saturation: "A", ke: "V s/rad",
    ///         vdt: "V", i0: "A",
    ///     }
    /// }
    /// let model = InverterFed::<_, Mine>::new(Saturated::new(4)?);
    /// # Ok::<(), greybox::pmsm::MotorError>(())
    /// ```
    InverterFed, AngledDrive, |wrapper, x, u, p, motor| {
        let loss = P::part::<DeadTimeLoss, S>(*p);
        let lost = x.dead_time(loss.i0, wrapper.motor.pole_pairs().electrical(u.theta));
        let u = AngledDrive { ud: u.ud - loss.vdt * lost.0, uq: u.uq - loss.vdt * lost.1, ..*u };
        motor(x, &AngledDrive::part::<M::Input, S>(u), &P::part::<M::Parameters, S>(*p))
    }
}

impl<M: MotorModel, P: Signals> MotorModel for InverterFed<M, P> {
    passes_on!(pole_pairs);
    passes_on!(torque);
}

impl InverterFed<ExactSurface, InverterFedWinding> {
    /// The motor's joint [`Ekf`], with this step's sample time; five states where rs, ke and vdt are free.
    ///
    /// # Errors
    /// A resistance, inductance, back-EMF or turnover current that does not start above zero; else as [`Ekf::new`].
    pub fn ekf<const N: usize>(self, start: EkfStart<Self>) -> Result<Ekf<Self, N>, ObserverError> {
        let InverterFedWinding { rs, ls, ke, i0, .. } = start.parameters;
        super::exact::all_positive([("rs", rs), ("ls", ls), ("ke", ke), ("i0", i0)])?;
        Ekf::new(self, self.motor.0.sample_time(), start)
    }
}

impl<S: Scalar> Currents<S> {
    /// The dead time's voltage (V), `1 V * tanh(i/i0)` in each phase, seen from the rotor at electrical angle `theta_e`.
    #[inline]
    pub fn dead_time(&self, i0: S, theta_e: S) -> (S, S) {
        let park = Park::amplitude_invariant();
        let phases = park.inverse([self.id, self.iq, S::from(0.0)], theta_e);
        let [d, q, _] = park.forward(phases.map(|i| (i / i0).tanh()), theta_e);
        (d, q)
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Drive, ExactStep, HeldIn, Salient, SalientWinding, Saturated, SaturatedWinding, Winding};
    use super::*;
    use crate::Model;
    use proptest::prelude::*;

    crate::signals! {
        /// A salient motor and its inverter.
        struct Line { rs: "ohm", ld: "H", lq: "H", ke: "V s/rad", vdt: "V", i0: "A" }
        /// A saturated motor and its inverter, in another order.
        struct SaturatedLine {
            vdt: "V", i0: "A", ke: "V s/rad", rs: "ohm", ld: "H", lq: "H", lq_saturated: "H", lq_cross: "H/A", i_saturation: "A",
        }
    }

    const Q: SalientWinding = SalientWinding { rs: 0.63, ld: 3.84e-3, lq: 4.16e-3, ke: 0.95 };

    proptest! {
        // Behind an inverter, any motor gets the commanded voltage less the dead time's: to the bit, for it is the same code.
        #[test]
        fn any_motor_gets_what_dead_time_leaves(id in -60.0..60.0, iq in -60.0..60.0, ud in -300.0..300.0,
                                                w in -400.0..400.0, theta in -9.0..9.0) {
            let (x, u) = (Currents { id, iq }, AngledDrive { ud, uq: 50.0, w, theta });
            let lost = x.dead_time(0.15, 4.0 * theta);
            let left = Drive { ud: ud - 2.0 * lost.0, uq: 50.0 - 2.0 * lost.1, w };
            let fed = InverterFed::<_, Line>::new(Salient::new(4).unwrap());
            let p = Line { rs: Q.rs, ld: Q.ld, lq: Q.lq, ke: Q.ke, vdt: 2.0, i0: 0.15 };
            prop_assert_eq!(fed.derivative(0.0, &x, &u, &p), Salient::new(4).unwrap().derivative(0.0, &x, &left, &Q));
            let s = SaturatedWinding { rs: 0.63, ld: 3.84e-3, lq: 4.16e-3, lq_saturated: 2e-3, lq_cross: -8e-6,
                                       i_saturation: 40.0, ke: 0.95 };
            let p = SaturatedLine { vdt: 2.0, i0: 0.15, ke: s.ke, rs: s.rs, ld: s.ld, lq: s.lq,
                                    lq_saturated: s.lq_saturated, lq_cross: s.lq_cross, i_saturation: s.i_saturation };
            let fed = InverterFed::<_, SaturatedLine>::new(Saturated::new(4).unwrap());
            prop_assert_eq!(fed.derivative(0.0, &x, &u, &p), Saturated::new(4).unwrap().derivative(0.0, &x, &left, &s));
        }

        // Dead time takes power from the motor whatever the angle.
        #[test]
        fn dead_time_is_a_loss(id in -60.0..60.0, iq in -60.0..60.0, theta_e in -9.0..9.0) {
            let (d, q) = Currents { id, iq }.dead_time(0.15, theta_e);
            prop_assert!(d * id + q * iq >= 0.0);
        }
    }

    #[test]
    fn an_exact_step_gets_it_too() {
        let step = ExactStep::new(4, 0.126e-3, HeldIn::Stationary).unwrap();
        let (i, theta) = (Currents { id: 3.0, iq: -8.0 }, 0.3);
        let lost = i.dead_time(0.15, 4.0 * theta);
        let p = InverterFedWinding { rs: 0.4, ls: 4e-3, ke: 0.95, vdt: 2.0, i0: 0.15 };
        let fed = InverterFed::<_, InverterFedWinding>::new(ExactSurface(step));
        let a = fed.next(0.0, &i, &AngledDrive { ud: 9.0, uq: 40.0, w: 60.0, theta }, &p);
        let u = Drive { ud: 9.0 - 2.0 * lost.0, uq: 40.0 - 2.0 * lost.1, w: 60.0 };
        assert_eq!(a, step.advance(&i, &u, &Winding { rs: 0.4, ls: 4e-3, ke: 0.95 }));
    }

    // Far from zero crossings a phase set of signs (+, -, -) is a vector of length 4/3 along phase a.
    #[test]
    fn dead_time_of_a_large_current() {
        let (d, q) = Currents { id: 30.0, iq: 0.0 }.dead_time(0.15, 0.0);
        approx::assert_relative_eq!(d, 4.0 / 3.0, max_relative = 1e-12);
        assert!(q.abs() < 1e-12);
    }
}
