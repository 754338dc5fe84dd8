use super::frames::{Stator, rotate_into, rotate_out_of};
use super::inverter::DeadTime;
use super::robot::RobotAxis;
use super::{COULOMB_WIDTH, Currents, Drive, MachineState, MotorModel, Salient, SalientWinding};
use crate::integrate::axpy;
use crate::model::Model;
use crate::scalar::Scalar;
use serde::{Deserialize, Serialize};

/// The simulated motor and its load, with everything that the estimators do not know.
///
/// Winding and magnet at their temperatures, cable, unequal inductances of which the q axis's falls with the current, a
/// sixth harmonic in EMF and torque, cogging, friction and gravity. It is driven by a voltage that stands still in the
/// *stationary* frame, as an inverter's does.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Plant {
    /// Values at the temperatures of the run.
    pub axis: RobotAxis,
    /// The voltage error of the inverter.
    pub dead_time: DeadTime,
    /// Sixth harmonic of EMF and torque constant, as a share of Ke.
    pub emf_harmonic: f64,
    /// By which share `Ld` is below and `Lq` above the axis's inductance.
    pub saliency: f64,
    /// By which share `Lq` falls at half the largest current, as `1 - saturation min((iq / (Imax/2))^2, 2)`.
    pub saturation: f64,
}

impl Plant {
    /// Slope of the motion under a stationary voltage (V).
    #[inline]
    pub fn derivative(&self, x: &MachineState, u: Stator) -> MachineState {
        let a = &self.axis;
        let theta_e = a.pole_pairs.electrical(x.theta);
        let (alpha, beta) = rotate_out_of((x.id, x.iq), theta_e);
        let lost = self.dead_time.lost(Stator { alpha, beta });
        let (ud, uq) = rotate_into((u.alpha - lost.alpha, u.beta - lost.beta), theta_e);
        let half = x.iq / (0.5 * a.i_max);
        let winding = SalientWinding {
            rs: a.rs + a.r_cable,
            ld: a.ls * (1.0 - self.saliency),
            lq: a.ls * (1.0 + self.saliency) * (1.0 - self.saturation * Scalar::min(half * half, 2.0)),
            ke: a.ke * (1.0 + self.emf_harmonic * Scalar::cos(6.0 * theta_e)),
        };
        let (motor, i) = (Salient::with(a.pole_pairs), Currents { id: x.id, iq: x.iq });
        let slope = motor.derivative(0.0, &i, &Drive { ud, uq, w: x.w }, &winding);
        let torque = motor.torque(&i, x.theta, &winding);
        let load = a.tc * Scalar::tanh(x.w / COULOMB_WIDTH)
            + a.bv * x.w
            + a.tg * Scalar::cos(x.theta / a.gear)
            + a.cogging * Scalar::sin(24.0 * x.theta);
        MachineState { id: slope.id, iq: slope.iq, w: (torque - load) / a.j, theta: x.w }
    }

    /// Electromagnetic torque (N m).
    pub fn torque(&self, x: &MachineState) -> f64 {
        let free = Plant { axis: RobotAxis { tc: 0.0, bv: 0.0, tg: 0.0, cogging: 0.0, ..self.axis }, ..*self };
        self.axis.j * free.derivative(x, Stator::default()).w
    }

    /// The motion after `ts` (s) under a stationary voltage, by midpoint steps (second-order Runge-Kutta).
    #[inline]
    pub fn advance(&self, mut x: MachineState, u: Stator, ts: f64, substeps: u32) -> MachineState {
        let h = ts / substeps as f64;
        for _ in 0..substeps {
            let middle = axpy::<MachineState, f64>(x, 0.5 * h, self.derivative(&x, u));
            x = axpy::<MachineState, f64>(x, h, self.derivative(&middle, u));
        }
        x
    }
}
