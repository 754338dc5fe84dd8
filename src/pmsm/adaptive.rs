//! A drive that controls its torque with the parameters that an observer estimates, otherwise ideal: no noise, no
//! delay, no dead time, and the voltage held in the rotor's frame (thesis, simulations of chapter 6).

use super::control::{Command, CurrentControl};
use super::machine::runge_kutta;
use super::{Currents, Drive, Machine, MachineParameters, MachineState, SQRT_3_2, VoltageAndLoad, Winding};
use crate::model::Model;
use crate::online::{AdaptationLaw, Mras, UpdateOutcome};

/// Motor, current control and observer, sampled together.
#[derive(Clone, Copy)]
pub struct Adaptive<M: Model, L> {
    /// The plant's equations.
    pub machine: Machine,
    /// The current control; its Ke is replaced by the observer's in every sample.
    pub control: CurrentControl,
    /// The observer, which starts from zero current as the plant does.
    pub observer: Mras<M, L>,
    /// Sample time (s).
    pub ts: f64,
}

/// One sample of an [`Adaptive`] drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instant {
    /// Time (s).
    pub t: f64,
    /// The plant's motion.
    pub x: MachineState,
    /// Electromagnetic torque (N m).
    pub torque: f64,
    /// The observer's parameters before this sample corrects them.
    pub estimate: Winding,
    /// The voltage from this sample to the next.
    pub command: Command,
    /// The observer's result at this sample.
    pub outcome: UpdateOutcome,
}

impl<M, L> Adaptive<M, L>
where
    M: Model<State = Currents, Input = Drive, Output = Currents, Parameters = Winding>,
    L: AdaptationLaw<M>,
{
    /// Runs for `duration` (s) from rest and shows each sample to `see`.
    ///
    /// `rotor` gives the plant's parameters at a time, `load` the torque (N m) besides viscous friction at a speed, and
    /// `reference` the current references at a time and motion, for the estimated torque constant (N m/A).
    pub fn run(
        mut self,
        duration: f64,
        rotor: impl Fn(f64) -> MachineParameters,
        load: impl Fn(f64) -> f64,
        mut reference: impl FnMut(f64, &MachineState, f64) -> Currents,
        mut see: impl FnMut(&Instant),
    ) {
        let mut x = MachineState::default();
        let samples = (duration / self.ts).round() as usize;
        for k in 0..=samples {
            let t = k as f64 * self.ts;
            let estimate = self.observer.parameters();
            self.control.ke = estimate.ke;
            let measured = Currents { id: x.id, iq: x.iq };
            let wanted = reference(t, &x, SQRT_3_2 * estimate.ke);
            let command = self.control.step(wanted, measured, x.w, self.ts);
            let u = Drive { ud: command.ud, uq: command.uq, w: x.w };
            let outcome = self.observer.update(t, &u, &measured).outcome;
            let p = rotor(t);
            let torque = self.machine.torque(&x, &p);
            see(&Instant { t, x, torque, estimate, command, outcome });
            let acting = VoltageAndLoad { ud: command.ud, uq: command.uq, tau_l: load(x.w) };
            x = runge_kutta(x, self.ts, |x| self.machine.derivative(t, x, &acting, &p));
        }
    }
}
