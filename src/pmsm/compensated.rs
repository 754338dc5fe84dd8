use super::motor_model::{MotorModel, passes_on, wraps_motor};
use super::{Currents, PolePairs};
use crate::{Of, Scalar, Signals};

crate::signals! {
    /// Commanded voltages, speed, angle and direction of the dead time's voltage.
    pub struct CompensatedDrive {
        /// Commanded voltage along the magnet flux.
        ud: "V",
        /// Commanded voltage 90 electrical degrees ahead of it.
        uq: "V",
        /// Mechanical speed.
        w: "rad/s",
        /// Mechanical angle in the middle of the sample interval.
        theta: "rad",
        /// Dead time's voltage per volt of `vdt`, along the flux: [`Currents::dead_time`] of *measured* currents.
        lost_d: "1",
        /// The same, 90 electrical degrees ahead.
        lost_q: "1",
    }
    /// Size of a dead time whose shape is known.
    struct DeadTimeSize {
        /// Voltage that dead time takes from each phase.
        vdt: "V",
    }
    /// Parameters of a surface-magnet motor, its cable and the size of its inverter's dead time.
    pub struct CompensatedWinding {
        /// Phase resistance, cable included; must be positive.
        rs: "ohm",
        /// Inductance, the same in both axes; must be positive.
        ls: "H",
        /// Line-to-line rms back-EMF per mechanical speed.
        ke: "V s/rad",
        /// Voltage that dead time takes from each phase.
        vdt: "V",
    }
}

wraps_motor! {
    /// A motor behind an inverter, for offline fits: the shape of the dead time's voltage comes from the measured currents,
    /// mean of the interval, at the angle of its middle. Only its size is a parameter, in which the model is then linear.
    /// The parameters `P` hold, by name, those of the motor `M` and `vdt` (V), the voltage that dead time takes from each phase.
    ///
    /// [`InverterFed`](super::InverterFed) takes the simulated current instead: near zero current, where the sign decides,
    /// what the motor's harmonics do to the measured current then goes into the parameters (0.3 % of Ke at 15 rad/s on a
    /// small axis).
    Compensated, CompensatedDrive, |_wrapper, x, u, p, motor| {
        let vdt = P::part::<DeadTimeSize, S>(*p).vdt;
        let u = CompensatedDrive { ud: u.ud - vdt * u.lost_d, uq: u.uq - vdt * u.lost_q, ..*u };
        motor(x, &CompensatedDrive::part::<M::Input, S>(u), &P::part::<M::Parameters, S>(*p))
    }
}

impl<M: MotorModel, P: Signals> MotorModel for Compensated<M, P> {
    passes_on!(pole_pairs);
    passes_on!(torque);
}
