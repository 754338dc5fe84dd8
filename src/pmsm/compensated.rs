use super::{Currents, Drive, ExactStep, Winding};
use crate::{Kind, Model, Scalar};
use serde::{Deserialize, Serialize};

crate::signals! {
    /// Commanded voltages, speed, and where the inverter's dead time points.
    pub struct CompensatedDrive {
        /// Commanded voltage along the magnet flux.
        ud: "V",
        /// Commanded voltage 90 electrical degrees ahead of it.
        uq: "V",
        /// Mechanical speed.
        w: "rad/s",
        /// Dead time's voltage per volt of `vdt`, along the flux: [`dead_time`](super::dead_time) of *measured* currents.
        lost_d: "1",
        /// The same, 90 electrical degrees ahead.
        lost_q: "1",
    }
    /// Parameters of a motor, its cable and the size of its inverter's dead time.
    pub struct CompensatedWinding {
        /// Phase resistance, cable included.
        rs: "ohm",
        /// Inductance, the same in both axes.
        ls: "H",
        /// Line-to-line rms back-EMF per mechanical speed.
        ke: "V s/rad",
        /// Voltage that dead time takes from each phase.
        vdt: "V",
    }
}

/// The offline grey box: exact steps, and a dead time whose shape comes from the measured currents, mean of the interval,
/// at the angle of its middle. Only its size is a parameter, in which the model is then linear.
///
/// [`ExactFed`](super::ExactFed) takes the simulated current instead: near zero current, where the sign decides, what the
/// motor's harmonics do to the measured current then goes into the parameters (0.3 % of Ke at 15 rad/s on a small axis).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ExactCompensated(
    /// How the step is made.
    pub ExactStep,
);

impl Model for ExactCompensated {
    type State = Currents;
    type Input = CompensatedDrive;
    type Output = Currents;
    type Parameters = CompensatedWinding;
    const KIND: Kind = Kind::Discrete;

    #[inline]
    fn next<S: Scalar>(
        &self,
        _t: S,
        x: &Currents<S>,
        u: &CompensatedDrive<S>,
        p: &CompensatedWinding<S>,
    ) -> Currents<S> {
        let drive = Drive { ud: u.ud - p.vdt * u.lost_d, uq: u.uq - p.vdt * u.lost_q, w: u.w };
        self.0.advance(x, &drive, &Winding { rs: p.rs, ls: p.ls, ke: p.ke })
    }

    #[inline]
    fn output<S: Scalar>(
        &self,
        _t: S,
        x: &Currents<S>,
        _u: &CompensatedDrive<S>,
        _p: &CompensatedWinding<S>,
    ) -> Currents<S> {
        *x
    }
}
